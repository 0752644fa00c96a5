//! Whether a verdict also holds under equally plausible assumptions: larger errors, other starting points, other free keys.

use std::sync::Arc;

use serde::Serialize;

use super::result::{Diagnosis, Verdict};
use super::work::Work;
use super::{Options, Progress, Task};
use crate::analysis::fit::parameter::Parameter;
use crate::analysis::measurement::DataSet;
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

/// A search with one assumption changed.
struct Change {
    name: String,
    mission: Mission,
    data: Vec<DataSet>,
    options: Options,
}

impl Task<'_> {
    /// Repeats a diagnosis under each change, with as many evaluations in total as the diagnosis itself may make.
    ///
    /// # Errors
    /// As [`super::diagnose`].
    pub(super) fn stability(&self, found: &Diagnosis) -> Result<Stability, InputError> {
        if found.verdict == Verdict::Unfit || !self.options.stability {
            return Ok(Stability::default());
        }
        let work = Arc::new(Work::of_at_most(self.options.evaluations));
        let mut all = Stability::default();
        let changes = self.changes(found);
        // The verdict stands: whoever waits sees it.
        let effects: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
        let stands = [found.verdict.name(), &effects.join(" + ")].join(" ");
        (self.progress.stage)(&format!("{}; its stability", stands.trim_end()), changes.len() as u64);
        let unseen = Progress { stage: &|_, _| (), advance: &|| () };
        for change in changes {
            if !work.allows(&change.name) {
                all.undone.push(change.name);
                continue;
            }
            let task = Task {
                mission: &change.mission,
                data: &change.data,
                hypotheses: self.hypotheses.clone(),
                options: &Options { stability: false, ..change.options },
                progress: &unseen,
                work: work.clone(),
            };
            let (verdict, effects, alternatives) = task.verdict()?;
            all.done.push(outcome(found, verdict, effects, &alternatives, &change.name));
            self.progress.step();
        }
        Ok(all)
    }

    fn changes(&self, found: &Diagnosis) -> Vec<Change> {
        let free = &self.options.free;
        let with = |name: String| {
            let (mission, data, options) = (self.mission.clone(), self.data.to_vec(), self.options.clone());
            Change { name, mission, data, options }
        };
        let mut larger = self.data.to_vec();
        for row in larger.iter_mut().flat_map(|set| &mut set.rows) {
            row.sigma *= LARGER;
            row.common.sigma *= LARGER;
        }
        let mut changes = vec![Change { data: larger, ..with(format!("errors x {LARGER}")) }];
        if free.is_empty() {
            let species = self.mission.detector.traps.iter();
            let densities = species.map(|species| format!("detector.traps.{}.density_per_px", species.name)).collect();
            let options = Options { free: densities, ..self.options.clone() };
            changes.push(Change { options, ..with("densities free".into()) });
        } else {
            if let Some(mission) = self.started_elsewhere() {
                changes
                    .push(Change { mission, ..with(format!("free keys start {ELSEWHERE} times larger or smaller")) });
            }
            let values: Vec<_> =
                found.parameters.iter().map(|fitted| (fitted.key.clone(), fitted.value.into())).collect();
            if let Ok(mission) = self.mission.with(&values) {
                let options = Options { free: Vec::new(), ..self.options.clone() };
                changes.push(Change { mission, options, ..with("no key free, at fitted values".into()) });
            }
        }
        changes
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
