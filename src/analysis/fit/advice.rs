//! Parameters that the data do not determine.

use super::errors::{Degeneracy, Errors, Invariant};
use super::parameter::Parameter;
use super::result::{Advice, Combination, Fitted, Term};

/// Correlation above which two parameters are reported as degenerate.
const TRADED_OFF: f64 = 0.95;

/// Error over value below which a parameter is determined by itself, in spite of a correlation.
const KNOWN: f64 = 0.05;

/// Advice on all parameters, the worst first.
pub(super) fn on(parameters: &[Parameter], fitted: &[Fitted], errors: &Errors) -> Vec<Advice> {
    let key = |index: usize| parameters[index].key.clone();
    let mut advice: Vec<Advice> = errors.degenerate.iter().map(|one| degenerate(one, fitted)).collect();
    let in_flat = |index: usize| errors.is_degenerate(index);
    for (index, fitted) in fitted.iter().enumerate() {
        let bound = parameters[index].at_bound(fitted.value);
        if let Some(bound) = bound {
            advice.push(Advice::AtBound { key: key(index), bound });
        }
        match fitted.sigma {
            None if !in_flat(index) && bound.is_none() => advice.push(Advice::Unconstrained { key: key(index) }),
            Some(sigma) if sigma > fitted.value.abs() && bound.is_none() => {
                advice.push(Advice::PoorlyConstrained { key: key(index), relative: sigma / fitted.value.abs() });
            }
            _ => {}
        }
    }
    let is_known = |index: usize| fitted[index].sigma.is_some_and(|sigma| sigma < KNOWN * fitted[index].value.abs());
    for (a, row) in errors.correlation().iter().enumerate() {
        for (b, correlation) in row.iter().enumerate().skip(a + 1) {
            if let Some(correlation) = correlation.filter(|found| found.abs() > TRADED_OFF)
                && !(is_known(a) && is_known(b))
            {
                advice.push(Advice::Correlated { keys: [key(a), key(b)], correlation });
            }
        }
    }
    advice
}

fn degenerate(degeneracy: &Degeneracy, fitted: &[Fitted]) -> Advice {
    let combination = |invariant: &Invariant| Combination {
        terms: invariant.terms.iter().map(|&(index, factor)| Term { key: fitted[index].key.clone(), factor }).collect(),
        value: invariant.terms.iter().map(|(index, factor)| factor * fitted[*index].value).sum(),
        sigma: invariant.sigma,
        unit: fitted[invariant.terms[0].0].unit,
    };
    Advice::Degenerate {
        keys: degeneracy.members.iter().map(|&index| fitted[index].key.clone()).collect(),
        combinations: degeneracy.combinations.iter().map(combination).collect(),
    }
}
