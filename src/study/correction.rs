//! Software correction: its factor computed instead of assumed.
//!
//! A galaxy is read out through the true detector, and corrected with the assumed detector, by iterating the forward model (Bristow
//! 2003; Massey et al. 2010, MNRAS 401, 371):
//!
//! ```text
//! image₀ = observed        imageₖ₊₁ = imageₖ + observed − trail(imageₖ)
//! ```
//!
//! The ratio of the residual to the original change of shape measures the correction. Read noise is added after the transfers but
//! corrected as if before them, which leaves its own residual (Massey et al. 2014, MNRAS 439, 887). Published: 97 % of trails
//! corrected on ACS (Massey et al. 2010), 98 % (Massey et al. 2014), and for a perfect model with read noise alone 99.68 % of
//! ellipticity in simulations for Euclid (Israel et al. 2015, MNRAS 453, 561).
//!
//! The residual shear biases of a population are computed to first order (`correction/population.rs`).

mod knowledge;
mod population;
mod round_trip;

use std::path::PathBuf;

use chrono::NaiveDate;
use serde::Serialize;

use super::{Estimate, Exposure, Study, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::parallel;
use crate::physics::shape::ShapeChange;
use crate::plan::curve::Curve;
use crate::warning::Warning;

pub use knowledge::Knowledge;
pub use population::{BiasLeft, PopulationRemainder, Tolerance};
pub use round_trip::{RoundTrip, corrected};

/// Options of the study.
#[derive(Clone, Debug)]
pub struct Correction {
    /// Relative error (1 sigma) of each species' density.
    pub density_error: f64,
    /// Relative error (1 sigma) of each release time.
    pub release_error: f64,
    /// Relative error (1 sigma) of the well fill power.
    pub well_fill_error: f64,
    /// Output of `ctiplan fit --json`: parameters, their errors and correlations, in place of the three above.
    pub fit: Option<PathBuf>,
    /// Iterations of the forward model.
    pub iterations: u32,
    /// Number of drawn sets of assumed parameters.
    pub draws: u32,
    /// Read noise, e- per pixel; by default that of the mission's clock, or of its galaxy.
    pub read_noise_e: Option<f64>,
    /// Number of noisy galaxies corrected with the true model; 0 for none.
    pub realisations: u32,
    /// Seed of the draws and of the noise; by default the mission's.
    pub seed: Option<u64>,
}

impl Default for Correction {
    fn default() -> Correction {
        Correction {
            density_error: 0.05,
            release_error: 0.05,
            well_fill_error: 0.02,
            fit: None,
            iterations: 5,
            draws: 400,
            read_noise_e: None,
            realisations: 100,
            seed: None,
        }
    }
}

/// The results of the study, at the end of the mission.
#[derive(Clone, Debug)]
pub struct Results {
    /// The residual after correction; None if there is nothing to correct: no traps, or no shape left.
    pub remainder: Option<Remainder>,
    /// The residual shear biases of the population; None if the mission has none.
    pub population: Option<PopulationRemainder>,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// The residual after correction.
#[derive(Clone, Debug)]
pub struct Remainder {
    /// |Δe| without correction.
    pub uncorrected_delta_e: f64,
    /// The residual from each cause.
    pub causes: Vec<Left>,
    /// Residual |Δe| from noise with the true model; None without noise.
    pub noise_delta_e: Option<Estimate>,
    /// The factor of the correction; None if a draw leaves no shape.
    pub earned: Option<Earned>,
    /// Factor needed to stay within the uncorrected budget.
    pub needed_factor: f64,
    /// Factor assumed by the mission.
    pub assumed_factor: f64,
    /// |Δe| over the mission, uncorrected.
    pub curve: Curve,
}

/// Why a correction is imperfect.
#[derive(Clone, Debug, PartialEq)]
pub enum Cause {
    /// Only its finite number of iterations.
    PerfectKnowledge,
    /// The error of one parameter, by its key.
    Parameter(String),
    /// The errors of all parameters: the root mean square of the draws.
    Together,
    /// Photon noise, and read noise, e- per pixel.
    Noise(f64),
}

/// The residual from one cause.
#[derive(Clone, Debug, Serialize)]
pub struct Left {
    /// The cause.
    #[serde(skip)]
    pub cause: Cause,
    /// Its error, %; None if the cause is not a parameter.
    pub error_percent: Option<f64>,
    /// Residual |Δe|; None if no shape is left.
    pub delta_e: Option<f64>,
    /// Its standard error from the finite number of draws; None if there are no draws, here and below.
    pub delta_e_sigma: Option<f64>,
    /// The same in % of the uncorrected |Δe|.
    pub left_percent: Option<f64>,
    /// Its standard error, %.
    pub left_error_percent: Option<f64>,
    /// Uncorrected |Δe| over the residual.
    pub factor: Option<f64>,
    /// Its standard error.
    pub factor_error: Option<f64>,
}

/// The factor of a correction.
#[derive(Clone, Debug)]
pub struct Earned {
    /// Uncorrected |Δe| over the residual.
    pub factor: Estimate,
    /// Share of the uncorrected |Δe| that is removed, %.
    pub removed_percent: Estimate,
    /// Day on which the budget is exceeded with this factor.
    pub exceeded_date: Option<NaiveDate>,
    /// Its standard error, days; None if unknown.
    pub exceeded_error_d: Option<f64>,
}

impl Study for Correction {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        let model = ready(mission)?;
        let knowledge = match &self.fit {
            Some(path) => Knowledge::read(path, mission)?,
            None => Knowledge::relative(
                &model.mission,
                &|_| self.density_error,
                &|_| self.release_error,
                self.well_fill_error,
            ),
        };
        let round_trip = RoundTrip::new(&model, mission.mission.duration_yr, self.iterations)?;
        let remainder = match round_trip.filter(|round_trip| round_trip.uncorrected.magnitude() > 0.0) {
            Some(round_trip) => Some(self.remainder(mission, &model, &round_trip, &knowledge, advance)?),
            None => None,
        };
        let population = PopulationRemainder::of(&model, &knowledge, advance)?;
        Ok(Results { remainder, population, warnings: warnings(mission) })
    }
}

impl Correction {
    fn remainder(
        &self,
        mission: &Mission,
        model: &Model,
        round_trip: &RoundTrip,
        knowledge: &Knowledge,
        advance: &(dyn Fn() + Sync),
    ) -> Result<Remainder, InputError> {
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let uncorrected = round_trip.uncorrected.magnitude();
        let mut causes = alone(model, round_trip, knowledge, advance)?;
        let together = match knowledge.parameters.is_empty() {
            true => causes[0].delta_e.map(|value| Estimate { value, error: 0.0 }),
            false => round_trip.drawn(knowledge, self.draws, seed, advance)?,
        };
        let (delta_e, sigma) = (together.map(|rms| rms.value), together.map(|rms| rms.error));
        causes.push(Left::new(Cause::Together, None, delta_e, sigma, uncorrected));
        let read_noise_e = self.read_noise_e.unwrap_or_else(|| Exposure::of(mission).read_noise_e);
        // Without read noise the true model leaves only the readout's error.
        let realisations = if read_noise_e > 0.0 { self.realisations } else { 0 };
        let noise = round_trip.noisy(read_noise_e, realisations, seed, advance)?;
        let noise = noise.map(|(mean, error)| Estimate { value: mean.delta_e1.abs(), error: error.delta_e1 });
        if let Some(Estimate { value, error }) = noise {
            causes.push(Left::new(Cause::Noise(read_noise_e), None, Some(value), Some(error), uncorrected));
        }
        let requirement = &mission.requirement;
        let curve = Curve::of(model)?;
        let earned =
            together.map(|together| Earned::of(earned_factor(uncorrected, together, noise), &curve, &model.mission));
        Ok(Remainder {
            uncorrected_delta_e: uncorrected,
            causes,
            noise_delta_e: noise,
            earned,
            needed_factor: uncorrected / requirement.delta_e,
            assumed_factor: requirement.correction_factor,
            curve,
        })
    }
}

/// The residual of perfect knowledge, and of each parameter's error (1 σ) alone.
fn alone(
    model: &Model,
    round_trip: &RoundTrip,
    knowledge: &Knowledge,
    advance: &(dyn Fn() + Sync),
) -> Result<Vec<Left>, InputError> {
    let uncorrected = round_trip.uncorrected.magnitude();
    let magnitude = |change: Option<ShapeChange>| change.map(|change| change.magnitude());
    let none = vec![0.0; knowledge.parameters.len()];
    let perfect = magnitude(round_trip.left_with(knowledge, &none)?);
    let mut left = vec![Left::new(Cause::PerfectKnowledge, None, perfect, None, uncorrected)];
    let places: Vec<usize> = (0..none.len()).collect();
    left.extend(parallel::try_map(&places, |index| {
        let mut deviations = none.clone();
        deviations[*index] = 1.0;
        let (key, sigma) = &knowledge.parameters[*index];
        let value = model.mission.number(key).unwrap_or(0.0);
        advance();
        let error_percent = (value != 0.0).then(|| 100.0 * sigma / value.abs());
        let delta_e = magnitude(round_trip.left_with(knowledge, &deviations)?);
        Ok(Left::new(Cause::Parameter(key.clone()), error_percent, delta_e, None, uncorrected))
    })?);
    Ok(left)
}

impl Left {
    fn new(
        cause: Cause,
        error_percent: Option<f64>,
        delta_e: Option<f64>,
        sigma: Option<f64>,
        uncorrected: f64,
    ) -> Left {
        let left = delta_e.map(|value| Estimate { value, error: sigma.unwrap_or(0.0) });
        let number = |estimate: Option<Estimate>| {
            let finite = estimate.filter(|estimate| estimate.value.is_finite());
            (finite.map(|finite| finite.value), finite.and_then(|finite| sigma.map(|_| finite.error)))
        };
        let (delta_e, delta_e_sigma) = number(left);
        let (left_percent, left_error_percent) = number(left.map(|left| left.times(100.0 / uncorrected)));
        let (factor, factor_error) = number(left.map(|left| left.under(uncorrected)));
        Left { cause, error_percent, delta_e, delta_e_sigma, left_percent, left_error_percent, factor, factor_error }
    }
}

/// The combined residual from errors of the parameters and noise. The residual from noise is a mean, that is, a bias. Its square is
/// estimated by the square of its estimate minus that of its error, which averages to zero without a bias.
fn earned_factor(uncorrected: f64, together: Estimate, noise: Option<Estimate>) -> Estimate {
    let noise = noise.unwrap_or(Estimate { value: 0.0, error: 0.0 });
    let bias2 = (noise.value.powi(2) - noise.error.powi(2)).max(0.0);
    let value = (together.value.powi(2) + bias2).sqrt();
    // Errors of the squares: 2 x σ, and for the bias at least 2 σ².
    let squares = (2.0 * together.value * together.error)
        .hypot(2.0 * bias2.sqrt() * noise.error)
        .hypot(std::f64::consts::SQRT_2 * noise.error.powi(2));
    Estimate { value, error: 0.5 * squares / value }.under(uncorrected)
}

impl Earned {
    /// From a factor with an error: the dates for one error less and one more give the error of the date.
    fn of(factor: Estimate, curve: &Curve, mission: &Mission) -> Earned {
        let date = |factor: f64| curve.crossing(mission.requirement.delta_e * factor).date(mission.mission.launch.0);
        let removed =
            Estimate { value: 100.0 * (1.0 - 1.0 / factor.value), error: 100.0 * factor.error / factor.value.powi(2) };
        let [low, own, high] = [-1.0, 0.0, 1.0].map(|errors| date(factor.value + errors * factor.error));
        let ends = low.zip(high.or(own)).filter(|_| own.is_some());
        Earned {
            factor,
            removed_percent: removed,
            exceeded_date: own,
            exceeded_error_d: ends.map(|(low, high)| 0.5 * (high - low).num_days() as f64),
        }
    }
}
