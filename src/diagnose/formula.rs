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
    /// The condition or covariate.
    pub name: String,
    /// `[effects.formula]`, ready for a mission or for `--candidates`.
    pub toml: String,
    /// chi2 before, and with it to first order.
    pub chi2: [f64; 2],
}

/// A parabola in the condition that residuals lean on most, added to the values or multiplied with them, whichever explains
/// more.
pub(super) fn suggest(validation: &Validation, covariates: &[Leaning]) -> Option<Suggestion> {
    let words = |name: &str| validation.sets.iter().any(|set| set.data.is_words(name));
    let leaning = covariates.iter().find(|leaning| !words(&leaning.name))?;
    let name = &leaning.name;
    let (mut residuals, mut at, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for set in &validation.sets {
        for (row, place) in set.data.against(name).into_iter().enumerate() {
            let measured = &set.data.rows[row];
            let known = place.is_finite();
            residuals.push((measured.value - set.model[row]) / measured.sigma);
            at.push(if known { place } else { 0.0 });
            values.push(if known { [1.0 / measured.sigma, set.model[row] / measured.sigma] } else { [0.0, 0.0] });
        }
    }
    let residuals = DVector::from_vec(residuals);
    let explained = |which: usize| {
        let columns = DMatrix::from_fn(at.len(), 3, |row, power| values[row][which] * at[row].powi(power as i32));
        let found = Span::of(&columns, FLAT).solve(&residuals);
        ((&residuals - columns * &found).norm_squared(), [found[0], found[1], found[2]])
    };
    let (sum, product) = (explained(0), explained(1));
    let before = residuals.norm_squared();
    let (chi2, [a, b, c], expression) = if product.0 <= sum.0 {
        (product.0, product.1, format!("value * (1 + a + b * {name} + c * {name}^2)"))
    } else {
        (sum.0, sum.1, format!("value + a + b * {name} + c * {name}^2"))
    };
    let toml = format!(
        "[effects.formula]\ntarget = \"value\"\nexpression = \"{expression}\"\na = {a:.6e}\nb = {b:.6e}\nc = {c:.6e}\n"
    );
    Some(Suggestion { name: name.clone(), toml, chi2: [before, chi2] })
}
