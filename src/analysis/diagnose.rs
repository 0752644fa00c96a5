//! Mission and measurements → which physical effect the model lacks.
//!
//! First, can the data carry a verdict at all (`data_quality`), and is the readout computed finely enough (`numerics`)? Then sets of
//! effects (`hypothesis`) are fitted, each with the errors of the data that are likeliest for it (`explanation`, `prior`, and
//! [`crate::analysis::likelihood`]), and ranked by one number, their evidence (`set_search`). The best set, or the smallest of its
//! subsets that is as good, is named (`verdict`), unless rows left out (`holdout`), residual trends, or a law of the measurement
//! (`formula`) speak against it (`evidence`). Its effects are tested against noise (`significance`); `experiment_design` proposes the
//! measurement that would distinguish rivals. `summary` collects all that is reported. Nothing is called missing that noise could have
//! made, and nothing is called certain that has a rival.

mod data_quality;
mod doubts;
mod evidence;
pub mod experiment_design;
mod explanation;
mod fitted_model;
mod formula;
pub mod holdout;
pub mod hypothesis;
mod json;
mod limits;
mod numerics;
mod options;
mod prior;
pub mod ranking;
mod result;
mod set_search;
mod significance;
mod stability;
mod summary;
mod unrecorded;
mod verdict;
mod work;

use std::sync::{Arc, Mutex};

use crate::analysis::fit;
use crate::analysis::likelihood::{Errors, Likelihood};
use crate::analysis::measurement::{DataSet, some_rows};
use crate::analysis::noise;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use evidence::{Evidence, Found};
use explanation::Fitter;
use fitted_model::Case;
pub use hypothesis::Hypothesis;
pub use options::{EVALUATIONS, Options, Progress};
pub use ranking::Ranking;
pub use result::{Covariate, Diagnosis, Limit, Next, Note, Reason, RowPlace, Rung, Step, Suggestion, Tried, Verdict};
use set_search::{Searched, SetSearch};
pub use stability::{Changed, Stability};
use work::Work;

/// Finds out what a mission's model lacks.
///
/// # Errors
/// If keys cannot be fitted, candidates make no sense, or the model has no value for a row.
pub fn diagnose(
    mission: &Mission,
    data: &[DataSet],
    options: &Options,
    progress: &Progress,
) -> Result<Diagnosis, InputError> {
    some_rows(data, "cannot diagnose")?;
    for key in &options.free {
        fit::parameter::Parameter::of(mission, key)?;
    }
    let order = by_name(data);
    let sorted: Vec<DataSet> = order.iter().map(|&place| data[place].clone()).collect();
    let task = Task {
        mission,
        data: &sorted,
        hypotheses: hypothesis::all(mission, options.candidates.as_ref())?,
        options,
        progress,
        work: Arc::new(Work::of_at_most(options.evaluations)),
    };
    let found = task.diagnosis()?;
    let stability = task.stability(&found)?;
    Ok(Diagnosis { stability, ..found }.with_files_at(&order))
}

/// Indices of the data sets in the order of their names. Rounding alone can change the path of a search, and the order in which
/// files are given must not change the result.
fn by_name(data: &[DataSet]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..data.len()).collect();
    order.sort_by(|&a, &b| data[a].file.cmp(&data[b].file));
    order
}

/// What is asked.
struct Task<'a> {
    mission: &'a Mission,
    data: &'a [DataSet],
    hypotheses: Vec<Hypothesis>,
    options: &'a Options,
    progress: &'a Progress<'a>,
    work: Arc<Work>,
}

/// Verdict, effects and alternatives.
type Outcome = (Verdict, Vec<String>, Vec<Vec<String>>);

impl Task<'_> {
    /// The whole diagnosis, but for its stability.
    fn diagnosis(&self) -> Result<Diagnosis, InputError> {
        self.judged(|evidence, found, notes| evidence.diagnosis(self.mission, found, notes))
    }

    /// The verdict alone.
    fn verdict(&self) -> Result<Outcome, InputError> {
        self.judged(|evidence, found, _| {
            let last = found.ladder.last().expect("the base");
            let effects = last.set().into_iter().map(|place| evidence.name(place)).collect();
            Ok((found.verdict, effects, found.alternatives))
        })
    }

    /// Searches, judges, and passes on what was found.
    fn judged<T>(&self, then: impl Fn(&Evidence, Found, Vec<Note>) -> Result<T, InputError>) -> Result<T, InputError> {
        let quoted = Case { work: self.work.clone(), ..Case::of(self.data) };
        (self.progress.stage)("numerics", 0);
        let (accurate, notes) = numerics::accurate(&quoted, self.mission)?;
        // Too few rows to fit the free parameters are refused.
        let free: &[String] = if quoted.n() < self.options.free.len() { &[] } else { &self.options.free };
        let likelihood = Likelihood::of(self.data);
        let fitter = Fitter { case: &quoted, likelihood: &likelihood, model: Model::new(&accurate) };
        let search =
            SetSearch { fitter, given: self.mission, hypotheses: &self.hypotheses, free, progress: self.progress };
        let refusal = data_quality::refusal(&quoted, self.options.free.len());
        if let Some(reason) = refusal.or_else(|| data_quality::contradictory(&quoted)) {
            let searched = search.base_alone()?;
            let noise = noise::as_quoted(self.data);
            return self.with_evidence(&search, &searched, noise, None, |evidence| {
                let base = evidence.node(searched.base())?;
                then(
                    evidence,
                    Found::of(Verdict::Unfit, reason.clone(), vec![base], evidence.noise.clone()),
                    notes.clone(),
                )
            });
        }
        let searched = search.run()?;
        let mut excluded: Vec<Vec<usize>> = Vec::new();
        loop {
            let named = verdict::name(&searched, &self.hypotheses, &likelihood, &|set| {
                excluded.iter().any(|known| known == set)
            });
            // The errors are those of what explains the data.
            let law = named.better(&searched);
            let (errors, off) = match law {
                Some(law) => (&law.errors, law.left.clone()),
                None => (&named.adopted.errors, likelihood.off(&named.adopted.model)),
            };
            let noise = noise::of(&likelihood, self.data, errors, &off);
            let done = self.with_evidence(&search, &searched, noise, Some(errors), |evidence| {
                evidence.judged(&named)?.map(|found| then(evidence, found, notes.clone())).transpose()
            })?;
            match done {
                Some(done) => return Ok(done),
                None => excluded.push(named.adopted.set()),
            }
        }
    }

    /// Calls a function with the data as their errors were estimated.
    fn with_evidence<T>(
        &self,
        search: &SetSearch,
        searched: &Searched,
        noise: Vec<noise::SetNoise>,
        errors: Option<&[Errors]>,
        then: impl FnOnce(&Evidence) -> Result<T, InputError>,
    ) -> Result<T, InputError> {
        let data = noise::allowed_for(self.data, &noise, search.fitter.likelihood, errors);
        let case = Case { work: self.work.clone(), ..Case::of(&data) };
        let split = holdout::split(&case);
        then(&Evidence {
            case: &case,
            quoted: self.data,
            search,
            searched,
            options: self.options,
            split: split.as_ref(),
            noise,
            known_trials: Mutex::default(),
        })
    }
}
