//! Significant properties of residuals.

use crate::analysis::independence::Independence;

use super::residual_trend::Trend;
use super::result::{Claim, Finding, SPOKEN, SetResult, chi2_chances, strongest};

/// All significant properties: for each data set its strongest trend, or its offset; errors that differ from the quoted ones; and
/// correlated residuals.
pub(super) fn of(sets: &[SetResult], trends: &[Trend], independence: &Independence) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, set) in sets.iter().enumerate() {
        let mut find = |claim: Claim, chance: f64| findings.push(Finding { set: index, claim, chance });
        let offset = set.bias_alarm(sets.len() + trends.len());
        if let Some(trend) = strongest(trends, index) {
            find(Claim::Trend, trend.false_alarm);
        } else if offset < SPOKEN {
            find(Claim::Offset, offset);
        }
        // For any of the data sets.
        let [below, above] =
            chi2_chances(set.chi2, set.data.rows.len()).map(|chance| (chance * sets.len() as f64).min(1.0));
        if above < SPOKEN && set.noise_sigma() > 1.0 && set.scatter_sigma > 2.0 {
            find(Claim::SmallErrors, above);
        } else if below < SPOKEN {
            find(Claim::LargeErrors, below);
        }
        if let Some(one) = independence.correlated().into_iter().find(|one| one.set == index) {
            find(Claim::Correlated, one.false_alarm);
        }
    }
    findings
}
