//! Epochs of events (a flare, a bakeout): data only determine between which two of their own epochs these lie.

use nalgebra::DVector;

use super::problem::{LOOSE, Optimum, Problem, chi2};
use crate::error::InputError;
use crate::numeric::least_squares::Span;

/// Increase of chi2 up to which an event epoch fits equally well: one standard error.
const AS_GOOD: f64 = 1.0;

/// Increase of chi2 above which no event epoch is searched.
const UNLIKELY: f64 = 16.0;

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
                for found in coarse.iter().map(|(_, found)| found.clone()).chain(fine.collect::<Vec<_>>()) {
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

    /// An optimum with each event epoch at the centre of the interval in which chi2 is equally good: its mean, if the data
    /// determine no more.
    pub(super) fn centred(&self, optimum: Optimum) -> Result<Optimum, InputError> {
        let (mut found, most) = (optimum.clone(), optimum.chi2 + AS_GOOD);
        for index in (0..found.at.len()).filter(|&index| self.parameters[index].is_event_epoch) {
            let around = self.around(&found, index, AS_GOOD);
            let moment = found.at[index];
            let from_yr = around.iter().map(|one| one.from_yr).fold(moment, f64::min);
            let to_yr = around.iter().map(|one| one.to_yr).fold(moment, f64::max);
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

    /// Intervals between epochs where an event may lie, outwards from that of an optimum until chi2 has increased by `rise`; the
    /// other parameters follow to first order, if that helps.
    fn around(&self, optimum: &Optimum, index: usize, rise: f64) -> Vec<Interval> {
        let epochs = self.epochs();
        let interval = |ends: &[f64]| -> Option<Interval> {
            let mut at = optimum.at.clone();
            at[index] = 0.5 * (ends[0] + ends[1]);
            let residuals = DVector::from_vec(self.residuals(&at).ok()?);
            // The signature of a flare depends on its epoch.
            let jacobian = self.jacobian(&at).ok()?;
            let follow = -Span::of(&jacobian, LOOSE).solve(&residuals);
            // Far from the optimum, or along parameters that the epoch makes equivalent, the first order may promise too much.
            let followed: Vec<f64> = at.iter().zip(&follow).map(|(at, follow)| at + follow).collect();
            let at_followed = self.residuals(&followed).map_or(f64::INFINITY, |residuals| chi2(&residuals));
            let here = residuals.norm_squared();
            let helps = at_followed <= here;
            let (least, follow) = if helps { (at_followed, follow) } else { (here, DVector::zeros(at.len())) };
            Some(Interval { from_yr: ends[0], to_yr: ends[1], rise: least - optimum.chi2, follow })
        };
        let near = |one: &Interval| one.rise < rise;
        let moment = optimum.at[index];
        let Some(here) = epochs.windows(2).position(|pair| (pair[0]..=pair[1]).contains(&moment)) else {
            return Vec::new();
        };
        let before = epochs[..=here + 1].windows(2).rev().map_while(|ends| interval(ends).filter(near));
        let after = epochs[here + 1..].windows(2).map_while(|ends| interval(ends).filter(near));
        before.chain(after).collect()
    }

    /// Errors of event epochs, and their contribution to those of all others: the probability of each interval between epochs is
    /// proportional to its length times exp(−chi2/2).
    pub(super) fn add_event_epochs(&self, optimum: &Optimum, sigmas: &mut [Option<f64>]) {
        for index in (0..optimum.at.len()).filter(|&index| self.parameters[index].is_event_epoch) {
            let around = self.around(optimum, index, UNLIKELY);
            let likely = |one: &Interval| (one.to_yr - one.from_yr) * (-0.5 * one.rise).exp();
            let all: f64 = around.iter().map(likely).sum();
            if all == 0.0 {
                continue;
            }
            let mean =
                |of: &dyn Fn(&Interval) -> f64| around.iter().map(|one| likely(one) * of(one)).sum::<f64>() / all;
            // Mean of (t − epoch)² over an interval.
            let square = |one: &Interval| {
                let [from, to] = [one.from_yr, one.to_yr].map(|t_yr| t_yr - optimum.at[index]);
                (from * from + from * to + to * to) / 3.0
            };
            for (other, sigma) in sigmas.iter_mut().enumerate() {
                *sigma = match sigma {
                    _ if other == index => Some(mean(&square).sqrt()),
                    Some(sigma) => Some(sigma.hypot(mean(&|one| one.follow[other].powi(2)).sqrt())),
                    None => None,
                };
            }
        }
    }
}

/// An interval between epochs, with an event epoch in it.
struct Interval {
    from_yr: f64,
    to_yr: f64,
    /// Increase of chi2 above that of the optimum.
    rise: f64,
    /// Changes of the other parameters.
    follow: DVector<f64>,
}
