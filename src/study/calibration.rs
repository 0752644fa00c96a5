//! How accurately a correction must know the traps, and what calibrations at a given interval achieve.
//!
//! To first order in the trailing, a correction with assumed parameters leaves the difference from the true effects:
//!
//! ```text
//! left = Σ ∂q/∂ln ρᵢ (Δρᵢ/ρᵢ) + Σ ∂q/∂ln τᵢ (Δτᵢ/τᵢ)        q: Δe of the judged galaxy, shear biases c and m of the population
//! ```
//!
//! with densities ρ and release times τ of the species. Israel et al. 2015 (MNRAS 453, 561) conclude that Euclid must know
//! densities to 0.03 % and release times to 0.04 %.
//!
//! Each calibration (trails of injected charge or of flats, pumping) measures densities and release times with independent relative
//! errors. Until the next one, densities are extrapolated linearly from the last two, or held constant:
//!
//! ```text
//! ρ̂(t) = ρ̂ₖ + (ρ̂ₖ − ρ̂ₖ₋₁)(t − tₖ)/(tₖ − tₖ₋₁)        ρ̂(t) = ρ̂ₖ
//! ```
//!
//! A solar event in between is not predicted: the Sun is drawn as for the distribution of the date.
//!
//! Given intervals are evaluated one by one; the longest that meets all limits is solved for (`calibration/longest.rs`).

mod longest;

use serde::Serialize;

use super::tolerance::{Sensitivity, known, limit};
use super::{Study, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::estimate::{quantile, share_error, share_error_in_order};
use crate::numeric::parallel;
use crate::plan::date_distribution::Confidence;
use crate::plan::draws::Draws;
use crate::plan::judgement::Limited;
use crate::warning::Warning;

pub use super::tolerance::Known;
pub use longest::{Longest, Outcome, TOLERANCE};

/// Months per year.
const MONTHS: f64 = 12.0;

/// Shortest interval between calibrations, months.
pub const LEAST_MONTHS: f64 = 0.1;

/// Options of the study.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Intervals between calibrations, months.
    pub intervals_months: Vec<f64>,
    /// Relative error (1 σ) of each density in one calibration.
    pub density_error: f64,
    /// Relative error (1 σ) of each release time in one calibration.
    pub release_error: f64,
    /// Probability with which the requirement is to be met, over draws of the Sun.
    pub probability: f64,
    /// Draws of the Sun.
    pub samples: u32,
    /// Seed of the draws; by default the mission's.
    pub seed: Option<u64>,
}

impl Default for Calibration {
    fn default() -> Calibration {
        Calibration {
            intervals_months: vec![0.25, 0.5, 1.0, 2.0, 3.0, 6.0, 12.0],
            density_error: 0.01,
            release_error: 0.01,
            probability: 0.9,
            samples: 400,
            seed: None,
        }
    }
}

/// How densities are extrapolated to the next calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Continued {
    /// Held constant.
    Constant,
    /// Linearly from the last two calibrations.
    Linear,
}

/// All methods.
const WAYS: [Continued; 2] = [Continued::Constant, Continued::Linear];

/// The results of the study.
#[derive(Clone, Debug)]
pub struct Results {
    /// The limited quantities.
    pub limited: Vec<Limited>,
    /// Their limits, without correction.
    pub limits: Vec<f64>,
    /// Each parameter by itself, and all together.
    pub known: Vec<Known>,
    /// Each interval, for each extrapolation of the densities.
    pub intervals: Vec<Interval>,
    /// The longest interval that meets all limits, for each extrapolation of the densities.
    pub longest: Vec<Longest>,
    /// The requested probability.
    pub probability: f64,
    /// Why the Sun is not drawn; None if it is.
    pub sun_not_drawn: Option<String>,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// Calibrations at an interval.
#[derive(Clone, Debug, Serialize)]
pub struct Interval {
    /// Time between two calibrations, months.
    pub interval_months: f64,
    /// How densities are extrapolated.
    pub continued: Continued,
    /// Largest error of the densities over the mission, % of those at its end, not exceeded with the requested probability.
    pub density_error_percent: f64,
    /// Largest share of a limit that is used over the mission, %, not exceeded with the requested probability.
    pub used_percent: f64,
    /// The limit of which that share is used.
    pub by: Option<Limited>,
    /// Fraction of the mission during which a limit is exceeded, mean over the draws, %.
    pub beyond_percent: f64,
    /// Probability that all limits are met, %.
    pub met_percent: f64,
    /// Its standard error from the finite number of draws, %.
    pub met_error_percent: f64,
}

impl Study for Calibration {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        self.check(mission)?;
        let model = ready(mission)?;
        let sensitivities = Sensitivity::all(&model, advance)?;
        let histories = DensityHistories::of(mission, self.samples, self.seed.unwrap_or(mission.accuracy.seed))?;
        let mut intervals = Vec::new();
        for interval_months in &self.intervals_months {
            for continued in WAYS {
                advance();
                intervals.push(self.interval(&sensitivities, &histories, *interval_months, continued));
            }
        }
        let longest = WAYS.map(|continued| {
            advance();
            self.longest(&sensitivities, &histories, continued)
        });
        let limited = Limited::by(mission);
        Ok(Results {
            limits: limited.iter().filter_map(|one| limit(mission, *one)).collect(),
            limited,
            known: known(mission, &sensitivities),
            intervals,
            longest: longest.to_vec(),
            probability: self.probability,
            sun_not_drawn: histories.sun_not_drawn,
            warnings: warnings(mission),
        })
    }
}

/// Histories of the number of traps, each relative to that expected at the end.
struct DensityHistories {
    /// Years since launch, ascending, and traps.
    of_draws: Vec<Vec<(f64, f64)>>,
    /// Draws in the order of the Sun's rank, if it is drawn.
    order: Option<Vec<usize>>,
    end_yr: f64,
    sun_not_drawn: Option<String>,
}

impl DensityHistories {
    fn of(mission: &Mission, samples: u32, seed: u64) -> Result<DensityHistories, InputError> {
        let draws = Draws::of(mission, None, samples, seed)?;
        Ok(DensityHistories {
            of_draws: draws.traps_over_expected()?,
            order: draws.sun_not_drawn().is_none().then(|| draws.by_rank()),
            end_yr: mission.mission.duration_yr,
            sun_not_drawn: draws.sun_not_drawn().map(String::from),
        })
    }

    /// Standard error of the probability that all limits are met.
    fn error_of_met(&self, worst: &[Worst]) -> f64 {
        let met: Vec<bool> = worst.iter().map(|one| one.used <= 1.0).collect();
        match &self.order {
            Some(order) => share_error_in_order(&met, order),
            None => share_error(met.iter().filter(|met| **met).count() as f64 / met.len() as f64, met.len() as f64),
        }
    }
}

/// A history at a time, by linear interpolation.
fn at(history: &[(f64, f64)], t_yr: f64) -> f64 {
    let after = history.partition_point(|point| point.0 < t_yr).clamp(1, history.len() - 1);
    let ((from_yr, from), (to_yr, to)) = (history[after - 1], history[after]);
    from + (to - from) * ((t_yr - from_yr) / (to_yr - from_yr)).clamp(0.0, 1.0)
}

impl Calibration {
    /// Checks that intervals are within the mission, and that the draws suffice for the probability.
    fn check(&self, mission: &Mission) -> Result<(), InputError> {
        let most = MONTHS * mission.mission.duration_yr;
        let within = |months: &&f64| !(LEAST_MONTHS..=most).contains(*months);
        if let Some(months) = self.intervals_months.iter().find(within) {
            let problem =
                format!("{months} months between calibrations; allowed: {LEAST_MONTHS} to {most} (the mission)");
            return Err(InputError::new("cannot calibrate", problem));
        }
        Confidence { probability: self.probability, samples: self.samples }.check()
    }

    /// Calibrations at an interval, over all draws of the Sun.
    fn interval(
        &self,
        sensitivities: &[Sensitivity],
        histories: &DensityHistories,
        interval_months: f64,
        continued: Continued,
    ) -> Interval {
        let worst = self.over_draws(sensitivities, histories, interval_months, continued);
        let quantile_of = |of: fn(&Worst) -> f64| {
            let mut values: Vec<f64> = worst.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            quantile(&values, self.probability)
        };
        let met = worst.iter().filter(|one| one.used <= 1.0).count() as f64 / worst.len() as f64;
        let used = quantile_of(|one| one.used);
        let nearest = worst.iter().min_by(|a, b| (a.used - used).abs().total_cmp(&(b.used - used).abs()));
        Interval {
            interval_months,
            continued,
            density_error_percent: 100.0 * quantile_of(|one| one.density_error),
            used_percent: 100.0 * used,
            by: nearest.map(|one| one.by),
            beyond_percent: 100.0 * worst.iter().map(|one| one.beyond).sum::<f64>() / worst.len() as f64,
            met_percent: 100.0 * met,
            met_error_percent: 100.0 * histories.error_of_met(&worst),
        }
    }

    /// The residuals of calibrations at an interval, for each draw of the Sun.
    fn over_draws(
        &self,
        sensitivities: &[Sensitivity],
        histories: &DensityHistories,
        interval_months: f64,
        continued: Continued,
    ) -> Vec<Worst> {
        parallel::map(&histories.of_draws, |history| {
            self.worst(sensitivities, history, histories.end_yr, interval_months / MONTHS, continued)
        })
    }

    /// The residuals of calibrations for a draw, evaluated just before each of them and at times in between.
    fn worst(
        &self,
        sensitivities: &[Sensitivity],
        history: &[(f64, f64)],
        end_yr: f64,
        interval_yr: f64,
        continued: Continued,
    ) -> Worst {
        let mut worst = Worst { density_error: 0.0, used: 0.0, by: sensitivities[0].limited, beyond: 0.0 };
        let calibrations = (end_yr / interval_yr).ceil() as usize;
        for number in 0..calibrations {
            let last_yr = number as f64 * interval_yr;
            let next_yr = (last_yr + interval_yr).min(end_yr);
            let before_yr = (continued == Continued::Linear && number > 0).then_some(last_yr - interval_yr);
            let calibrated = Calibrated::of(history, last_yr, before_yr);
            for look in 1..=LOOKS {
                let t_yr = last_yr + (next_yr - last_yr) * f64::from(look) / f64::from(LOOKS);
                let traps = at(history, t_yr);
                let (common, own) = calibrated.errors(t_yr, traps, self.density_error);
                worst.density_error = worst.density_error.max(common.hypot(own));
                let used = |one: &Sensitivity| (one.used(own, self.release_error, common, traps), one.limited);
                let most = sensitivities.iter().map(used).max_by(|a, b| a.0.total_cmp(&b.0)).expect("a limit");
                if most.0 > worst.used {
                    (worst.used, worst.by) = most;
                }
                if most.0 > 1.0 {
                    worst.beyond += (next_yr - last_yr) / (f64::from(LOOKS) * end_yr);
                }
            }
        }
        worst
    }
}

/// Number of times between two calibrations at which errors are evaluated.
const LOOKS: u32 = 8;

/// The residuals of calibrations for a draw.
struct Worst {
    /// Largest error of the densities, relative to those expected at the end.
    density_error: f64,
    /// Largest share of a limit that is used.
    used: f64,
    /// The limit of which that share is used.
    by: Limited,
    /// Fraction of the time during which a limit is exceeded.
    beyond: f64,
}

/// Traps at the last calibration, and at the previous one for linear extrapolation: times (years since launch) and densities
/// relative to those expected at the end.
struct Calibrated {
    last: (f64, f64),
    before: Option<(f64, f64)>,
}

impl Calibrated {
    fn of(history: &[(f64, f64)], last_yr: f64, before_yr: Option<f64>) -> Calibrated {
        Calibrated { last: (last_yr, at(history, last_yr)), before: before_yr.map(|t_yr| (t_yr, at(history, t_yr))) }
    }

    /// Errors at a time with this number of traps: the one common to all densities, and the independent ones from the relative
    /// error of a calibration: ρ̂ₖ (1 + x) − ρ̂ₖ₋₁ x.
    fn errors(&self, t_yr: f64, traps: f64, relative: f64) -> (f64, f64) {
        let (last_yr, last) = self.last;
        let Some((before_yr, before)) = self.before else { return (last - traps, relative * last) };
        let ahead = (t_yr - last_yr) / (last_yr - before_yr);
        (last + (last - before) * ahead - traps, relative * ((1.0 + ahead) * last).hypot(ahead * before))
    }
}
