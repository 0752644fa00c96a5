//! How often noise alone does as well, over everything that was tried.
//!
//! Noise of whitened residuals (`whitening`) is drawn many times, the part that the free parameters absorb is removed, and the
//! whole search is repeated on it: every effect, every trial, to first order in the strength. (In pure noise a fit finds only weak
//! effects, for which the first order suffices; `docs/diagnosis.md` shows how well this holds.) Each effect's largest gain in chi2
//! is converted to its own p-value, because effects differ in degrees of freedom. The false-alarm probability is how often the
//! lowest p-value of all effects is as low.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::fitted_model::{Case, Node};
use super::hypothesis::Trial;
use crate::analysis::whitening::Whitening;
use crate::numeric::parallel;

/// Simulations of noise.
const SIMULATIONS: u64 = 4000;

/// Simulations that must exceed a value for its probability to be estimated from their number.
const ENOUGH: usize = 20;

/// The noise of whitened residuals.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Noise {
    /// Standard deviation in each data set, in units of its sigma.
    scale: Vec<f64>,
    /// Degrees of freedom from which that sigma was estimated, in each data set; None if it is as quoted.
    freedom: Vec<Option<f64>>,
}

/// Excess of a file's chi2, in its standard deviations, from which its errors are taken as too small. The significance of effects
/// is then computed with larger errors, so it costs little to do this in one of forty files whose errors are right.
const BEYOND: f64 = 2.0;

impl Noise {
    /// Noise with the given errors; estimated errors are uncertain by their degrees of freedom.
    pub(super) fn of(case: &Case) -> Noise {
        let freedom = case.data.iter().map(|set| set.shared.freedom).collect();
        Noise { scale: vec![1.0; case.data.len()], freedom }
    }

    /// The residual noise of a fitted model: larger than the errors if their excess is significant, and then as uncertain as its
    /// estimate.
    pub(super) fn left_at(case: &Case, node: &Node) -> Noise {
        let mut noise = Noise::of(case);
        let taken = node.freedom() / case.n() as f64;
        for set in 0..case.data.len() {
            let rows = case.rows(set);
            let freedom = (rows.len() as f64 * taken).max(1.0);
            let chi2: f64 = rows.map(|row| node.residuals[row].powi(2)).sum();
            if chi2 > freedom + BEYOND * (2.0 * freedom).sqrt() {
                noise.scale[set] = (chi2 / freedom).sqrt();
                noise.freedom[set] = Some(noise.freedom[set].map_or(freedom, |known| known.min(freedom)));
            }
        }
        noise
    }

    fn sample(&self, case: &Case, correlations: &[Whitening], random: &mut ChaCha8Rng) -> DVector<f64> {
        let scale = self.scale.iter().zip(&self.freedom).map(|(scale, freedom)| {
            // An error estimated from noise is itself uncertain: Student's t.
            let squares = freedom.map(|freedom| (freedom, rand_distr::ChiSquared::new(freedom).expect("above 0")));
            scale * squares.map_or(1.0, |(freedom, law)| (freedom / law.sample(random)).sqrt())
        });
        let scale: Vec<f64> = scale.collect();
        let white = DVector::from_fn(case.n(), |row, _| {
            let fresh: f64 = StandardNormal.sample(random);
            scale[case.set_of[row]] * fresh
        });
        // So is an estimated correlation: errors correlated by another one, whitened with the estimate.
        if correlations.is_empty() {
            return white;
        }
        let coloured = correlations[random.random_range(0..correlations.len())].undone(white.as_slice());
        DVector::from_vec(case.whitening.linear(&coloured))
    }
}

/// The null distribution: what the whole search finds in noise.
pub(super) struct Null {
    /// For each hypothesis the gains of its best trial, ascending.
    gains: Vec<Vec<f64>>,
    /// Degrees of freedom of the chi2 distribution that the tail of each follows.
    freedom: Vec<f64>,
    /// Lowest p-value of all hypotheses in each simulation, ascending.
    least: Vec<f64>,
}

/// Correlations that stand for the error of an estimated one.
const CORRELATIONS: usize = 16;

/// Simulations that are searched together, by one matrix product; the result does not depend on it.
const TOGETHER: u64 = 100;

/// For each simulation of noise at a fitted model the gain of each hypothesis' best trial, and chi2.
fn searched(case: &Case, node: &Node, trials: &[Vec<Trial>], noise: &Noise, seed: u64) -> Vec<(Vec<f64>, f64)> {
    let directions: Vec<_> = trials.iter().flatten().flat_map(|trial| trial.basis.column_iter()).collect();
    // `[(direction, row)]`
    let directions = DMatrix::from_fn(directions.len(), case.n(), |direction, row| directions[direction][row]);
    let correlations = case.at_other_correlations(CORRELATIONS);
    let some = |first: u64| {
        let samples: Vec<DVector<f64>> = (first..first + TOGETHER)
            .map(|simulation| {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(simulation);
                noise.sample(case, &correlations, &mut random)
            })
            .collect();
        let samples = DMatrix::from_columns(&samples);
        let residuals = &samples - &node.basis * (node.basis.transpose() * &samples);
        let along = &directions * &residuals;
        let of_one = |simulation: usize| {
            let along = along.column(simulation);
            let (mut along, mut gains) = (along.as_slice(), Vec::with_capacity(trials.len()));
            for trials in trials {
                let mut best = 0.0_f64;
                for trial in trials {
                    let (here, rest) = along.split_at(trial.dimensions());
                    best = best.max(trial.gain_along(here));
                    along = rest;
                }
                gains.push(best);
            }
            (gains, residuals.column(simulation).norm_squared())
        };
        (0..samples.ncols()).map(of_one).collect::<Vec<_>>()
    };
    let firsts: Vec<u64> = (0..SIMULATIONS).step_by(TOGETHER as usize).collect();
    parallel::map(firsts, some).into_iter().flatten().collect()
}

impl Null {
    /// Repeats the search on noise at a fitted model.
    pub fn simulate(case: &Case, node: &Node, trials: &[Vec<Trial>], noise: &Noise, seed: u64) -> Null {
        let simulated: Vec<(Vec<f64>, f64)> = searched(case, node, trials, noise, seed);
        let mut gains: Vec<Vec<f64>> = Vec::new();
        for hypothesis in 0..trials.len() {
            let mut all: Vec<f64> = simulated.iter().map(|(gains, _)| gains[hypothesis]).collect();
            all.sort_by(f64::total_cmp);
            gains.push(all);
        }
        let share = |hypothesis: usize, gain: f64| {
            let beyond = SIMULATIONS as usize - gains[hypothesis].partition_point(|known| *known < gain);
            beyond as f64 / SIMULATIONS as f64
        };
        let mut least: Vec<f64> = simulated
            .iter()
            .map(|(gains, _)| {
                let chances = gains.iter().enumerate().filter(|(_, gain)| **gain > 0.0);
                chances.map(|(hypothesis, gain)| share(hypothesis, *gain)).fold(1.0, f64::min)
            })
            .collect();
        least.sort_by(f64::total_cmp);
        let freedom = trials.iter().map(|trials| {
            let dimensions = trials.iter().map(Trial::dimensions).max().unwrap_or(1);
            (dimensions + usize::from(trials.len() > 2)) as f64
        });
        Null { freedom: freedom.collect(), gains, least }
    }

    /// Probability that noise alone gains as much for one hypothesis with any of its trials.
    pub fn chance(&self, hypothesis: usize, gain: f64) -> f64 {
        let known = &self.gains[hypothesis];
        let beyond = known.len() - known.partition_point(|known| *known < gain);
        if beyond >= ENOUGH {
            return beyond as f64 / known.len() as f64;
        }
        // If free parameters absorb it, noise gains nothing, to first order.
        let law = ChiSquared::new(self.freedom[hypothesis]).expect("above 0");
        if known[known.len() - 1] <= 0.0 {
            return law.sf(gain);
        }
        // Beyond the simulations, extrapolated with a chi2 distribution from the last well-determined gain.
        let last = known[known.len() - ENOUGH];
        let at_last = ENOUGH as f64 / known.len() as f64;
        if last <= 0.0 { at_last * law.sf(gain) } else { at_last * (law.sf(gain) / law.sf(last)).min(1.0) }
    }

    /// Probability that noise alone makes any hypothesis look as good.
    pub fn false_alarm(&self, hypothesis: usize, gain: f64) -> f64 {
        let chance = self.chance(hypothesis, gain);
        let below = |chance: f64| self.least.partition_point(|least| *least <= chance);
        let seen = below(chance);
        if seen >= 4 * ENOUGH {
            return seen as f64 / self.least.len() as f64;
        }
        // Effective number of trials, from the distribution of the lowest p-values.
        let at = 4.0 * ENOUGH as f64 / self.least.len() as f64;
        let trials = (below(at) as f64 / (at * self.least.len() as f64)).max(1.0);
        (chance * trials).min(1.0)
    }

    /// The gain of a hypothesis at which its false-alarm probability equals a level.
    pub fn threshold(&self, hypothesis: usize, level: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1000.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.false_alarm(hypothesis, middle) > level { low = middle } else { high = middle }
        }
        high
    }
}
