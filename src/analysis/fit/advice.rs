//! Parameters that the data do not determine.

use super::parameter::Parameter;
use super::result::{Advice, Fitted};

/// Correlation above which two parameters are reported as degenerate.
const TRADED_OFF: f64 = 0.95;

/// Error over value below which a parameter is determined by itself, in spite of a correlation.
const KNOWN: f64 = 0.05;

/// Advice on all parameters, the worst first.
pub(super) fn on(
    parameters: &[Parameter],
    fitted: &[Fitted],
    correlation: &[Vec<f64>],
    flat: &[Vec<f64>],
) -> Vec<Advice> {
    let mut advice = Vec::new();
    let key = |index: usize| parameters[index].key.clone();
    for direction in flat {
        let mut members: Vec<usize> = (0..direction.len()).filter(|&index| direction[index].abs() > 0.1).collect();
        members.sort_by(|a, b| direction[*b].abs().total_cmp(&direction[*a].abs()));
        advice.push(Advice::Degenerate { keys: members.into_iter().map(key).collect() });
    }
    let in_flat = |index: usize| flat.iter().any(|direction| direction[index].abs() > 0.01);
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
    for (a, row) in correlation.iter().enumerate() {
        for (b, &correlation) in row.iter().enumerate().skip(a + 1) {
            if correlation.abs() > TRADED_OFF && !(in_flat(a) && in_flat(b)) && !(is_known(a) && is_known(b)) {
                advice.push(Advice::Correlated { keys: [key(a), key(b)], correlation });
            }
        }
    }
    advice
}
