//! What a fit finds.

use nalgebra::DMatrix;
use serde::Serialize;

use crate::mission::Mission;

/// What a fit found.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The mission with the fitted values.
    pub mission: Mission,
    /// Free parameters, in the order given.
    pub parameters: Vec<Fitted>,
    /// Correlation of two parameters, `[[i, j]]`; 0 with one to which the data are insensitive.
    pub correlation: Vec<Vec<f64>>,
    /// chi2 of the mission as it was.
    pub chi2_before: f64,
    /// chi2 at the optimum.
    pub chi2: f64,
    /// Rows.
    pub n: usize,
    /// Model at the optimum, for each row of each data set, in order.
    pub values: Vec<f64>,
    /// What the data do not determine, in words.
    pub advice: Vec<Advice>,
    /// chi2 that each start came to, best first.
    pub starts: Vec<f64>,
    /// chi2 that the mission's own values came to: that of a local minimum, if it is larger than [`Fit::chi2`].
    pub chi2_from_mission: f64,
    /// Other minima of chi2, the lowest first.
    pub minima: Vec<Minimum>,
    /// Derivatives of (value − model)/sigma with respect to the parameters at the optimum, `[(row, parameter)]`; 0 for those
    /// that move nothing in reach.
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
    /// Value in the mission as it was.
    pub before: f64,
    /// Value at the optimum.
    pub value: f64,
    /// 1-sigma error, of the larger side if chi2 is not parabolic; None if the data do not constrain it.
    pub sigma: Option<f64>,
}

impl Fit {
    /// Degrees of freedom.
    pub fn degrees_of_freedom(&self) -> usize {
        self.n.saturating_sub(self.parameters.len())
    }

    /// By how many of its standard deviations chi2 is more than noise makes.
    pub fn excess(&self) -> f64 {
        let freedom = self.degrees_of_freedom().max(1) as f64;
        (self.chi2 - freedom) / (2.0 * freedom).sqrt()
    }

    /// rms of (value − model)/sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.n as f64).sqrt()
    }

    /// Whether a value of chi2 is that of the optimum, as exactly as a fit ends.
    pub fn is_optimum(&self, chi2: f64) -> bool {
        is_same(chi2, self.chi2)
    }
}

/// A doubt about fitted parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Advice {
    /// The data do not change with it.
    Unconstrained {
        /// The key.
        key: String,
    },
    /// It is less well known than it is large.
    PoorlyConstrained {
        /// The key.
        key: String,
        /// Error over value.
        relative: f64,
    },
    /// Several keys can be changed together without a change of chi2.
    Degenerate {
        /// The keys, those that matter most first.
        keys: Vec<String>,
    },
    /// Two keys are known together but not each for itself.
    Correlated {
        /// The keys.
        keys: [String; 2],
        /// Their correlation.
        correlation: f64,
    },
    /// It would go further if it could.
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
        /// By how much chi2 is larger there, all others fitted.
        rise: f64,
    },
    /// Species have exchanged the order of their release times, and without that the data are described less well.
    Exchanged {
        /// The keys of the release times.
        keys: Vec<String>,
    },
    /// It was not fitted, and others would be different if it were.
    Assumed {
        /// The key.
        key: String,
        /// What it was taken to be.
        value: f64,
    },
}

/// Fall of chi2 below which two minima are one.
pub(super) const SAME: f64 = 0.01;

/// Whether two values of chi2 are those of one minimum, as exactly as a fit ends.
pub(super) fn is_same(chi2: f64, best: f64) -> bool {
    chi2 < best + SAME * (1.0 + best)
}
