//! Larger errors, or effects that are missing?
//!
//! With few rows, the sum of two effects looks like noise to a model that has none or one of them: errors estimated from the
//! residuals are then too large, and hide both. So before larger errors are accepted, effects are tried with the quoted errors, and
//! the two explanations are compared by their likelihood. With errors larger by a factor s, which is fitted, n rows give
//!
//! ```text
//! −2 ln L = n ln s² + chi2/s²,   s² = chi2/n
//! ```
//!
//! and with quoted errors chi2. Each parameter costs 2, and each effect what the best of all effects gains by chance.

use std::sync::Arc;

use super::evidence::{Evidence, Found};
use super::fitted_model::Node;
use super::noise::{self, SetNoise};
use super::{data_quality, pairs, rivals};
use crate::error::InputError;

/// Rows of a file up to which effects are tried in place of larger errors. In files of 60 rows, two effects have been mistaken for
/// larger errors. With more rows, the errors are estimated from the residuals beyond everything smooth, and a search with errors
/// that are too small would double the time.
pub(super) const FEW: usize = 64;

impl Evidence<'_> {
    /// A model that explains the data with these errors, much better than the nearest models do with larger errors of some files.
    /// None if there is none.
    ///
    /// # Errors
    /// Those of the search.
    pub(super) fn without_larger(&self, larger: &[SetNoise]) -> Result<Option<Found>, InputError> {
        let nearest = self.nearest()?;
        let most = self.most(&nearest, larger);
        if self.promised(&nearest) > most || !self.work().allows("effects in place of larger errors") {
            return Ok(None);
        }
        let found = self.select()?;
        let is_better = found.ladder.last().is_some_and(|node| node.chi2() + self.cost(node) < most);
        Ok((found.explains() && is_better).then_some(found))
    }

    /// If nothing explains the data, but effects explain most and leave no trend in a file that is too short for its errors to be
    /// estimated: the errors of this file as they leave them. None otherwise.
    ///
    /// # Errors
    /// If the model has no value for a row.
    pub(super) fn larger_errors(&self, noise: &[SetNoise], found: &Found) -> Result<Option<Vec<SetNoise>>, InputError> {
        let Some(node) = found.ladder.last().filter(|node| !node.added.is_empty()) else { return Ok(None) };
        let case = self.case();
        let reason = data_quality::sigma_too_small(case, node);
        let Some(larger) = noise::with_larger(case, noise, node, &reason) else { return Ok(None) };
        let is_short = |index: usize| larger[index] == noise[index] || case.rows(index).len() <= FEW;
        let white = (0..larger.len()).all(is_short) && self.is_white(node)?;
        Ok(white.then_some(larger))
    }

    /// Rows that are wrong, each with its residual in sigma, if a law of the measurement explains all others with these errors, much
    /// better than the nearest models do with larger errors of some files. None if there is none.
    ///
    /// # Errors
    /// Those of the search.
    pub(super) fn law_without_larger(&self, larger: &[SetNoise]) -> Result<Option<Vec<(usize, f64)>>, InputError> {
        Ok(self.far_from_a_law_below(self.most(&self.nearest()?, larger)))
    }

    /// What −2 ln L and penalties must be below to be much better than the nearest models with larger errors.
    fn most(&self, nearest: &[Arc<Node>], larger: &[SetNoise]) -> f64 {
        let with = nearest.iter().map(|node| self.with_larger(node, larger)).fold(f64::INFINITY, f64::min);
        with - rivals::margin(self.options.level)
    }

    /// −2 ln L of a model plus the cost of its parameters; errors are fitted in the files in which they are larger.
    fn with_larger(&self, node: &Node, larger: &[SetNoise]) -> f64 {
        let of_file = |(index, noise): (usize, &SetNoise)| {
            let rows = self.case().rows(index);
            let (n, chi2) = (rows.len() as f64, node.residuals.rows_range(rows).norm_squared());
            if noise.scale > 1.0 { n * (chi2 / n).ln() + n + 2.0 } else { chi2 }
        };
        larger.iter().enumerate().map(of_file).sum::<f64>() + self.cost(node)
    }

    /// chi2 with one more effect than some models, or two more than the base, to first order, plus the cost of the model without
    /// them: usually a lower limit.
    fn promised(&self, nearest: &[Arc<Node>]) -> f64 {
        let with_one_more = nearest.iter().map(|node| {
            let expansion = self.search.expand(node);
            let gain = (0..expansion.trials.len()).map(|place| expansion.gain(place)).fold(0.0, f64::max);
            node.chi2() - gain + self.cost(node)
        });
        let expansion = self.search.expand(self.base);
        let pairs = pairs::promising(&expansion, self.search.hypotheses, |_, _| true);
        let with_two = pairs.first().map(|pair| self.base.chi2() - pair.gain + self.cost(self.base));
        with_one_more.chain(with_two).fold(f64::INFINITY, f64::min)
    }
}
