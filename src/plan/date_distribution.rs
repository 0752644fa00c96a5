//! The date on which the budget is exceeded, as a distribution.

use chrono::NaiveDate;
use rayon::prelude::*;
use serde::Serialize;

use super::evaluate::evaluate;
use super::mission_sample::MissionSample;
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::calendar::date_after;
use crate::numeric::estimate::{quantile, with_errors};

/// Probabilities of the quantiles.
pub const QUANTILES: [f64; 3] = [0.05, 0.5, 0.95];

/// When the budget is exceeded, over a sample of missions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DateDistribution {
    /// Missions that were evaluated.
    pub samples: usize,
    /// Independent missions that they are worth.
    pub effective_samples: f64,
    /// Seed of the draws; None where they were drawn before.
    pub seed: Option<u64>,
    /// Without software correction.
    pub uncorrected: Dates,
    /// With it.
    pub corrected: Dates,
}

/// When a limit is exceeded.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dates {
    /// Probability that it is exceeded within the mission.
    pub probability_exceeded: f64,
    /// Its standard error from the finite number of samples.
    pub probability_error: f64,
    /// Quantiles of the date, in the order of [`QUANTILES`].
    pub quantiles: Vec<DateQuantile>,
    /// The time of each sample, years since launch, rising; infinite where it is not exceeded within the mission.
    #[serde(skip)]
    pub times_yr: Vec<f64>,
}

/// A quantile of a date.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DateQuantile {
    /// Probability that the limit is exceeded by then.
    pub p: f64,
    /// Years since launch; None where it is not within the mission.
    pub t_yr: Option<f64>,
    /// Its standard error from the finite number of samples, yr; None where that is not known.
    pub error_yr: Option<f64>,
    /// The day; None where it is not within the mission, or past the end of the calendar.
    pub date: Option<NaiveDate>,
}

/// Evaluates a mission with so many draws of a sample, evenly chosen. `progress` is called once for each that is done.
///
/// # Errors
/// Where a draw makes no sense to the mission or leaves its galaxy without a shape; names the row of the first.
pub fn over_sample(
    mission: &Mission,
    sample: &MissionSample,
    count: usize,
    progress: impl Fn() + Sync,
) -> Result<DateDistribution, InputError> {
    let judged = Mission { galaxies: vec![mission.judged_galaxy().clone()], ..mission.clone() };
    let rows = sample.chosen(count);
    let exceeded = |row: &usize| -> Result<[f64; 2], InputError> {
        let drawn = sample.mission(&judged, *row)?;
        let verdict = evaluate(&drawn).map_err(|error| sample.fault(*row, error))?.verdict;
        progress();
        Ok([&verdict.uncorrected, &verdict.corrected].map(|crossing| crossing.t_yr.unwrap_or(f64::INFINITY)))
    };
    let found: Vec<Result<[f64; 2], InputError>> = rows.par_iter().map(exceeded).collect();
    // The first of several errors, whichever came first.
    let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
    let effective = sample.effective_samples.unwrap_or(f64::INFINITY).clamp(1.0, rows.len() as f64);
    let dates = |limit: usize| {
        let times_yr = found.iter().map(|times| times[limit]).collect();
        Dates::of(times_yr, effective, mission.mission.launch.0, mission.accuracy.seed)
    };
    Ok(DateDistribution {
        samples: rows.len(),
        effective_samples: effective,
        seed: None,
        uncorrected: dates(0),
        corrected: dates(1),
    })
}

impl Dates {
    /// Of times (years since launch, infinite where not within the mission) that are worth so many independent ones. Errors of
    /// quantiles are those of a bootstrap with a seed.
    pub fn of(mut times_yr: Vec<f64>, effective: f64, launch: NaiveDate, seed: u64) -> Dates {
        times_yr.sort_by(f64::total_cmp);
        let statistics = |places: &[usize]| {
            let mut drawn: Vec<f64> = places.iter().map(|place| times_yr[*place]).collect();
            drawn.sort_by(f64::total_cmp);
            QUANTILES.map(|p| quantile(&drawn, p)).to_vec()
        };
        let widened = (times_yr.len() as f64 / effective).sqrt();
        let found = with_errors(times_yr.len(), seed, statistics);
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
        let within = times_yr.iter().filter(|t_yr| t_yr.is_finite()).count() as f64 / times_yr.len() as f64;
        Dates { probability_exceeded: within, probability_error: share_error(within, effective), quantiles, times_yr }
    }
}

/// Standard error of a share of n independent draws: that of a Beta distribution after a flat prior, which is not 0 where none or
/// all are.
fn share_error(share: f64, n: f64) -> f64 {
    let (some, others) = (share * n + 1.0, (1.0 - share) * n + 1.0);
    (some * others / (n + 3.0)).sqrt() / (n + 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_shares_are_those_on_paper() {
        let launch = NaiveDate::from_ymd_opt(2030, 1, 1).unwrap();
        // Even between 0 and 10 yr; the mission ends after 6.
        let times = |n: usize| (0..n).map(move |i| 10.0 * (i as f64 + 0.5) / n as f64);
        let n = 1000;
        let within: Vec<f64> = times(n).map(|t_yr| if t_yr > 6.0 { f64::INFINITY } else { t_yr }).collect();
        let dates = Dates::of(within.clone(), n as f64, launch, 1);
        assert!((dates.probability_exceeded - 0.6).abs() < 1e-12);
        assert!((dates.probability_error / (0.6 * 0.4 / n as f64).sqrt() - 1.0).abs() < 0.01, "{dates:?}");
        let [early, median, late] = dates.quantiles[..] else { panic!("{dates:?}") };
        assert!((early.t_yr.unwrap() - 0.5).abs() < 0.02 && (median.t_yr.unwrap() - 5.0).abs() < 0.02, "{dates:?}");
        assert_eq!((late.t_yr, late.error_yr, late.date), (None, None, None));
        // 10 yr √(p (1 − p)/n); bootstrap errors are good to a tenth.
        let expected = 10.0 * (0.25 / n as f64).sqrt();
        assert!((median.error_yr.unwrap() / expected - 1.0).abs() < 0.25, "{median:?} {expected}");
        // A quarter as many independent draws: errors twice as large.
        let fewer = Dates::of(within, 0.25 * n as f64, launch, 1);
        assert!((fewer.quantiles[1].error_yr.unwrap() / median.error_yr.unwrap() - 2.0).abs() < 1e-9);
    }

    #[test]
    fn what_never_happened_may_yet_happen() {
        let launch = NaiveDate::from_ymd_opt(2030, 1, 1).unwrap();
        let dates = Dates::of(vec![f64::INFINITY; 98], 98.0, launch, 1);
        assert_eq!(dates.probability_exceeded, 0.0);
        // Beta(1, 99): standard deviation √(99/101)/100.
        assert!((dates.probability_error - (99.0_f64 / 101.0).sqrt() / 100.0).abs() < 1e-12);
        assert!(dates.quantiles.iter().all(|at| at.t_yr.is_none()));
    }
}
