//! Number of a draw → its quantile in every distribution, between 0 and 1.
//!
//! Draws are independent of each other: it does not matter which process computes one, or what it computed before. Each has its own
//! stream of random numbers, selected by its number. In a Latin hypercube (McKay, Beckman & Conover 1979, Technometrics 21, 239)
//! each distribution is divided into as many strata of equal probability as there are draws. One permutation per distribution, from
//! the seed alone, assigns draws to strata: every stratum has one draw. Sobol's points (Sobol 1967, with the scrambling of Owen
//! 1995 after Burley 2020, JCGT 9(4), 1) fill all distributions together: means of smooth functions converge faster with n draws
//! than 1/√n.

use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The sampling of distributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// One draw in each stratum of equal probability, for each distribution.
    LatinHypercube,
    /// Independent draws.
    MonteCarlo,
    /// Scrambled points of Sobol's sequence, at most [`MOST_SOBOL`].
    Sobol,
}

/// Maximum number of points of Sobol's sequence, and of distributions.
pub const MOST_SOBOL: (u64, usize) = (1 << 16, sobol_burley::NUM_DIMENSIONS as usize);

/// Draws from several distributions together.
#[derive(Clone, Debug)]
pub struct Sample {
    seed: u64,
    draws: u64,
    dimensions: usize,
    sampling: Sampling,
    /// For each distribution the stratum of each draw; empty for independent draws.
    strata: Vec<Vec<u32>>,
}

impl Sample {
    /// `draws` draws from `dimensions` distributions.
    ///
    /// # Panics
    /// With more than [`MOST_SOBOL`] points of Sobol's sequence.
    pub fn new(sampling: Sampling, seed: u64, draws: u64, dimensions: usize) -> Sample {
        if sampling == Sampling::Sobol {
            assert!(draws <= MOST_SOBOL.0 && dimensions <= MOST_SOBOL.1, "too many points of Sobol's sequence");
        }
        let permutation = |dimension: usize| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            // Streams of draws count upwards from 0.
            random.set_stream(u64::MAX - dimension as u64);
            let mut strata: Vec<u32> = (0..draws as u32).collect();
            strata.shuffle(&mut random);
            strata
        };
        let strata = match sampling {
            Sampling::LatinHypercube => (0..dimensions).map(permutation).collect(),
            Sampling::MonteCarlo | Sampling::Sobol => Vec::new(),
        };
        Sample { seed, draws, dimensions, sampling, strata }
    }

    /// The quantile of a draw in each distribution: above 0 and below 1.
    pub fn places(&self, draw: u64) -> Vec<f64> {
        if self.sampling == Sampling::Sobol {
            return (0..self.dimensions).map(|dimension| self.sobol(draw as u32, dimension as u32)).collect();
        }
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(draw);
        (0..self.dimensions)
            .map(|dimension| {
                // The midpoint of one of 2^53 equal parts: never 0; in the last stratum rounding may make it 1.
                let within = ((random.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
                let place = match self.strata.get(dimension) {
                    Some(strata) => (f64::from(strata[draw as usize]) + within) / self.draws as f64,
                    None => within,
                };
                place.min(1.0 - f64::EPSILON / 2.0)
            })
            .collect()
    }

    fn sobol(&self, draw: u32, dimension: u32) -> f64 {
        // Both halves of the seed matter.
        let seed = (self.seed as u32) ^ ((self.seed >> 32) as u32).rotate_left(16);
        let place = f64::from(sobol_burley::sample(draw, dimension, seed));
        place.clamp(SOBOL_EDGE, 1.0 - SOBOL_EDGE)
    }
}

/// Minimum distance from 0 and from 1 of Sobol's points, which have 24 bits.
const SOBOL_EDGE: f64 = 1.0 / (1_u64 << 25) as f64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latin_hypercube_meets_every_stratum_once() {
        let sample = Sample::new(Sampling::LatinHypercube, 7, 1000, 3);
        let places: Vec<Vec<f64>> = (0..1000).map(|draw| sample.places(draw)).collect();
        for dimension in 0..3 {
            let mut strata: Vec<usize> = places.iter().map(|place| (place[dimension] * 1000.0) as usize).collect();
            assert_ne!(strata, (0..1000).collect::<Vec<_>>());
            strata.sort();
            assert_eq!(strata, (0..1000).collect::<Vec<_>>());
        }
        // Distributions are independent: 1/√1000 is a standard deviation.
        let mean = places.iter().map(|place| (place[0] - 0.5) * (place[1] - 0.5) * 12.0).sum::<f64>() / 1000.0;
        assert!(mean.abs() < 4.0 / 1000_f64.sqrt(), "{mean}");
    }

    #[test]
    fn points_of_sobol_fill_every_pair_of_distributions() {
        // For 2^2k points, one is in each of 2^k × 2^k squares, for the first two dimensions.
        let sample = Sample::new(Sampling::Sobol, 5, 256, 2);
        let square = |draw: u64| {
            let places = sample.places(draw);
            ((places[0] * 16.0) as usize) * 16 + (places[1] * 16.0) as usize
        };
        let mut squares: Vec<usize> = (0..256).map(square).collect();
        squares.sort();
        assert_eq!(squares, (0..256).collect::<Vec<_>>());
        assert_ne!(sample.places(3), Sample::new(Sampling::Sobol, 6, 256, 2).places(3));
        // A mean of a product over 12 distributions is more accurate than for independent draws.
        let product = |sampling: Sampling| {
            let sample = Sample::new(sampling, 1, 4096, 12);
            let value = |draw: u64| sample.places(draw).iter().map(|place| 1.0 + 0.3 * (place - 0.5)).product::<f64>();
            ((0..4096).map(value).sum::<f64>() / 4096.0 - 1.0).abs()
        };
        assert!(product(Sampling::Sobol) < 0.2 * product(Sampling::MonteCarlo));
    }

    #[test]
    fn independent_draws_stay_when_there_are_more() {
        let few = Sample::new(Sampling::MonteCarlo, 7, 10, 2);
        let many = Sample::new(Sampling::MonteCarlo, 7, 10_000, 2);
        assert!((0..10).all(|draw| few.places(draw) == many.places(draw)));
        assert_ne!(few.places(0), Sample::new(Sampling::MonteCarlo, 8, 10, 2).places(0));
        let values: Vec<f64> = (0..10_000).map(|draw| many.places(draw)[1]).collect();
        let mean = values.iter().sum::<f64>() / 1e4;
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / 1e4;
        // Four standard errors: 1/√12 / 100 of the mean, 1/√180 / 100 of the variance.
        assert!((mean - 0.5).abs() < 4.0 * 0.00289 && (variance - 1.0 / 12.0).abs() < 4.0 * 0.000745);
    }
}
