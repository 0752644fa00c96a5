//! Signatures: every form of every effect on top of a set, evaluated once, and what the best of them promise.
//!
//! The strength of a form is solved for together with the free parameters, and the likelihood of what remains is computed with all errors
//! estimated anew, since rows that look wrong without an effect may be its signature.

use std::collections::BTreeMap;

use toml::Table;

use super::super::explanation::Explanation;
use super::linear::Linear;
use super::{ROUNDS, SetSearch};
use crate::analysis::likelihood::{Errors, minus_2_ln_l};
use crate::mission_file;
use crate::numeric::parallel;

/// Forms of an effect whose remaining errors are estimated anew, for each of the two ways to weigh rows;
const SHORTLISTED: usize = 3;

/// One form of an effect at a fitted set: tables whose changes of the predictions add.
pub(super) struct Trial {
    pub hypothesis: usize,
    pub tables: Vec<Table>,
    /// Changes of the predictions, in their units.
    pub changes: Vec<Vec<f64>>,
    pub strength: Strength,
}

/// What is known of the strength of a trial.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Strength {
    /// As it is.
    Fixed,
    /// Not below zero.
    Positive,
}

/// What a trial promises.
#[derive(Clone)]
pub(super) struct Promise<'t> {
    pub trial: &'t Trial,
    /// −2 ln L and priors that it may reach, with its parameters' price.
    pub objective: f64,
    /// Factors on the strengths of its tables.
    pub strengths: Vec<f64>,
    /// Steps of the other parameters.
    pub steps: Vec<f64>,
    pub errors: Vec<Errors>,
    /// value − model, to first order.
    pub left: Vec<f64>,
}

impl SetSearch<'_> {
    /// Every form of every effect on top of a set, evaluated once.
    pub(super) fn trials(&self, line: &Explanation) -> Vec<Trial> {
        let model = self.fitter.model.like(&line.mission);
        let reach = self.fitter.case.reach.with_dose(|t_yr| model.dose_mev_g(t_yr).ok());
        let set = line.set();
        let mut wanted: Vec<(usize, Vec<Table>, Strength)> = Vec::new();
        for (place, hypothesis) in self.hypotheses.iter().enumerate() {
            let is_new =
                if set.contains(&place) { hypothesis.may_repeat() } else { hypothesis.is_new_to(&line.mission) };
            if !is_new {
                continue;
            }
            for tables in hypothesis.ways(&line.mission, &reach) {
                let has_strength = !hypothesis.free("", &tables[0], &reach).is_empty();
                let strength = if has_strength { Strength::Positive } else { Strength::Fixed };
                wanted.push((place, tables, strength));
            }
        }
        let evaluated = parallel::map(wanted, |(hypothesis, tables, strength)| {
            let kind = self.hypotheses[hypothesis].kind;
            let change = |table: &Table| {
                let (mission, _) = mission_file::add_effect(&line.mission, kind, table.clone()).ok()?;
                let moved = self.fitter.predicted(&mission)?;
                Some(moved.iter().zip(&line.model).map(|(moved, model)| moved - model).collect::<Vec<f64>>())
            };
            let changes = tables.iter().map(change).collect::<Option<Vec<_>>>()?;
            let moves = changes.iter().flatten().any(|change| *change != 0.0);
            moves.then_some(Trial { hypothesis, tables, changes, strength })
        });
        evaluated.into_iter().flatten().collect()
    }

    /// What the best forms of each effect promise, those of the same effect together, the best effect first.
    pub(super) fn promises<'t>(&self, line: &Explanation, trials: &'t [Trial]) -> Vec<Promise<'t>> {
        let plain = self.plain(line);
        let problems = [&line.errors, &plain].map(|errors| Linear::of(self, line, errors));
        let mut by_effect: BTreeMap<usize, Vec<&Trial>> = BTreeMap::new();
        for trial in trials {
            by_effect.entry(trial.hypothesis).or_default().push(trial);
        }
        let mut shortlist: Vec<&Trial> = Vec::new();
        for trials in by_effect.into_values() {
            let mut chosen: Vec<usize> = Vec::new();
            for problem in &problems {
                let gains = parallel::map(trials.iter(), |trial| problem.gain(&trial.changes, trial.strength));
                let mut order: Vec<usize> = (0..trials.len()).collect();
                order.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));
                order.truncate(SHORTLISTED);
                chosen.extend(order);
            }
            chosen.sort_unstable();
            chosen.dedup();
            shortlist.extend(chosen.into_iter().map(|place| trials[place]));
        }
        let promises = parallel::map(shortlist, |trial| self.promise(line, &plain, trial));
        let mut promises: Vec<Promise> = promises.into_iter().flatten().collect();
        promises.sort_by(|a, b| a.objective.total_cmp(&b.objective).then(a.trial.hypothesis.cmp(&b.trial.hypothesis)));
        let mut order: Vec<usize> = Vec::new();
        for promise in &promises {
            if !order.contains(&promise.trial.hypothesis) {
                order.push(promise.trial.hypothesis);
            }
        }
        let rank = |promise: &Promise| order.iter().position(|place| *place == promise.trial.hypothesis);
        promises.sort_by_key(|promise| rank(promise));
        promises
    }

    /// Errors with every row right, from the scatter of the residuals.
    pub(super) fn plain(&self, line: &Explanation) -> Vec<Errors> {
        let all_right =
            |errors: &Errors| Errors { right: vec![1.0; errors.right.len()], correlation: 0.0, ..errors.clone() };
        line.errors.iter().map(all_right).collect()
    }

    /// What a trial promises, with all errors estimated anew at what it leaves.
    pub(super) fn promise<'t>(&self, line: &Explanation, plain: &[Errors], trial: &'t Trial) -> Option<Promise<'t>> {
        let price =
            self.hypotheses[trial.hypothesis].parameters(&trial.tables[0], &self.fitter.case.reach) as f64 * 2.0;
        let mut best: Option<Promise> = None;
        for from in [&line.errors[..], plain] {
            let mut errors = from.to_vec();
            for _ in 0..ROUNDS {
                let problem = Linear::of(self, line, &errors);
                let Some(found) = problem.solve(&trial.changes, trial.strength) else { break };
                let left = problem.left(line, &found, &trial.changes);
                errors = self.fitter.likelihood.errors(&left, Some(&errors));
                let objective = minus_2_ln_l(&errors) + problem.prior(&found) + price;
                if best.as_ref().is_none_or(|best| objective < best.objective) {
                    let (steps, strengths) = found.split_at(line.unknowns.len());
                    best = Some(Promise {
                        trial,
                        objective,
                        strengths: strengths.to_vec(),
                        steps: steps.to_vec(),
                        errors: errors.clone(),
                        left,
                    });
                }
            }
        }
        best
    }
}
