//! Range of the data, in which an effect is searched.

use crate::physics::conditions::Conditions;

/// Range of the conditions of some data.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// Launch and the epochs of the data, years since launch, ascending.
    pub epochs_yr: Vec<f64>,
    /// Shortest and longest time between two parallel transfers, ms.
    pub line_time_ms: [f64; 2],
    /// Largest distance behind a packet, px; 1 if there are no trails.
    pub trail_px: u32,
    /// Smallest charge of a pixel (the faintest background, or without one the faintest packet) and the brightest packet or block
    /// with its background, e-; None if there are only galaxies.
    pub charge_e: Option<[f64; 2]>,
    /// Distinct backgrounds above 0, ascending, at most eight, e-.
    pub backgrounds_e: Vec<f64>,
    /// Coldest and warmest detector, K.
    pub temperature_k: [f64; 2],
    /// Dose of the model at the last epoch, or a year after launch if that is later, or the largest that rows state, as a scale for
    /// trials, MeV/g.
    pub dose_mev_g: f64,
}

impl Reach {
    /// The range of some rows' conditions.
    ///
    /// # Panics
    /// If there are no rows.
    pub fn of<'a>(rows: impl Iterator<Item = &'a Conditions> + Clone) -> Reach {
        let ends = |value: &dyn Fn(&Conditions) -> Option<f64>| {
            rows.clone().filter_map(value).fold(None, |ends: Option<[f64; 2]>, value| match ends {
                None => Some([value, value]),
                Some([low, high]) => Some([low.min(value), high.max(value)]),
            })
        };
        let mut epochs_yr: Vec<f64> = rows.clone().map(|at| at.t_yr).chain([0.0]).collect();
        epochs_yr.sort_by(f64::total_cmp);
        epochs_yr.dedup();
        let packets_e = ends(&|at| Some(at.signal_e.or(at.signal_read_e)? + at.background_e));
        let background_e =
            ends(&|at| Some(at.background_e).filter(|background_e| *background_e > 0.0)).map(|ends| ends[0]);
        Reach {
            epochs_yr,
            line_time_ms: ends(&|at| Some(at.line_time_ms)).expect("at least one row"),
            trail_px: rows.clone().filter_map(|at| at.trail_px).max().unwrap_or(1),
            backgrounds_e: Reach::backgrounds_of(rows.clone()),
            charge_e: packets_e.map(|[faintest_e, brightest_e]| [background_e.unwrap_or(faintest_e), brightest_e]),
            temperature_k: ends(&|at| Some(at.temperature_k)).expect("at least one row"),
            dose_mev_g: ends(&|at| at.dose_mev_g).map_or(0.0, |ends| ends[1]),
        }
    }

    /// Distinct backgrounds above 0 in some rows' conditions, ascending, at most eight, evenly chosen, e-.
    pub fn backgrounds_of<'a>(rows: impl Iterator<Item = &'a Conditions>) -> Vec<f64> {
        let mut all: Vec<f64> = rows.map(|at| at.background_e).filter(|background_e| *background_e > 0.0).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        let step = all.len().div_ceil(BACKGROUNDS).max(1);
        all.into_iter().step_by(step).collect()
    }

    /// The same with the dose from a model, if it is larger than what rows state.
    pub fn with_dose(&self, dose_mev_g: impl FnOnce(f64) -> Option<f64>) -> Reach {
        let of_model = dose_mev_g(self.last_yr().max(1.0)).unwrap_or(0.0);
        Reach { dose_mev_g: of_model.max(self.dose_mev_g), ..self.clone() }
    }

    /// Midpoints between epochs, at most `most`, evenly chosen.
    pub fn between_epochs(&self, most: usize) -> Vec<f64> {
        let middles: Vec<f64> = self.epochs_yr.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        let step = middles.len().div_ceil(most).max(1);
        middles.into_iter().step_by(step).collect()
    }

    /// Last epoch, years since launch.
    pub fn last_yr(&self) -> f64 {
        self.epochs_yr.last().copied().unwrap_or(0.0)
    }

    /// Whether rows differ in temperature.
    pub fn varies_in_temperature(&self) -> bool {
        self.temperature_k[1] > self.temperature_k[0]
    }
}

/// Maximum number of backgrounds.
const BACKGROUNDS: usize = 8;

/// Numbers in equal ratios from one to another, both included.
pub fn ratios(low: f64, high: f64, count: usize) -> impl Iterator<Item = f64> {
    let step = (high / low).powf(1.0 / (count.max(2) - 1) as f64);
    (0..count).map(move |index| low * step.powi(index as i32))
}
