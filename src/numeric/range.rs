//! Ranges of numbers and of dates: equal steps, equal ratios, whole months.
//!
//! A value is computed from the first one and its number, never from its neighbour, so that errors do not add up and a month that is
//! too short for a day does not shorten the months after it. Numbers are rounded to the decimals of what was written: 0.1 and two
//! steps of 0.1 are 0.3, not 0.30000000000000004.

use chrono::{Months, NaiveDate};

/// Significant digits of values that divide a range. The double nearest to a decimal number of up to 15 digits prints as that number;
/// one digit less is above the rounding of a power, 3e-15 for ratios of 1e12.
const DIGITS: i32 = 14;

/// `from`, `from + step`, ..., not beyond `to`; `None` if `step` does not lead from one to the other in fewer than `most` steps.
pub fn by_step(from: f64, to: f64, step: f64, most: usize) -> Option<Vec<f64>> {
    let steps = (to - from) / step;
    if !(0.0..most as f64).contains(&steps) {
        return None;
    }
    let decimals = decimals(from).max(decimals(step));
    let value = |k: usize| if k == 0 { from } else { rounded(from + k as f64 * step, decimals) };
    let within = |value: &f64| if step > 0.0 { *value <= to } else { *value >= to };
    // Rounding may put the quotient on either side of a whole number.
    Some((0..=steps.round() as usize).map(value).filter(within).collect())
}

/// `count` values (2 or more) in equal steps, both ends included.
pub fn equal_steps(from: f64, to: f64, count: usize) -> Vec<f64> {
    let decimals = places(from.abs().max(to.abs()));
    between(from, to, count, |share| rounded(from + share * (to - from), decimals))
}

/// `count` values (2 or more) in equal ratios, both ends included; the ends are above 0.
pub fn equal_ratios(from: f64, to: f64, count: usize) -> Vec<f64> {
    between(from, to, count, |share| {
        let value = from * (to / from).powf(share);
        rounded(value, places(value))
    })
}

/// Every so many months (1 or more) from a day, not beyond another. A month that is too short has its last day.
pub fn by_months(from: NaiveDate, to: NaiveDate, months: u32) -> Vec<NaiveDate> {
    let day = |k: u32| from.checked_add_months(Months::new(months.checked_mul(k)?));
    (0..).map_while(day).take_while(|date| *date <= to).collect()
}

/// Both ends as they are, and `value` at the shares of the range between them.
fn between(from: f64, to: f64, count: usize, value: impl Fn(f64) -> f64) -> Vec<f64> {
    let last = count - 1;
    let at = |k: usize| match k {
        0 => from,
        _ if k == last => to,
        _ => value(k as f64 / last as f64),
    };
    (0..count).map(at).collect()
}

/// Digits behind the point of a number in its shortest form.
fn decimals(number: f64) -> usize {
    number.to_string().split_once('.').map_or(0, |(_, fraction)| fraction.len())
}

/// Digits behind the point that leave [`DIGITS`] significant ones.
fn places(number: f64) -> usize {
    let exponent = if number > 0.0 { number.log10().floor() as i32 } else { 0 };
    usize::try_from(DIGITS - 1 - exponent).unwrap_or(0)
}

fn rounded(number: f64, decimals: usize) -> f64 {
    let rounded: f64 = format!("{number:.decimals$}").parse().expect("a number that was printed");
    // Not −0.
    rounded + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A decimal number: `units` times 10^−`decimals`.
    fn written(units: i64, decimals: usize) -> f64 {
        format!("{units}e-{decimals}").parse().unwrap()
    }

    /// Starts, steps and numbers of steps in units of the last decimal.
    fn many() -> impl Iterator<Item = (i64, i64, i64, usize)> {
        let starts = [-1000, -7, 0, 1, 3, 10, 99, 12_345];
        let steps = [1, 3, 7, 10, 25, 999];
        let counts = [1, 2, 9, 10, 99, 1000];
        starts.into_iter().flat_map(move |start| {
            steps.into_iter().flat_map(move |step| {
                counts.into_iter().flat_map(move |n| [0, 1, 3, 9, 15].map(|decimals| (start, step, n, decimals)))
            })
        })
    }

    #[test]
    fn a_range_by_steps_has_the_decimal_numbers_and_its_last_one() {
        for (start, step, n, decimals) in many() {
            for sign in [1, -1] {
                let of = |k: i64| written(start + sign * k * step, decimals);
                let range = by_step(of(0), of(n), written(sign * step, decimals), 100_000).unwrap();
                let expected: Vec<f64> = (0..=n).map(of).collect();
                assert_eq!(range, expected, "{start} {step} {n} {decimals}");
                assert!(range.iter().zip(&expected).all(|(found, of)| found.to_string() == of.to_string()));
            }
        }
    }

    #[test]
    fn nothing_is_beyond_the_end() {
        for (start, step, n, decimals) in many().filter(|(_, step, _, decimals)| *step > 1 && *decimals < 15) {
            let end = written(start + n * step - 1, decimals);
            let range = by_step(written(start, decimals), end, written(step, decimals), 100_000).unwrap();
            assert_eq!(range.len() as i64, n, "{start} {step} {n} {decimals}");
        }
        assert_eq!(by_step(0.0, 0.999_999_999_9, 0.5, 10), Some(vec![0.0, 0.5]));
        assert_eq!(by_step(0.9, 0.999, 0.001, 100).unwrap().last(), Some(&0.999));
        assert_eq!(by_step(1.0, 2.0, 0.0, 10), None);
        assert_eq!(by_step(2.0, 1.0, 1.0, 10), None);
    }

    #[test]
    fn a_range_by_numbers_has_both_ends_and_short_numbers() {
        for (start, step, n, decimals) in many().filter(|(.., decimals)| *decimals < 10) {
            let of = |k: i64| written(start + k * step, decimals);
            let expected: Vec<f64> = (0..=n).map(of).collect();
            assert_eq!(equal_steps(of(0), of(n), n as usize + 1), expected, "{start} {step} {n} {decimals}");
        }
        for (least, most) in [(-6, 6), (0, 3), (-12, 0), (-3, 300)] {
            let decade = |k: i32| format!("1e{k}").parse::<f64>().unwrap();
            let expected: Vec<f64> = (least..=most).map(decade).collect();
            let found = equal_ratios(decade(least), decade(most), expected.len());
            assert_eq!((found[0], found.last()), (expected[0], expected.last()));
            if most - least < 15 {
                assert_eq!(found, expected);
            }
        }
    }

    #[test]
    fn every_date_is_counted_from_the_first() {
        let day = |text: &str| text.parse::<NaiveDate>().unwrap();
        for first in ["2024-02-29", "2024-01-31", "2023-12-30", "2025-03-15"].map(day) {
            for months in [1, 3, 6, 12, 48] {
                for n in [1_u32, 2, 5, 32] {
                    let of = |k: u32| first.checked_add_months(Months::new(k * months)).unwrap();
                    assert_eq!(by_months(first, of(n), months), (0..=n).map(of).collect::<Vec<_>>());
                }
            }
        }
        assert_eq!(by_months(day("2024-02-29"), day("2032-02-29"), 12)[4], day("2028-02-29"));
    }
}
