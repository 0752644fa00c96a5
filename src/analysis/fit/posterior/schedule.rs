//! Length of the chains.

use std::ops::ControlFlow;

use hammer_and_sample as sampler;

use crate::numeric::autocorrelation;

/// Minimum length of the chain after burn-in, in autocorrelation times.
pub(super) const LONG: f64 = 50.0;

/// Fraction of the steps discarded as burn-in.
const BURN_IN: f64 = 0.25;

/// Steps before the first check of the chain, and the factor to the next.
const FIRST: usize = 100;
const NEXT: f64 = 1.3;

/// Until a chain is long enough, or no evaluations are left.
pub(super) struct Schedule {
    walkers: usize,
    /// Requested number of independent draws.
    wanted: usize,
    /// Maximum number of steps, by the evaluations left.
    most: usize,
    /// Steps at which the chain is checked.
    look: usize,
}

impl Schedule {
    /// For a number of walkers and of evaluations.
    pub fn new(walkers: usize, wanted: usize, evaluations: usize) -> Schedule {
        // One evaluation for each start, and always a few steps.
        let most = (evaluations / walkers).saturating_sub(1).max(4);
        Schedule { walkers, wanted, most, look: FIRST }
    }

    fn is_enough(&self, chain: &[Vec<f64>]) -> bool {
        let after = kept(chain, self.walkers);
        let dimensions = after.first().map_or(0, Vec::len);
        (0..dimensions).all(|place| {
            let time = time(after, place, self.walkers);
            let steps = (after.len() / self.walkers) as f64;
            steps >= LONG * time && after.len() as f64 >= time * self.wanted as f64
        })
    }
}

impl sampler::Schedule<Vec<f64>> for Schedule {
    fn next_step(&mut self, chain: &[Vec<f64>]) -> ControlFlow<()> {
        let steps = chain.len() / self.walkers;
        if steps >= self.most {
            return ControlFlow::Break(());
        }
        if steps == self.look {
            self.look = (NEXT * steps as f64).ceil() as usize;
            if self.is_enough(chain) {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }
}

/// The part of a chain, step after step of all walkers, after burn-in.
pub(super) fn kept(chain: &[Vec<f64>], walkers: usize) -> &[Vec<f64>] {
    let steps = chain.len() / walkers;
    let burn_in = (BURN_IN * steps as f64).ceil() as usize;
    &chain[burn_in * walkers..]
}

/// Integrated autocorrelation time of a coordinate, in steps.
pub(super) fn time(chain: &[Vec<f64>], place: usize, walkers: usize) -> f64 {
    let of_walker =
        |walker: usize| chain.iter().skip(walker).step_by(walkers).map(|at| at[place]).collect::<Vec<f64>>();
    autocorrelation::time(&(0..walkers).map(of_walker).collect::<Vec<_>>())
}
