//! Ranges of axes, and positions of numbers and grid lines.

use super::font::length;
use super::pen::SMALL;

/// Maximum number of labels on an axis: fewer if they do not fit, but not less than the minimum.
const MOST: usize = 8;
const MOST_LEAST: usize = 3;
/// Largest value shown; its inverse is the smallest on a logarithmic axis. Sums of such values are still far from overflow.
const LARGEST: f64 = 1e250;

/// One axis; `low` and `high` are logarithms if it is logarithmic.
#[derive(Clone, Debug)]
pub struct Axis {
    log: bool,
    /// Whether its values are counts, which have no fractions.
    counts: bool,
    low: f64,
    high: f64,
    ticks: Vec<f64>,
    labels: Vec<String>,
    /// Values of thinner grid lines.
    pub minor: Vec<f64>,
}

impl Axis {
    /// An axis that includes all values it can show, with as many labels as fit, given their count and their width.
    pub fn new(values: impl Iterator<Item = f64>, log: bool, counts: bool, fits: impl Fn(f64, f64) -> bool) -> Axis {
        let mut axis = Axis { log, counts, low: 0.0, high: 1.0, ticks: vec![], labels: vec![], minor: vec![] };
        let (low, high) = values
            .filter(|value| axis.shows(*value))
            .map(|value| if log { value.log10() } else { value })
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if low <= high {
            let margin = margin(low, high, log);
            (axis.low, axis.high) = (low - margin, high + margin);
        }
        for most in (MOST_LEAST..=MOST).rev() {
            axis.number(most);
            if fits(axis.labels.len() as f64, axis.width()) {
                break;
            }
        }
        axis
    }

    /// Width of the widest label, px.
    pub fn width(&self) -> f64 {
        self.labels.iter().map(|label| length(label, SMALL)).fold(0.0, f64::max)
    }

    /// Whether a value can be shown.
    pub fn shows(&self, value: f64) -> bool {
        value.abs() <= LARGEST && (!self.log || value >= 1.0 / LARGEST)
    }

    /// Position of a value between the ends of the axis, 0 to 1. Values beyond the ends are clamped.
    pub fn place(&self, value: f64) -> f64 {
        let value = if self.log { value.max(0.0).log10() } else { value };
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// Values with labels, and the labels.
    pub fn numbers(&self) -> impl Iterator<Item = (f64, &str)> {
        self.ticks.iter().copied().zip(self.labels.iter().map(String::as_str))
    }

    /// Sets about `most` labels.
    fn number(&mut self, most: usize) {
        // 1, 2, 5 are too few within a decade.
        if self.log && self.high - self.low >= 1.0 {
            (self.ticks, self.minor) = decades(self.low, self.high, most);
            self.labels = labels(&self.ticks, false);
        } else {
            let value = |place: f64| if self.log { 10f64.powf(place) } else { place };
            self.ticks = steps(value(self.low), value(self.high), most, self.counts);
            self.labels = labels(&self.ticks, true);
        }
    }
}

/// Space between the outermost values and the ends of their axis.
fn margin(low: f64, high: f64, log: bool) -> f64 {
    let size = low.abs().max(high.abs());
    let (least, alone) = if log { (0.05, 0.3) } else { (1e-9 * size, 0.12 * size) };
    if high - low > least.max(1.0 / LARGEST) {
        0.04 * (high - low)
    } else if alone > 1.0 / LARGEST {
        alone
    } else {
        1.0
    }
}

/// At most about `most` multiples of 1, 2 or 5 times a power of ten. Parsed from text, they are the floats closest to the decimals,
/// and need no more digits when printed.
fn steps(low: f64, high: f64, most: usize, counts: bool) -> Vec<f64> {
    let least = ((high - low) / most as f64).max(if counts { 1.0 } else { 0.0 });
    let exponent = least.log10().floor() as i32;
    let unit = 10f64.powi(exponent);
    let step = [1, 2, 5].into_iter().find(|step| f64::from(*step) * unit >= least).unwrap_or(10);
    let first = (low / (f64::from(step) * unit)).ceil() as i64;
    let last = (high / (f64::from(step) * unit)).floor() as i64;
    (first..=last)
        .take(2 * most)
        .filter_map(|index| format!("{}e{exponent}", index * i64::from(step)).parse().ok())
        .collect()
}

/// Labels on a logarithmic axis, at most `most`: 1, 2, 5 in each decade, or powers of ten; and thinner grid lines.
fn decades(low: f64, high: f64, most: usize) -> (Vec<f64>, Vec<f64>) {
    let values = |digits: &[i32], every: i32| -> Vec<f64> {
        (low.floor() as i32..=high.ceil() as i32)
            .filter(|decade| decade % every == 0)
            .flat_map(|decade| digits.iter().filter_map(move |digit| format!("{digit}e{decade}").parse().ok()))
            .filter(|value: &f64| (low..=high).contains(&value.log10()))
            .collect()
    };
    let ticks = [values(&[1, 2, 5], 1)].into_iter().chain((1..).map(|every| values(&[1], every)));
    let minor = if high - low < 12.0 { values(&[1, 2, 3, 4, 5, 6, 7, 8, 9], 1) } else { values(&[1], 1) };
    (ticks.into_iter().find(|ticks| ticks.len() <= most).unwrap_or_default(), minor)
}

/// Numbers as text, with exponents if all are small or one is large. On a linear axis all have the same number of decimals.
fn labels(values: &[f64], even: bool) -> Vec<String> {
    let sizes = || values.iter().map(|value| value.abs());
    let largest = sizes().fold(0.0, f64::max);
    let smallest = if even { largest } else { sizes().fold(largest, f64::min) };
    let exponents = largest >= 1e5 || smallest < 1e-3;
    let last = values.iter().filter(|value| **value != 0.0).map(|value| parts(*value).1).max().unwrap_or(0);
    let label = |value: &f64| match (exponents, even) {
        (true, _) if *value == 0.0 => "0".into(),
        (true, true) => format!("{value:.*e}", (last + parts(*value).0).max(0) as usize),
        (true, false) => format!("{value:e}"),
        (false, true) => format!("{value:.*}", last.max(0) as usize),
        (false, false) => value.to_string(),
    };
    values.iter().map(label).collect()
}

/// A number's exponent, and the decimals it needs when printed without one.
fn parts(value: f64) -> (i32, i32) {
    let text = format!("{value:e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent = exponent.parse().unwrap_or(0);
    (exponent, digits.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32) - exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(values: &[f64], log: bool) -> Vec<String> {
        Axis::new(values.iter().copied(), log, false, |_, _| true).labels
    }

    #[test]
    fn counts_have_no_fractions() {
        let counted = |values: &[f64]| Axis::new(values.iter().copied(), false, true, |_, _| true).labels;
        assert_eq!(counted(&[0.0, 1.0]), ["0", "1"]);
        assert_eq!(counted(&[0.0, 3.0]), ["0", "1", "2", "3"]);
        assert_eq!(counted(&[0.0, 40.0]), ["0", "10", "20", "30", "40"]);
    }

    #[test]
    fn numbers_are_readable() {
        assert_eq!(labels(&[0.0, 1.0], false), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(&[2024.0, 2030.0], false), ["2024", "2025", "2026", "2027", "2028", "2029", "2030"]);
        assert_eq!(labels(&[0.0, 2e-4], false), ["0", "5e-5", "1.0e-4", "1.5e-4", "2.0e-4"]);
        assert_eq!(labels(&[-2e6, 1e6], false), ["-2.0e6", "-1.5e6", "-1.0e6", "-5e5", "0", "5e5", "1.0e6"]);
        assert_eq!(labels(&[0.0, 1e200], false), ["0", "2e199", "4e199", "6e199", "8e199", "1.0e200"]);
        assert_eq!(labels(&[1e-6, 1e-3], true), ["1e-6", "1e-5", "1e-4", "1e-3"]);
        assert_eq!(labels(&[-1.0, 0.0, 1.0, 40.0], true), ["1", "2", "5", "10", "20"]);
    }

    #[test]
    fn one_value_or_none_still_has_an_axis() {
        for (values, log) in [(&[][..], false), (&[], true), (&[0.0], false), (&[0.0], true), (&[3e-9], true)] {
            let axis = Axis::new(values.iter().copied(), log, false, |_, _| false);
            assert!(axis.low < axis.high && axis.labels.len() >= 2, "{values:?} {log}: {axis:?}");
        }
    }
}
