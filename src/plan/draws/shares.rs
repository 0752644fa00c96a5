//! Deviations of the inputs of draws, and a quantity of each draw → shares of its variance.
//!
//! ```text
//! y = β₀ + Σ βᵢ zᵢ + rest        share i = βᵢ² var(zᵢ)/(Σ β² var(z) + var(rest))
//! ```
//!
//! The variance of a deviation is 1 by the distribution from which it is drawn. That of the Sun is known only from the draws, with
//! the uncertainty of their number. The keys of a posterior are correlated, so they have one share, the variance of their sum β z.
//!
//! Squared standardised regression coefficients of independent inputs (Saltelli et al. 2008, Global Sensitivity Analysis).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::numeric::least_squares::Span;

/// A quantity of some draws, and their deviations (in σ).
pub struct Explained<'a> {
    draws: Vec<(&'a [f64], f64)>,
    /// The deviations that are those of a posterior.
    of_posterior: Range<usize>,
    /// Whether the last of the deviations is that of the Sun.
    sun_is_last: bool,
}

impl<'a> Explained<'a> {
    /// From the draws that have a value.
    pub fn of(
        draws: impl Iterator<Item = (&'a [f64], Option<f64>)>,
        of_posterior: Range<usize>,
        sun_is_last: bool,
    ) -> Explained<'a> {
        let draws = draws.filter_map(|(deviations, value)| Some((deviations, value?))).collect();
        Explained { draws, of_posterior, sun_is_last }
    }

    /// Standard deviation of the quantity; NaN for fewer than two.
    pub fn sigma(&self) -> f64 {
        variance(self.draws.iter().map(|(_, value)| *value)).sqrt()
    }

    /// Shares of the variance for each input, the posterior as one, and the rest. None if there are too few draws, or nothing
    /// varies.
    pub fn shares(&self) -> Option<Vec<f64>> {
        let inputs = self.draws.first()?.0.len();
        if inputs == 0 || self.draws.len() < 2 * (inputs + 1) {
            return None;
        }
        let design = DMatrix::from_fn(self.draws.len(), inputs + 1, |row, column| match column {
            0 => 1.0,
            column => self.draws[row].0[column - 1],
        });
        let values = DVector::from_iterator(self.draws.len(), self.draws.iter().map(|(_, value)| *value));
        let found = Span::of(&design, 1e-9).solve(&values);
        let rest = (&values - design * &found).norm_squared() / (self.draws.len() - inputs - 1) as f64;
        let slopes: Vec<f64> = found.iter().skip(1).copied().collect();
        let joint = |deviations: &[f64]| self.of_posterior.clone().map(|input| slopes[input] * deviations[input]).sum();
        let of_posterior: f64 = variance(self.draws.iter().map(|(deviations, _)| joint(deviations)));
        let mut parts: Vec<f64> = slopes.iter().map(|slope| slope * slope).collect();
        if let Some(sun) = parts.last_mut().filter(|_| self.sun_is_last) {
            *sun *= variance(self.draws.iter().map(|(deviations, _)| deviations[inputs - 1]));
        }
        if !self.of_posterior.is_empty() {
            parts.splice(self.of_posterior.clone(), [of_posterior]);
        }
        parts.push(rest);
        let total: f64 = parts.iter().sum();
        (total > 0.0).then(|| parts.iter().map(|part| part / total).collect())
    }
}

fn variance(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    values.map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0)
}
