//! A key that a fit may change: its bounds, and the coordinate without bounds.
//!
//! | values allowed | inner coordinate u | |
//! |---|---|---|
//! | above 0 | ln x | |
//! | from a on | x = a − s + √(u² + s²) | s: size of the starting value |
//! | from a to b | x = a + (b − a)(1 + sin u)/2 | |
//! | all | x | |
//!
//! The second and third are MINUIT's (James & Roos 1975, Comp. Phys. Comm. 10, 343).

use crate::error::InputError;
use crate::mission::{Mission, keys};
use crate::mission_file::{Handle, lookup};

/// A free parameter.
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Dotted key.
    pub key: String,
    /// Unit of its values; empty for pure numbers.
    pub unit: &'static str,
    /// Standard deviation of its values in nature over their mean; None if it is not known.
    pub scatter: Option<f64>,
    /// Value in the mission.
    pub start: f64,
    /// Smallest value allowed.
    pub low: f64,
    /// Largest value allowed.
    pub high: f64,
    /// Whether it is the epoch of an event, which data only determine between two of their epochs.
    pub is_event_epoch: bool,
    /// Its handle in the mission; None if it can only be set through the text.
    pub(crate) handle: Option<Handle>,
    scale: Scale,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    Log,
    From,
    Between,
    Linear,
}

/// If a value that must be above 0 no longer has any effect, a fit would move it to 0 or infinity: a prior of this many sigma for a
/// factor e keeps it near its starting value. That shifts a value known to a factor e by a thousandth of its error.
const FEATHER: f64 = 0.03;

/// Multiple of the smallest value in a fit, up to which a value that must be above 0 is at its bound.
const NEXT_TO_NOTHING: f64 = 1e3;

/// Decades above a typical change that are searched for a value whose size is unknown, and steps in each.
const UNKNOWN_DECADES: f64 = 6.0;
const STEPS_PER_DECADE: f64 = 4.0;

/// Share of an interval between two epochs that an event keeps from them: on an epoch itself it belongs to the interval before.
const BESIDE: f64 = 1e-6;

/// Upper bounds above this are not physical.
const BOUNDLESS: f64 = 1e3;

impl Parameter {
    /// The parameter of a mission's key.
    ///
    /// # Errors
    /// If the mission has no such key, or its value is not a number that can be fitted.
    pub fn of(mission: &Mission, key: &str) -> Result<Parameter, InputError> {
        let refusal = |problem: String| InputError::new(format!("cannot fit `{key}`"), problem);
        let path = mission.path(key).map_err(|(problem, help)| InputError { help, ..refusal(problem) })?;
        let known = lookup::find(&path).expect("a key that was found");
        let (scale, low, high) = match known.kind {
            keys::Allowed::Positive(low, high) => (Scale::Log, low, high),
            keys::Allowed::Number(low, high) if low.is_infinite() && high.is_infinite() => (Scale::Linear, low, high),
            keys::Allowed::Number(low, high) if high > BOUNDLESS => (Scale::From, low, high),
            keys::Allowed::Number(low, high) => (Scale::Between, low, high),
            keys::Allowed::Integer(..) => {
                let help = format!("compare some: ctiplan validate MISSION DATA --set {key}=VALUE");
                let problem = "only keys with real numbers can be fitted, and this one takes whole numbers";
                return Err(refusal(problem.into()).with_help(help));
            }
            _ => return Err(refusal("only keys with real numbers can be fitted".into())),
        };
        let start = mission.number(key).ok_or_else(|| {
            refusal("it has no number to start from".into()).with_help("give the key a value in the mission file")
        })?;
        let is_event_epoch = key.starts_with("effects.") && key.ends_with(".t_yr");
        let handle = Handle::of(mission, key);
        Ok(Parameter {
            key: key.to_string(),
            unit: known.unit,
            scatter: known.scatter,
            start,
            low,
            high,
            is_event_epoch,
            handle,
            scale,
        })
    }

    /// The same parameter with bounds, just inside of them; the epoch of an event has derivatives there.
    pub(super) fn between(&self, low: f64, high: f64) -> Parameter {
        let inside = BESIDE * (high - low);
        let (low, high) = (low + inside, high - inside);
        let start = self.start.clamp(low, high);
        Parameter { start, low, high, is_event_epoch: false, scale: Scale::Between, ..self.clone() }
    }

    /// The same with another starting value.
    pub(crate) fn starting_at(&self, value: f64) -> Parameter {
        Parameter { start: value, ..self.clone() }
    }

    /// Size of a typical change.
    fn size(&self) -> f64 {
        match (self.start - self.low).abs() {
            size if size.is_finite() && size > 0.0 => size,
            _ if self.start != 0.0 => self.start.abs(),
            _ => 1.0,
        }
    }

    /// The inner coordinate of a value.
    pub fn inner(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Log => value.max(f64::MIN_POSITIVE).ln(),
            // A bound is a stationary point that a fit cannot leave: start slightly inside.
            Scale::From => {
                let above = (value - self.low + self.size()).max((1.0 + 1e-6) * self.size());
                (above * above - self.size() * self.size()).sqrt()
            }
            Scale::Between => {
                let share = (2.0 * (value - self.low) / (self.high - self.low) - 1.0).clamp(-1.0 + 1e-9, 1.0 - 1e-9);
                share.asin()
            }
            Scale::Linear => value,
        }
    }

    /// The value at an inner coordinate.
    pub fn outer(&self, inner: f64) -> f64 {
        let value = match self.scale {
            Scale::Log => inner.exp(),
            Scale::From => self.low - self.size() + inner.hypot(self.size()),
            Scale::Between => self.low + 0.5 * (self.high - self.low) * (1.0 + inner.sin()),
            Scale::Linear => inner,
        };
        value.max(self.least()).min(self.high)
    }

    /// The smallest value in a fit: nearly 0 if the value must be above 0.
    fn least(&self) -> f64 {
        if self.is_log() { 1e-12 * self.high.min(1.0) } else { self.low }
    }

    /// Distance of a value from the mission's, in typical changes (of its logarithm, if it must be above 0).
    pub fn changes_from_start(&self, value: f64) -> f64 {
        let change = (self.inner(value) - self.inner(self.start)).abs();
        match self.scale {
            Scale::Log | Scale::Between => change,
            Scale::From | Scale::Linear => change / self.size(),
        }
    }

    /// Whether a value with one bound is less than a tenth, or more than ten times, as far from it as the mission's.
    pub fn is_driven_out(&self, value: f64) -> bool {
        let ratio = match self.scale {
            Scale::Log => value / self.start,
            Scale::From => (value - self.low) / self.size(),
            Scale::Between | Scale::Linear => 1.0,
        };
        !(0.1..10.0).contains(&ratio)
    }

    /// The coordinate of a scan, in which a flat prior is flat: ln x if x must be above 0, otherwise x.
    pub fn coordinate(&self, value: f64) -> f64 {
        if self.is_log() { value.max(self.least()).ln() } else { value }
    }

    /// The value at such a coordinate, within the bounds.
    pub fn at_coordinate(&self, coordinate: f64) -> f64 {
        let value = if self.is_log() { coordinate.exp() } else { coordinate };
        value.max(self.least()).min(self.high)
    }

    /// Smallest and largest such coordinate.
    pub fn coordinates(&self) -> (f64, f64) {
        (self.coordinate(self.least()), self.coordinate(self.high))
    }

    /// A 1-sigma error of a value in that coordinate; a typical change if it is unknown or larger than a factor e.
    pub fn coordinate_error(&self, value: f64, sigma: Option<f64>) -> f64 {
        match sigma.filter(|sigma| sigma.is_finite() && *sigma > 0.0) {
            Some(sigma) if self.is_log() => (sigma / value).min(1.0),
            Some(sigma) => sigma,
            None if self.is_log() => 1.0,
            None => self.size(),
        }
    }

    /// Prior towards the starting value, in sigma per unit of the inner coordinate.
    pub fn prior(&self) -> f64 {
        if self.is_log() { FEATHER } else { 0.0 }
    }

    /// Whether its values are above 0, so that factors matter.
    pub fn is_log(&self) -> bool {
        self.scale == Scale::Log
    }

    /// A step of the inner coordinate for derivatives: a thousandth of a typical change.
    pub fn inner_step(&self, inner: f64) -> f64 {
        match self.scale {
            Scale::Log => 1e-3,
            Scale::From => 1e-3 * self.size().max(inner.abs()),
            Scale::Between => {
                // Towards the centre, away from the bounds.
                let towards = if inner.sin() > 0.0 { -1.0 } else { 1.0 };
                towards * inner.cos().signum() * 1e-3 * (self.size() / (self.high - self.low)).clamp(0.01, 1.0)
            }
            Scale::Linear => 1e-3 * if inner == 0.0 { 1.0 } else { inner.abs() },
        }
    }

    /// Values on both sides for derivatives with respect to the parameter itself, within bounds.
    pub fn around(&self, value: f64) -> (f64, f64) {
        let size = match self.scale {
            Scale::Log => value.abs(),
            _ => 0.3 * self.size() + value.abs().min(self.size()),
        };
        let step = 1e-3 * size;
        let least = if self.is_log() { 0.5 * value } else { self.low };
        let high = (value + step).min(self.high);
        ((value - step).max(least), high)
    }

    /// A random value, from a random number between 0 and 1: within a factor of 10, the allowed range, or two typical changes; from a
    /// start at its bound, within six decades.
    pub fn elsewhere(&self, chance: f64) -> f64 {
        let value = match self.scale {
            // A start at the bound says nothing of the size.
            Scale::From if self.start <= self.low => {
                self.low + self.size() * 10_f64.powf((UNKNOWN_DECADES + 1.0) * chance - 1.0)
            }
            Scale::Log | Scale::From => {
                let size = if self.start > self.low { self.start - self.low } else { self.size() };
                self.low.max(0.0) + size * 10_f64.powf(2.0 * chance - 1.0)
            }
            Scale::Between => self.low + (self.high - self.low) * chance,
            Scale::Linear => self.start + self.size() * (4.0 * chance - 2.0),
        };
        value.min(self.high)
    }

    /// Allowed values at some distances to either side, in typical changes or, above 0, in logarithms; and that of the mission.
    pub fn around_it(&self, value: f64, distances: &[f64]) -> Vec<f64> {
        let at = |distance: f64| {
            let moved = match self.scale {
                // The size of a value at its bound is that of the start.
                Scale::Log | Scale::From => {
                    self.low.max(0.0) + (value - self.low.max(0.0)).max(1e-2 * self.size()) * distance.exp()
                }
                Scale::Between => {
                    // The largest distance corresponds to the range from bound to bound.
                    let farthest = distances.iter().copied().fold(0.0, f64::max);
                    value + distance / farthest * (self.high - self.low)
                }
                Scale::Linear => value + distance * self.size(),
            };
            moved.max(self.least()).min(self.high)
        };
        let both = distances.iter().flat_map(|distance| [at(-distance), at(*distance)]);
        let far = self.far_from_bound(value);
        let mut values: Vec<f64> = both.chain([self.start]).chain(far).filter(|other| *other != value).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    }

    /// Values of all sizes, if a value with one bound is at it: it says nothing of the size of others.
    fn far_from_bound(&self, value: f64) -> impl Iterator<Item = f64> {
        let is_at_it = self.scale == Scale::From && self.at_bound(value) == Some(self.low);
        let steps = if is_at_it { (UNKNOWN_DECADES * STEPS_PER_DECADE) as i32 } else { 0 };
        let far = |step: i32| self.low + self.size() * 10_f64.powf(f64::from(step) / STEPS_PER_DECADE);
        (1..=steps).map(far).filter(|far| *far <= self.high)
    }

    /// Whether a value is at a bound, to a fraction of a typical change.
    pub fn at_bound(&self, value: f64) -> Option<f64> {
        let near = 1e-3 * self.size();
        let low = if self.is_log() { value < NEXT_TO_NOTHING * self.least() } else { value - self.low < near };
        if low && self.low.is_finite() {
            Some(self.low)
        } else if self.high - value < near.min(1e-3 * self.high.abs()) {
            Some(self.high)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_go_there_and_back_and_keep_to_the_bounds() {
        let text = format!(
            "{}\n[effects.bakeout]\nt_yr = 2.0\nfraction = 0.3\n[effects.formula]\ntarget = \"value\"\nexpression = \"value + a\"\na = -0.2\n",
            include_str!("../../../missions/snap_l2.toml")
        );
        let mission = Mission::parse(&text).unwrap();
        for key in [
            "detector.traps.VV.density_per_px",
            "detector.traps.VV.release_ms",
            "effects.bakeout.fraction",
            "effects.formula.a",
            "detector.well_fill_power",
        ] {
            let parameter = Parameter::of(&mission, key).unwrap();
            for value in [0.7 * parameter.start, parameter.start, 1.9 * parameter.start] {
                let back = parameter.outer(parameter.inner(value));
                assert!((back / value - 1.0).abs() < 1e-5, "{key}: {value}, {back}");
            }
            for inner in [-30.0, -1.0, 0.0, 2.0, 40.0] {
                let value = parameter.outer(inner);
                assert!(value >= parameter.low && value <= parameter.high, "{key}: {value}");
            }
        }
        assert!(Parameter::of(&mission, "readout.transfers").is_err());
        assert!(Parameter::of(&mission, "mission.name").is_err());
        assert!(Parameter::of(&mission, "effects.bakeout.t_yr").unwrap().is_event_epoch);
    }
}
