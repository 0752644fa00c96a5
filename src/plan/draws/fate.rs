//! One draw over time → when its |Δe| exceeds the budget.

use crate::error::InputError;
use crate::model::Model;
use crate::physics::shape::ShapeChange;
use crate::plan::curve::{Curve, Point};
use crate::plan::population::TrapLimits;

/// The result of one draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fate {
    /// |Δe| at the end of the mission; None if no shape is left.
    pub delta_e: Option<f64>,
    /// First time (years since launch) at which it exceeds the uncorrected and the corrected budget; None if not within the
    /// mission.
    pub exceeded_yr: [Option<f64>; 2],
    /// Dose at the end of the mission over the common factor on all doses, with cosmic rays of a mean cycle, MeV/g: the effect of
    /// this draw's Sun.
    pub sun_mev_g: f64,
    /// The same for the limits on c and m of the population, when the number of traps reaches theirs.
    pub biases_exceeded_yr: [[Option<f64>; 2]; 2],
}

/// Times of a mission at which |Δe| is computed, besides its jumps.
const TIMES: usize = 12;

/// Share of the mission's dose that may pass between two evaluations.
const PASSED: f64 = 0.01;

/// Distance from a limit, over the largest |Δe|, within which |Δe| is computed individually: values at many times may be
/// interpolated, with smaller errors than that.
const NEAR: f64 = 1e-3;

impl Fate {
    /// For a model with these changes of shape, at many times at once (years since launch), whose mission ends at `end_yr` or is
    /// followed for longer. `traps_per_px`: numbers of traps of all species at which shear biases exceed their limits.
    ///
    /// # Errors
    /// Those of the changes, and if the model has no dose.
    pub fn of(
        model: &Model,
        end_yr: f64,
        traps_per_px: &TrapLimits,
        changes: impl Fn(&[f64]) -> Result<Vec<Option<ShapeChange>>, InputError>,
    ) -> Result<Fate, InputError> {
        let magnitudes = |times: &[f64]| -> Result<Vec<Option<f64>>, InputError> {
            Ok(changes(times)?.into_iter().map(|change| change.map(|change| change.magnitude())).collect())
        };
        let magnitude = |t_yr: f64| Ok::<_, InputError>(magnitudes(&[t_yr])?[0]);
        let times = times_yr(model, end_yr)?;
        let found = magnitudes(&times)?;
        let biases_exceeded_yr = biases_exceeded_yr(model, &times, traps_per_px)?;
        let mut points: Vec<Point> = times.into_iter().zip(found).collect();
        let limits = model.mission.requirement.limits();
        let largest = points.iter().filter_map(|point| point.1).fold(0.0, f64::max);
        let near = |value: f64| limits.iter().any(|limit| (value - limit).abs() < NEAR * largest);
        for point in points.iter_mut().filter(|point| point.1.is_some_and(near)) {
            point.1 = magnitude(point.0)?;
        }
        let curve = Curve::through(points);
        let first = |limit: f64| Ok(curve.crossing_of(limit, magnitude)?.t_yr);
        let sun_mev_g = sun_mev_g(model, end_yr)?;
        Ok(Fate {
            delta_e: curve.points.iter().find(|point| point.0 == end_yr).and_then(|end| end.1),
            exceeded_yr: [first(limits[0])?, first(limits[1])?],
            sun_mev_g,
            biases_exceeded_yr,
        })
    }
}

/// Dose (MeV/g) at the end of the mission, over the factor on all doses, with cosmic rays of a mean cycle.
fn sun_mev_g(model: &Model, end_yr: f64) -> Result<f64, InputError> {
    let history = model.history();
    let all = history.dose_mev_g(end_yr)?;
    let factor = model.mission.environment.dose_factor;
    Ok(match model.mission.imported.cosmic_rays {
        None => all / factor,
        Some(level) => (all - (1.0 - 1.0 / level) * history.cosmic_rays_mev_g(end_yr)) / factor,
    })
}

/// When the traps of all species reach the limits, searched at some times (years since launch).
fn biases_exceeded_yr(
    model: &Model,
    times: &[f64],
    traps_per_px: &TrapLimits,
) -> Result<[[Option<f64>; 2]; 2], InputError> {
    let limits = [traps_per_px.c, traps_per_px.m];
    if limits.as_flattened().iter().all(|limit| limit.is_infinite()) {
        return Ok([[None; 2]; 2]);
    }
    let traps = |t_yr: f64| {
        let traps = model.traps(t_yr)?;
        Ok::<_, InputError>(Some(traps.iter().map(|species| species.density_per_px).sum()))
    };
    let points = times.iter().map(|t_yr| Ok((*t_yr, traps(*t_yr)?))).collect::<Result<Vec<Point>, InputError>>()?;
    let curve = Curve::through(points);
    let mut found = [[None; 2]; 2];
    for (found, limit) in found.as_flattened_mut().iter_mut().zip(limits.as_flattened()) {
        *found = if limit.is_finite() { curve.crossing_of(*limit, traps)?.t_yr } else { None };
    }
    Ok(found)
}

/// Times at which a draw is evaluated: those of the model, except for small events, the end of its mission, and some in between.
fn times_yr(model: &Model, end_yr: f64) -> Result<Vec<f64>, InputError> {
    let duration_yr = model.mission.mission.duration_yr;
    let mut times = model.times_yr(duration_yr);
    times.extend([end_yr, duration_yr]);
    times.extend((1..TIMES).map(|index| duration_yr * index as f64 / TIMES as f64));
    times.sort_by(f64::total_cmp);
    times.dedup();
    let history = model.history();
    let Some(sun) = &model.mission.imported.sun else { return Ok(times) };
    let least = PASSED * history.dose_mev_g(duration_yr)?;
    let is_of_sun = |t_yr: f64| {
        t_yr > 0.0
            && t_yr != end_yr
            && t_yr < duration_yr
            && sun.binary_search_by(|node| node.0.total_cmp(&t_yr)).is_ok()
    };
    let mut looked_mev_g = 0.0;
    let mut kept = Vec::with_capacity(times.len());
    for (place, &t_yr) in times.iter().enumerate() {
        let next_mev_g = times.get(place + 1).map_or(Ok(f64::INFINITY), |next| history.dose_mev_g(*next))?;
        // The start of a large event, and its end.
        if !is_of_sun(t_yr) || next_mev_g - looked_mev_g > least {
            looked_mev_g = history.dose_mev_g(t_yr)?;
            kept.push(t_yr);
        }
    }
    Ok(kept)
}
