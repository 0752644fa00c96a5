//! The assessment of one mission: its evaluation with noise and population, noisy galaxies one by one, and the date as a
//! distribution. The product of `ctiplan evaluate`.

use crate::error::InputError;
use crate::mission::Mission;
use crate::model::noise::Realisations;
use crate::model::realise::{NoisyChange, realise};
use crate::plan::date_distribution::{Confidence, DateDistribution, date_distribution};
use crate::plan::evaluate::{Evaluation, evaluate};
use crate::plan::flown::Flown;
use crate::plan::mission_sample::MissionSample;
pub use crate::plan::progress::Progress;
use crate::plan::time_series::TimeSeries;

/// What is requested.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Seed of all random numbers; none: the mission's.
    pub seed: Option<u64>,
    /// Number of galaxies read out with photon and read noise at the end of the mission; none: no such galaxies.
    pub monte_carlo: Option<u32>,
    /// Draws of the mission for the distribution of the date; 0: no distribution.
    pub samples: u32,
    /// Keys drawn together, in place of their separate uncertainties.
    pub posterior: Option<MissionSample>,
    /// The requested probability of meeting the corrected budget, above 0 and below 1.
    pub confidence: Option<f64>,
    /// Whether the time series between the years is needed, for figures.
    pub time_series: bool,
}

/// The results.
#[derive(Clone, Debug)]
pub struct Assessment {
    /// The evaluation.
    pub evaluation: Evaluation,
    /// Means of the noisy galaxies at the end of the mission, in the mission's order; empty if not requested; None if fewer than
    /// two could be measured.
    pub noisy: Vec<Option<NoisyChange>>,
    /// The date as a distribution, if requested.
    pub distribution: Option<DateDistribution>,
    /// Dose and traps up to the last observation of the Sun; None if it is not taken as it was.
    pub flown: Option<Flown>,
    /// The requested probability of meeting the corrected budget.
    pub confidence: Option<f64>,
    /// The time series between the years; without it, no figures are drawn.
    pub time_series: Option<TimeSeries>,
}

/// Assesses a mission.
///
/// # Errors
/// If a galaxy has no measurable shape, an effect has no value, a posterior has other keys, or the draws are too few for the
/// confidence.
pub fn assess(mission: &Mission, options: &Options, progress: &Progress) -> Result<Assessment, InputError> {
    if let Some(probability) = options.confidence {
        Confidence { probability, samples: options.samples }.check()?;
    }
    let seed = options.seed.unwrap_or(mission.accuracy.seed);
    let realisations = Realisations { count: mission.accuracy.noise_realisations, seed };
    let evaluation = evaluate(mission)?.with_noise(realisations)?.with_population(seed)?;
    let noisy = options.monte_carlo.map(|count| noisy(&evaluation, count, seed, progress)).transpose()?;
    let time_series = options.time_series.then(|| TimeSeries::of(&evaluation.model)).transpose()?;
    let distribution = match options.samples {
        0 => None,
        samples => {
            let (posterior, biases) = (options.posterior.as_ref(), evaluation.population.as_ref());
            let found = date_distribution(mission, posterior, biases, samples, seed, progress)?;
            Some(found.with_noise(&evaluation).with_part_of_a_year(mission, progress)?)
        }
    };
    let noisy = noisy.unwrap_or_default();
    let flown = Flown::of(mission)?;
    Ok(Assessment { evaluation, noisy, distribution, flown, confidence: options.confidence, time_series })
}

/// Each galaxy `count` times with noise, at the end of the mission.
fn noisy(
    evaluation: &Evaluation,
    count: u32,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<Option<NoisyChange>>, InputError> {
    let mission = evaluation.mission();
    let device = evaluation.model.device_at(mission.mission.duration_yr)?;
    (progress.stage)("galaxies", u64::from(count) * mission.galaxies.len() as u64);
    let each = |galaxy| realise(mission, galaxy, &device, count as usize, seed, || (progress.advance)());
    mission.galaxies.iter().map(each).collect()
}
