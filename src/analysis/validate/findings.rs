//! Where a model fails: what is significant of its residuals.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::SetResult;
use super::lean::Lean;

/// False-alarm probability below which anything is claimed.
pub(super) const SPOKEN: f64 = 1e-3;

/// What is claimed of residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// Residuals depend on a condition.
    Trend,
    /// Residuals are off in the mean.
    Offset,
    /// The quoted errors are too small.
    SmallErrors,
    /// The quoted errors are too large.
    LargeErrors,
}

/// A significant property of the residuals of one data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The data set, by its place.
    pub set: usize,
    /// What is claimed.
    pub claim: Claim,
    /// Chance that noise alone looks like that in any of the data sets.
    pub chance: f64,
}

/// All that is significant: for each data set its strongest trend, or its offset; and errors that are not those quoted.
pub(super) fn of(sets: &[SetResult], leans: &[Lean]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, set) in sets.iter().enumerate() {
        let mut find = |claim: Claim, chance: f64| findings.push(Finding { set: index, claim, chance });
        let offset = set.bias_alarm(sets.len() + leans.len());
        if let Some(lean) = strongest(leans, index) {
            find(Claim::Trend, lean.false_alarm);
        } else if offset < SPOKEN {
            find(Claim::Offset, offset);
        }
        // Of any of the data sets.
        let [below, above] =
            chi2_chances(set.chi2, set.data.rows.len()).map(|chance| (chance * sets.len() as f64).min(1.0));
        if above < SPOKEN && set.noise_sigma() > 1.0 && set.scatter_sigma > 2.0 {
            find(Claim::SmallErrors, above);
        } else if below < SPOKEN {
            find(Claim::LargeErrors, below);
        }
    }
    findings
}

/// The most significant trend of a data set; None where none is significant.
pub(super) fn strongest(leans: &[Lean], set: usize) -> Option<&Lean> {
    leans.iter().find(|lean| lean.set == set && lean.false_alarm < SPOKEN)
}

/// Chances that noise alone has no more, and no less, chi2 in that many rows.
pub(super) fn chi2_chances(chi2: f64, rows: usize) -> [f64; 2] {
    ChiSquared::new(rows as f64).map_or([1.0; 2], |law| [law.cdf(chi2), law.sf(chi2)])
}
