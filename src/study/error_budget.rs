//! Which uncertain input dominates the date on which the budget is exceeded.
//!
//! The Sun and the inputs of `[uncertainty]` are drawn as for the distribution of the date (`plan/draws.rs`): with the same number
//! of draws and the same seed, the dates are the same. Shares refer to the variance of ln |Δe| at the end of the mission, by linear
//! regression on the z:
//!
//! ```text
//! ln |Δe| = β₀ + Σ βᵢ zᵢ + rest        share i = βᵢ²/(Σ β² + var(rest))
//! ```
//!
//! (Saltelli et al. 2008, Global Sensitivity Analysis: squared standardised regression coefficients of independent
//! inputs.)

mod statistics;

use chrono::NaiveDate;
use serde::Serialize;

use super::{Estimate, Study, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::calendar::{DAYS_PER_YEAR, date_after};
use crate::numeric::parallel;
use crate::plan::draws::input::{Shield, Sigma};
use crate::plan::draws::{Draws, Emulated, Fates};
use crate::plan::progress::Progress;
use crate::warning::Warning;

pub use crate::plan::draws::Fate;
use statistics::Statistics;

/// Longest time for which dates can be followed, yr.
const HORIZON_YR: f64 = 100.0;

/// Percentiles of dates.
pub const PERCENTILES: [f64; 5] = [5.0, 16.0, 50.0, 84.0, 95.0];

/// Options of the study.
#[derive(Clone, Debug)]
pub struct ErrorBudget {
    /// Number of draws of the mission.
    pub draws: u32,
    /// Years since launch up to which dates are followed, at most 100; by default only the mission.
    pub horizon_yr: Option<f64>,
    /// A mission whose detector is also evaluated, all else the same.
    pub detector_of: Option<Mission>,
    /// Seed of the draws; by default the mission's.
    pub seed: Option<u64>,
}

impl Default for ErrorBudget {
    fn default() -> ErrorBudget {
        ErrorBudget { draws: 1000, horizon_yr: None, detector_of: None, seed: None }
    }
}

/// The results of the study.
#[derive(Clone, Debug)]
pub struct Results {
    /// Years since launch up to which dates are followed.
    pub horizon_yr: f64,
    /// The mission.
    pub own: Budget,
    /// The same with the detector of another mission, and that mission's name.
    pub other: Option<(String, Budget)>,
    /// Whether the thickness of the shield is an input; it is not if no thickness of aluminium gives the mission's dose.
    pub has_shield: bool,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// The results for one detector.
#[derive(Clone, Debug)]
pub struct Budget {
    /// Uncertain inputs; in descending order of their shares, if these are known.
    pub inputs: Vec<InputShare>,
    /// Share of the variance that is not linear in the inputs; None if |Δe| does not vary or is lost.
    pub rest_share: Option<Estimate>,
    /// Standard deviation of ln |Δe| at the end of the mission.
    pub sigma_ln: Option<Estimate>,
    /// When the uncorrected and the corrected budget are exceeded.
    pub exceeded: [Exceeded; 2],
    /// Result for the mission without any deviation.
    pub nominal: Fate,
    /// Result of each draw.
    pub fates: Vec<Fate>,
    /// Why the Sun was not drawn; None if it was.
    pub sun_not_drawn: Option<String>,
    /// How changes of shape were emulated; None if each was read out.
    pub emulated: Option<Emulated>,
}

/// An uncertain input.
#[derive(Clone, Debug, Serialize)]
pub struct InputShare {
    /// Name of the input.
    #[serde(rename = "input")]
    pub name: String,
    /// Relative standard deviation, %; None if it is one of time, or for the Sun, whose distribution is not normal.
    pub sigma_percent: Option<f64>,
    /// Standard deviation, yr; None if it is relative.
    pub sigma_yr: Option<f64>,
    /// Share of the variance of ln |Δe| at the end of the mission, %; None if |Δe| does not vary or is lost.
    pub share_percent: Option<f64>,
    /// Its standard error, %.
    pub share_error_percent: Option<f64>,
    /// Change of |Δe| at the end of the mission if the input is 1 σ larger, %; for the Sun, at 84 % of the draws relative to 50 %.
    pub delta_e_percent: Option<f64>,
    /// Day on which the uncorrected budget is exceeded if the input is 1 σ smaller; with the Sun at 16 %.
    pub low_date: Option<NaiveDate>,
    /// The same if it is 1 σ larger; with the Sun at 84 %.
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

/// A percentile of a time, with its standard error if known.
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
        Ok(Results { horizon_yr, own, other, has_shield, warnings: warnings(mission) })
    }
}

impl ErrorBudget {
    /// Years since launch up to which dates are followed.
    fn horizon_yr(&self, mission: &Mission) -> Result<f64, InputError> {
        let duration_yr = mission.mission.duration_yr;
        let horizon_yr = self.horizon_yr.unwrap_or(duration_yr);
        if !(horizon_yr >= duration_yr && horizon_yr <= HORIZON_YR.max(duration_yr)) {
            let problem =
                format!("a horizon of {horizon_yr} yr; allowed: {duration_yr} (the mission) to {HORIZON_YR} yr");
            return Err(InputError::new("cannot follow dates", problem));
        }
        Ok(horizon_yr)
    }

    fn budget(&self, mission: &Mission, horizon_yr: f64, advance: &(dyn Fn() + Sync)) -> Result<Budget, InputError> {
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let draws = Draws::followed_to(horizon_yr, mission, None, self.draws, seed)?;
        let inputs = draws.inputs().len() + usize::from(draws.sun_not_drawn().is_none());
        let needed = 2 * (inputs as u32 + 1);
        if self.draws < needed {
            let problem = format!("{} draws are too few for {inputs} uncertain inputs", self.draws);
            return Err(InputError::new("cannot draw", problem).with_help(format!("--samples {needed} or more")));
        }
        let found = draws.fates(&Progress { stage: &|_, _| {}, advance })?;
        let nominal = draws.alone(None)?;
        let swings = swings(&draws, &found, &nominal)?;
        let statistics = Statistics::of(&found, mission.mission.duration_yr, seed);
        let launch = mission.mission.launch.0;
        Ok(Budget {
            inputs: ranked(&found.names, &swings, &statistics, launch),
            rest_share: statistics.shares.map(|(_, rest)| rest),
            sigma_ln: statistics.sigma_ln,
            exceeded: statistics.limits.map(|crossings| Exceeded {
                percentiles: crossings.percentiles.into_iter().map(|one| Some(Percentile::of(one?, launch))).collect(),
                within_percent: crossings.within.times(100.0),
            }),
            nominal,
            sun_not_drawn: draws.sun_not_drawn().map(String::from),
            emulated: found.emulated,
            fates: found.fates,
        })
    }
}

/// The effect of one input alone, all else as expected.
struct Swing {
    /// Its uncertainty; None for the Sun.
    sigma: Option<Sigma>,
    /// Results for the mission at −1 σ and at +1 σ.
    ends: [Fate; 2],
    /// Result in between.
    middle: Fate,
}

/// Each input alone at −1 σ and +1 σ; the Sun, if drawn, is last: at 16 % and 84 % of its doses.
fn swings(draws: &Draws, found: &Fates, nominal: &Fate) -> Result<Vec<Swing>, InputError> {
    let places: Vec<usize> = (0..draws.inputs().len()).collect();
    let mut swings = parallel::try_map(&places, |place| {
        let ends = [draws.alone(Some((*place, -1.0)))?, draws.alone(Some((*place, 1.0)))?];
        Ok(Swing { sigma: Some(draws.inputs()[*place].sigma), ends, middle: *nominal })
    })?;
    if draws.sun_not_drawn().is_none() {
        let mut by_dose: Vec<usize> = (0..found.fates.len()).collect();
        by_dose.sort_by(|a, b| found.fates[*a].sun_mev_g.total_cmp(&found.fates[*b].sun_mev_g));
        let at = |p: f64| {
            let place = by_dose[(p * by_dose.len() as f64) as usize];
            draws.under_the_sun_of(found.numbers[place])
        };
        let [low, middle, high] = ONE_SIGMA.map(at);
        swings.push(Swing { sigma: None, ends: [low?, high?], middle: middle? });
    }
    Ok(swings)
}

/// Probabilities of −1 σ, 0 and +1 σ of a normal distribution.
const ONE_SIGMA: [f64; 3] = [0.158_655, 0.5, 0.841_345];

impl Percentile {
    fn of((t_yr, error_yr): (f64, Option<f64>), launch: NaiveDate) -> Percentile {
        Percentile { t_yr, error_yr, date: date_after(launch, t_yr) }
    }
}

/// Inputs in descending order of their shares, with the results of the mission at −1 σ and +1 σ of each alone.
fn ranked(names: &[String], swings: &[Swing], statistics: &Statistics, launch: NaiveDate) -> Vec<InputShare> {
    let shares = statistics.shares.as_ref().map(|(shares, _)| shares);
    let mut order: Vec<usize> = (0..swings.len()).collect();
    if let Some(shares) = shares {
        order.sort_by(|a, b| shares[*b].value.total_cmp(&shares[*a].value));
    }
    let date = |fate: &Fate| date_after(launch, fate.exceeded_yr[0]?);
    let input = |place: usize| {
        let Swing { sigma, ends: [low, high], middle } = &swings[place];
        let (sigma_percent, sigma_yr) = match sigma {
            Some(Sigma::Relative(sigma)) => (Some(100.0 * sigma), None),
            Some(Sigma::Years(sigma_yr)) => (None, Some(*sigma_yr)),
            None => (None, None),
        };
        let share = shares.map(|shares| shares[place].times(100.0));
        let over = high.delta_e.zip(middle.delta_e).filter(|(_, middle)| *middle > 0.0);
        InputShare {
            name: names[place].clone(),
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
