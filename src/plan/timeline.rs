//! |Δe| over a mission, densely sampled: one curve gives the crossing of any limit.

use chrono::NaiveDate;

use crate::error::InputError;
use crate::model::Model;
use crate::model::predict;
use crate::numeric::calendar::date_after;
use crate::physics::conditions::Conditions;
use crate::physics::shape::ShapeChange;
use crate::plan::requirement::{Crossing, Point, crossing};

/// Initial number of times in a mission, besides its years, bends and jumps.
const TIMES: usize = 60;

/// Maximum number of halvings of an interval in which |Δe| is not straight.
const HALVINGS: usize = 8;

/// Allowed deviation of |Δe| from a straight line over two intervals: relative to its change over them, which shifts a date by a
/// hundredth of an interval, or to its largest value.
const BENT: f64 = 0.02;
const BENT_OF_LARGEST: f64 = 1e-4;

/// |Δe| of a galaxy over time; of the judged one by default.
#[derive(Clone, Debug)]
pub struct Timeline {
    launch: NaiveDate,
    /// Years since launch, ascending, with |Δe|; None if no shape is left.
    pub points: Vec<Point>,
}

impl Timeline {
    /// For a mission as it is.
    ///
    /// # Errors
    /// If a formula has no value, here and below.
    pub fn of(model: &Model) -> Result<Timeline, InputError> {
        Timeline::under(model, |_| {})
    }

    /// For a mission under other conditions.
    ///
    /// # Errors
    /// As [`Timeline::of`].
    pub fn under(model: &Model, change: impl Fn(&mut Conditions)) -> Result<Timeline, InputError> {
        Timeline::of_galaxy(model, model.judged(), change)
    }

    /// The same for any galaxy, by its index in the mission.
    ///
    /// # Errors
    /// As [`Timeline::of`].
    pub fn of_galaxy(model: &Model, galaxy: usize, change: impl Fn(&mut Conditions)) -> Result<Timeline, InputError> {
        let duration_yr = model.mission.mission.duration_yr;
        let mut times: Vec<f64> = (0..=TIMES).map(|index| duration_yr * index as f64 / TIMES as f64).collect();
        times.extend((1..).map(f64::from).take_while(|t_yr| *t_yr < duration_yr));
        times.extend(model.times_yr(duration_yr));
        let at_all = |times: &[f64]| -> Result<Vec<Point>, InputError> {
            let under = |t_yr: &f64| {
                let mut at = model.conditions(*t_yr);
                change(&mut at);
                at
            };
            let conditions: Vec<Conditions> = times.iter().map(under).collect();
            let changes = predict::changes(model, galaxy, &conditions)?;
            let magnitude = |change: Option<ShapeChange>| change.map(|change| change.magnitude());
            Ok(times.iter().copied().zip(changes.into_iter().map(magnitude)).collect())
        };
        let breaks = model.times_yr(duration_yr);
        let mut points = at_all(&in_order(times))?;
        for _ in 0..HALVINGS {
            let more = where_bent(&points, &breaks);
            if more.is_empty() {
                break;
            }
            points.extend(at_all(&more)?);
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        Ok(Timeline { launch: model.mission.mission.launch.0, points })
    }

    /// The weighted sum of several timelines.
    pub fn weighted(timelines: &[Timeline], weights: &[f64]) -> Timeline {
        let times = in_order(timelines.iter().flat_map(|one| one.points.iter().map(|point| point.0)).collect());
        let sum = |t_yr: f64| {
            timelines.iter().zip(weights).map(|(one, weight)| one.at(t_yr).map(|value| weight * value)).sum()
        };
        let points = times.into_iter().map(|t_yr| (t_yr, sum(t_yr))).collect();
        Timeline { launch: timelines[0].launch, points }
    }

    /// |Δe| at the end of the mission; None if no shape is left.
    pub fn end(&self) -> Option<f64> {
        self.points.last().expect("a mission has an end").1
    }

    /// |Δe| at a time (years since launch); None if no shape is left.
    pub fn at(&self, t_yr: f64) -> Option<f64> {
        let after = self.points.partition_point(|point| point.0 < t_yr).clamp(1, self.points.len() - 1);
        let (before, after) = (self.points[after - 1], self.points[after]);
        let place = (t_yr - before.0) / (after.0 - before.0);
        Some(before.1? * (1.0 - place) + after.1? * place)
    }

    /// When |Δe| reaches a limit.
    pub fn crossing(&self, limit: f64) -> Crossing {
        let crossing = crossing(limit, &self.points, |t_yr| Ok(self.at(t_yr)));
        crossing.expect("a straight line has a value")
    }

    /// The day on which |Δe| reaches a limit; None if it does not within the mission.
    pub fn date(&self, limit: f64) -> Option<NaiveDate> {
        date_after(self.launch, self.crossing(limit).t_yr?)
    }
}

fn in_order(mut times: Vec<f64>) -> Vec<f64> {
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// Midpoints of the intervals on both sides of points where a curve is not straight. At `breaks` it may bend or jump.
fn where_bent(points: &[Point], breaks: &[f64]) -> Vec<f64> {
    let largest = points.iter().filter_map(|point| point.1).fold(0.0, f64::max);
    let mut more = Vec::new();
    for three in points.windows(3) {
        let [(t_a, a), (t_b, b), (t_c, c)] = [three[0], three[1], three[2]];
        let (Some(a), Some(b), Some(c)) = (a, b, c) else { continue };
        if breaks.contains(&t_b) {
            continue;
        }
        let bend = (b - a - (c - a) * (t_b - t_a) / (t_c - t_a)).abs();
        if bend > BENT * (c - a).abs() && bend > BENT_OF_LARGEST * largest {
            more.extend([0.5 * (t_a + t_b), 0.5 * (t_b + t_c)]);
        }
    }
    in_order(more)
}
