//! Larger errors, or effects that are missing?
//!
//! What two effects leave together, of which a model has none or one, looks like noise where rows are few: errors that are told from
//! what is left are too large then, and hide both. So before larger errors are believed, effects are tried with the errors as they are
//! quoted, and the two explanations are compared by their likelihood. With errors larger by s, to be fitted, n rows come to
//!
//! ```text
//! −2 ln L = n ln s² + chi2/s²,   s² = chi2/n
//! ```
//!
//! and with quoted errors to chi2. Each parameter costs 2, and each effect what choosing it among all others gains by chance.

use std::sync::Arc;

use super::evidence::{Evidence, Found};
use super::fitted_model::Node;
use super::noise::SetNoise;
use super::{pairs, rivals};
use crate::error::InputError;

/// Rows of a file up to which effects are tried in the place of larger errors. In files of 60 rows two of them have been taken for such;
/// of more, what is left beyond everything smooth tells the errors, and a search with errors that are too small takes as long again.
pub(super) const FEW: usize = 64;

impl Evidence<'_> {
    /// A model that explains the data with these errors, and much better than larger ones of some files do with the models nearest to
    /// the data. None if there is none.
    ///
    /// # Errors
    /// Those of the search.
    pub(super) fn without_larger(&self, larger: &[SetNoise]) -> Result<Option<Found>, InputError> {
        let nearest = self.nearest()?;
        let with = nearest.iter().map(|node| self.with_larger(node, larger)).fold(f64::INFINITY, f64::min);
        let most = with - rivals::margin(self.options.level);
        if self.promised(&nearest) > most || !self.work().allows("effects in place of larger errors") {
            return Ok(None);
        }
        let found = self.select()?;
        let is_better = found.ladder.last().is_some_and(|node| node.chi2() + self.cost(node) < most);
        Ok((found.explains() && is_better).then_some(found))
    }

    /// −2 ln L of a model, with errors to be fitted in those files in which they are larger, and what its parameters cost.
    fn with_larger(&self, node: &Node, larger: &[SetNoise]) -> f64 {
        let of_file = |(index, noise): (usize, &SetNoise)| {
            let rows = self.case().rows(index);
            let (n, chi2) = (rows.len() as f64, node.residuals.rows_range(rows).norm_squared());
            if noise.scale > 1.0 { n * (chi2 / n).ln() + n + 2.0 } else { chi2 }
        };
        larger.iter().enumerate().map(of_file).sum::<f64>() + self.cost(node)
    }

    /// chi2 with one effect more than some models, or with two more than the base, to first order, and what is paid for less: mostly
    /// less than it will be.
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
