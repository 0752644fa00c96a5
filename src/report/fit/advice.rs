//! Parameters that the data do not determine, in words.

use std::fmt;

use serde::ser::{Serialize, Serializer};

use super::to_two_digits;
use crate::analysis::fit::{Advice, Combination, Term};
use crate::mission::keys::plain;
use crate::report::listed;
use crate::report::validate::significant;

impl fmt::Display for Advice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Advice::Unconstrained { key } => {
                write!(out, "{key}: unconstrained, the data are insensitive to it; hold it fixed")
            }
            Advice::PoorlyConstrained { key, relative } => {
                write!(out, "{key}: poorly constrained, its error is {relative:.1} times its value")
            }
            Advice::Degenerate { keys, combinations } => {
                let combinations: Vec<String> = combinations.iter().map(in_words).collect();
                let several = if combinations.len() == 1 { "combination is" } else { "combinations are" };
                write!(
                    out,
                    "{}: degenerate, only their {several} constrained: {}; hold one of them fixed",
                    keys.join(", "),
                    combinations.join(", ")
                )
            }
            Advice::Correlated { keys, correlation } => write!(
                out,
                "{} and {}: correlated ({correlation:+.3}); only their combination is constrained",
                keys[0], keys[1]
            ),
            Advice::DependsOn { key, held, values, found, rise } => write!(
                out,
                "{key}: {} with {held} = {}, but {} with {} (chi2 {rise:+.1}); only a combination of the two is constrained",
                significant(found[0]),
                significant(values[0]),
                significant(found[1]),
                significant(values[1])
            ),
            Advice::AtBound { key, bound } => write!(out, "{key}: at its bound, {}", plain(*bound)),
            Advice::Open { key, above, value, unit, rise } => {
                let limit = if *above { "a lower" } else { "an upper" };
                let at = [significant(*value), unit.to_string()].join(" ");
                let at = at.trim_end();
                write!(out, "{key}: the data set {limit} limit only; at {at} chi2 is larger by just {rise:.1}")
            }
            Advice::Undetermined { key, between: [low, high], unit, rise } => {
                let range = [significant(*low), "to".into(), significant(*high), unit.to_string()].join(" ");
                write!(out, "{key}: not determined; from {} chi2 rises by at most {rise:.1}", range.trim_end())
            }
            Advice::Unsettled { fits, change } => write!(
                out,
                "errors of conditions depend on the values above: after {fits} fits, each with the errors of the one before, chi2 still \
                 changed by {change:+.2}; fit again from these values"
            ),
            Advice::Exchanged { keys } => write!(
                out,
                "{}: the species have exchanged the order of their release times, and names and energy levels have stayed; in the order that was \
                 given, chi2 is higher",
                listed(keys)
            ),
            Advice::Assumed { key, value } => {
                write!(out, "{key}: assumed, not fitted; the values above hold with {}", plain(*value))
            }
        }
    }
}

/// `first - 0.5 x second = 1.20 +- 0.03 yr`.
fn in_words(combination: &Combination) -> String {
    let mut said = String::new();
    for (place, Term { key, factor }) in combination.terms.iter().enumerate() {
        let sign = if *factor < 0.0 { " - " } else { " + " };
        match place {
            0 => said.push_str(key),
            _ => said.push_str(&format!("{sign}{} x {key}", significant(factor.abs()))),
        }
    }
    let (value, error) = to_two_digits(combination.value, combination.sigma);
    format!("{said} = {value} +- {error} {}", combination.unit).trim_end().to_string()
}

/// In text form.
impl Serialize for Advice {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}
