//! Epochs of events (a flare, a bakeout): chi2 jumps where one passes an epoch of the data. Between two of these it is smooth, and
//! often flat: the time is exchanged for the amplitude.

use nalgebra::{DMatrix, DVector};

use super::errors::Errors;
use super::parameter::Parameter;
use super::problem::{LOOSE, Optimum, Problem};
use crate::error::InputError;
use crate::numeric::least_squares::Span;

/// Increase of chi2 up to which an event epoch fits equally well: one standard error.
const AS_GOOD: f64 = 1.0;

/// Increase of chi2 above which no event epoch is searched.
const UNLIKELY: f64 = 16.0;

/// Nodes of an interval between epochs, in half-lengths from its centre: those of Gauss and Legendre, which keep away from its ends.
const NODES: [f64; 3] = [-0.774_596_669_241_483_4, 0.0, 0.774_596_669_241_483_4];

/// Evenly spaced times in an interval, for means: a time known to a hundredth of the interval is resolved.
const POINTS: usize = 128;

/// Steps to a conditional optimum, and the chi2 above the one expected that justifies another.
const FOLLOWED: usize = 3;
const FOLLOWED_TO: f64 = 0.01;

/// Number of trials that are repeated with event epochs free within their intervals.
const SLID: usize = 3;

/// Only one in this many intervals between epochs is tried first for an event epoch.
const EVERY: usize = 4;

impl Problem<'_> {
    /// Minimises from a start, trying every interval between epochs for each event epoch.
    pub(super) fn with_event_epochs(&self, start: &[f64]) -> Optimum {
        let moments: Vec<usize> = (0..start.len()).filter(|&index| self.parameters[index].is_event_epoch).collect();
        let mut best = self.minimise(start);
        if moments.is_empty() {
            return best;
        }
        let candidates: Vec<f64> = self.epochs().windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        // Event epochs may depend on each other: repeated once after all have been tried.
        for _ in 0..if moments.len() > 1 { 2 } else { 1 } {
            for &index in &moments {
                let from = best.at.clone();
                let attempt = |place: usize| {
                    let mut at = from.clone();
                    at[index] = candidates[place];
                    self.minimise(&at)
                };
                // One in every few intervals first, then all around the best of them.
                let coarse: Vec<(usize, Optimum)> =
                    (0..candidates.len()).step_by(EVERY).map(|place| (place, attempt(place))).collect();
                let least = coarse.iter().min_by(|a, b| a.1.chi2.total_cmp(&b.1.chi2)).map_or(0, |(place, _)| *place);
                let around = least.saturating_sub(EVERY - 1)..(least + EVERY).min(candidates.len());
                let fine = around.filter(|place| place % EVERY != 0).map(attempt);
                let tried: Vec<Optimum> = coarse.iter().map(|(_, found)| found.clone()).chain(fine).collect();
                for found in tried.iter().cloned().chain(self.slid(tried.clone())) {
                    if found.chi2 < best.chi2 - 1e-9 * best.chi2.abs() {
                        best = found;
                    }
                }
            }
        }
        best
    }

    /// Launch and the epochs of the data, years since launch, ascending.
    fn epochs(&self) -> Vec<f64> {
        let mut epochs: Vec<f64> = self.questions.iter().map(|question| question.at.t_yr).collect();
        epochs.push(0.0);
        epochs.sort_by(f64::total_cmp);
        epochs.dedup();
        epochs
    }

    /// The end of the last trial: the nearly best ones again, with their event epochs free within their intervals.
    fn slid(&self, mut tried: Vec<Optimum>) -> Vec<Optimum> {
        tried.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
        tried.truncate(SLID);
        let most = tried.first().map_or(0.0, |least| least.chi2 + UNLIKELY);
        tried.into_iter().filter(|one| one.chi2 < most).map(|one| self.within_intervals(one)).collect()
    }

    /// Launch or the epoch of the data before a time, and the epoch after it.
    pub(super) fn interval_of(&self, t_yr: f64) -> Option<[f64; 2]> {
        self.epochs().windows(2).map(|ends| [ends[0], ends[1]]).find(|ends| t_yr > ends[0] && t_yr <= ends[1])
    }

    /// An optimum with each event epoch at the centre of the times at which chi2 is equally good: their mean, if the data
    /// determine no more.
    pub(super) fn centred(&self, optimum: Optimum) -> Result<Optimum, InputError> {
        let (mut found, most) = (optimum.clone(), optimum.chi2 + AS_GOOD);
        for index in (0..found.at.len()).filter(|&index| self.parameters[index].is_event_epoch) {
            let moment = found.at[index];
            let (mut from_yr, mut to_yr) = (moment, moment);
            for one in self.around(&found, index, AS_GOOD) {
                for point in one.points().filter(|point| point.chi2 < most) {
                    from_yr = from_yr.min(point.at[index] - 0.5 * one.step_yr());
                    to_yr = to_yr.max(point.at[index] + 0.5 * one.step_yr());
                }
            }
            let mut at = found.at.clone();
            at[index] = 0.5 * (from_yr + to_yr);
            if at[index] == moment {
                continue;
            }
            let moved = self.minimise(&at);
            if moved.chi2 < most {
                found = moved;
            }
        }
        Ok(found)
    }

    /// Intervals between epochs where an event may lie, outwards from that of an optimum until chi2 has increased by `rise`.
    fn around(&self, optimum: &Optimum, index: usize, rise: f64) -> Vec<Interval> {
        let epochs = self.epochs();
        let interval = |ends: &[f64]| -> Option<Interval> {
            let time = |node: f64| 0.5 * (ends[0] + ends[1]) + 0.5 * node * (ends[1] - ends[0]);
            let [first, centre, last] = NODES.map(time);
            let centre = self.conditional(&optimum.at, index, centre)?;
            let first = self.conditional(&centre.at, index, first)?;
            let last = self.conditional(&centre.at, index, last)?;
            Some(Interval { from_yr: ends[0], to_yr: ends[1], nodes: [first, centre, last] })
        };
        let near = |one: &Interval| one.nodes.iter().any(|node| node.chi2 < optimum.chi2 + rise);
        let moment = optimum.at[index];
        let Some(here) = epochs.windows(2).position(|pair| (pair[0]..=pair[1]).contains(&moment)) else {
            return Vec::new();
        };
        let before = epochs[..=here + 1].windows(2).rev().map_while(|ends| interval(ends).filter(near));
        let after = epochs[here + 1..].windows(2).map_while(|ends| interval(ends).filter(near));
        before.chain(after).collect()
    }

    /// The optimum with an event epoch fixed, from one nearby: the other parameters follow to first order, repeated if chi2 is not
    /// the one expected. None if the model has no value.
    fn conditional(&self, from: &[f64], index: usize, t_yr: f64) -> Option<Optimum> {
        let mut at = from.to_vec();
        at[index] = t_yr;
        let mut residuals = DVector::from_vec(self.residuals(&at).ok()?);
        for _ in 0..FOLLOWED {
            // The signature of a flare depends on its epoch.
            let span = Span::of(&self.jacobian(&at).ok()?, LOOSE);
            let follow = -span.solve(&residuals);
            let expected = residuals.norm_squared() - span.directions().tr_mul(&residuals).norm_squared();
            let followed: Vec<f64> = self.parameters.iter().zip(&at).zip(&follow).map(followed).collect();
            // Far from the optimum, or along parameters that the epoch makes equivalent, the first order may promise too much.
            let Ok(after) = self.residuals(&followed).map(DVector::from_vec) else { break };
            if after.norm_squared() >= residuals.norm_squared() {
                break;
            }
            (at, residuals) = (followed, after);
            if residuals.norm_squared() < expected + FOLLOWED_TO {
                break;
            }
        }
        Some(Optimum { chi2: residuals.norm_squared(), at })
    }

    /// Errors of event epochs, and their contribution to those of all others: each time has the probability exp(-chi2/2), all others
    /// at their conditional optimum, which changes with the time even where chi2 does not.
    pub(super) fn add_event_epochs(&self, optimum: &Optimum, errors: &mut Errors) {
        for index in (0..optimum.at.len()).filter(|&index| self.parameters[index].is_event_epoch) {
            let around = self.around(optimum, index, UNLIKELY);
            let least = around.iter().flat_map(|one| &one.nodes).map(|node| node.chi2).fold(optimum.chi2, f64::min);
            let n = optimum.at.len();
            let (mut all, mut squares) = (0.0, DMatrix::zeros(n, n));
            for one in &around {
                for point in one.points() {
                    // Not below what was reached: a parabola may be.
                    let likely = one.step_yr() * (-0.5 * (point.chi2 - least).max(0.0)).exp();
                    let off = DVector::from_fn(n, |other, _| point.at[other] - optimum.at[other]);
                    all += likely;
                    squares += likely * &off * off.transpose();
                }
            }
            if all > 0.0 {
                errors.add(index, &(squares / all));
            }
        }
    }
}

/// A value after a step, within the bounds.
fn followed(((parameter, at), step): ((&Parameter, &f64), &f64)) -> f64 {
    match *step {
        0.0 => *at,
        step => parameter.outer(parameter.inner((at + step).clamp(parameter.low, parameter.high))),
    }
}

/// An interval between epochs, with an event epoch in it.
struct Interval {
    from_yr: f64,
    to_yr: f64,
    /// Conditional optima at [`NODES`].
    nodes: [Optimum; 3],
}

impl Interval {
    fn step_yr(&self) -> f64 {
        (self.to_yr - self.from_yr) / POINTS as f64
    }

    /// Conditional optima at evenly spaced times, by parabolas through the nodes: within an interval the model is smooth.
    fn points(&self) -> impl Iterator<Item = Optimum> + '_ {
        let parabola = |values: [f64; 3], place: f64| {
            let [first, centre, last] = values;
            let (share, curved) = (place / NODES[2], 0.5 * (first + last) - centre);
            centre + 0.5 * share * (last - first) + share * share * curved
        };
        (0..POINTS).map(move |point| {
            let place = (2 * point + 1) as f64 / POINTS as f64 - 1.0;
            let at = (0..self.nodes[0].at.len())
                .map(|index| parabola([0, 1, 2].map(|node| self.nodes[node].at[index]), place));
            Optimum { at: at.collect(), chi2: parabola([0, 1, 2].map(|node| self.nodes[node].chi2), place) }
        })
    }
}
