//! Whether a verdict also holds under equally plausible assumptions: larger errors, the quoted ones, another seed, other starting
//! points, other free keys.

use std::sync::Arc;

use serde::Serialize;

use super::evidence::Evidence;
use super::noise;
use super::result::{Diagnosis, Reason, Verdict};
use super::work::Work;
use super::{Options, ROUNDS, Task};
use crate::analysis::fit::Fitted;
use crate::analysis::fit::parameter::Parameter;
use crate::error::InputError;
use crate::mission::Mission;

/// The outcome of a search under another assumption.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changed {
    /// What was changed.
    pub change: String,
    /// The verdict with this change.
    pub verdict: Verdict,
    /// The effects added with this change, in the order of the catalogue.
    pub effects: Vec<String>,
    /// Whether the verdict is the same as without the change, and the effects are the same or rivals of the adopted ones; or the same
    /// effects have no rival with the change.
    pub holds: bool,
}

/// The outcome of searches under other assumptions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stability {
    /// Searches made.
    pub done: Vec<Changed>,
    /// Assumptions not tested because the limit on evaluations was reached.
    pub undone: Vec<String>,
}

impl Stability {
    /// Whether a verdict holds under every assumption that was tested; None if none was.
    pub fn holds(&self) -> Option<bool> {
        (!self.done.is_empty()).then(|| self.done.iter().all(|changed| changed.holds))
    }
}

/// Factor by which errors are enlarged.
const LARGER: f64 = 1.35;

/// Factor on the starting values of free keys, alternately up and down.
const ELSEWHERE: f64 = 1.25;

/// Errors of a fitted value beyond which the data exclude the mission's.
const EXCLUDED: f64 = 3.0;

/// A search with one assumption changed.
struct Change {
    name: String,
    mission: Mission,
    options: Options,
    errors: Errors,
}

/// The errors of a changed search.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Errors {
    /// As the diagnosis estimated them.
    Same,
    /// The same, enlarged.
    Larger,
    /// As quoted, apart from wrong rows and pedestals.
    Quoted,
    /// Estimated anew.
    Anew,
}

impl Task<'_> {
    /// Repeats a diagnosis under each change, with as many evaluations in total as one round of the diagnosis.
    ///
    /// # Errors
    /// As [`super::diagnose`].
    pub(super) fn stability(&self, evidence: &Evidence, found: &Diagnosis) -> Result<Stability, InputError> {
        if found.verdict == Verdict::Unfit || !self.options.stability {
            return Ok(Stability::default());
        }
        let work = Arc::new(Work::of_at_most(self.options.evaluations));
        let mut all = Stability::default();
        for change in self.changes(found) {
            if !work.allows(&change.name) {
                all.undone.push(change.name);
                continue;
            }
            let errors = change.errors;
            let changed = self.changed(evidence, found, change, &work)?;
            let explains = !matches!(changed.verdict, Verdict::Unexplained | Verdict::Unfit);
            if errors == Errors::Quoted && !explains {
                // Nothing was found with which they would be right.
                continue;
            }
            // That a search explains nothing is no result if it was cut short.
            if changed.verdict == Verdict::Unexplained && !work.undone().is_empty() {
                all.undone.push(changed.change);
            } else {
                all.done.push(changed);
            }
        }
        Ok(all)
    }

    fn changes(&self, found: &Diagnosis) -> Vec<Change> {
        let free = &self.options.free;
        let with = |name: String| {
            let (mission, options) = (self.mission.clone(), self.options.clone());
            Change { name, mission, options, errors: Errors::Same }
        };
        // Errors that were not estimated would not be by another seed.
        let estimated = !noise::is_same(&found.noise, &noise::as_quoted(self.quoted));
        let with_seed = if estimated { Errors::Anew } else { Errors::Same };
        let seed = self.options.seed.wrapping_add(1);
        let mut changes = vec![
            Change { errors: Errors::Larger, ..with(format!("errors x {LARGER}")) },
            Change {
                options: Options { seed, ..self.options.clone() },
                errors: with_seed,
                ..with(format!("seed {seed}"))
            },
        ];
        if found.noise.iter().any(|noise| noise.scale > 1.0) {
            changes.push(Change { errors: Errors::Quoted, ..with("errors as quoted".into()) });
        }
        if free.is_empty() {
            let densities: Vec<String> = self
                .mission
                .detector
                .traps
                .iter()
                .map(|species| format!("detector.traps.{}.density_per_px", species.name))
                .collect();
            changes.push(Change {
                options: Options { free: densities, ..self.options.clone() },
                ..with("densities free".into())
            });
        } else {
            if let Some(mission) = self.started_elsewhere() {
                changes
                    .push(Change { mission, ..with(format!("free keys start {ELSEWHERE} times larger or smaller")) });
            }
            let options = Options { free: Vec::new(), ..self.options.clone() };
            changes.push(match self.at_fitted_values(found) {
                Some(mission) => Change { options, mission, ..with("no key free, at fitted values".into()) },
                None => Change { options, ..with("no key free".into()) },
            });
        }
        // A whole diagnosis takes longest.
        changes.sort_by_key(|change| change.errors == Errors::Anew);
        changes
    }

    /// The mission with the fitted values of free keys that the data exclude in the mission: held there, any verdict would change. None if
    /// there are none, or no model explains the data.
    fn at_fitted_values(&self, found: &Diagnosis) -> Option<Mission> {
        if found.verdict == Verdict::Unexplained {
            return None;
        }
        let is_excluded = |fitted: &&Fitted| {
            let given = self.mission.number(&fitted.key);
            let off = given.zip(fitted.sigma).map(|(given, sigma)| (fitted.value - given).abs() / sigma);
            self.options.free.contains(&fitted.key) && off.is_some_and(|off| off > EXCLUDED)
        };
        let excluded = found.parameters.iter().filter(is_excluded);
        let values: Vec<_> = excluded.map(|fitted| (fitted.key.clone(), fitted.value.into())).collect();
        if values.is_empty() { None } else { self.mission.with(&values).ok() }
    }

    /// The mission with other starting values of the free keys; None if such a mission makes no sense.
    fn started_elsewhere(&self) -> Option<Mission> {
        let settings = self.options.free.iter().enumerate().map(|(index, key)| {
            let parameter = Parameter::of(self.mission, key).ok()?;
            let factor = if index % 2 == 0 { ELSEWHERE } else { 1.0 / ELSEWHERE };
            let value = (factor * parameter.start).clamp(parameter.low, parameter.high);
            Some((key.clone(), value.into()))
        });
        self.mission.with(&settings.collect::<Option<Vec<_>>>()?).ok()
    }

    /// The whole diagnosis with a change, its errors estimated anew.
    fn changed_anew(&self, found: &Diagnosis, change: &Change, work: &Arc<Work>) -> Result<Changed, InputError> {
        let task = Task {
            mission: &change.mission,
            quoted: self.quoted,
            hypotheses: self.hypotheses.clone(),
            options: &Options { stability: false, ..change.options.clone() },
            progress: self.progress,
            work: Arc::new(Work::of_at_most(self.options.evaluations)),
        };
        let other = task.rounds()?;
        work.count_all_of(&task.work);
        let effects = other.steps.iter().map(|step| step.effect.clone()).collect();
        Ok(outcome(found, other.verdict, effects, &other.alternatives, &change.name))
    }

    fn changed(
        &self,
        evidence: &Evidence,
        found: &Diagnosis,
        change: Change,
        work: &Arc<Work>,
    ) -> Result<Changed, InputError> {
        if change.errors == Errors::Anew {
            return self.changed_anew(found, &change, work);
        }
        let task = Task {
            mission: &change.mission,
            quoted: self.quoted,
            hypotheses: self.hypotheses.clone(),
            options: &change.options,
            progress: self.progress,
            work: work.clone(),
        };
        let frees_no_less = self.options.free.iter().all(|key| change.options.free.contains(key));
        // If no key becomes fixed, an optimum of the diagnosis is also a good start with other errors.
        let like = (change.mission == *self.mission && frees_no_less).then_some(evidence.search);
        let mut noise = found.noise.clone();
        for round in 1.. {
            let changed = match change.errors {
                Errors::Larger => noise::larger(&noise, LARGER),
                Errors::Quoted => noise::with_scales_of_1(&noise),
                Errors::Same | Errors::Anew => noise.clone(),
            };
            let data = noise::allowed_for(self.quoted, &changed);
            // As in a diagnosis: rows that only a poor model marks as wrong are left out at first and restored later.
            let (other, better) = task.with_evidence(&data, like, |evidence, _| {
                let other = evidence.select()?;
                // If effects beside a law were found, the same is looked for with the change.
                let is_beside = matches!(&found.reason, Reason::BetterLaw { beside, .. } if !beside.is_empty());
                let other = if is_beside { evidence.or_law_beside_fewer(other)? } else { other };
                let is_estimated = change.errors != Errors::Quoted && round < ROUNDS;
                let better = task.other_errors(evidence, &noise, &other)?.filter(|_| is_estimated);
                let last = other.ladder.last().expect("the base");
                let effects = last.set().into_iter().map(|place| evidence.name(place)).collect();
                Ok((outcome(found, other.verdict, effects, &other.alternatives, &change.name), better))
            })?;
            match better.filter(|_| work.allows(&change.name)) {
                Some(better) => noise = better,
                None => return Ok(other),
            }
        }
        unreachable!("the last round returns")
    }
}

/// The outcome of a search, compared with the diagnosis.
fn outcome(
    found: &Diagnosis,
    verdict: Verdict,
    effects: Vec<String>,
    alternatives: &[Vec<String>],
    change: &str,
) -> Changed {
    let known = || found.steps.iter().map(|step| &step.effect);
    let rivals: Vec<&String> = found.alternatives.iter().chain(alternatives).flatten().collect();
    let as_many = effects.len() == found.steps.len();
    let agree = as_many && known().all(|effect| effects.contains(effect) || rivals.contains(&effect));
    let same = as_many && known().all(|effect| effects.contains(effect));
    let without_rivals = found.verdict == Verdict::Ambiguous && verdict == Verdict::Missing && same;
    let holds = verdict == found.verdict && agree || without_rivals;
    Changed { change: change.into(), verdict, holds, effects }
}
