//! Which uncertain input dominates the date on which the budget is exceeded.
//!
//! Inputs are multiplied by exp(σ z) with standard normal z and the relative uncertainties σ of `[uncertainty]`; each draw is a
//! mission of its own. Maxima of the Sun that are not known yet are shifted, each with all after it, by σ z with the scatter σ of
//! the length of a cycle. Shares are of the variance of ln |Δe| at the end of the mission, by linear regression on the z:
//!
//! ```text
//! ln |Δe| = β₀ + Σ βᵢ zᵢ + rest        share i = βᵢ²/(Σ β² + var(rest))
//! ```
//!
//! (Saltelli et al. 2008, Global Sensitivity Analysis: squared standardised regression coefficients of independent
//! inputs.) Confidence of the fluence is no such input: it is chosen, see `study shielding`.

mod sampler;
mod statistics;

use chrono::NaiveDate;
use serde::Serialize;

use super::{Estimate, Study, budgets, each, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::calendar::{DAYS_PER_YEAR, date_after};
use crate::plan::timeline::Timeline;
use crate::warning::Warning;

use crate::plan::draws::input::{Shield, Sigma};
pub use sampler::Fate;
use sampler::Sampler;
use statistics::Statistics;

/// How far dates are followed beyond the mission if nothing else is asked for, in durations and in years.
const HORIZON: f64 = 3.0;
const HORIZON_YR: f64 = 100.0;

/// Percentiles of dates.
pub const PERCENTILES: [f64; 5] = [5.0, 16.0, 50.0, 84.0, 95.0];

/// Options of the study.
#[derive(Clone, Debug)]
pub struct ErrorBudget {
    /// Missions that are drawn.
    pub draws: u32,
    /// Years since launch up to which dates are followed; if none are given, three times the mission, at most 100, or the
    /// mission alone if its corrected budget is exceeded within half of it.
    pub horizon_yr: Option<f64>,
    /// A mission whose detector is flown as well, all else the same.
    pub detector_of: Option<Mission>,
    /// Seed of the draws; the mission's if none is given.
    pub seed: Option<u64>,
}

impl Default for ErrorBudget {
    fn default() -> ErrorBudget {
        ErrorBudget { draws: 1000, horizon_yr: None, detector_of: None, seed: None }
    }
}

/// What the study finds.
#[derive(Clone, Debug)]
pub struct Results {
    /// Number of draws.
    pub draws: u32,
    /// Years since launch up to which dates are followed.
    pub horizon_yr: f64,
    /// The mission.
    pub own: Budget,
    /// The same with another mission's detector, by the name of that mission.
    pub other: Option<(String, Budget)>,
    /// Whether the thickness of the shield is an input; it is none if no thickness of aluminium makes the mission's dose.
    pub has_shield: bool,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// What is found for one detector.
#[derive(Clone, Debug)]
pub struct Budget {
    /// Uncertain inputs; the largest share first, if shares are known.
    pub inputs: Vec<InputShare>,
    /// Share of the variance that is not linear in the inputs; None if |Δe| does not vary or is lost.
    pub rest_share: Option<Estimate>,
    /// Standard deviation of ln |Δe| at the end of the mission.
    pub sigma_ln: Option<Estimate>,
    /// When the uncorrected and the corrected budget are exceeded.
    pub exceeded: [Exceeded; 2],
    /// What becomes of the mission without any deviation.
    pub nominal: Fate,
    /// What becomes of each draw.
    pub fates: Vec<Fate>,
}

/// An uncertain input.
#[derive(Clone, Debug, Serialize)]
pub struct InputShare {
    /// Name of the input.
    #[serde(rename = "input")]
    pub name: String,
    /// Relative standard deviation, %; None if it is one of time.
    pub sigma_percent: Option<f64>,
    /// Standard deviation, yr; None if it is a relative one.
    pub sigma_yr: Option<f64>,
    /// Share of the variance of ln |Δe| at the end of the mission, %; None if |Δe| does not vary or is lost.
    pub share_percent: Option<f64>,
    /// Its standard error, %.
    pub share_error_percent: Option<f64>,
    /// Change of |Δe| at the end of the mission if the input is 1 σ larger, %.
    pub delta_e_percent: Option<f64>,
    /// Day on which the uncorrected budget is exceeded if the input is 1 σ smaller.
    pub low_date: Option<NaiveDate>,
    /// The same if it is 1 σ larger.
    pub high_date: Option<NaiveDate>,
}

impl InputShare {
    /// Share of the variance, %.
    pub fn share(&self) -> Option<Estimate> {
        self.share_percent.zip(self.share_error_percent).map(|(value, error)| Estimate { value, error })
    }
}

/// When a budget is exceeded.
#[derive(Clone, Debug)]
pub struct Exceeded {
    /// Percentiles of the time, in the order of [`PERCENTILES`]; None if later than the horizon.
    pub percentiles: Vec<Option<Percentile>>,
    /// Share of the draws in which it is exceeded within the mission, %.
    pub within_percent: Estimate,
}

/// A percentile of a time, with its standard error if that is known.
#[derive(Clone, Copy, Debug)]
pub struct Percentile {
    /// Years since launch.
    pub t_yr: f64,
    /// Standard error, yr.
    pub error_yr: Option<f64>,
    /// The day; None if that is beyond the calendar.
    pub date: Option<NaiveDate>,
}

impl Percentile {
    /// The day and its standard error in days.
    pub fn day(&self) -> Option<(NaiveDate, Option<f64>)> {
        Some((self.date?, self.error_yr.map(|error_yr| error_yr * DAYS_PER_YEAR)))
    }
}

impl Study for ErrorBudget {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        let horizon_yr = self.horizon_yr(mission)?;
        let own = self.budget(mission, horizon_yr, advance)?;
        let other = match &self.detector_of {
            None => None,
            Some(other) => {
                let flown = Mission { detector: other.detector.clone(), ..mission.clone() };
                Some((other.mission.name.clone(), self.budget(&flown, horizon_yr, advance)?))
            }
        };
        let has_shield = Shield::of(mission).is_some();
        Ok(Results { draws: self.draws, horizon_yr, own, other, has_shield, warnings: warnings(mission) })
    }
}

impl ErrorBudget {
    /// Years since launch up to which dates are followed.
    fn horizon_yr(&self, mission: &Mission) -> Result<f64, InputError> {
        let duration_yr = mission.mission.duration_yr;
        let [_, corrected] = budgets(mission);
        let exceeded_yr = Timeline::of(&ready(mission)?)?.crossing(corrected).t_yr;
        let soon = exceeded_yr.is_some_and(|t_yr| t_yr < 0.5 * duration_yr);
        let long_yr = (HORIZON * duration_yr).min(HORIZON_YR).max(duration_yr);
        let horizon_yr = self.horizon_yr.unwrap_or(if soon { duration_yr } else { long_yr });
        if !(horizon_yr >= duration_yr && horizon_yr <= HORIZON_YR.max(duration_yr)) {
            let problem =
                format!("a horizon of {horizon_yr} yr; allowed: {duration_yr} (the mission) to {HORIZON_YR} yr");
            return Err(InputError::new("cannot follow dates", problem));
        }
        Ok(horizon_yr)
    }

    fn budget(&self, mission: &Mission, horizon_yr: f64, advance: &(dyn Fn() + Sync)) -> Result<Budget, InputError> {
        let sampler = Sampler::new(mission, horizon_yr)?;
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let needed = 2 * (sampler.inputs.len() as u32 + 1);
        if self.draws < needed {
            let problem = format!("{} draws are too few for {} uncertain inputs", self.draws, sampler.inputs.len());
            return Err(InputError::new("cannot draw", problem).with_help(format!("--draws {needed} or more")));
        }
        let deviations: Vec<Vec<f64>> = (0..self.draws).map(|draw| sampler.deviations(seed, draw)).collect();
        let fates = each(&deviations, |deviations| {
            advance();
            sampler.fate(deviations)
        })?;
        let places: Vec<usize> = (0..sampler.inputs.len()).collect();
        let swings = each(&places, |place| Ok([sampler.alone(*place, -1.0)?, sampler.alone(*place, 1.0)?]))?;
        let nominal = sampler.fate(&vec![0.0; sampler.inputs.len()])?;
        let statistics = Statistics::of(&deviations, &fates, sampler.duration_yr, seed);
        let launch = mission.mission.launch.0;
        Ok(Budget {
            inputs: ranked(&sampler, &statistics, &nominal, &swings, launch),
            rest_share: statistics.shares.map(|(_, rest)| rest),
            sigma_ln: statistics.sigma_ln,
            exceeded: statistics.limits.map(|crossings| Exceeded {
                percentiles: crossings.percentiles.into_iter().map(|one| Some(Percentile::of(one?, launch))).collect(),
                within_percent: crossings.within.times(100.0),
            }),
            nominal,
            fates,
        })
    }
}

impl Percentile {
    fn of((t_yr, error_yr): (f64, Option<f64>), launch: NaiveDate) -> Percentile {
        Percentile { t_yr, error_yr, date: date_after(launch, t_yr) }
    }
}

/// Inputs by their share, the largest first, with what becomes of the mission at −1 σ and +1 σ of each alone.
fn ranked(
    sampler: &Sampler,
    statistics: &Statistics,
    nominal: &Fate,
    swings: &[[Fate; 2]],
    launch: NaiveDate,
) -> Vec<InputShare> {
    let shares = statistics.shares.as_ref().map(|(shares, _)| shares);
    let mut order: Vec<usize> = (0..swings.len()).collect();
    if let Some(shares) = shares {
        order.sort_by(|a, b| shares[*b].value.total_cmp(&shares[*a].value));
    }
    let date = |fate: &Fate| date_after(launch, fate.exceeded_yr[0]?);
    let input = |place: usize| {
        let [low, high] = &swings[place];
        let (sigma_percent, sigma_yr) = match sampler.inputs[place].sigma {
            Sigma::Relative(sigma) => (Some(100.0 * sigma), None),
            Sigma::Years(sigma_yr) => (None, Some(sigma_yr)),
        };
        let share = shares.map(|shares| shares[place].times(100.0));
        let over = high.delta_e.zip(nominal.delta_e).filter(|(_, nominal)| *nominal > 0.0);
        InputShare {
            name: sampler.inputs[place].name.clone(),
            sigma_percent,
            sigma_yr,
            share_percent: share.map(|share| share.value),
            share_error_percent: share.map(|share| share.error),
            delta_e_percent: over.map(|(with, without)| 100.0 * (with / without - 1.0)),
            low_date: date(low),
            high_date: date(high),
        }
    };
    order.into_iter().map(input).collect()
}
