//! Deviations of the inputs of draws and a quantity of each → shares of its variance.
//!
//! ```text
//! y = β₀ + Σ βᵢ zᵢ + rest        share i = βᵢ²/(Σ β² + var(rest))
//! ```
//!
//! Squared standardised regression coefficients of independent inputs (Saltelli et al. 2008, Global Sensitivity Analysis).

use nalgebra::{DMatrix, DVector};

use crate::numeric::least_squares::Span;

/// A quantity, and the deviations (in σ) that made it, of some draws.
pub struct Explained<'a>(Vec<(&'a [f64], f64)>);

impl<'a> Explained<'a> {
    /// Of the draws that have a value.
    pub fn of(draws: impl Iterator<Item = (&'a [f64], Option<f64>)>) -> Explained<'a> {
        Explained(draws.filter_map(|(deviations, value)| Some((deviations, value?))).collect())
    }

    /// Standard deviation of the quantity; not a number of fewer than two.
    pub fn sigma(&self) -> f64 {
        let n = self.0.len() as f64;
        let mean = self.0.iter().map(|(_, value)| value).sum::<f64>() / n;
        (self.0.iter().map(|(_, value)| (value - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
    }

    /// Shares of the variance of each input, and what is left. None where there are too few, or nothing varies.
    pub fn shares(&self) -> Option<Vec<f64>> {
        let inputs = self.0.first()?.0.len();
        if inputs == 0 || self.0.len() < 2 * (inputs + 1) {
            return None;
        }
        let design = DMatrix::from_fn(self.0.len(), inputs + 1, |row, column| match column {
            0 => 1.0,
            column => self.0[row].0[column - 1],
        });
        let values = DVector::from_iterator(self.0.len(), self.0.iter().map(|(_, value)| *value));
        let found = Span::of(&design, 1e-9).solve(&values);
        let rest = (&values - design * &found).norm_squared() / (self.0.len() - inputs - 1) as f64;
        let mut parts: Vec<f64> = found.iter().skip(1).map(|slope| slope * slope).collect();
        parts.push(rest);
        let total: f64 = parts.iter().sum();
        (total > 0.0).then(|| parts.iter().map(|part| part / total).collect())
    }
}
