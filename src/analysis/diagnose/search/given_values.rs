//! Fits from the mission's values of the free keys.
//!
//! A model that lacks an effect may drive a free key to where it, or an effect, has no influence: a release time to its bound, the density
//! of all traps that radiation makes to 0. From there no gradient leads back.

use std::sync::Arc;

use super::{Search, Sketch, Start};
use crate::analysis::diagnose::fitted_model::{Case, Node};
use crate::analysis::diagnose::hypothesis::Trial;
use crate::analysis::fit;
use crate::analysis::fit::parameter::Parameter;

/// Change of a free key from the mission's value, in ordinary changes, beyond which a fit is started once more from that value.
const FAR: f64 = 0.25;

/// chi2 per degree of freedom above which a model does not explain the data, even if errors are too small.
const FAR_FROM_NOISE: f64 = 4.0;

impl Search<'_> {
    /// The trials of an effect on top of a model. If it changes nothing there, and the model does not explain the data: on top of the same
    /// model with the mission's values.
    pub(super) fn trials(&self, place: usize, node: &Node) -> Vec<Trial> {
        let trials = self.hypotheses[place].trials(place, self.case, node);
        let as_given = || self.as_given(node).map(|given| self.hypotheses[place].trials(place, self.case, &given));
        if trials.is_empty() { as_given().unwrap_or_default() } else { trials }
    }

    /// A model with the mission's values of free keys that were driven out, as far as that was made (`make_as_given`).
    pub(super) fn as_given(&self, node: &Node) -> Option<Arc<Node>> {
        let all = self.as_given.lock().expect("nobody panics");
        all.iter().find(|(of, _)| *of == node.fit.values).map(|(_, given)| given.clone())
    }

    /// Puts free keys that were driven out back at the mission's values, if a model does not explain the data; not while others run in
    /// parallel. A fit that lacks an effect may end without any traps that radiation makes: no effect on these could be seen there.
    pub(super) fn make_as_given(&self, case: &Case, node: &Node) {
        if node.chi2() < FAR_FROM_NOISE * node.freedom() || self.as_given(node).is_some() {
            return;
        }
        let given = self.base.iter().filter_map(|key| Parameter::of(self.given, key).ok());
        let out = |given: &Parameter| node.mission().number(&given.key).is_some_and(|value| given.is_driven_out(value));
        let moved: Vec<_> = given.filter(out).map(|given| (given.key, given.start.into())).collect();
        if moved.is_empty() {
            return;
        }
        let options = fit::Options { settled: true, ..fit::Options::default() };
        let fit = |mission| Node::fit(case, &node.model.like(&mission), node.added.clone(), &self.base, &options);
        if let Some(Ok(given)) = node.mission().with(&moved).ok().map(fit) {
            self.as_given.lock().expect("nobody panics").push((node.fit.values.clone(), Arc::new(given)));
        }
    }

    /// A rough fit, or the fit from the mission's own values of the initially free keys if that is better. A model that lacks an
    /// effect may have driven a free key to where it has no influence (a release time to its bound), from where no gradient leads
    /// back once the effect is added.
    pub(super) fn refitted_from_given_values(&self, node: &Node, sketch: Sketch) -> Sketch {
        let given = self.base.iter().filter_map(|key| Parameter::of(self.given, key).ok());
        let is_far = |given: &Parameter| {
            let value = sketch.mission.number(&given.key);
            value.is_some_and(|value| given.changes_from_start(value) > FAR)
        };
        let moved: Vec<_> = given.filter(is_far).map(|given| (given.key, given.start.into())).collect();
        if moved.is_empty() {
            return sketch;
        }
        let back = || -> Option<Sketch> {
            let mission = sketch.mission.with(&moved).ok()?;
            let model = node.model.like(&mission);
            let problem = self.problem(&model, &sketch.added).ok()?;
            let found = problem.approach(&problem.nothing_known());
            self.followed(node, vec![Start { added: sketch.added.clone(), mission, found }])
        };
        back().filter(|back| back.chi2 < sketch.chi2).unwrap_or(sketch)
    }
}
