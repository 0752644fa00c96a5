//! Mission and measurements → which physical effect the model lacks.
//!
//! The steps follow the order in which mistakes are avoided. First, can the data carry a verdict (`data_quality`), and is the
//! readout computed finely enough (`numerics`)? Then the free parameters are fitted, and effects are added one at a time and in
//! pairs (`forward_selection`, with `hypothesis`, `search`, `pairs`) until the stopping rule is met (`stopping_rule`). Each effect
//! found is tested for significance against noise (`adopt`, `significance`), by prediction of groups of rows left out (`holdout`)
//! and against rivals (`rivals`) and laws of the measurement itself (`measurement_law`); `experiment_design` proposes the measurement
//! that would distinguish rivals. If nothing explains the data, the remainder is described (`unexplained`, `formula`). `summary`
//! collects all that is reported. Nothing is called missing that noise could have made, and nothing is called certain that has a
//! rival.

mod adopt;
mod data_quality;
mod doubts;
mod evidence;
pub mod experiment_design;
mod explanation;
mod fitted_model;
mod formula;
mod forward_selection;
pub mod holdout;
pub mod hypothesis;
mod json;
mod larger_errors;
mod limits;
mod measurement_law;
pub mod noise;
mod numerics;
mod options;
mod pairs;
mod prior;
pub mod ranking;
mod result;
mod rivals;
mod search;
mod set_search;
mod significance;
mod stability;
mod stopping_rule;
mod summary;
mod trimmed;
mod unexplained;
mod unrecorded;
mod verdict;
mod work;

use std::sync::{Arc, OnceLock};

use crate::analysis::fit::{self, Problem};
use crate::analysis::measurement::{DataSet, some_rows};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use evidence::{Evidence, Found};
use fitted_model::{Case, Node};
pub use hypothesis::Hypothesis;
use noise::SetNoise;
pub use options::{EVALUATIONS, Options, Progress};
pub use ranking::{Ranking, ranking};
pub use result::{Covariate, Diagnosis, Limit, Next, Note, Reason, RowPlace, Rung, Step, Suggestion, Tried, Verdict};
use search::Search;
pub use stability::{Changed, Stability};
use work::Work;

/// Random starting points of the base fit.
const ELSEWHERE: usize = 3;

/// Rounds of the search at most, each with the errors estimated at the end of the one before.
const ROUNDS: usize = 6;

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
        quoted: &sorted,
        hypotheses: hypothesis::all(mission, options.candidates.as_ref())?,
        options,
        progress,
        work: Arc::new(Work::of_at_most(options.evaluations)),
    };
    Ok(task.rounds()?.with_files_at(&order))
}

/// Indices of the data sets in the order of their names. Rounding alone can change the path of a search, and the order in which
/// files are given must not change the result.
fn by_name(data: &[DataSet]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..data.len()).collect();
    order.sort_by(|&a, &b| data[a].file.cmp(&data[b].file));
    order
}

/// What stays the same from round to round.
struct Task<'a> {
    mission: &'a Mission,
    quoted: &'a [DataSet],
    hypotheses: Vec<Hypothesis>,
    options: &'a Options,
    progress: &'a Progress<'a>,
    work: Arc<Work>,
}

/// The outcome of a round.
enum Attempt {
    Done(Box<Diagnosis>),
    /// The estimated errors differ: another round is needed.
    Again(Vec<SetNoise>),
}

/// The state of the errors before a search.
enum FirstLook {
    AsQuoted,
    Others(Vec<SetNoise>),
    /// Far from the quoted ones, but with the quoted ones a model explains the data, or the nearest leaves
    /// trends or less noise than that.
    Decided(Box<Found>),
}

impl Task<'_> {
    /// The search, repeated until its errors are those estimated at its end; at first with the quoted ones.
    fn rounds(&self) -> Result<Diagnosis, InputError> {
        let mut noise = noise::as_quoted(self.quoted);
        for round in 0..ROUNDS {
            match self.attempt(&noise, round)? {
                Attempt::Done(found) => return Ok(*found),
                Attempt::Again(better) => noise = better,
            }
        }
        unreachable!("the last round is done")
    }

    /// Calls a function with the base fit and everything that a search of these data needs. If `like` is given (the same data with
    /// other errors), it begins where that search ended.
    fn with_evidence<T>(
        &self,
        data: &[DataSet],
        like: Option<&Search>,
        then: impl FnOnce(&Evidence, Vec<Note>) -> Result<T, InputError>,
    ) -> Result<T, InputError> {
        let case = Case { work: self.work.clone(), ..Case::of(data) };
        // Too few rows to fit the free parameters are refused later.
        let free = if case.n() < self.options.free.len() { Vec::new() } else { self.options.free.clone() };
        (self.progress.stage)("numerics and base fit", 0);
        let (accurate, notes) = numerics::accurate(&case, self.mission)?;
        let level: Vec<DataSet> = data.iter().map(DataSet::without_pedestal).collect();
        let level = Case { work: self.work.clone(), ..Case::of(&level) };
        let base = Arc::new(base_fit([&case, &level], &Model::new(&accurate), &free, self.options.seed)?);
        let mut search =
            Search::new([&case, &level], self.mission, &self.hypotheses, free, self.options.seed, self.progress);
        if let Some(other) = like {
            search.begin_like(other, &base);
        }
        let split = holdout::split(&case);
        let law = OnceLock::new();
        then(&Evidence { search: &search, options: self.options, base: &base, split: split.as_ref(), law }, notes)
    }

    /// The whole search, with the errors taken as given.
    fn attempt(&self, noise: &[SetNoise], round: usize) -> Result<Attempt, InputError> {
        self.work.begin_round();
        let data = noise::allowed_for(self.quoted, noise);
        let more_rounds = round + 1 < ROUNDS;
        self.with_evidence(&data, None, |evidence, notes| {
            let refusal = data_quality::refusal(evidence.case(), self.options.free.len());
            let mut selected = None;
            if refusal.is_none() && round == 0 {
                match self.first_look(evidence, noise)? {
                    FirstLook::Others(better) => return Ok(Attempt::Again(better)),
                    FirstLook::Decided(found) => selected = Some(*found),
                    FirstLook::AsQuoted => (),
                }
            }
            let refusal = refusal
                .or_else(|| data_quality::errors_beyond(noise))
                .or_else(|| data_quality::errors_too_large(evidence.case(), evidence.base))
                .or_else(|| data_quality::contradictory(evidence.case()));
            let mut found = match (refusal, selected) {
                (Some(reason), _) => Found::of(Verdict::Unfit, reason, vec![evidence.base.clone()]),
                (None, Some(found)) => evidence.or_law_beside_fewer(found)?,
                (None, None) => evidence.or_law_beside_fewer(evidence.select()?)?,
            };
            let mut notes = notes;
            match self.other_errors(evidence, noise, &found)? {
                Some(better) if more_rounds => return Ok(Attempt::Again(better)),
                Some(_) => notes.push(Note::NotConverged { rounds: ROUNDS }),
                None => (),
            }
            found.noise = match found.verdict {
                // If no model explains the data, a pedestal cannot be identified.
                Verdict::Unexplained => noise.to_vec(),
                _ => noise::with_pedestals(evidence.case(), found.ladder.last().expect("the base"), noise),
            };
            evidence.explain(&mut found)?;
            let found = evidence.diagnosis(self.mission, found, notes)?;
            let stability = self.stability(evidence, &found)?;
            Ok(Attempt::Done(Box::new(Diagnosis { stability, ..found })))
        })
    }

    /// The errors estimated from the residuals of the model nearest to the data, before any search.
    fn first_look(&self, evidence: &Evidence, noise: &[SetNoise]) -> Result<FirstLook, InputError> {
        let nearest = evidence.nearest()?;
        let better = self.estimated(evidence, &nearest[0], noise);
        if noise::is_same(&better, noise) {
            return Ok(FirstLook::AsQuoted);
        }
        if better.iter().any(|noise| noise.scale > 1.0) {
            // A gain that changes makes rows scatter as well.
            let as_quoted = noise::with_scales_of_1(&better);
            let data = noise::allowed_for(self.quoted, &as_quoted);
            if let Some(far) = self.with_evidence(&data, None, |evidence, _| evidence.law_without_larger(&better))? {
                return Ok(FirstLook::Others(noise::with_wrong(self.quoted, &as_quoted, &far)));
            }
        }
        let Some(beyond) = data_quality::errors_beyond(&better) else {
            return self.larger_or_effects(evidence, noise, better);
        };
        // One wrong row that bends everything smooth looks like larger errors of all rows, and so does an effect that is not among
        // the nearest. If a model explains the data with their quoted errors, these hold. With errors that are too large, anything
        // would explain them.
        if let Some(odd) = evidence.odd_rows(None, &nearest) {
            return Ok(FirstLook::Others(noise::with_wrong(self.quoted, noise, &odd.rows)));
        }
        if !matches!(beyond, Reason::SmallErrors { .. }) {
            return Ok(FirstLook::Others(better));
        }
        let found = evidence.select()?;
        let remains = match &found.nearest {
            Some(node) if found.verdict == Verdict::Unexplained => !evidence.leaves_larger_noise(node)?,
            _ => false,
        };
        let holds = found.explains() || remains;
        Ok(if holds { FirstLook::Decided(Box::new(found)) } else { FirstLook::Others(better) })
    }

    /// The errors estimated from the residuals of a model.
    fn estimated(&self, evidence: &Evidence, node: &Arc<Node>, known: &[SetNoise]) -> Vec<SetNoise> {
        let found = noise::estimate(evidence.case(), self.quoted, &evidence.search.expand(node), known);
        noise::kept_if_exceeded(evidence.case(), evidence.base, known, found)
    }

    /// Larger errors that can be allowed for, unless effects explain the data better with the quoted ones.
    fn larger_or_effects(
        &self,
        evidence: &Evidence,
        noise: &[SetNoise],
        better: Vec<SetNoise>,
    ) -> Result<FirstLook, InputError> {
        let larger = || better.iter().zip(self.quoted).filter(|(better, _)| better.scale > 1.0).map(|(_, set)| set);
        // With many rows, errors can be estimated regardless of what effects leave.
        let few = larger().count() > 0 && larger().all(|set| set.rows.len() <= larger_errors::FEW);
        if !few || better.iter().any(|better| better.correlation > 0.0) {
            return Ok(FirstLook::Others(better));
        }
        let as_quoted = noise::with_scales_of_1(&better);
        if noise::is_same(&as_quoted, noise) {
            let found = evidence.without_larger(&better)?;
            return Ok(found.map_or(FirstLook::Others(better), |found| FirstLook::Decided(Box::new(found))));
        }
        // Wrong rows stay marked as wrong.
        let data = noise::allowed_for(self.quoted, &as_quoted);
        let found = self.with_evidence(&data, None, |evidence, _| evidence.without_larger(&better))?;
        Ok(FirstLook::Others(if found.is_some() { as_quoted } else { better }))
    }

    /// The errors that the search should have used, as estimated at its end; None if it used them.
    fn other_errors(
        &self,
        evidence: &Evidence,
        noise: &[SetNoise],
        found: &Found,
    ) -> Result<Option<Vec<SetNoise>>, InputError> {
        if !found.wrong.is_empty() {
            return Ok(Some(noise::with_wrong(self.quoted, noise, &found.wrong)));
        }
        if found.verdict == Verdict::Unfit {
            let larger = |node: &Arc<Node>| noise::with_larger(evidence.case(), noise, node, &found.reason);
            return Ok(found.nearest.as_ref().and_then(larger));
        }
        let node = found.nearest.as_ref().unwrap_or(found.ladder.last().expect("the base"));
        if found.law.as_ref().is_some_and(|law| law.is_law) {
            return Ok(None);
        }
        if found.verdict == Verdict::Unexplained {
            let better = trimmed::wrong_rows(evidence, self.quoted, noise, node)?;
            if better.is_some() {
                return Ok(better);
            }
            let better = evidence.larger_errors(noise, found)?;
            if better.is_some() {
                return Ok(better);
            }
        }
        let known = if found.explains() { noise::confirmed(evidence.case(), node, noise) } else { noise.to_vec() };
        let better = self.estimated(evidence, node, &known);
        let is_beyond = matches!(data_quality::errors_beyond(&better), Some(Reason::SmallErrors { .. }));
        if found.verdict == Verdict::Unexplained && is_beyond && !evidence.leaves_larger_noise(node)? {
            return Ok(None);
        }
        Ok((!noise::is_same(&better, noise)).then_some(better))
    }
}

/// The fit of the free parameters; also from other starting points if it does not explain the data.
fn base_fit([case, level]: [&Case; 2], model: &Model, free: &[String], seed: u64) -> Result<Node, InputError> {
    let fit = |model: &Model, scan: bool| {
        let options = fit::Options { seed, scan, ..fit::Options::default() };
        Node::fit(case, model, Vec::new(), free, &options)
    };
    if free.is_empty() {
        return fit(model, false);
    }
    let count = |_| case.work.count();
    let roughly = |model: &Model, case: &Case| -> Result<(Model, f64), InputError> {
        let (mission, chi2) = Problem::new(model, case.data, free, &count, |_| true)?.sketch()?;
        Ok((model.like(&mission), chi2))
    };
    // Far from the data, a pedestal absorbs the whole difference and leaves the free parameters no gradient. So one start is a fit
    // without pedestals.
    let (near, _) = roughly(model, level)?;
    let mut starts = [roughly(&near, case)?, roughly(model, case)?];
    starts.sort_by(|a, b| a.1.total_cmp(&b.1));
    let [(start, _), (other, rough)] = starts;
    let mut best = fit(&start, false)?;
    if fit::is_another(rough, best.chi2()) {
        let other = fit(&other, false)?;
        if other.chi2() < best.chi2() {
            best = other;
        }
    }
    let clear = best.chi2() > best.freedom() + 4.0 * (2.0 * best.freedom()).sqrt();
    if !clear {
        return Ok(best);
    }
    // A parameter with a kink (a notch near the background) has minima that no gradient leads to.
    let scanned = fit(&best.model, true)?;
    if scanned.chi2() < best.chi2() {
        best = scanned;
    }
    for mission in Problem::new(model, case.data, free, &count, |_| true)?.elsewhere(ELSEWHERE, seed, best.chi2()) {
        let other = fit(&model.like(&mission), false)?;
        if other.chi2() < best.chi2() {
            best = other;
        }
    }
    Ok(best)
}
