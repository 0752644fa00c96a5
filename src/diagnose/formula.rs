//! What is left, as a formula: the start of a hypothesis of the user's own.

use nalgebra::{DMatrix, DVector};

use super::Leaning;
use crate::least_squares::Span;
use crate::validate::Validation;

/// Part of a power of a covariate that lower ones leave, below which it is none.
const FLAT: f64 = 1e-10;

/// An effect that would describe what residuals lean on. It says nothing of the cause.
#[derive(Clone, Debug)]
pub struct Suggestion {
    /// `[effects.formula]`, ready for a mission or for `--candidates`.
    pub toml: String,
    /// chi2 before, and with it to first order.
    pub chi2: [f64; 2],
}

/// A parabola in the condition that residuals lean on most, or a constant where they lean on none, added to the values or
/// multiplied with them, whichever explains more. None where they lean on words alone.
pub(super) fn suggest(validation: &Validation, covariates: &[Leaning]) -> Option<Suggestion> {
    let words = |name: &str| validation.sets.iter().any(|set| set.data.is_words(name));
    let leaning = covariates.iter().find(|leaning| !words(&leaning.name));
    if leaning.is_none() && !covariates.is_empty() {
        return None;
    }
    let powers = if leaning.is_some() { 3 } else { 1 };
    let (mut residuals, mut at, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for set in &validation.sets {
        let places = leaning.map_or_else(|| vec![0.0; set.data.rows.len()], |leaning| set.data.against(&leaning.name));
        for (row, place) in places.into_iter().enumerate() {
            let measured = &set.data.rows[row];
            let known = place.is_finite();
            residuals.push((measured.value - set.model[row]) / measured.sigma);
            at.push(if known { place } else { 0.0 });
            values.push(if known { [1.0 / measured.sigma, set.model[row] / measured.sigma] } else { [0.0, 0.0] });
        }
    }
    let residuals = DVector::from_vec(residuals);
    let explained = |which: usize| {
        let power = |row: usize, power: usize| values[row][which] * at[row].powi(power as i32);
        let columns = DMatrix::from_fn(at.len(), powers, power);
        let found = Span::of(&columns, FLAT).solve(&residuals);
        ((&residuals - columns * &found).norm_squared(), found)
    };
    let (sum, product) = (explained(0), explained(1));
    let before = residuals.norm_squared();
    let parts = leaning.map_or_else(|| "a".into(), |Leaning { name, .. }| format!("a + b * {name} + c * {name}^2"));
    let (chi2, found, expression) = if product.0 <= sum.0 {
        (product.0, product.1, format!("value * (1 + {parts})"))
    } else {
        (sum.0, sum.1, format!("value + {parts}"))
    };
    let mut toml = format!("[effects.formula]\ntarget = \"value\"\nexpression = \"{expression}\"\n");
    for (name, value) in ["a", "b", "c"].iter().zip(found.iter()) {
        toml += &format!("{name} = {value:.6e}\n");
    }
    Some(Suggestion { toml, chi2: [before, chi2] })
}
