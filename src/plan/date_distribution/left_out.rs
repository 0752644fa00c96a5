//! What the distribution of a date leaves out, and how large it is: noise, and ESP's least time of one active year.

use serde::Serialize;

use super::{DateDistribution, Dates};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::root_finding;
use crate::plan::draws::{Draws, Fate};
use crate::plan::evaluate::Evaluation;
use crate::plan::progress::Progress;

/// A mission with less than one active year of the Sun.
///
/// ESP gives the fluence of one active year or more, so that of the mission is that of a whole year within its own time: too much. The
/// same mission, followed until its active time is one year, has no more of this fluence than falls before its end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PartOfAYear {
    /// Expected active years of the mission.
    pub active_years: f64,
    /// Time to which it was followed, with one active year, years since launch.
    pub followed_yr: f64,
    /// Probability that the uncorrected and the corrected budget are then exceeded by the end of the mission.
    pub probability_exceeded: [f64; 2],
}

impl DateDistribution {
    /// The same with the probabilities with the noise of one exposure: to first order noise multiplies |Δe|, by the same factor in
    /// every draw as in the evaluation.
    pub fn with_noise(mut self, evaluation: &Evaluation) -> DateDistribution {
        let judged = evaluation.model.judged();
        let noisy = evaluation.noise.as_ref().and_then(|noise| noise.years.last()?[judged]);
        let without = evaluation.end().galaxies[judged].map(|change| change.magnitude()).filter(|value| *value > 0.0);
        let Some(factor) = noisy.zip(without).map(|(noisy, without)| noisy.magnitude() / without) else { return self };
        let limits = evaluation.mission().requirement.limits();
        let fates = &self.draws.0;
        let exceeded = |which: usize| {
            let with_noise = |fate: &&Fate| fate.delta_e.is_none_or(|delta_e| factor * delta_e >= limits[which]);
            let earlier = |fate: &&Fate| factor >= 1.0 && fate.exceeded_yr[which].is_some();
            fates.iter().filter(|fate| with_noise(fate) || earlier(fate)).count() as f64 / fates.len() as f64
        };
        let [uncorrected, corrected] = [0, 1].map(exceeded);
        self.uncorrected.probability_exceeded_with_noise = Some(uncorrected);
        self.corrected.probability_exceeded_with_noise = Some(corrected);
        self
    }

    /// The same with [`PartOfAYear`], if it applies to the mission.
    ///
    /// # Errors
    /// As [`super::date_distribution`].
    pub fn with_part_of_a_year(
        mut self,
        mission: &Mission,
        progress: &Progress,
    ) -> Result<DateDistribution, InputError> {
        if self.sun_not_drawn.is_none() && self.posterior_keys.is_empty() {
            self.part_of_a_year = PartOfAYear::of(mission, self.asked, self.seed, progress)?;
        }
        Ok(self)
    }
}

impl PartOfAYear {
    fn of(mission: &Mission, samples: u32, seed: u64, progress: &Progress) -> Result<Option<PartOfAYear>, InputError> {
        let end_yr = mission.mission.duration_yr;
        let active_years = Model::new(mission).history().active_years(end_yr);
        if active_years <= 0.0 || active_years >= 1.0 {
            return Ok(None);
        }
        let mut longer = mission.clone();
        if longer.environment.active_years.is_some() {
            longer.environment.active_years = Some(1.0);
        }
        let Some(followed_yr) = with_one_active_year(mission, active_years) else { return Ok(None) };
        let found = Draws::followed_to(followed_yr, &longer, None, samples, seed)?.fates(progress)?;
        let by_the_end = |fate: &&Fate, which: usize| fate.exceeded_yr[which].is_some_and(|t_yr| t_yr <= end_yr);
        let share = |which: usize| {
            found.fates.iter().filter(|fate| by_the_end(fate, which)).count() as f64 / found.fates.len() as f64
        };
        Ok(Some(PartOfAYear { active_years, followed_yr, probability_exceeded: [0, 1].map(share) }))
    }
}

/// Longest time (yr) after the end of a mission in which the rest of an active year is looked for: a cycle.
const CYCLE_YR: f64 = 11.0;

/// Time (years since launch) by which a mission has one active year; None if not within a cycle.
fn with_one_active_year(mission: &Mission, active_years: f64) -> Option<f64> {
    let end_yr = mission.mission.duration_yr;
    if mission.environment.active_years.is_some() {
        return Some(end_yr / active_years);
    }
    let model = Model::new(mission);
    let until = |t_yr: f64| model.history().active_years(t_yr) - 1.0;
    let most_yr = end_yr + CYCLE_YR;
    (until(most_yr) > 0.0).then(|| root_finding::between(end_yr, most_yr, 1e-6, until))
}

impl Dates {
    /// Probability that the limit is met until the end of the mission with the noise of one exposure, if computed.
    pub fn probability_met_with_noise(&self) -> Option<f64> {
        self.probability_exceeded_with_noise.map(|exceeded| 1.0 - exceeded)
    }
}
