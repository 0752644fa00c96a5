//! |Δe| over a mission, densely: one curve answers when any limit is exceeded.

use chrono::NaiveDate;

use crate::calendar::date_after;
use crate::conditions::Conditions;
use crate::error::InputError;
use crate::model::Model;
use crate::predict;
use crate::requirement::{Crossing, crossing};
use crate::shape::ShapeChange;

/// Times of a mission, besides its years and the times at which its dose rate changes. Between two of them |Δe| is as straight
/// as the dose is: a date is right to a fraction of a day in a year.
const TIMES: usize = 60;

/// |Δe| of a galaxy over time, of the judged one where nothing else is said.
#[derive(Clone, Debug)]
pub struct Timeline {
    launch: NaiveDate,
    /// Years since launch, rising, with |Δe|; None where no shape is left.
    pub points: Vec<(f64, Option<f64>)>,
}

impl Timeline {
    /// Over a mission as it is.
    ///
    /// # Errors
    /// Where a formula has no value, here and below.
    pub fn of(model: &Model) -> Result<Timeline, InputError> {
        Timeline::under(model, |_| {})
    }

    /// Over a mission under other conditions.
    ///
    /// # Errors
    /// As [`Timeline::of`].
    pub fn under(model: &Model, change: impl Fn(&mut Conditions)) -> Result<Timeline, InputError> {
        Timeline::of_galaxy(model, model.judged(), change)
    }

    /// The same of any galaxy, by its place in the mission.
    ///
    /// # Errors
    /// As [`Timeline::of`].
    pub fn of_galaxy(model: &Model, galaxy: usize, change: impl Fn(&mut Conditions)) -> Result<Timeline, InputError> {
        let duration_yr = model.mission.mission.duration_yr;
        let mut times: Vec<f64> = (0..=TIMES).map(|index| duration_yr * index as f64 / TIMES as f64).collect();
        times.extend((1..).map(f64::from).take_while(|t_yr| *t_yr < duration_yr));
        times.extend(model.times_yr(duration_yr));
        times.sort_by(f64::total_cmp);
        times.dedup();
        let under = |t_yr: &f64| {
            let mut at = model.conditions(*t_yr);
            change(&mut at);
            at
        };
        let conditions: Vec<Conditions> = times.iter().map(under).collect();
        let changes = predict::changes(model, galaxy, &conditions)?;
        let magnitude = |change: Option<ShapeChange>| change.map(|change| change.magnitude());
        let points = times.into_iter().zip(changes.into_iter().map(magnitude)).collect();
        Ok(Timeline { launch: model.mission.mission.launch.0, points })
    }

    /// The mean of several, which have the same times.
    pub fn mean(timelines: &[Timeline]) -> Timeline {
        let weights = vec![1.0 / timelines.len() as f64; timelines.len()];
        Timeline::weighted(timelines, &weights)
    }

    /// The weighted sum of several, which have the same times.
    pub fn weighted(timelines: &[Timeline], weights: &[f64]) -> Timeline {
        let sum = |index: usize| {
            timelines.iter().zip(weights).map(|(one, weight)| one.points[index].1.map(|value| weight * value)).sum()
        };
        let points = timelines[0].points.iter().enumerate().map(|(index, (t_yr, _))| (*t_yr, sum(index))).collect();
        Timeline { launch: timelines[0].launch, points }
    }

    /// |Δe| at the end of the mission; None where no shape is left.
    pub fn end(&self) -> Option<f64> {
        self.points.last().expect("a mission has an end").1
    }

    /// |Δe| at a time (years since launch); None where no shape is left.
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

    /// The day on which |Δe| reaches a limit; None where it does not within the mission.
    pub fn date(&self, limit: f64) -> Option<NaiveDate> {
        date_after(self.launch, self.crossing(limit).t_yr?)
    }
}
