//! Results of a fit.

use nalgebra::DMatrix;
use serde::Serialize;

use crate::analysis::independence::Independence;
use crate::analysis::validate::{SPOKEN, chi2_chances};
use crate::mission::Mission;
use crate::warning::Warning;

/// Excess of chi2, in its standard deviations, from which a model does not describe the data within their errors.
const MISFIT: f64 = 3.0;

/// Results of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The mission with the fitted values.
    pub mission: Mission,
    /// Free parameters, in the order given.
    pub parameters: Vec<Fitted>,
    /// Correlation of two parameters, `[[i, j]]`; None with one that has no error.
    pub correlation: Vec<Vec<Option<f64>>>,
    /// chi2 of the original mission.
    pub chi2_before: f64,
    /// chi2 at the optimum.
    pub chi2: f64,
    /// Rows.
    pub n: usize,
    /// Model at the optimum, for each row of each data set, in order.
    pub values: Vec<f64>,
    /// Parameters that the data do not determine, in words.
    pub advice: Vec<Advice>,
    /// chi2 reached from each start, best first.
    pub starts: Vec<f64>,
    /// chi2 reached from the mission's own values: that of a local minimum, if it is larger than [`Fit::chi2`].
    pub chi2_from_mission: f64,
    /// Independence of the residuals of neighbouring rows; nothing is tested unless all rows are fitted.
    pub independence: Independence,
    /// Other minima of chi2, the lowest first.
    pub minima: Vec<Minimum>,
    /// Conditions of the data that are the mission's although columns look like them.
    pub warnings: Vec<Warning>,
    /// Derivatives of (value − model)/sigma with respect to the parameters at the optimum, `[(row, parameter)]`; 0 for those
    /// without effect nearby.
    pub(crate) jacobian: DMatrix<f64>,
}

/// Another minimum of chi2.
#[derive(Clone, Debug, Serialize)]
pub struct Minimum {
    /// chi2.
    pub chi2: f64,
    /// Values of the parameters, in their order.
    pub values: Vec<f64>,
}

/// One fitted parameter.
#[derive(Clone, Debug, Serialize)]
pub struct Fitted {
    /// Dotted key.
    pub key: String,
    /// Unit of the value; empty for pure numbers.
    pub unit: &'static str,
    /// Value in the original mission.
    pub before: f64,
    /// Value at the optimum.
    pub value: f64,
    /// 1-sigma error, of the larger side if chi2 is not parabolic; None if the data do not constrain it.
    pub sigma: Option<f64>,
}

impl Fit {
    /// Another fit of the same data that started from this one, with what this one started from.
    pub(super) fn replaced_by(self, other: Fit) -> Fit {
        let mut parameters = other.parameters;
        parameters.iter_mut().zip(&self.parameters).for_each(|(after, before)| after.before = before.before);
        let Fit { chi2_before, starts, chi2_from_mission, minima, .. } = self;
        Fit { parameters, chi2_before, starts, chi2_from_mission, minima, ..other }
    }

    /// Degrees of freedom.
    pub fn degrees_of_freedom(&self) -> usize {
        self.n.saturating_sub(self.parameters.len())
    }

    /// Excess of chi2 over its expectation, in standard deviations.
    pub fn excess(&self) -> f64 {
        let freedom = self.degrees_of_freedom().max(1) as f64;
        (self.chi2 - freedom) / (2.0 * freedom).sqrt()
    }

    /// Whether chi2 is that of the errors: at most three of its standard deviations above its expectation.
    pub fn describes_data(&self) -> bool {
        self.excess() <= MISFIT
    }

    /// The probability that noise leaves no more chi2, if it is so small that the errors of the data are too large.
    pub fn errors_too_large(&self) -> Option<f64> {
        Some(chi2_chances(self.chi2, self.degrees_of_freedom())[0]).filter(|chance| *chance < SPOKEN)
    }

    /// rms of (value − model)/sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.n as f64).sqrt()
    }

    /// Combinations of degenerate parameters that are constrained.
    pub fn combinations(&self) -> Vec<&Combination> {
        let mut found = Vec::new();
        for advice in &self.advice {
            if let Advice::Degenerate { combinations, .. } = advice {
                found.extend(combinations);
            }
        }
        found
    }

    /// Whether a value of chi2 equals that of the optimum, within the tolerance of a fit.
    pub fn is_optimum(&self, chi2: f64) -> bool {
        is_same(chi2, self.chi2)
    }
}

/// A sum of parameters, each times a factor, that the data constrain although they do not constrain its parameters; to first order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Combination {
    /// Its terms.
    pub terms: Vec<Term>,
    /// Its value.
    pub value: f64,
    /// 1-sigma error.
    pub sigma: f64,
    /// Unit of value and error.
    pub unit: &'static str,
}

/// A term of a combination.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Term {
    /// Dotted key.
    pub key: String,
    /// Its factor, in the combination's unit over that of the key.
    pub factor: f64,
}

/// Advice on fitted parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Advice {
    /// The data are insensitive to it.
    Unconstrained {
        /// The key.
        key: String,
    },
    /// Its error is larger than its value.
    PoorlyConstrained {
        /// The key.
        key: String,
        /// Error over value.
        relative: f64,
    },
    /// Several keys can be changed together without a change of chi2.
    Degenerate {
        /// The keys, the most important ones first.
        keys: Vec<String>,
        /// Combinations of them that are constrained.
        combinations: Vec<Combination>,
    },
    /// Only a combination of two keys is constrained.
    Correlated {
        /// The keys.
        keys: [String; 2],
        /// Their correlation.
        correlation: f64,
    },
    /// It changes with a key that is held, at about the same chi2.
    DependsOn {
        /// The key.
        key: String,
        /// The one that is held.
        held: String,
        /// Its value, and another one.
        values: [f64; 2],
        /// The fitted values with these.
        found: [f64; 2],
        /// Increase of chi2 with the other one.
        rise: f64,
    },
    /// The fit is limited by a bound.
    AtBound {
        /// The key.
        key: String,
        /// The bound.
        bound: f64,
    },
    /// Values far away on one side are not excluded: there is a limit on the other side only.
    Open {
        /// The key.
        key: String,
        /// Whether it is the side of larger values.
        above: bool,
        /// A value far away.
        value: f64,
        /// Unit of the value.
        unit: &'static str,
        /// Increase of chi2 there, all others refitted.
        rise: f64,
    },
    /// Values far away on both sides are not excluded.
    Undetermined {
        /// The key.
        key: String,
        /// Two values far apart.
        between: [f64; 2],
        /// Unit of the values.
        unit: &'static str,
        /// Increase of chi2 at the worse of them, all others refitted.
        rise: f64,
    },
    /// Errors of conditions still changed chi2 when they were last derived at the result.
    Unsettled {
        /// Number of fits.
        fits: usize,
        /// The last change of chi2.
        change: f64,
    },
    /// Species have exchanged the order of their release times, and the data are described less well with the original order.
    Exchanged {
        /// The keys of the release times.
        keys: Vec<String>,
    },
    /// It was not fitted; the others would change if it were.
    Assumed {
        /// The key.
        key: String,
        /// Its assumed value.
        value: f64,
    },
}

impl Advice {
    /// The parameter that has no limit on one side or on both.
    pub(crate) fn limited(&self) -> Option<&str> {
        match self {
            Advice::Open { key, .. } | Advice::Undetermined { key, .. } => Some(key),
            _ => None,
        }
    }
}

/// Difference of chi2 below which two minima are the same.
pub(super) const SAME: f64 = 0.01;

/// Whether two values of chi2 belong to the same minimum, within the tolerance of a fit.
pub(super) fn is_same(chi2: f64, best: f64) -> bool {
    chi2 < best + SAME * (1.0 + best)
}
