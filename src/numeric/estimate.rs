//! Numbers estimated from draws, and their errors.
//!
//! Errors are those of the bootstrap: the draws are resampled with replacement, and the number is computed for each such sample
//! (Efron 1979, Ann. Statist. 7, 1).

use crate::numeric::parallel;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Samples of the bootstrap: the relative accuracy of an error is a tenth.
const SAMPLES: u64 = 200;

/// Random streams of the bootstrap, separate from those of the draws themselves.
const STREAMS: u64 = 1 << 40;

/// A number with its standard error, in the same unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard error from the finite number of draws.
    pub error: f64,
}

/// Values of statistics, and their standard errors from the finite number of draws.
///
/// `statistics` computes them from the draws with the given indices, always the same number of statistics. A statistic may be
/// infinite: later than the horizon. An error is half the central 68.3 % of the samples, or its lower half if the upper one is
/// infinite; None if that is also infinite. The same seed gives the same bits for any number of threads.
pub fn with_errors(
    draws: usize,
    seed: u64,
    statistics: impl Fn(&[usize]) -> Vec<f64> + Sync,
) -> Vec<(f64, Option<f64>)> {
    let sample = |sample: u64| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAMS + sample);
        let places: Vec<usize> = (0..draws).map(|_| random.random_range(0..draws)).collect();
        statistics(&places)
    };
    let samples: Vec<Vec<f64>> = parallel::map(0..SAMPLES, sample);
    let values = statistics(&(0..draws).collect::<Vec<_>>());
    let error = |index: usize| spread(samples.iter().map(|sample| sample[index]).collect());
    values.into_iter().enumerate().map(|(index, value)| (value, error(index))).collect()
}

/// The quantile of sorted numbers at a probability `p`, with linear interpolation. Numbers may be infinite.
pub fn quantile(sorted: &[f64], p: f64) -> f64 {
    let place = p * (sorted.len() - 1) as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    if low == high { low } else { low + place.fract() * (high - low) }
}

/// Half the central 68.3 % of values.
fn spread(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let [low, middle, high] =
        [0.1587, 0.5, 0.8413].map(|share| values[(share * (values.len() - 1) as f64).round() as usize]);
    let half = if high.is_finite() { 0.5 * (high - low) } else { middle - low };
    half.is_finite().then_some(half)
}

impl Estimate {
    /// The estimate times an exact factor.
    pub fn times(self, factor: f64) -> Estimate {
        Estimate { value: factor * self.value, error: factor.abs() * self.error }
    }

    /// An exact number over the estimate.
    pub fn under(self, dividend: f64) -> Estimate {
        let value = dividend / self.value;
        Estimate { value, error: (value / self.value).abs() * self.error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_mean_is_that_of_the_textbook() {
        let values: Vec<f64> = (0..400).map(|index| f64::from(index % 20)).collect();
        let mean =
            |places: &[usize]| vec![places.iter().map(|place| values[*place]).sum::<f64>() / places.len() as f64];
        let (value, error) = with_errors(values.len(), 1, mean)[0];
        assert_eq!(value, 9.5);
        // √((20² − 1)/12/400)
        let expected = (399.0 / 12.0 / 400.0_f64).sqrt();
        assert!((error.unwrap() / expected - 1.0).abs() < 0.25, "{error:?} {expected}");
    }
}
