//! Measurements with errors as flown data have them.

use clap::ValueEnum;
use ctiplan::analysis::measurement::DataSet;
use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How errors are wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Rough {
    /// Quoted 1.4 times too small
    Scale,
    /// Quoted 2 times too large
    Large,
    /// 4 % of the rows off by 12 to 30 sigma
    Outliers,
    /// Correlated by 0.6 along trails (of the model with what is hidden)
    Correlated,
    /// A constant of 3 to 8 sigma in all values of a file
    Pedestal,
}

/// Correlation of neighbours in a trail.
pub const CORRELATION: f64 = 0.6;

impl Rough {
    /// Makes data so.
    pub fn apply(self, data: &mut [DataSet], seed: u64) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sign = |random: &mut ChaCha8Rng| if random.random::<bool>() { 1.0 } else { -1.0 };
        for set in data {
            match self {
                Rough::Scale => set.rows.iter_mut().for_each(|row| row.sigma /= 1.4),
                Rough::Large => set.rows.iter_mut().for_each(|row| row.sigma *= 2.0),
                Rough::Outliers => {
                    let count = (0.04 * set.rows.len() as f64).round() as usize;
                    for row in sample(&mut random, set.rows.len(), count) {
                        let off_sigma = sign(&mut random) * random.random_range(12.0..30.0);
                        set.rows[row].value += off_sigma * set.rows[row].sigma;
                    }
                }
                Rough::Correlated => {}
                Rough::Pedestal => {
                    let mut sigmas: Vec<f64> = set.rows.iter().map(|row| row.sigma).collect();
                    sigmas.sort_by(f64::total_cmp);
                    let off = sign(&mut random) * random.random_range(3.0..8.0) * sigmas[sigmas.len() / 2];
                    set.rows.iter_mut().for_each(|row| row.value += off);
                }
            }
        }
    }
}
