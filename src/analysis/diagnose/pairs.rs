//! Two effects at once, to first order.
//!
//! The search adds one effect at a time to the best few models. It misses two effects that compensate each other, so that neither
//! gains much alone. For these the signatures of all pairs of trials are fitted to the residuals together, which takes no readout.

use nalgebra::{DMatrix, DVector};

use super::fitted_model::FLAT;
use super::hypothesis::{FARTHEST, Hypothesis, Trial};
use super::search::Expansion;
use crate::numeric::least_squares::Span;
use crate::numeric::parallel;

/// Two trials, each with the factor on the strength in its table.
pub(super) struct Pair<'a> {
    pub trials: [(&'a Trial, f64); 2],
    /// Decrease of chi2.
    pub gain: f64,
    /// Remaining residuals.
    pub left: DVector<f64>,
}

/// For each wanted pair of hypotheses the best pair of their trials, sorted by decrease of chi2, the largest first.
pub(super) fn promising<'a>(
    expansion: &'a Expansion,
    hypotheses: &[Hypothesis],
    wanted: impl Fn(usize, usize) -> bool,
) -> Vec<Pair<'a>> {
    let all = (0..hypotheses.len()).flat_map(|a| (a..hypotheses.len()).map(move |b| (a, b)));
    let all: Vec<(usize, usize)> =
        all.filter(|&(a, b)| wanted(a, b) && (a != b || hypotheses[a].may_repeat())).collect();
    let best = |&(a, b): &(usize, usize)| {
        let [one, other] = [a, b].map(|place| &expansion.trials[place]);
        let both = one.iter().flat_map(|one| other.iter().map(move |other| [one, other]));
        both.filter_map(|both| together(both, &expansion.node.residuals)).max_by(|a, b| a.gain.total_cmp(&b.gain))
    };
    let mut pairs: Vec<Pair> = parallel::map(&all, best).into_iter().flatten().collect();
    pairs.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    pairs
}

/// Two trials fitted to residuals together; None if they are collinear, or a strength is out of reach.
fn together<'a>(trials: [&'a Trial; 2], residuals: &DVector<f64>) -> Option<Pair<'a>> {
    let mut left = residuals.clone();
    for signature in trials.iter().filter_map(|trial| trial.fixed()) {
        left -= signature;
    }
    let adjusted: Vec<&Trial> = trials.into_iter().filter(|trial| trial.fixed().is_none()).collect();
    let columns: Vec<_> = adjusted.iter().flat_map(|trial| trial.basis.column_iter()).collect();
    let columns = if columns.is_empty() { DMatrix::zeros(left.len(), 0) } else { DMatrix::from_columns(&columns) };
    let span = Span::of(&columns, FLAT);
    if span.directions().ncols() < columns.ncols() {
        return None;
    }
    let along = span.solve(&left);
    left -= &columns * &along;
    let mut first = 0;
    let mut strengths = trials.map(|trial| (trial, 1.0));
    for (trial, strength) in strengths.iter_mut().filter(|(trial, _)| trial.fixed().is_none()) {
        *strength = trial.strength_along(along.rows(first, trial.dimensions()));
        first += trial.dimensions();
    }
    let in_reach = strengths.iter().all(|(_, strength)| *strength > 0.0 && *strength < FARTHEST);
    let gain = residuals.norm_squared() - left.norm_squared();
    in_reach.then_some(Pair { trials: strengths, gain, left })
}
