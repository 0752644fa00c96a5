//! The remaining residuals as a formula: a starting point for the user's own hypothesis.

use nalgebra::{DMatrix, DVector};

use super::result::{Covariate, Suggestion};
use crate::analysis::validate::{SetResult, Validation};
use crate::numeric::least_squares::Span;
use crate::physics::observable::Observable;

/// Share of a power of a covariate beyond the span of the lower ones, below which it is linearly dependent.
const FLAT: f64 = 1e-10;

/// Names of a formula's parameters.
pub(super) const NAMES: [&str; 3] = ["a", "b", "c"];

/// What a formula changes, and how.
#[derive(Clone, Copy)]
struct Form {
    /// The values of one observable; None for all of them.
    of: Option<Observable>,
    /// Multiplied with the values, or added to them.
    multiplied: bool,
}

/// Forms that make sense: something added has the unit of one observable.
fn forms(validation: &Validation) -> Vec<Form> {
    let mut observables: Vec<Observable> = validation.sets.iter().map(|set| set.data.observable).collect();
    observables.sort_by_key(|observable| *observable as usize);
    observables.dedup();
    let all = Form { of: None, multiplied: true };
    let of_one = |of: Option<Observable>| [true, false].map(|multiplied| Form { of, multiplied });
    match &observables[..] {
        [_] => of_one(None).to_vec(),
        several => [all].into_iter().chain(several.iter().flat_map(|one| of_one(Some(*one)))).collect(),
    }
}

/// A parabola in the condition with the strongest residual trend, or a constant if there is no trend. It is added to the values or
/// multiplied with them, of one observable or of all, whichever explains most. None if the residuals trend with words alone.
pub(super) fn suggest(validation: &Validation, covariates: &[Covariate]) -> Option<Suggestion> {
    let words = |name: &str| validation.sets.iter().any(|set| set.data.is_words(name));
    let covariate = covariates.iter().find(|covariate| !words(&covariate.name));
    if covariate.is_none() && !covariates.is_empty() {
        return None;
    }
    let powers = if covariate.is_some() { 3 } else { 1 };
    let residuals = validation.sets.iter().flat_map(|set| set.off_sigma());
    let residuals = DVector::from_vec(residuals.collect());
    let explained = |form: Form| {
        let columns = validation.sets.iter().flat_map(|set| columns(set, form, covariate, powers));
        let columns = DMatrix::from_row_iterator(residuals.len(), powers, columns);
        let found = Span::of(&columns, FLAT).solve(&residuals);
        (form, (&residuals - columns * &found).norm_squared(), found)
    };
    let all = forms(validation).into_iter().map(explained);
    let (form, chi2, found) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let parts = covariate.map_or_else(|| "a".into(), |Covariate { name, .. }| format!("a + b * {name} + c * {name}^2"));
    let expression = if form.multiplied { format!("value * (1 + {parts})") } else { format!("value + {parts}") };
    let target = form.of.map_or_else(|| "value".into(), |of| format!("value.{}", of.name()));
    let toml = table(&target, &expression, found.as_slice());
    Some(Suggestion { toml, chi2: [residuals.norm_squared(), chi2], is_law: false, is_fitted: false, step_yr: None })
}

/// `[effects.formula]` as it would be written in a mission, with the values of the parameters [`NAMES`].
pub(super) fn table(target: &str, expression: &str, values: &[f64]) -> String {
    let head = format!("[effects.formula]\ntarget = \"{target}\"\nexpression = \"{expression}\"\n");
    let lines = NAMES.iter().zip(values).map(|(name, value)| format!("{name} = {value:.6e}\n"));
    std::iter::once(head).chain(lines).collect()
}

/// Changes of the rows of a data set (consecutive, in sigma) with each power of a form.
fn columns(set: &SetResult, form: Form, covariate: Option<&Covariate>, powers: usize) -> Vec<f64> {
    let places =
        covariate.map_or_else(|| vec![0.0; set.data.rows.len()], |covariate| set.data.against(&covariate.name));
    let concerned = form.of.is_none_or(|observable| observable == set.data.observable);
    let of_row = |(row, place): (usize, f64)| {
        let size = if form.multiplied { set.model[row] } else { 1.0 } / set.data.rows[row].sigma;
        let power =
            move |power: usize| if concerned && place.is_finite() { size * place.powi(power as i32) } else { 0.0 };
        (0..powers).map(power).collect::<Vec<_>>()
    };
    places.into_iter().enumerate().flat_map(of_row).collect()
}
