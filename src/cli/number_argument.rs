//! Numbers in a command line: the message about a value that is refused says what is needed.

use std::fmt::Display;
use std::ops::Bound::{Excluded, Included, Unbounded};
use std::ops::RangeBounds;
use std::str::FromStr;

/// Whole numbers within a range.
pub(super) fn whole<T>(
    range: impl RangeBounds<T> + Clone + Send + Sync + 'static,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + Display,
{
    move |text| text.trim().parse().ok().filter(|value| range.contains(value)).ok_or_else(|| needed(&range))
}

/// What [`whole`] asks for.
fn needed<T: Display>(range: &impl RangeBounds<T>) -> String {
    let from = match range.start_bound() {
        Included(least) | Excluded(least) => least.to_string(),
        Unbounded => "0".into(),
    };
    match range.end_bound() {
        Included(most) | Excluded(most) => format!("a whole number from {from} to {most} is needed"),
        Unbounded => format!("a whole number, {from} or more, is needed"),
    }
}

/// A number that is allowed; `needed` says which are.
pub(super) fn number(text: &str, allowed: impl Fn(f64) -> bool, needed: &str) -> Result<f64, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite() && allowed(*value))
        .ok_or_else(|| needed.to_string())
}

/// A number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text, |value| value > 0.0, "a number above 0 is needed")
}

/// A number, 0 or more.
pub(super) fn at_least_0(text: &str) -> Result<f64, String> {
    number(text, |value| value >= 0.0, "a number, 0 or more, is needed")
}

/// Any number.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    number(text, |_| true, "a number is needed")
}

/// A probability; that of a certain event is not among them.
pub(super) fn probability(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value < 1.0 => Ok(value),
        Ok(value) if (1.0..=100.0).contains(&value) => {
            Err(format!("a number above 0 and below 1 is needed; {value} % is {}", value / 100.0))
        }
        _ => Err("a number above 0 and below 1 is needed".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_number_outside_its_range_is_refused_in_words() {
        assert_eq!(whole(2..=10_u32)(" 10"), Ok(10));
        assert_eq!(whole(1_u64..)("18446744073709551615"), Ok(u64::MAX));
        for text in ["1", "11", "-3", "2.0", "", "many"] {
            assert_eq!(whole(2..=10_u32)(text), Err("a whole number from 2 to 10 is needed".into()), "{text}");
        }
        assert_eq!(whole(1_u32..)("0"), Err("a whole number, 1 or more, is needed".into()));
        assert_eq!(whole(..=5_u32)("6"), Err("a whole number from 0 to 5 is needed".into()));
    }
}
