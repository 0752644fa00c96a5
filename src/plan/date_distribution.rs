//! Distribution of the date on which the budget is exceeded.
//!
//! It is that of the mean change of shape, without noise. What this leaves out is computed beside it (`date_distribution/left_out.rs`).

mod left_out;

use chrono::NaiveDate;
use serde::Serialize;

use super::draws::{Draws, Emulated, Fate, Fates};
use super::mission_sample::MissionSample;
use super::population::PopulationBias;
use super::progress::Progress;
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::calendar::date_after;
use crate::numeric::estimate::{quantile, share_error, share_error_in_order, with_errors};

pub use left_out::PartOfAYear;

/// Probabilities of the quantiles.
pub const QUANTILES: [f64; 3] = [0.05, 0.5, 0.95];

/// When the budget is exceeded, over a sample of missions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DateDistribution {
    /// Missions that were evaluated.
    pub samples: usize,
    /// Missions requested: more than `samples` if shapes cannot be emulated.
    pub asked: u32,
    /// Effective number of independent missions.
    pub effective_samples: f64,
    /// Seed of the draws.
    pub seed: u64,
    /// Without software correction.
    pub uncorrected: Dates,
    /// With it.
    pub corrected: Dates,
    /// For the limits on the additive and the multiplicative shear bias, estimated from the number of traps alone; None if there is
    /// no such limit, or biases do not depend on that number alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c: Option<LimitDates>,
    /// See `c`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub m: Option<LimitDates>,
    /// For the first limit exceeded, if biases are limited and estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first: Option<LimitDates>,
    /// What each input contributes to the variance of ln |Δe| at the end of the mission, the largest first; empty if it
    /// does not vary.
    pub shares: Vec<Share>,
    /// Why the Sun was not drawn; None if it was.
    pub sun_not_drawn: Option<String>,
    /// What ESP's least time of one active year does to a mission with less; None for others, or if this was not computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part_of_a_year: Option<PartOfAYear>,
    /// How changes of shape were emulated; None if each was read out, for fewer draws.
    pub emulated: Option<Emulated>,
    /// Keys that were drawn from a posterior.
    pub posterior_keys: Vec<String>,
    /// Whether its sample says that it has converged; None without a posterior, or if it does not say.
    pub posterior_converged: Option<bool>,
    /// Whether its fit describes the data within their errors; None as before.
    pub posterior_describes_data: Option<bool>,
    /// Keys of the device in which the fitted mission differs from this one.
    pub posterior_differing: Vec<String>,
    /// The result of each draw, and their order for errors.
    #[serde(skip)]
    draws: (Vec<Fate>, Option<Vec<usize>>),
}

/// When a limit is exceeded, without and with software correction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimitDates {
    /// Without software correction.
    pub uncorrected: Dates,
    /// With software correction.
    pub corrected: Dates,
}

/// Share of a variance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// Name of the input, or [`NOT_LINEAR`].
    pub input: String,
    /// Share, from 0 to 1.
    pub share: f64,
    /// Its standard error from the finite number of draws.
    pub error: f64,
}

/// When a limit is exceeded.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dates {
    /// Probability that it is exceeded within the mission.
    pub probability_exceeded: f64,
    /// Its standard error from the finite number of samples.
    pub probability_error: f64,
    /// The same probability with the noise of one exposure, if that was computed: |Δe| of each draw at the end, multiplied as that of
    /// the mission is by noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability_exceeded_with_noise: Option<f64>,
    /// Quantiles of the date, in the order of [`QUANTILES`].
    pub quantiles: Vec<DateQuantile>,
    /// The time of each sample, years since launch, ascending; infinite if not exceeded within the mission.
    #[serde(skip)]
    pub times_yr: Vec<f64>,
}

/// A quantile of a date.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DateQuantile {
    /// Probability that the limit is exceeded by then.
    pub p: f64,
    /// Years since launch; None if not within the mission.
    pub t_yr: Option<f64>,
    /// Its standard error from the finite number of samples, yr; None if unknown.
    pub error_yr: Option<f64>,
    /// The day; None if not within the mission, or past the end of the calendar.
    pub date: Option<NaiveDate>,
}

/// Draws a mission repeatedly: its Sun, its `[uncertainty]`, and a posterior if one is given. `biases`: the expected biases of its
/// population, if they are limited.
///
/// # Errors
/// If a draw is not a valid mission or leaves its galaxy without a shape; names the row of the posterior.
pub fn date_distribution(
    mission: &Mission,
    posterior: Option<&MissionSample>,
    biases: Option<&PopulationBias>,
    samples: u32,
    seed: u64,
    progress: &Progress,
) -> Result<DateDistribution, InputError> {
    let mut draws = Draws::of(mission, posterior, samples, seed)?;
    let limits = biases.and_then(|biases| Some((biases, biases.trap_limits()?)));
    if let Some((_, limits)) = &limits {
        draws = draws.with_limits_on_traps(limits)?;
    }
    let found = draws.fates(progress)?;
    let count = found.fates.len();
    // The effective size of the posterior limits that of the draws; so does its number of draws.
    let worth = posterior.map(|sample| sample.effective_samples.unwrap_or(f64::INFINITY).min(sample.len() as f64));
    let effective = worth.unwrap_or(f64::INFINITY).clamp(1.0, count as f64);
    // Rows of a posterior are independent of each other.
    let order = found.order.as_deref().filter(|_| posterior.is_none());
    let dates = |exceeded_yr: &dyn Fn(&Fate) -> Option<f64>| {
        let times_yr = found.fates.iter().map(|fate| exceeded_yr(fate).unwrap_or(f64::INFINITY)).collect();
        Dates::of(times_yr, order, effective, mission.mission.launch.0, seed)
    };
    let both = |exceeded_yr: &dyn Fn(&Fate, usize) -> Option<f64>| LimitDates {
        uncorrected: dates(&|fate| exceeded_yr(fate, 0)),
        corrected: dates(&|fate| exceeded_yr(fate, 1)),
    };
    let limits_a_galaxy = mission.requirement.limits_a_galaxy();
    let first = |fate: &Fate, limit: usize| {
        let of_galaxy = fate.exceeded_yr[limit].filter(|_| limits_a_galaxy);
        let of_biases = fate.biases_exceeded_yr.iter().filter_map(|bias| bias[limit]);
        of_biases.chain(of_galaxy).min_by(f64::total_cmp)
    };
    let bias = |member: usize| both(&|fate, limit| fate.biases_exceeded_yr[member][limit]);
    let limited = limits.map(|(biases, _)| [biases.c.is_some(), biases.m.is_some()]).unwrap_or_default();
    Ok(DateDistribution {
        samples: count,
        asked: samples,
        effective_samples: effective,
        seed,
        uncorrected: dates(&|fate| fate.exceeded_yr[0]),
        corrected: dates(&|fate| fate.exceeded_yr[1]),
        c: limited[0].then(|| bias(0)),
        m: limited[1].then(|| bias(1)),
        first: limited.contains(&true).then(|| both(&first)),
        shares: shares(&found, order, seed),
        sun_not_drawn: draws.sun_not_drawn().map(String::from),
        part_of_a_year: None,
        emulated: found.emulated,
        posterior_converged: posterior.and_then(|sample| sample.converged),
        posterior_describes_data: posterior.and_then(|sample| sample.describes_data),
        posterior_differing: posterior.map_or(Vec::new(), |sample| sample.differing.clone()),
        posterior_keys: posterior.map_or(Vec::new(), |sample| sample.keys.clone()),
        draws: (found.fates, found.order),
    })
}

/// Shares of the variance of ln |Δe| at the end of the mission, the largest first; empty if it does not vary.
fn shares(found: &Fates, order: Option<&[usize]>, seed: u64) -> Vec<Share> {
    let count = found.names.len() + 1;
    let statistics = |places: &[usize]| found.explained(places).shares().unwrap_or(vec![f64::NAN; count]);
    let names = found.names.iter().map(String::as_str).chain([NOT_LINEAR]);
    let values = with_errors(found.fates.len(), order, seed, statistics);
    let share = |(name, (share, error)): (&str, (f64, Option<f64>))| Share {
        input: name.to_string(),
        share,
        error: error.unwrap_or(0.0),
    };
    let mut shares: Vec<Share> = names.zip(values).map(share).collect();
    if shares.iter().any(|share| !share.share.is_finite()) {
        return Vec::new();
    }
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    shares
}

/// Name of the contribution of inputs in combination or not linear in one input.
pub const NOT_LINEAR: &str = "rest";

/// Minimum number of draws beyond a probability for it to be estimated.
const LEAST_BEYOND: f64 = 5.0;

/// Number of draws that is zero except for rounding: 1 − 0.9 is a little less than 0.1.
const ROUNDING: f64 = 1e-6;

/// The requested probability of meeting a budget, and the number of draws from which it is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Confidence {
    /// Probability, between 0 and 1.
    pub probability: f64,
    /// Draws of each mission.
    pub samples: u32,
}

impl Confidence {
    /// Whether it can be estimated from this number of draws.
    ///
    /// # Errors
    /// If the draws are too few.
    pub fn check(self) -> Result<(), InputError> {
        let percent = 100.0 * self.probability;
        let needed = (LEAST_BEYOND / (1.0 - self.probability).min(self.probability) - ROUNDING).ceil();
        if f64::from(self.samples) < needed {
            let problem = format!("{} draws are too few for a probability of {percent} %", self.samples);
            return Err(InputError::new("cannot estimate probabilities", problem)
                .with_help(format!("--samples {needed} or more")));
        }
        Ok(())
    }

    /// The distribution of a mission's date, with the mission's own seed, so that compared missions have the same draws. `biases`:
    /// those of its population if they are limited.
    ///
    /// # Errors
    /// As [`date_distribution`], and if limited biases cannot be estimated for the draws.
    pub fn of(self, mission: &Mission, biases: Option<&PopulationBias>) -> Result<DateDistribution, InputError> {
        self.check()?;
        if biases.is_some_and(|biases| biases.by_traps.is_none()) {
            let problem = "its traps change by more than their number, and the shear biases of draws are known against that number alone";
            let refused =
                format!("cannot tell probabilities of requirement.c and m of mission \"{}\"", mission.mission.name);
            return Err(InputError::new(refused, problem).with_help("leave out --probability, or requirement.c and m"));
        }
        date_distribution(mission, None, biases, self.samples, mission.accuracy.seed, &Progress::NONE)
    }
}

impl DateDistribution {
    /// When the requirement is violated, without and with correction: the first of all limits.
    pub fn requirement(&self) -> [&Dates; 2] {
        match &self.first {
            Some(first) => [&first.uncorrected, &first.corrected],
            None => [&self.uncorrected, &self.corrected],
        }
    }

    /// Probability that the corrected budgets are met until the end of the mission.
    pub fn probability_met(&self) -> f64 {
        self.requirement()[1].probability_met()
    }
}

impl Dates {
    /// Probability that the limit is met until the end of the mission.
    pub fn probability_met(&self) -> f64 {
        1.0 - self.probability_exceeded
    }

    /// How long (years since launch) the limit is met with a given probability; None if until the end of the mission.
    pub fn kept_yr(&self, probability: f64) -> Option<f64> {
        Some(quantile(&self.times_yr, 1.0 - probability)).filter(|t_yr| t_yr.is_finite())
    }

    /// From times (years since launch, infinite if not within the mission) of draws that are evenly spread in an order, or of an
    /// effective number of independent ones. Errors of quantiles are from a bootstrap with a seed.
    pub fn of(mut times_yr: Vec<f64>, order: Option<&[usize]>, effective: f64, launch: NaiveDate, seed: u64) -> Dates {
        let statistics = |places: &[usize]| {
            let mut drawn: Vec<f64> = places.iter().map(|place| times_yr[*place]).collect();
            drawn.sort_by(f64::total_cmp);
            QUANTILES.map(|p| quantile(&drawn, p)).to_vec()
        };
        let widened = (times_yr.len() as f64 / effective).sqrt();
        let found = with_errors(times_yr.len(), order, seed, statistics);
        let at = |(p, (t_yr, error_yr)): (f64, (f64, Option<f64>))| {
            let t_yr = Some(t_yr).filter(|t_yr| t_yr.is_finite());
            DateQuantile {
                p,
                t_yr,
                error_yr: t_yr.and(error_yr).map(|error_yr| widened * error_yr),
                date: t_yr.and_then(|t_yr| date_after(launch, t_yr)),
            }
        };
        let quantiles = QUANTILES.into_iter().zip(found).map(at).collect();
        let holds: Vec<bool> = times_yr.iter().map(|t_yr| t_yr.is_finite()).collect();
        let probability_exceeded = holds.iter().filter(|within| **within).count() as f64 / holds.len() as f64;
        let probability_error = match order {
            Some(order) => share_error_in_order(&holds, order),
            None => share_error(probability_exceeded, effective),
        };
        times_yr.sort_by(f64::total_cmp);
        Dates { probability_exceeded, probability_error, probability_exceeded_with_noise: None, quantiles, times_yr }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_shares_are_those_on_paper() {
        let launch = NaiveDate::from_ymd_opt(2030, 1, 1).unwrap();
        // Evenly between 0 and 10 yr; the mission ends after 6.
        let times = |n: usize| (0..n).map(move |i| 10.0 * (i as f64 + 0.5) / n as f64);
        let n = 1000;
        let within: Vec<f64> = times(n).map(|t_yr| if t_yr > 6.0 { f64::INFINITY } else { t_yr }).collect();
        let dates = Dates::of(within.clone(), None, n as f64, launch, 1);
        assert!((dates.probability_exceeded - 0.6).abs() < 1e-12);
        assert!((dates.probability_error / (0.6 * 0.4 / n as f64).sqrt() - 1.0).abs() < 0.01, "{dates:?}");
        let [early, median, late] = dates.quantiles[..] else { panic!("{dates:?}") };
        assert!((early.t_yr.unwrap() - 0.5).abs() < 0.02 && (median.t_yr.unwrap() - 5.0).abs() < 0.02, "{dates:?}");
        assert_eq!((late.t_yr, late.error_yr, late.date), (None, None, None));
        // 10 yr √(p (1 − p)/n); bootstrap errors are accurate to about 10 %.
        let expected = 10.0 * (0.25 / n as f64).sqrt();
        assert!((median.error_yr.unwrap() / expected - 1.0).abs() < 0.25, "{median:?} {expected}");
        // A quarter as many independent draws: errors twice as large.
        let fewer = Dates::of(within, None, 0.25 * n as f64, launch, 1);
        assert!((fewer.quantiles[1].error_yr.unwrap() / median.error_yr.unwrap() - 2.0).abs() < 1e-9);
    }

    #[test]
    fn what_never_happened_may_yet_happen() {
        let launch = NaiveDate::from_ymd_opt(2030, 1, 1).unwrap();
        let dates = Dates::of(vec![f64::INFINITY; 98], None, 98.0, launch, 1);
        assert_eq!(dates.probability_exceeded, 0.0);
        // Beta(1, 99): standard deviation √(99/101)/100.
        assert!((dates.probability_error - (99.0_f64 / 101.0).sqrt() / 100.0).abs() < 1e-12);
        assert!(dates.quantiles.iter().all(|at| at.t_yr.is_none()));
    }
}
