//! Draws of a mission whose inputs are uncertain, and what becomes of each.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::environment::solar_cycle::{self, ACTIVE_YR};
use crate::error::InputError;
use crate::mission::{DoseModel, Mission};
use crate::model::Model;
use crate::numeric::calendar::decimal_year;
use crate::physics::accuracy::Purpose;
use crate::physics::galaxy::snr;
use crate::plan::draws::input::{Input, Shield, cycles, inputs};
use crate::plan::timeline::Timeline;
use crate::study::{budgets, ready};

/// What becomes of one draw: |Δe| at the end of the mission, and when it exceeds the uncorrected and the corrected budget.
#[derive(Clone, Debug)]
pub struct Fate {
    /// |Δe| at the end of the mission; None if no shape is left.
    pub delta_e: Option<f64>,
    /// Years since launch; None if later than the horizon.
    pub exceeded_yr: [Option<f64>; 2],
}

/// A mission that is drawn from.
pub struct Sampler {
    model: Model,
    /// Length of the mission, yr.
    pub duration_yr: f64,
    /// What is uncertain.
    pub inputs: Vec<Input>,
}

impl Sampler {
    /// Followed for so many years from launch.
    ///
    /// # Errors
    /// If its galaxy has no measurable shape before the readout.
    pub fn new(mission: &Mission, horizon_yr: f64) -> Result<Sampler, InputError> {
        let model = ready(mission)?;
        let mut base = model.mission.clone();
        // Draws differ by factors: in the models of the paper what is derived is made a number first.
        if matches!(base.environment.model, DoseModel::Constant | DoseModel::SolarCycle) {
            base.environment.active_dose_rate_mev_g_yr =
                Some(model.history().active_rate_mev_g_yr / base.environment.dose_factor);
        }
        let galaxy = &base.galaxies[0];
        let flux_e = snr::flux_e(&base, galaxy);
        base.galaxies[0].flux_e = Some(flux_e);
        base.galaxies[0].snr = None;
        base = Purpose::Draws.of(&base);
        let mut inputs = inputs(&base, Shield::of(mission));
        base.mission.duration_yr = horizon_yr;
        let last = decimal_year(base.mission.launch.0) + horizon_yr;
        // Those of which the active years may begin before the end; in years, so that draws can shift them.
        let maxima = solar_cycle::maxima(&base.environment.solar_maximum, last + ACTIVE_YR);
        base.environment.solar_maximum = maxima.iter().map(|maximum| maximum.year).collect();
        if !model.history().averages_the_cycle() {
            inputs.extend(cycles(&maxima));
        }
        Ok(Sampler { duration_yr: mission.mission.duration_yr, model: model.like(&base), inputs })
    }

    /// With deviations (in σ) of the inputs.
    ///
    /// # Errors
    /// If a formula has no value, here and below.
    pub fn fate(&self, deviations: &[f64]) -> Result<Fate, InputError> {
        let mut mission = self.model.mission.clone();
        for (input, deviation) in self.inputs.iter().zip(deviations) {
            input.deviate(&mut mission, *deviation);
        }
        let timeline = Timeline::of(&self.model.like(&mission))?;
        Ok(Fate {
            delta_e: timeline.at(self.duration_yr),
            exceeded_yr: budgets(&mission).map(|budget| timeline.crossing(budget).t_yr),
        })
    }

    /// Deviations (in σ) of the inputs in one draw.
    pub fn deviations(&self, seed: u64, draw: u32) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::from(draw));
        self.inputs.iter().map(|_| StandardNormal.sample(&mut random)).collect()
    }

    /// With a deviation (in σ) of one input alone.
    ///
    /// # Errors
    /// As [`Sampler::fate`].
    pub fn alone(&self, index: usize, deviation: f64) -> Result<Fate, InputError> {
        let mut deviations = vec![0.0; self.inputs.len()];
        deviations[index] = deviation;
        self.fate(&deviations)
    }
}
