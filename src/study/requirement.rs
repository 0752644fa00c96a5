//! The requirement → what it allows: the inverse of an evaluation.
//!
//! One quantity at a time is varied, all else the same, until the budget is just met at the end of the mission. Dose, traps and
//! fluence are proportional to each other, so the allowed factor f on the mission's dose is solved for once,
//!
//! ```text
//! max |Δe|(t; f D) = limit          or          P(max |Δe|(t; f D) ≤ limit) = confidence
//! ```
//!
//! and with it the shield, whose dose is f times that of the mission's shield. Line times are searched at the end of the mission.

use std::cell::Cell;

use chrono::{Months, NaiveDate};
use serde::Serialize;

use super::{Study, budgets, ratios, ready, warnings};
use crate::error::InputError;
use crate::mission::{MOST_DOSE_FACTOR, Mission};
use crate::model::Model;
use crate::numeric::parallel;
use crate::numeric::root_finding;
use crate::physics::conditions::Conditions;
use crate::plan::curve::Curve;
use crate::plan::date_distribution::Confidence;
use crate::plan::draws::input::Shield;
use crate::study::launch::Launch;
use crate::warning::Warning;

/// Range of the mission's dose, as a multiple of it, in which f is searched; not above what `environment.dose_factor` accepts.
const FACTORS: [f64; 2] = [1e-3, MOST_DOSE_FACTOR];

/// Tolerance of the logarithm of a factor.
const CLOSE: f64 = 1e-4;

/// The same if the factor is estimated from draws.
const CLOSE_OF_DRAWS: f64 = 0.02;

/// Range of line times on either side of the mission's own, as a factor, and their number.
const REACH: f64 = 30.0;
const LINE_TIMES: usize = 41;

/// Range of launch dates in years, and the step in months.
const LAUNCHES_YR: u32 = 11;
const STEP_MONTHS: u32 = 6;

/// Options of the study.
#[derive(Clone, Copy, Debug, Default)]
pub struct Requirement {
    /// The probability with which the budget is to be met, in addition to the expected value.
    pub confidence: Option<Confidence>,
}

/// The results of the study.
#[derive(Clone, Debug)]
pub struct Results {
    /// What the uncorrected and the corrected budget allow.
    pub limits: [Limit; 2],
    /// The mission's own values.
    pub own: Own,
    /// Line times (ms) tried, with |Δe| at the end of the mission; infinite if the shape is lost.
    pub line_times: Vec<(f64, f64)>,
    /// The requested probability, and the draws from which it is estimated.
    pub confidence: Option<Confidence>,
    /// Multiples of the mission's dose that were searched.
    pub factors: [f64; 2],
    /// Launch dates tried, starting with the mission's own.
    pub launches: Vec<NaiveDate>,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// The mission's own values of the quantities that a requirement limits.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Own {
    /// Largest |Δe| of the mission; None if a shape is lost.
    pub delta_e: Option<f64>,
    /// Dose at the end, MeV/g.
    pub dose_mev_g: f64,
    /// Traps at the end, 1/px.
    pub traps_per_px: f64,
    /// Protons of 10 MeV of the same dose, cm⁻².
    pub protons_10mev_cm2: f64,
    /// Areal density of the shield, along the normal of a slab, otherwise the mean over its directions; None if unknown.
    pub shield_g_cm2: Option<f64>,
    /// Transfers.
    pub transfers: u32,
    /// Line time, ms.
    pub line_time_ms: f64,
}

/// What a limit allows.
#[derive(Clone, Debug)]
pub struct Limit {
    /// Largest |Δe| before correction.
    pub delta_e: f64,
    /// Factor on the dose, for the expected value, and with the requested probability.
    pub factor: [Bound; 2],
    /// Standard error of that probability at the factor found, or at that nearest to it; None if it was not requested.
    pub confident_error: Option<f64>,
    /// Factor on the thickness of the shield, likewise.
    pub shield: [Bound; 2],
    /// Largest number of transfers; None if not even one is allowed, or all are.
    pub transfers: Bound,
    /// Ranges of line time (ms) for which |Δe| at the end is within the limit, from those tried.
    pub line_times_ms: Vec<[f64; 2]>,
    /// Number of the launch dates that meet it.
    pub launches: usize,
}

/// The largest allowed value (for a shield, the smallest).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// It was not requested, or does not apply to this mission.
    NotSought,
    /// None of the values tried.
    None,
    /// This value.
    At(f64),
    /// All of the values tried.
    All,
}

impl Bound {
    /// The value.
    pub fn value(self) -> Option<f64> {
        if let Bound::At(value) = self { Some(value) } else { None }
    }
}

impl Study for Requirement {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        if !mission.requirement.limits_a_galaxy() {
            let problem = "requirement.delta_e is missing: this study finds what it allows";
            return Err(InputError::new(format!("cannot invert mission \"{}\"", mission.mission.name), problem)
                .with_help("add requirement.delta_e; requirement.c and m are judged by `ctiplan evaluate`"));
        }
        if let Some(asked) = self.confidence {
            asked.check()?;
        }
        // The galaxy's budget is inverted, not those of the population.
        let mission = &of_galaxy_alone(mission);
        let model = ready(mission)?;
        let shield = Shield::of(mission);
        let launch = Launch { launches: Some(launches(mission.mission.launch.0)), ..Launch::default() };
        let launched = super::Study::study(&launch, mission, advance)?;
        let clocks = self.clocks(&model, advance)?;
        let limit = |place: usize| -> Result<Limit, InputError> {
            let delta_e = budgets(mission)[place];
            let expected = factor(factors(mission), CLOSE, |factor| excess(&with_dose(&model, factor), delta_e))?;
            let (confident, confident_error) = self.confident(mission, place, advance)?;
            let behind = |factor: Bound| match (factor, &shield) {
                (Bound::At(factor), Some(shield)) => shield.factor_for(factor).map_or(Bound::None, Bound::At),
                _ => Bound::NotSought,
            };
            let kept = |launch: &crate::study::launch::Launched| {
                [launch.judged.exceeded_t_yr, launch.judged.corrected_t_yr][place].is_none()
            };
            Ok(Limit {
                delta_e,
                shield: [expected, confident].map(behind),
                factor: [expected, confident],
                confident_error,
                transfers: transfers(&model, delta_e)?,
                line_times_ms: within(&model, &clocks, delta_e)?,
                launches: launched.launches.iter().filter(|launch| kept(launch)).count(),
            })
        };
        Ok(Results {
            limits: [limit(0)?, limit(1)?],
            own: own(&model, shield.as_ref().map(|shield| shield.areal_g_cm2))?,
            line_times: clocks,
            confidence: self.confidence,
            factors: factors(mission),
            launches: launched.launches.iter().map(|launch| launch.launch).collect(),
            warnings: warnings(mission),
        })
    }
}

/// The mission with only the limit on |Δe|.
fn of_galaxy_alone(mission: &Mission) -> Mission {
    let mut alone = mission.clone();
    (alone.requirement.c, alone.requirement.m) = (None, None);
    alone
}

impl Requirement {
    /// Factor on the dose at which the budget is met with the requested probability, and the standard error of that probability.
    fn confident(
        &self,
        mission: &Mission,
        place: usize,
        advance: &(dyn Fn() + Sync),
    ) -> Result<(Bound, Option<f64>), InputError> {
        let Some(asked) = self.confidence else { return Ok((Bound::NotSought, None)) };
        let nearest = Cell::new((f64::INFINITY, f64::NAN));
        let bound = factor(factors(mission), CLOSE_OF_DRAWS, |factor| {
            advance();
            let mut scaled = mission.clone();
            scaled.environment.dose_factor *= factor;
            let found = asked.of(&scaled, None)?;
            let dates = if place == 0 { found.uncorrected } else { found.corrected };
            // Offset by half a draw: no number of draws gives exactly the requested probability.
            let excess = dates.probability_exceeded - (1.0 - asked.probability) + 0.5 / f64::from(asked.samples);
            if excess.abs() < nearest.get().0 {
                nearest.set((excess.abs(), dates.probability_error));
            }
            Ok(excess)
        })?;
        Ok((bound, Some(nearest.get().1)))
    }

    /// Line times (ms) with |Δe| at the end of the mission; infinite if no shape is left.
    fn clocks(&self, model: &Model, advance: &(dyn Fn() + Sync)) -> Result<Vec<(f64, f64)>, InputError> {
        let own_ms = model.mission.readout.line_time_ms;
        parallel::try_map(&ratios(own_ms / REACH, own_ms * REACH, LINE_TIMES), |line_time_ms| {
            advance();
            Ok((*line_time_ms, at_line_time(model, *line_time_ms)?))
        })
    }
}

/// Every half year of a solar cycle, from a first launch on.
fn launches(first: NaiveDate) -> Vec<NaiveDate> {
    let later = |step: u32| first.checked_add_months(Months::new(STEP_MONTHS * step));
    (0..12 * LAUNCHES_YR / STEP_MONTHS).filter_map(later).collect()
}

/// The mission's own values.
fn own(model: &Model, shield_g_cm2: Option<f64>) -> Result<Own, InputError> {
    let mission = &model.mission;
    let end_yr = mission.mission.duration_yr;
    let dose_mev_g = model.dose_mev_g(end_yr)?;
    let largest = largest(&Curve::of(model)?);
    Ok(Own {
        delta_e: Some(largest).filter(|largest| largest.is_finite()),
        dose_mev_g,
        traps_per_px: model.traps(end_yr)?.iter().map(|species| species.density_per_px).sum(),
        protons_10mev_cm2: dose_mev_g / mission.environment.niel.at_10_mev(),
        shield_g_cm2,
        transfers: mission.readout.transfers,
        line_time_ms: mission.readout.line_time_ms,
    })
}

/// Largest |Δe| of a mission; infinite if a shape is lost.
fn largest(curve: &Curve) -> f64 {
    curve.points.iter().map(|point| point.1.unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
}

/// Relative amount by which a mission exceeds a limit on |Δe|, at most 1.
fn excess(model: &Model, limit: f64) -> Result<f64, InputError> {
    Ok((largest(&Curve::of(model)?) / limit - 1.0).min(1.0))
}

/// The mission with its dose multiplied by a factor.
fn with_dose(model: &Model, factor: f64) -> Model {
    let mut mission = model.mission.clone();
    mission.environment.dose_factor *= factor;
    model.like(&mission)
}

/// Factors on the mission's dose that are searched.
fn factors(mission: &Mission) -> [f64; 2] {
    let [least, most] = FACTORS;
    [least, (most / mission.environment.dose_factor.max(1.0)).max(1.0)]
}

/// The largest factor whose excess is not above 0; bracketed outwards from 1 by factors of 2, then refined.
fn factor(
    [least, most]: [f64; 2],
    close: f64,
    excess: impl Fn(f64) -> Result<f64, InputError>,
) -> Result<Bound, InputError> {
    let (mut inner, mut at_inner) = (1.0_f64, excess(1.0)?);
    let [outwards, end] = if at_inner <= 0.0 { [2.0, most] } else { [0.5, least] };
    while inner != end {
        let outer = (inner * outwards).clamp(least, most);
        let at_outer = excess(outer)?;
        if (at_outer <= 0.0) != (at_inner <= 0.0) {
            let ends = [(inner.ln(), at_inner), (outer.ln(), at_outer)];
            let log = root_finding::try_between(ends, close, |log| excess(log.exp()))?;
            return Ok(Bound::At(log.exp()));
        }
        (inner, at_inner) = (outer, at_outer);
    }
    Ok(if at_inner <= 0.0 { Bound::All } else { Bound::None })
}

/// Maximum number of transfers within a limit on |Δe|, up to those of the largest detector.
fn transfers(model: &Model, limit: f64) -> Result<Bound, InputError> {
    let exceeds = |transfers: u32| -> Result<bool, InputError> {
        Ok(largest(&Curve::under(model, |at| at.transfers = transfers)?) > limit)
    };
    if exceeds(1)? {
        return Ok(Bound::None);
    }
    if !exceeds(MOST_TRANSFERS)? {
        return Ok(Bound::All);
    }
    let (mut within, mut beyond) = (1, MOST_TRANSFERS);
    while beyond - within > 1 {
        let middle = within + (beyond - within) / 2;
        if exceeds(middle)? { beyond = middle } else { within = middle }
    }
    Ok(Bound::At(f64::from(within)))
}

/// Transfers of a register longer than any in existence.
const MOST_TRANSFERS: u32 = 16_384;

/// |Δe| at the end of the mission with another line time (ms); infinite if no shape is left.
fn at_line_time(model: &Model, line_time_ms: f64) -> Result<f64, InputError> {
    let at = Conditions { line_time_ms, ..model.conditions(model.mission.mission.duration_yr) };
    let change = model.change_by(0, &model.device(&at)?)?;
    Ok(change.map_or(f64::INFINITY, |change| change.magnitude()))
}

/// Ranges of line time (ms) within a limit on |Δe|, bracketed by those tried and refined in between.
fn within(model: &Model, clocks: &[(f64, f64)], limit: f64) -> Result<Vec<[f64; 2]>, InputError> {
    let excess = |delta_e: f64| (delta_e / limit - 1.0).min(1.0);
    let mut found: Vec<[f64; 2]> = Vec::new();
    let mut from = clocks.first().filter(|first| excess(first.1) <= 0.0).map(|first| first.0);
    for pair in clocks.windows(2) {
        let ends = [pair[0], pair[1]].map(|(line_time_ms, delta_e)| (line_time_ms.ln(), excess(delta_e)));
        if (ends[0].1 <= 0.0) == (ends[1].1 <= 0.0) {
            continue;
        }
        let crossing = |log: f64| Ok::<f64, InputError>(excess(at_line_time(model, log.exp())?));
        let edge = root_finding::try_between(ends, CLOSE, crossing)?.exp();
        match from.take() {
            Some(from) => found.push([from, edge]),
            None => from = Some(edge),
        }
    }
    if let (Some(from), Some(last)) = (from, clocks.last()) {
        found.push([from, last.0]);
    }
    Ok(found)
}
