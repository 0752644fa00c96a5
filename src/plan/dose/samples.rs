//! The dose of a mission with the Sun drawn: `ctiplan dose --samples`.

use serde::Serialize;

use super::source::calendar_years;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::estimate::share_error_in_order;
use crate::numeric::parallel;
use crate::physics::DoseHistory;
use crate::physics::solar_event_dose::{SOLAR_PROTONS, SolarEventDoses};

/// Probabilities of the quantiles.
pub const QUANTILES: [f64; 5] = [0.05, 0.25, 0.50, 0.75, 0.95];

/// Quantiles of a mission's dose with the Sun drawn, before effects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Samples {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of samples.
    pub samples: u32,
    /// Of the mission's dose.
    pub quantiles: Vec<Quantile>,
    /// Of the dose since launch at the end of each calendar year.
    pub years: Vec<SampledYear>,
    /// Mean number of solar events of a mission.
    pub events: f64,
    /// Mean share of the largest event in the dose of all events; None if no sample has an event.
    pub largest_event_share: Option<f64>,
    /// Dose (MeV/g) from all sources other than solar protons, the same in all samples.
    pub others_mev_g: f64,
}

/// A quantile of a dose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantile {
    /// Probability that it is not exceeded.
    pub p: f64,
    /// MeV/g.
    pub dose_mev_g: f64,
    /// Standard error from the finite number of samples, MeV/g.
    pub error: f64,
    /// The same for ESP's quantile of the sum over the expected active years, MeV/g; None before the end of the mission.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub esp_mev_g: Option<f64>,
}

/// Quantiles at the end of a calendar year.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SampledYear {
    /// The year.
    pub year: i32,
    /// Of the dose since launch.
    pub quantiles: Vec<Quantile>,
}

/// The result of one sample.
struct Realisation {
    /// Dose of solar events (MeV/g) since launch at the end of each calendar year.
    doses_mev_g: Vec<f64>,
    events: usize,
    /// Share of the largest event; None without events.
    largest: Option<f64>,
}

impl Samples {
    /// Draws the Sun of a mission repeatedly.
    ///
    /// # Errors
    /// If its dose is not derived from solar protons.
    pub fn of(mission: &Mission, samples: u32, seed: u64) -> Result<Samples, InputError> {
        let model = Model::new(mission);
        let history = model.history();
        let doses = SolarEventDoses::of(mission, history, samples, seed)?;
        let years: Vec<(i32, f64)> = calendar_years(mission).map(|(year, _, end_yr)| (year, end_yr)).collect();
        let realisation = |index: usize| Realisation::of(&doses.steps(index), &years);
        let realisations: Vec<Realisation> = parallel::map(0..doses.events.samples(), realisation);
        let mut order: Vec<usize> = (0..realisations.len()).collect();
        order.sort_by(|a, b| doses.events.rank(*a).total_cmp(&doses.events.rank(*b)));
        let quantiles = |place: usize| {
            let others_mev_g = others_mev_g(mission, history, years[place].1);
            let of = |realisation: &Realisation| others_mev_g + realisation.doses_mev_g[place];
            let drawn: Vec<f64> = realisations.iter().map(of).collect();
            let mut sorted = drawn.clone();
            sorted.sort_by(f64::total_cmp);
            QUANTILES.map(|p| Quantile::of(&drawn, &sorted, &order, p)).to_vec()
        };
        let others_mev_g = others_mev_g(mission, history, mission.mission.duration_yr);
        let years: Vec<SampledYear> = (years.iter().enumerate())
            .map(|(place, (year, _))| SampledYear { year: *year, quantiles: quantiles(place) })
            .collect();
        let mut at_end = years.last().map_or(Vec::new(), |year| year.quantiles.clone());
        at_end.iter_mut().for_each(|at| at.esp_mev_g = Some(others_mev_g + doses.esp_mev_g(at.p)));
        Ok(Samples {
            seed,
            samples,
            quantiles: at_end,
            years,
            events: mean(realisations.iter().map(|realisation| realisation.events as f64)).unwrap_or(0.0),
            largest_event_share: mean(realisations.iter().filter_map(|realisation| realisation.largest)),
            others_mev_g,
        })
    }
}

impl Realisation {
    /// From doses (MeV/g), each with its time, at the end of calendar years (years since launch).
    fn of(steps: &[(f64, f64)], years: &[(i32, f64)]) -> Realisation {
        let mut doses_mev_g = vec![0.0; years.len()];
        for (t_yr, dose_mev_g) in steps {
            let year = years.partition_point(|(_, end_yr)| end_yr < t_yr).min(years.len() - 1);
            doses_mev_g[year] += dose_mev_g;
        }
        let mut sum = 0.0;
        for dose_mev_g in &mut doses_mev_g {
            sum += *dose_mev_g;
            *dose_mev_g = sum;
        }
        let most = steps.iter().map(|(_, dose_mev_g)| *dose_mev_g).fold(0.0, f64::max);
        Realisation { doses_mev_g, events: steps.len(), largest: (sum > 0.0).then(|| most / sum) }
    }
}

impl Quantile {
    /// From doses, the same sorted, and their order by the rank of the Sun. The error is that of the fraction of doses below the
    /// quantile, by the slope of the quantiles: between p ± √(p(1 − p)/n), where many of the n doses are.
    fn of(drawn: &[f64], sorted: &[f64], order: &[usize], p: f64) -> Quantile {
        let dose_mev_g = quantile(sorted, p);
        let below: Vec<bool> = drawn.iter().map(|dose| *dose < dose_mev_g).collect();
        let spread = (p * (1.0 - p) / sorted.len() as f64).sqrt();
        let slope = 0.5 * (quantile(sorted, p + spread) - quantile(sorted, p - spread)) / spread;
        Quantile { p, dose_mev_g, error: slope * share_error_in_order(&below, order), esp_mev_g: None }
    }
}

/// A quantile of sorted numbers: number r of n is that at (r + ½)/n, with linear interpolation.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let place = (p * sorted.len() as f64 - 0.5).clamp(0.0, (sorted.len() - 1) as f64);
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    low + place.fract() * (high - low)
}

/// Dose (MeV/g) up to a time (years since launch) from all sources except solar protons.
fn others_mev_g(mission: &Mission, history: &DoseHistory, until_yr: f64) -> f64 {
    let environment = &mission.environment;
    let others = history.sources.iter().filter(|source| source.name != SOLAR_PROTONS);
    let derived: f64 = others.map(|source| history.of_source_mev_g(source, 0.0, until_yr)).sum();
    derived + environment.dose_factor * environment.cosmic_ray_floor_mev_g_yr * until_yr
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value));
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_doses_without_order_have_the_errors_of_the_textbook() {
        let n = 4000;
        let sorted: Vec<f64> = (0..n).map(|index| (f64::from(index) + 0.5) / f64::from(n)).collect();
        let order: Vec<usize> = (0..n as usize).collect();
        // Multiples of the golden ratio are without order, but more even than at random.
        let drawn: Vec<f64> = (0..n).map(|index| sorted[(index * 1609 % n) as usize]).collect();
        for p in QUANTILES {
            let found = Quantile::of(&drawn, &sorted, &order, p);
            assert!((found.dose_mev_g - p).abs() < 1e-12, "{found:?}");
            let ratio = found.error / (p * (1.0 - p) / f64::from(n)).sqrt();
            assert!((0.9..1.6).contains(&ratio), "{found:?} {ratio}");
            // In the order of the ranks, each rank has its dose: one draw is uncertain.
            let ranked = Quantile::of(&sorted, &sorted, &order, p);
            assert!((ranked.error * f64::from(n) - 0.5_f64.sqrt()).abs() < 1e-3, "{ranked:?}");
        }
    }

    #[test]
    fn doses_add_up_year_by_year() {
        let realisation = Realisation::of(
            &[(1.5, 2.0), (0.2, 1.0), (2.0, 4.0), (0.1, 1.0)],
            &[(2030, 0.5), (2031, 1.5), (2032, 2.0)],
        );
        assert_eq!(
            (realisation.doses_mev_g, realisation.events, realisation.largest),
            (vec![2.0, 4.0, 8.0], 4, Some(0.5))
        );
    }
}
