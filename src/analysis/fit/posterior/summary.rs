//! Summary of a sample: each parameter, and pairs.

use std::fmt;

use serde::ser::{Serialize, Serializer};

use super::super::parameter::Parameter;
use super::schedule::{LONG, time};
use crate::mission::keys::plain;
use crate::numeric::estimate::quantile;

/// Probabilities at the ends of the intervals of 68.3 and 95.4 %: one and two standard deviations of a normal distribution.
const ENDS: [[f64; 2]; 2] = [[0.1587, 0.8413], [0.0228, 0.9772]];

/// Distance from an end of a prior, in half-widths of the central 68.3 %, and fraction of the draws within it above which the prior
/// ends the interval: for half of a normal distribution 5 % are that near, for a normal distribution two half-widths away 1 %.
const NEXT_TO_END: f64 = 0.1;
const MANY: f64 = 0.02;

/// The marginal posterior of one parameter.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Marginal {
    /// Dotted key.
    pub key: String,
    /// Unit of its values; empty for pure numbers.
    pub unit: &'static str,
    /// Its prior.
    pub prior: Prior,
    /// Median.
    pub median: f64,
    /// Ends of the central 68.3 %.
    pub interval_68: [f64; 2],
    /// Ends of the central 95.4 %.
    pub interval_95: [f64; 2],
    /// Integrated autocorrelation time, steps of a walker; None if nothing moves.
    pub autocorrelation_steps: Option<f64>,
    /// Effective number of independent draws in the chain.
    pub effective_samples: f64,
    /// Steps of each walker after burn-in.
    pub steps: usize,
    /// Whether many draws are at an end of the prior, so that the interval reflects the prior rather than the data.
    pub ended_by_prior: bool,
}

/// A prior that is flat between two values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prior {
    /// In the value.
    Flat {
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// In its logarithm.
    FlatInLogarithm {
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
}

impl Prior {
    fn of(parameter: &Parameter) -> Prior {
        let (low, high) = parameter.coordinates();
        match parameter.is_log() {
            true => Prior::FlatInLogarithm { low: low.exp(), high: high.exp() },
            false => Prior::Flat { low, high },
        }
    }
}

impl fmt::Display for Prior {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, low, high) = match self {
            Prior::Flat { low, high } => ("in the value", low, high),
            Prior::FlatInLogarithm { low, high } => ("in the logarithm", low, high),
        };
        write!(out, "flat {what}")?;
        let rounded = |value: f64| plain(format!("{value:.3e}").parse().expect("a number"));
        match (low.is_finite(), high.is_finite()) {
            (true, true) => write!(out, " from {} to {}", rounded(*low), rounded(*high)),
            (true, false) => write!(out, " from {}", rounded(*low)),
            (false, true) => write!(out, " up to {}", rounded(*high)),
            (false, false) => Ok(()),
        }
    }
}

/// In text form.
impl Serialize for Prior {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl Marginal {
    /// For a parameter, by its index in a chain of coordinates, step after step of all walkers.
    pub(super) fn of(parameter: &Parameter, place: usize, chain: &[Vec<f64>], walkers: usize) -> Marginal {
        let time = time(chain, place, walkers);
        let mut sorted: Vec<f64> = chain.iter().map(|at| at[place]).collect();
        sorted.sort_by(f64::total_cmp);
        let value = |p: f64| parameter.at_coordinate(quantile(&sorted, p));
        let (low, high) = parameter.coordinates();
        let [from, to] = ENDS[0].map(|p| quantile(&sorted, p));
        let near = NEXT_TO_END * 0.5 * (to - from);
        let at_ends = sorted.iter().filter(|at| **at < low + near || **at > high - near).count();
        Marginal {
            key: parameter.key.clone(),
            unit: parameter.unit,
            prior: Prior::of(parameter),
            median: value(0.5),
            interval_68: ENDS[0].map(value),
            interval_95: ENDS[1].map(value),
            autocorrelation_steps: Some(time).filter(|time| time.is_finite()),
            effective_samples: (chain.len() as f64 / time).max(1.0),
            steps: chain.len() / walkers,
            ended_by_prior: at_ends as f64 > MANY * sorted.len() as f64,
        }
    }

    /// Whether walkers were followed long enough for a known autocorrelation time.
    pub fn is_long_enough(&self) -> bool {
        self.autocorrelation_steps.is_some_and(|time| self.steps as f64 >= LONG * time)
    }
}

/// Correlation of the coordinates of a chain.
pub(super) fn correlation(chain: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = chain.first().map_or(0, Vec::len);
    let mean: Vec<f64> =
        (0..n).map(|place| chain.iter().map(|at| at[place]).sum::<f64>() / chain.len() as f64).collect();
    let product = |a: usize, b: usize| chain.iter().map(|at| (at[a] - mean[a]) * (at[b] - mean[b])).sum::<f64>();
    let of = |a: usize, b: usize| {
        let both = (product(a, a) * product(b, b)).sqrt();
        if a == b {
            1.0
        } else if both > 0.0 {
            (product(a, b) / both).clamp(-1.0, 1.0)
        } else {
            0.0
        }
    };
    (0..n).map(|a| (0..n).map(|b| of(a, b)).collect()).collect()
}
