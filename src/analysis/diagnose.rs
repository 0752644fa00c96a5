//! Mission and measurements → which physical effect the model lacks.
//!
//! In the order in which mistakes are avoided: whether the data can carry a verdict (`data_quality`), whether the readout is
//! computed finely enough (`numerics`), the fit of what is free, every effect on top of it and pairs (`forward_selection`, with
//! `hypothesis`, `search`, `pairs`) until nothing more is called for (`stopping_rule`); of what was found how often noise does as well
//! (`adopt`, `significance`), groups of rows left out (`holdout`), rivals (`rivals`), and the measurement that would tell them apart
//! (`experiment_design`); or what is left (`unexplained`, `formula`). Then everything that is told of it (`summary`). Nothing is called missing
//! that noise could have made, and nothing is called certain that has a rival.

mod adopt;
mod data_quality;
mod evidence;
pub mod experiment_design;
mod fitted_model;
mod formula;
mod forward_selection;
mod holdout;
pub mod hypothesis;
mod json;
mod limits;
mod numerics;
mod options;
mod pairs;
mod result;
mod rivals;
mod search;
pub mod significance;
mod stopping_rule;
mod summary;
mod unexplained;
mod work;

use std::sync::Arc;

use crate::analysis::fit::{self, Problem};
use crate::analysis::measurement::DataSet;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use evidence::{Evidence, Found};
use fitted_model::{Case, Node};
pub use hypothesis::Hypothesis;
pub use options::{EVALUATIONS, Options, Progress};
pub use result::{Diagnosis, Leaning, Limit, Next, Note, Reason, RowPlace, Rung, Step, Suggestion, Tried, Verdict};
use search::Search;
use work::Work;

/// Random starting points of the base fit.
const ELSEWHERE: usize = 3;

/// Finds out what a mission's model lacks.
///
/// # Errors
/// Where keys cannot be fitted, candidates make no sense, or the model has no value for a row.
pub fn diagnose(
    mission: &Mission,
    data: &[DataSet],
    options: &Options,
    progress: &Progress,
) -> Result<Diagnosis, InputError> {
    let case = Case { work: Work::of_at_most(options.evaluations), ..Case::of(data) };
    let hypotheses = hypothesis::all(mission, options.candidates.as_ref())?;
    for key in &options.free {
        fit::parameter::Parameter::of(mission, key)?;
    }
    let refusal = data_quality::refusal(&case, options.free.len());
    let free = if refusal.is_some() { Vec::new() } else { options.free.clone() };
    (progress.stage)("numerics and base fit", 0);
    let (accurate, notes) = numerics::accurate(&case, mission)?;
    let base = Arc::new(base_fit(&case, &Model::new(&accurate), &free, options.seed)?);
    let search = Search::new(&case, &hypotheses, free, options.seed, progress);
    let split = holdout::split(&case);
    let told =
        Evidence { search: &search, options, base: &base, groups: split.as_ref().map(|(_, groups)| &groups[..]) };
    let found = match refusal.or_else(|| data_quality::sigma_too_large(&case, &base)) {
        Some(reason) => Found::of(Verdict::Unfit, reason, vec![base.clone()]),
        None => told.hunt()?,
    };
    told.diagnosis(mission, found, split.as_ref().map(|(column, _)| column.to_string()), notes)
}

/// The fit of what is free: from elsewhere too where it does not explain the data.
fn base_fit(case: &Case, model: &Model, free: &[String], seed: u64) -> Result<Node, InputError> {
    let options = fit::Options { seed, scan: false, ..fit::Options::default() };
    let fit = |model: &Model| Node::fit(case, model, Vec::new(), free, &options);
    let mut best = fit(model)?;
    let clear = best.chi2() > best.freedom() + 4.0 * (2.0 * best.freedom()).sqrt();
    if free.is_empty() || !clear {
        return Ok(best);
    }
    let count = |_| case.work.count();
    for mission in Problem::new(model, case.data, free, &count, |_| true)?.elsewhere(ELSEWHERE, seed, best.chi2()) {
        let other = fit(&model.like(&mission))?;
        if other.chi2() < best.chi2() {
            best = other;
        }
    }
    Ok(best)
}
