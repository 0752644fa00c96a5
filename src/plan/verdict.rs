//! The state of a mission at the end of a year, and when |Δe| of its judged galaxy exceeds the budget.

use chrono::NaiveDate;

use crate::error::InputError;
use crate::model::Model;
use crate::numeric::calendar::date_after;
use crate::numeric::parallel;
use crate::physics::SpeciesState;
use crate::physics::shape::ShapeChange;
use crate::plan::curve::{self, Crossing, Point};

/// State at one time.
#[derive(Clone, Debug)]
pub struct Year {
    /// Years since launch.
    pub t_yr: f64,
    /// The day; None past the end of the calendar.
    pub date: Option<NaiveDate>,
    /// Dose since launch as measured by its monitor, MeV/g.
    pub dose_mev_g: f64,
    /// Traps.
    pub traps: Vec<SpeciesState>,
    /// Mean change of each galaxy's shape, in the mission's order. None if no shape is left to measure.
    pub galaxies: Vec<Option<ShapeChange>>,
}

/// When the budget is exceeded, and the rate of the change.
#[derive(Clone, Debug, PartialEq)]
pub struct BudgetVerdict {
    /// Without software correction.
    pub uncorrected: Crossing,
    /// With it.
    pub corrected: Crossing,
    /// d|Δe|/dt just after launch, per year.
    pub rate_at_launch_per_yr: Option<f64>,
    /// |Δe| at the end of the mission over its duration, per year.
    pub mean_rate_per_yr: Option<f64>,
}

/// Share of the mission over which the rate at launch is measured: long enough for the accuracy of shapes, too short for the curve
/// to bend.
const JUST_AFTER: f64 = 1e-3;

/// State at a time (years since launch).
pub(super) fn year(model: &Model, t_yr: f64) -> Result<Year, InputError> {
    let device = model.device_at(t_yr)?;
    let galaxies = parallel::try_map(0..model.mission.galaxies.len(), |galaxy| model.change_by(galaxy, &device))?;
    Ok(Year {
        t_yr,
        date: date_after(model.mission.mission.launch.0, t_yr),
        dose_mev_g: device.dose_mev_g()?,
        galaxies,
        traps: device.traps,
    })
}

/// |Δe| of the judged galaxy at a time (years since launch); None if the shape is lost.
fn magnitude(model: &Model, t_yr: f64) -> Result<Option<f64>, InputError> {
    Ok(model.change(model.judged(), t_yr)?.map(|change| change.magnitude()))
}

/// When |Δe| of the judged galaxy crosses limits, each located with as few readouts as possible; `known` points are reused.
pub(crate) fn crossings<const N: usize>(
    model: &Model,
    limits: [f64; N],
    known: &[Point],
) -> Result<[Crossing; N], InputError> {
    curve::crossings(model, limits, known, |t_yr| magnitude(model, t_yr))
}

/// d|Δe|/dt just after launch, per year; None if no shape is left.
pub(crate) fn rate_at_launch_per_yr(model: &Model) -> Result<Option<f64>, InputError> {
    let just_after_yr = JUST_AFTER * model.mission.mission.duration_yr;
    let (launch, later) = (magnitude(model, 0.0)?, magnitude(model, just_after_yr)?);
    Ok(later.zip(launch).map(|(later, launch)| (later - launch) / just_after_yr))
}

/// Mean of d|Δe|/dt over the mission, per year, from |Δe| at its end; None if no shape is left at launch or then. Changes by traps
/// present at launch and by the amplifier are not part of the rate.
pub(crate) fn mean_rate_per_yr(model: &Model, at_end: Option<f64>) -> Result<Option<f64>, InputError> {
    let at_launch = magnitude(model, 0.0)?;
    Ok(at_end.zip(at_launch).map(|(end, launch)| (end - launch) / model.mission.mission.duration_yr))
}

/// Judges the requirement; `years` (ascending) are reused.
pub(super) fn verdict(model: &Model, years: &[Year]) -> Result<BudgetVerdict, InputError> {
    let magnitude = |year: &Year| year.galaxies[model.judged()].map(|change| change.magnitude());
    let known: Vec<Point> = years.iter().map(|year| (year.t_yr, magnitude(year))).collect();
    let limits = model.mission.requirement.limits();
    let [uncorrected, corrected] = crossings(model, limits, &known)?;
    Ok(BudgetVerdict {
        uncorrected,
        corrected,
        rate_at_launch_per_yr: rate_at_launch_per_yr(model)?,
        mean_rate_per_yr: mean_rate_per_yr(model, known.last().and_then(|end| end.1))?,
    })
}
