//! Whether a fitted model calls for more.

use std::sync::Arc;

use super::Told;
use super::case::Node;
use super::chance::Noise;
use crate::error::InputError;
use crate::validate::validate;

/// Parts of the level: of the search, of leanings, and of chi2.
pub(super) const SEARCH: f64 = 0.5;
pub(super) const LEAN: f64 = 0.25;
const CHI2: f64 = 0.1;

/// Part of the level at which a model that has an effect added calls for more: two are missing less often than one, and a good
/// answer is not to be spoiled as often as data are complete.
const FURTHER: f64 = 0.2;

/// False alarm to first order below which an effect is fitted to see.
const NEAR: f64 = 0.3;

impl Told<'_> {
    /// Whether a model calls for nothing more: by chi2, by what residuals lean on, by any effect on top.
    pub(super) fn is_enough(&self, node: &Arc<Node>) -> Result<bool, InputError> {
        let level = self.options.level * if node.added.is_empty() { 1.0 } else { FURTHER };
        let noise = Noise::left_at(self.case(), node);
        let white = Noise { scale: vec![1.0; self.case().data.len()], correlation: noise.correlation };
        // By the textbook first: far beyond it nothing need be simulated.
        if noise.correlation == 0.0 && node.chi2() > node.freedom() + 8.0 * (2.0 * node.freedom()).sqrt() {
            return Ok(false);
        }
        let null = self.search.null(node, &white);
        let chi2 = null.chi2_above(node.chi2()) < CHI2 * level;
        let validation = validate(node.mission(), self.case().data, self.options.seed)?;
        let leans = validation.leans.iter().any(|lean| lean.false_alarm < LEAN * level);
        let expansion = self.search.expand(node);
        let alarm = |place: usize, gain: f64| null.false_alarm(place, gain);
        let near: Vec<usize> =
            expansion.promising().into_iter().filter(|&place| alarm(place, expansion.gain(place)) < NEAR).collect();
        let sketches = self.search.sketches(&expansion, &near);
        let search = sketches.iter().any(|sketch| alarm(sketch.last(), node.chi2() - sketch.chi2) < SEARCH * level);
        Ok(!chi2 && !leans && !search)
    }
}
