//! The stopping rule: whether the data call for more than a fitted model.

use std::sync::Arc;

use super::evidence::Evidence;
use super::fitted_model::Node;
use super::search::Sketch;
use super::significance::{Noise, Null};
use crate::analysis::validate::validate;
use crate::error::InputError;

/// Shares of the level: for the search, for residual trends, and for chi2.
pub(super) const SEARCH: f64 = 0.5;
pub(super) const TRENDS: f64 = 0.25;
const CHI2: f64 = 0.1;

/// Share of the level for further effects on top of an added one: two effects are missing less often than one, and a correct answer
/// must not be spoiled as often as a false alarm is allowed for complete data.
const FURTHER: f64 = 0.2;

/// First-order false-alarm probability below which an effect is fitted to check.
const NEAR: f64 = 0.3;

impl Evidence<'_> {
    /// Whether a model needs nothing more, by chi2, by residual trends, and by any effect on top.
    pub(super) fn is_enough(&self, node: &Arc<Node>) -> Result<bool, InputError> {
        let Some(null) = self.mere_noise(node)? else { return Ok(false) };
        let expansion = self.search.expand(node);
        let alarm = |place: usize, gain: f64| null.false_alarm(place, gain);
        let near: Vec<usize> =
            expansion.promising().into_iter().filter(|&place| alarm(place, expansion.gain(place)) < NEAR).collect();
        let sketches = self.search.sketches(&expansion, &near);
        let calls = |sketch: &Sketch| alarm(sketch.last(), sketch.gain_over(node)) < SEARCH * self.level(node);
        Ok(!sketches.iter().any(calls))
    }

    /// The null distribution for the noise of the data, if neither chi2 nor residual trends exceed it; None otherwise.
    pub(super) fn mere_noise(&self, node: &Arc<Node>) -> Result<Option<Null>, InputError> {
        let noise = Noise::of(self.case());
        // First by the textbook chi2: a large excess needs no simulation.
        if noise.is_as_quoted() && node.chi2_of_rows() > node.freedom() + 8.0 * (2.0 * node.freedom()).sqrt() {
            return Ok(None);
        }
        let null = self.search.null(node, &noise);
        if null.chi2_above(node.chi2_of_rows()) < self.chi2_level(node) {
            return Ok(None);
        }
        let validation = validate(node.mission(), self.case().data, self.options.seed)?;
        let trends = validation.trends.iter().any(|trend| trend.false_alarm < TRENDS * self.level(node));
        Ok((!trends).then_some(null))
    }

    /// The significance level for chi2 of a model.
    fn chi2_level(&self, node: &Node) -> f64 {
        // Several effects describe much that has another cause, such as a step of the gain, except for a remainder.
        if node.added.len() > 1 { self.options.level } else { CHI2 * self.level(node) }
    }

    /// The significance level for an addition to a model.
    pub(super) fn level(&self, node: &Node) -> f64 {
        self.options.level * if node.added.is_empty() { 1.0 } else { FURTHER }
    }
}
