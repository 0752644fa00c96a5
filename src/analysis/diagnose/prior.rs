//! What is believed of a parameter before the data: normal in the value, or in its logarithm if only its size is unknown.
//!
//! Widths are those of ignorance within reason, set once: a species' density is known to a factor of 4, a time to one of 7, a power
//! or a factor to 50 %, a fraction to 0.4, a temperature to 5 K; of an amplitude only that it may be hundreds of times weaker or
//! stronger than a visible one; what nature is known to scatter by is in the effect's own key. A parameter that data determine to a
//! relative error r costs 2 ln(width/r) in −2 ln Z; a width twice as large costs 1.4 more.

use toml::{Table, Value};

use crate::analysis::fit::parameter::Parameter;

// Standard deviations of logarithms. With all four twice or half as large, the verdicts and effects of the eight practice cases are the same
// (`cargo run --release --example corpus`, measured on bdabd09): a width twice as large costs 1.4.

/// Of a density: a factor of 4.5.
const DENSITY_LN: f64 = 1.5;

/// Of a time: a factor of 7.4. Trials of release times (`extra_species.rs`) span a factor of 1000 or more, 1.7 of these to either side.
const TIME_LN: f64 = 2.0;

/// Of a power or a factor about the mission's: 1.65, from 0.3 to 0.8 about a well fill power of 0.5.
const POWER_LN: f64 = 0.5;

/// Of a strength that may be any: a factor of 12; two of these reach from a trial to 150 times its strength, or to a 150th.
const SIZE_LN: f64 = 2.5;

/// Standard deviations of values.
const FRACTION: f64 = 0.4;
const KELVIN: f64 = 5.0;

/// A phase is uniform over a period: this normal width, in periods, has the same density at its mean.
const PHASE: f64 = 0.399;

/// Strengths in trials are weak, so that the first order holds: typical ones are larger by this factor.
const TYPICAL: f64 = 3.0;

/// The same for strengths of either sign, as a standard deviation.
const EITHER_SIGN: f64 = 10.0;

/// Smallest strength in a fit, over that of a trial.
const LEAST: f64 = 1e-5;

/// A normal prior, and the bounds of the parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prior {
    /// Whether mean, width and bounds are those of the logarithm.
    is_log: bool,
    /// Whether all values are as probable as the mean.
    is_flat: bool,
    pub mean: f64,
    pub width: f64,
    low: f64,
    high: f64,
}

impl Prior {
    /// Of a key of the mission that is free, at its value there.
    pub fn of_key(parameter: &Parameter) -> Prior {
        let (start, low, high) = (parameter.start, parameter.low, parameter.high);
        if parameter.is_log() && start > 0.0 {
            let width = match parameter.unit {
                "ms" | "yr" => TIME_LN,
                "" => POWER_LN,
                _ => DENSITY_LN,
            };
            return Prior::log(start, width, LEAST * start, high);
        }
        let width = match parameter.unit {
            "K" => KELVIN,
            _ if low >= 0.0 && high <= 1.0 => FRACTION,
            _ => EITHER_SIGN * if start == 0.0 { 1.0 } else { start.abs() },
        };
        Prior { is_log: false, is_flat: false, mean: start, width, low, high }
    }

    /// Of a parameter of an effect, from its values in a trial and without the effect. The table of the trial says whether it is the
    /// only one.
    pub fn of_effect(parameter: &Parameter, name: &str, trial: &Table, nothing: &Table) -> Prior {
        let (low, high) = (parameter.low, parameter.high);
        let value = parameter.start;
        let without = number(nothing, name);
        let is_alone = trial.values().filter(|value| value.is_float()).count() == 1;
        let linear = |mean: f64, width: f64| Prior { is_log: false, is_flat: false, mean, width, low, high };
        if let Some(scatter) = parameter.scatter {
            let mean = without.unwrap_or(value);
            return linear(mean, scatter * mean);
        }
        if let (Some(period_yr), "yr" | "(decimal year)", false) =
            (number(trial, "period_yr"), parameter.unit, parameter.is_log())
        {
            return Prior { is_flat: true, ..linear(value, PHASE * period_yr) };
        }
        if parameter.is_log() {
            let width = match parameter.unit {
                "ms" | "yr" => TIME_LN,
                "" if is_alone => POWER_LN,
                _ => DENSITY_LN,
            };
            let mean = without.filter(|without| is_alone && without.is_finite() && *without > 0.0).unwrap_or(value);
            return Prior::log(mean, width, LEAST * value, high);
        }
        match parameter.unit {
            "K" => linear(without.unwrap_or(0.0), KELVIN),
            _ if low >= 0.0 && high <= 1.0 => linear(without.unwrap_or(0.0), FRACTION),
            _ if low >= 0.0 && without.is_none_or(|without| without == 0.0) && value > 0.0 => {
                Prior::log(TYPICAL * value, SIZE_LN, LEAST * value, high)
            }
            _ => {
                let without = without.unwrap_or(0.0);
                let apart = (value - without).abs();
                linear(without, EITHER_SIGN * if apart == 0.0 { 1.0 } else { apart })
            }
        }
    }

    fn log(mean: f64, width: f64, low: f64, high: f64) -> Prior {
        Prior { is_log: true, is_flat: false, mean: mean.ln(), width, low: low.ln(), high: high.ln() }
    }

    /// The coordinate of a value in which the prior is normal, within the bounds.
    pub fn coordinate(&self, value: f64) -> f64 {
        let coordinate = if self.is_log { value.max(f64::MIN_POSITIVE).ln() } else { value };
        coordinate.clamp(self.low, self.high)
    }

    /// The value at a coordinate.
    pub fn value(&self, coordinate: f64) -> f64 {
        if self.is_log { coordinate.exp() } else { coordinate }
    }

    /// Whether it is known by its size.
    pub fn is_size(&self) -> bool {
        self.is_log
    }

    /// A coordinate within the bounds.
    pub fn clamp(&self, coordinate: f64) -> f64 {
        coordinate.clamp(self.low, self.high)
    }

    /// Whether a coordinate is at a bound, and a step would lead beyond.
    pub fn is_stopped(&self, coordinate: f64, step: f64) -> bool {
        (coordinate <= self.low && step < 0.0) || (coordinate >= self.high && step > 0.0)
    }

    /// −2 ln of the prior at a coordinate over its maximum.
    pub fn cost(&self, coordinate: f64) -> f64 {
        if self.is_flat { 0.0 } else { ((coordinate - self.mean) / self.width).powi(2) }
    }

    /// From a coordinate to where the prior draws it.
    pub fn pull(&self, coordinate: f64) -> f64 {
        if self.is_flat { 0.0 } else { self.mean - coordinate }
    }

    /// A step for derivatives, towards the middle: a thousandth of the logarithm, or of a typical size.
    pub fn step(&self, coordinate: f64) -> f64 {
        let size =
            if self.is_log { 1.0 } else { (0.1 * self.width).max((coordinate - self.mean).abs().min(self.width)) };
        let step = 2e-3 * size;
        if coordinate + step > self.high { -step } else { step }
    }

    /// The largest step of a fit.
    pub fn longest(&self) -> f64 {
        if self.is_log { 1.5 } else { 2.0 * self.width }
    }
}

/// A number of an effect's table by its path in it, such as `time_yr` or `traps.slow.density_per_px`.
pub(super) fn number(table: &Table, path: &str) -> Option<f64> {
    let Some((array, rest)) = path.split_once('.') else {
        return table.get(path).and_then(|value| value.as_float().or(value.as_integer().map(|value| value as f64)));
    };
    let (member, name) = rest.rsplit_once('.')?;
    let mut members = table.get(array)?.as_array()?.iter().filter_map(Value::as_table);
    let found = members.find(|table| table.get("name").and_then(Value::as_str) == Some(member));
    found.and_then(|table| number(table, name))
}
