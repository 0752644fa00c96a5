//! Whether a fitted model calls for more.

use std::sync::Arc;

use super::evidence::Evidence;
use super::fitted_model::Node;
use super::search::Sketch;
use super::significance::{Noise, Null};
use crate::analysis::validate::validate;
use crate::error::InputError;

/// Parts of the level: of the search, of residual trends, and of chi2.
pub(super) const SEARCH: f64 = 0.5;
pub(super) const TRENDS: f64 = 0.25;
const CHI2: f64 = 0.1;

/// Part of the level at which a model that has an effect added calls for more: two are missing less often than one, and a good
/// answer is not to be spoiled as often as data are complete.
const FURTHER: f64 = 0.2;

/// False alarm to first order below which an effect is fitted to see.
const NEAR: f64 = 0.3;

impl Evidence<'_> {
    /// Whether a model calls for nothing more: by chi2, by what residuals trend on, by any effect on top.
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

    /// Noise as the data state it, where neither chi2 nor what residuals trend on says that there is more; None elsewhere.
    pub(super) fn mere_noise(&self, node: &Arc<Node>) -> Result<Option<Null>, InputError> {
        let noise = Noise::of(self.case());
        // By the textbook first: far beyond it nothing need be simulated.
        if noise.is_as_quoted() && node.chi2_of_rows() > node.freedom() + 8.0 * (2.0 * node.freedom()).sqrt() {
            return Ok(None);
        }
        let null = self.search.null(node, &noise);
        if null.chi2_above(node.chi2_of_rows()) < CHI2 * self.level(node) {
            return Ok(None);
        }
        let validation = validate(node.mission(), self.case().data, self.options.seed)?;
        let trends = validation.trends.iter().any(|trend| trend.false_alarm < TRENDS * self.level(node));
        Ok((!trends).then_some(null))
    }

    /// The level at which something on top of a model is believed.
    pub(super) fn level(&self, node: &Node) -> f64 {
        self.options.level * if node.added.is_empty() { 1.0 } else { FURTHER }
    }
}
