//! Numbers estimated from draws, and their errors.
//!
//! Errors are those of the bootstrap: the draws are resampled with replacement, and the number is computed for each such sample
//! (Efron 1979, Ann. Statist. 7, 1). Draws that are evenly spread in the order of an input (strata of equal probability, one draw in
//! each) are only exchanged with a neighbour in this order, as they stand for its part alone.

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
/// `order`: the draws in the order of an input in which they are evenly spread; None if they are independent. `statistics` computes
/// them from the draws with the given indices, always the same number of statistics. A statistic may be infinite: later than the
/// horizon. An error is half the central 68.3 % of the samples, or its lower half if the upper one is infinite; None if that is also
/// infinite. The same seed gives the same bits for any number of threads.
pub fn with_errors(
    draws: usize,
    order: Option<&[usize]>,
    seed: u64,
    statistics: impl Fn(&[usize]) -> Vec<f64> + Sync,
) -> Vec<(f64, Option<f64>)> {
    let sample = |sample: u64| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAMS + sample);
        statistics(&match order {
            None => (0..draws).map(|_| random.random_range(0..draws)).collect::<Vec<usize>>(),
            Some(order) => neighbours(order, sample as usize % 2, &mut random),
        })
    };
    let samples: Vec<Vec<f64>> = parallel::map(0..SAMPLES, sample);
    let values = statistics(&(0..draws).collect::<Vec<_>>());
    // Two of a pair resampled have half of the variance of the pair: (n - 1)/n with n = 2.
    let widened = if order.is_some() { std::f64::consts::SQRT_2 } else { 1.0 };
    let error = |index: usize| spread(samples.iter().map(|sample| sample[index]).collect()).map(|one| widened * one);
    values.into_iter().enumerate().map(|(index, value)| (value, error(index))).collect()
}

/// Each draw, or its neighbour in an order, at random: pairs begin at the first or at the second draw.
fn neighbours(order: &[usize], first: usize, random: &mut ChaCha8Rng) -> Vec<usize> {
    let mut places = order[..first].to_vec();
    for pair in order[first..].chunks(2) {
        places.extend(pair.iter().map(|_| pair[random.random_range(0..pair.len())]));
    }
    places
}

/// Standard error of the fraction of draws for which something holds, in the order of an input in which they are evenly spread: with
/// y = 1 where it holds and 0 where not, the variance of the sum is half the sum of squared differences between neighbours. At
/// least that of one change, as a change may be just beyond the first or the last of the draws.
pub fn share_error_in_order(holds: &[bool], order: &[usize]) -> f64 {
    let changes = order.windows(2).filter(|pair| holds[pair[0]] != holds[pair[1]]).count();
    (0.5 * changes.max(1) as f64).sqrt() / holds.len() as f64
}

/// Standard error of the fraction of n independent draws: that of a Beta distribution after a flat prior, which does not vanish for
/// fractions of 0 and 1.
pub fn share_error(share: f64, n: f64) -> f64 {
    let (some, others) = (share * n + 1.0, (1.0 - share) * n + 1.0);
    (some * others / (n + 3.0)).sqrt() / (n + 2.0)
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
        let (value, error) = with_errors(values.len(), None, 1, mean)[0];
        assert_eq!(value, 9.5);
        // √((20² − 1)/12/400)
        let expected = (399.0 / 12.0 / 400.0_f64).sqrt();
        assert!((error.unwrap() / expected - 1.0).abs() < 0.25, "{error:?} {expected}");
    }
    /// x evenly spread, y independent: the mean of x + y scatters as that of y, and so does a fraction.
    #[test]
    fn an_input_that_is_evenly_spread_has_no_error() {
        let n = 400;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|place| place * 7919 % n);
        let mut x = vec![0.0; n];
        order.iter().enumerate().for_each(|(rank, place)| x[*place] = rank as f64 / n as f64);
        let values: Vec<f64> = x.iter().map(|x| x + 0.1 * random.random::<f64>()).collect();
        let mean = |places: &[usize]| vec![places.iter().map(|place| values[*place]).sum::<f64>() / n as f64];
        let error = with_errors(n, Some(&order), 1, mean)[0].1.unwrap();
        let expected = 0.1 / (12.0 * n as f64).sqrt();
        assert!((error / expected - 1.0).abs() < 0.25, "{error} {expected}");
        // y changes the fraction where x is within 0.1 of the limit: of p = u (1 - u) the integral is 1/6.
        let holds: Vec<bool> = values.iter().map(|value| *value > 0.5).collect();
        let (found, expected) = (share_error_in_order(&holds, &order), (0.1 * n as f64 / 6.0).sqrt() / n as f64);
        assert!((found / expected - 1.0).abs() < 0.5, "{found} {expected}");
        assert!(found < 0.3 * share_error(0.5, n as f64));
        assert!((share_error_in_order(&vec![true; n], &order) - 0.5_f64.sqrt() / n as f64).abs() < 1e-12);
    }
}
