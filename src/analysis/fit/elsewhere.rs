//! Search for a deeper minimum of chi2 elsewhere.
//!
//! If a model has a kink (a packet that sinks into a notch near the background), chi2 has several minima, and a minimiser ends in
//! the one next to its start. Each parameter is scanned separately, on either side of the optimum, at the mission's value, and at
//! its kinks, next to which a minimum may be narrow; all others follow to first order: 20 to 28 evaluations of the model for each.
//! If the scan finds a lower chi2 than at the optimum, or a second valley, the fit starts once more. The mission's own values are
//! among the starts, so that a fit with a parameter fixed there cannot end lower than one with it free.

use nalgebra::DVector;

use super::parameter::Parameter;
use super::problem::{LOOSE, Optimum, Problem};
use super::result::SAME;
use crate::effect::Reach;
use crate::numeric::least_squares::Span;
use crate::numeric::parallel;

/// Distances of a scan from the optimum, in typical changes of a parameter (of its logarithm, if it must be above 0).
const DISTANCES: [f64; 9] = [0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 3.2, 4.6];

/// Rounds of scans of all parameters, and new starts in each: the most promising ones.
const ROUNDS: usize = 3;
const STARTS: usize = 3;

/// Increase of chi2 within which a rough fit has found the known minimum.
const ROUGH: f64 = 1.0;

/// Excess of chi2, in addition to a share of it, above which a minimum is not followed to its bottom.
const FAR_ABOVE: f64 = 30.0;

/// Whether a rough fit may lead to a minimum other than the known one, and not far above it.
pub(crate) fn is_another(rough: f64, known: f64) -> bool {
    let rise = rough - known;
    let is_known = rise > -SAME && rise < ROUGH;
    !is_known && rise < FAR_ABOVE * (1.0 + 0.01 * known)
}

impl Problem<'_> {
    /// Minima found by scans around an optimum, lower or higher than it.
    pub(super) fn scanned(&self, optimum: &Optimum) -> Vec<Optimum> {
        let mut best = optimum.clone();
        let mut found = Vec::new();
        for _ in 0..ROUNDS {
            let valleys = self.valleys(&best);
            let minima: Vec<Optimum> = valleys.iter().filter_map(|start| self.another(start, &best)).collect();
            let lowest = minima.iter().min_by(|a, b| a.chi2.total_cmp(&b.chi2)).cloned();
            found.extend(minima);
            match lowest {
                Some(lowest) if lowest.chi2 < best.chi2 - SAME => best = lowest,
                _ => break,
            }
        }
        found
    }

    /// The minimum reached from a start; None if a rough fit reaches no other.
    fn another(&self, start: &[f64], known: &Optimum) -> Option<Optimum> {
        let rough = self.roughly(start);
        is_another(rough.chi2, known.chi2).then(|| self.minimise(&rough.at))
    }

    /// Values at which chi2 has a kink: a background sinks into a notch there.
    fn kinks(&self, parameter: &Parameter) -> Vec<f64> {
        match parameter.key.rsplit('.').next() {
            Some("notch_e") => Reach::backgrounds_of(self.questions.iter().map(|question| &**question.at)),
            _ => Vec::new(),
        }
    }

    /// Points from which another minimum may be reached, sorted by chi2.
    fn valleys(&self, optimum: &Optimum) -> Vec<Vec<f64>> {
        let Ok(jacobian) = self.jacobian(&optimum.at) else { return Vec::new() };
        let moving = |index: &usize| !self.parameters[*index].is_event_epoch;
        let mut starts: Vec<(f64, Vec<f64>)> = Vec::new();
        for index in (0..optimum.at.len()).filter(moving) {
            let span = Span::of(&jacobian.clone().remove_column(index), LOOSE);
            let parameter = &self.parameters[index];
            let scanned = |value: f64| -> Option<(f64, Vec<f64>)> {
                let mut at = optimum.at.clone();
                at[index] = value;
                let residuals = DVector::from_vec(self.residuals(&at).ok()?);
                let follow = -span.solve(&residuals).insert_row(index, 0.0);
                let left = &residuals - span.directions() * (span.directions().transpose() * &residuals);
                for (other, parameter) in self.parameters.iter().enumerate().filter(|(other, _)| *other != index) {
                    let moved = (at[other] + follow[other]).clamp(parameter.low, parameter.high);
                    at[other] = parameter.outer(parameter.inner(moved));
                }
                Some((left.norm_squared(), at))
            };
            let mut values = parameter.around_it(optimum.at[index], &DISTANCES);
            values.extend(self.kinks(parameter));
            let mut scan: Vec<(f64, Vec<f64>)> = parallel::map(values, scanned).into_iter().flatten().collect();
            scan.push((optimum.chi2, optimum.at.clone()));
            scan.sort_by(|a, b| a.1[index].total_cmp(&b.1[index]));
            for (place, (chi2, at)) in scan.iter().enumerate() {
                let lower = |other: Option<&(f64, Vec<f64>)>| other.is_none_or(|(other, _)| chi2 < other);
                let valley = lower(scan[..place].last()) && lower(scan.get(place + 1));
                if at[index] != optimum.at[index] && (valley || *chi2 < optimum.chi2 - SAME) {
                    starts.push((*chi2, at.clone()));
                }
            }
        }
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.truncate(STARTS);
        starts.into_iter().map(|(_, at)| at).collect()
    }
}
