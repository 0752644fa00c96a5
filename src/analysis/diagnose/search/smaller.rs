//! Models with one effect less than another, and effects in its place, from the other's values.

use std::sync::Arc;

use super::{SAME_MINIMUM, Search, Sketch, most_promising};
use crate::analysis::diagnose::fitted_model::{Added, Node};
use crate::analysis::diagnose::hypothesis::{FARTHEST, Trial};
use crate::analysis::fit;
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::parallel;

/// A fitted model without one of the effects of another.
pub(super) struct Smaller {
    /// Predictions of the other.
    of: Vec<f64>,
    /// Index of the effect among those added to it.
    without: usize,
    node: Arc<Node>,
}

impl Search<'_> {
    /// The fitted model without one of the effects of another (by its index among those added): at least as near to the data as from
    /// where the other's values of all else lead.
    pub fn without(&self, base: &Arc<Node>, node: &Node, place: usize) -> Result<Arc<Node>, InputError> {
        let mut others = node.added.clone();
        others.remove(place);
        let known = self.with(base, &others.iter().map(|added| added.hypothesis).collect::<Vec<_>>())?;
        if others.is_empty() {
            return Ok(known);
        }
        let same = |known: &&Smaller| known.without == place && known.of == node.fit.values;
        let done = self.smaller.lock().expect("nobody panics").iter().find(same).map(|known| known.node.clone());
        if let Some(done) = done.filter(|done| done.chi2() <= known.chi2()) {
            return Ok(done);
        }
        let found = self.refitted_from(&known, node, others).unwrap_or(known);
        let smaller = Smaller { of: node.fit.values.clone(), without: place, node: found.clone() };
        self.smaller.lock().expect("nobody panics").push(smaller);
        Ok(found)
    }

    /// A fitted model refitted from the values of one with more effects; None if that is no nearer to the data.
    fn refitted_from(&self, node: &Node, larger: &Node, others: Vec<Added>) -> Option<Arc<Node>> {
        let model = node.model.like(&self.with_values_of(node, larger, others)?);
        let problem = self.problem(&model, &node.added).ok()?;
        let found = problem.polish(problem.approach(&problem.nothing_known()));
        if found.chi2 > node.chi2() - SAME_MINIMUM {
            return None;
        }
        let found = self.fit(&node.model.like(&problem.mission(&found.at).ok()?), &node.added, false).ok()?;
        self.remember_settled(&found);
        Some(found)
    }

    /// The mission of a model with the values of one that has more effects. `others` are the effects of that one which the model has
    /// too.
    fn with_values_of(&self, node: &Node, larger: &Node, mut others: Vec<Added>) -> Option<Mission> {
        let mut from: Vec<(String, String)> = self.base.iter().map(|key| (key.clone(), key.clone())).collect();
        for added in &node.added {
            let other = others.remove(others.iter().position(|other| other.hypothesis == added.hypothesis)?);
            let name = |key: &str| key.strip_prefix(&added.key).map(str::to_owned);
            from.extend(added.free.iter().filter_map(|key| Some((key.clone(), other.key.clone() + &name(key)?))));
        }
        let values = from.into_iter().map(|(key, other)| Some((key, larger.mission().number(&other)?.into())));
        node.mission().with(&values.collect::<Option<Vec<_>>>()?).ok()
    }

    /// Rough fits of effects in place of one of a model (by its index among those added), from the model's values of all else. `smaller` is
    /// the fitted model without it, in which the other effects may stand in for what is missing: a bounce of the other sign, from which no
    /// gradient leads back.
    pub fn sketches_in_place(&self, smaller: &Node, node: &Node, place: usize, wanted: &[usize]) -> Vec<Sketch> {
        let mut others = node.added.clone();
        others.remove(place);
        let options = fit::Options { settled: true, ..fit::Options::default() };
        let there = || -> Option<Node> {
            let model = smaller.model.like(&self.with_values_of(smaller, node, others)?);
            Node::fit(self.case, &model, smaller.added.clone(), &self.base, &options).ok()
        };
        let Some(there) = there() else { return Vec::new() };
        let sketch = |place: &usize| {
            let trials = self.hypotheses[*place].trials(*place, self.case, &there);
            let start = |trial: &&Trial| {
                let strength = trial.strength(&there.residuals).clamp(0.1, FARTHEST);
                self.start_at(&there, &[(*trial, strength)])
            };
            self.followed(&there, most_promising(&trials, &there).iter().filter_map(start).collect())
        };
        parallel::map(wanted, sketch).into_iter().flatten().collect()
    }
}
