//! Distributions of a key's values, by their quantiles.
//!
//! ```text
//! uniform     x = a + u (b − a)            log-uniform  x = a (b/a)^u
//! normal      x = μ + σ Φ⁻¹(u)             log-normal   x = m exp(σ Φ⁻¹(u))
//! ```
//!
//! u is uniform between 0 and 1. If a normal or log-normal distribution is truncated at `min` or `max`, u is uniform between the
//! probabilities of the two ends, so that the rest keeps its shape. Quantiles are used in both kinds of sampling, and preserve the
//! strata of a Latin hypercube.

use statrs::distribution::{ContinuousCDF, Normal};

/// A distribution of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distribution {
    /// Uniform between two numbers.
    Uniform {
        /// Smallest.
        from: f64,
        /// Largest.
        to: f64,
    },
    /// Uniform in the logarithm between two numbers above 0.
    LogUniform {
        /// Smallest.
        from: f64,
        /// Largest.
        to: f64,
    },
    /// Normal.
    Normal {
        /// μ.
        mean: f64,
        /// σ.
        sigma: f64,
        /// Truncation limits; infinite if there are none.
        ends: (f64, f64),
    },
    /// Log-normal.
    LogNormal {
        /// m, the median.
        median: f64,
        /// σ of the natural logarithm: if small, nearly the relative scatter.
        sigma: f64,
        /// Truncation limits; 0 and infinite if there are none.
        ends: (f64, f64),
    },
}

impl Distribution {
    /// The quantile at a probability `u` (above 0 and below 1).
    pub fn quantile(&self, u: f64) -> f64 {
        match *self {
            Distribution::Uniform { from, to } => (from + u * (to - from)).clamp(from, to),
            Distribution::LogUniform { from, to } => (from * (to / from).powf(u)).clamp(from, to),
            Distribution::Normal { mean, sigma, ends } => {
                let standard = cut(u, (ends.0 - mean) / sigma, (ends.1 - mean) / sigma);
                (mean + sigma * standard).clamp(ends.0, ends.1)
            }
            Distribution::LogNormal { median, sigma, ends } => {
                let standard = cut(u, (ends.0 / median).ln() / sigma, (ends.1 / median).ln() / sigma);
                (median * (sigma * standard).exp()).clamp(ends.0, ends.1)
            }
        }
    }

    /// Probability between the truncation limits; 1 without truncation.
    pub fn kept(&self) -> f64 {
        let normal = Normal::standard();
        let between = |low: f64, high: f64| normal.cdf(high) - normal.cdf(low);
        match *self {
            Distribution::Normal { mean, sigma, ends } => between((ends.0 - mean) / sigma, (ends.1 - mean) / sigma),
            Distribution::LogNormal { median, sigma, ends } => {
                between((ends.0 / median).ln() / sigma, (ends.1 / median).ln() / sigma)
            }
            _ => 1.0,
        }
    }
}

/// Quantile of the truncated standard normal distribution.
fn cut(u: f64, low: f64, high: f64) -> f64 {
    let normal = Normal::standard();
    let (below_low, below_high) = (normal.cdf(low), normal.cdf(high));
    normal.inverse_cdf(below_low + u * (below_high - below_low)).clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and standard deviation from the quantiles of evenly spaced probabilities.
    fn moments(distribution: Distribution, of: fn(f64) -> f64) -> (f64, f64) {
        const N: usize = 200_000;
        let values = (0..N).map(|i| of(distribution.quantile((i as f64 + 0.5) / N as f64)));
        let (sum, square) = values.fold((0.0, 0.0), |(sum, square), x| (sum + x, square + x * x));
        let mean = sum / N as f64;
        (mean, (square / N as f64 - mean * mean).sqrt())
    }

    fn near(found: (f64, f64), expected: (f64, f64)) {
        // The tails beyond the last of 200 000 quantiles contain 1e-4 of the variance.
        let scale = expected.1;
        assert!((found.0 - expected.0).abs() < 1e-4 * scale, "{found:?} {expected:?}");
        assert!((found.1 - expected.1).abs() < 3e-4 * scale, "{found:?} {expected:?}");
    }

    #[test]
    fn moments_are_those_on_paper() {
        let same: fn(f64) -> f64 = |x| x;
        let infinite = (f64::NEG_INFINITY, f64::INFINITY);
        near(moments(Distribution::Uniform { from: 2.0, to: 5.0 }, same), (3.5, 3.0 / 12_f64.sqrt()));
        near(
            moments(Distribution::LogUniform { from: 1.0, to: 1e3 }, f64::ln),
            (0.5 * 1e3_f64.ln(), 1e3_f64.ln() / 12_f64.sqrt()),
        );
        near(moments(Distribution::Normal { mean: 153.0, sigma: 2.0, ends: infinite }, same), (153.0, 2.0));
        let log_normal = Distribution::LogNormal { median: 0.5, sigma: 0.3, ends: (0.0, f64::INFINITY) };
        near(moments(log_normal, f64::ln), (0.5_f64.ln(), 0.3));
        // Half a normal distribution: mean σ √(2/π), standard deviation σ √(1 − 2/π).
        let half = Distribution::Normal { mean: 1.0, sigma: 2.0, ends: (1.0, f64::INFINITY) };
        let two_over_pi = 2.0 / std::f64::consts::PI;
        near(moments(half, same), (1.0 + 2.0 * two_over_pi.sqrt(), 2.0 * (1.0 - two_over_pi).sqrt()));
        assert!((half.kept() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_cut_distribution_keeps_to_its_ends() {
        let cut = Distribution::LogNormal { median: 1.0, sigma: 1.0, ends: (0.9, 1.1) };
        for u in [1e-300, 1e-9, 0.5, 1.0 - 1e-16] {
            assert!((0.9..=1.1).contains(&cut.quantile(u)));
        }
    }
}
