//! Autocorrelation time of a Markov chain.

/// Width of the window in autocorrelation times.
const WINDOW: f64 = 5.0;

/// Integrated autocorrelation time of a quantity along chains of equal length, in steps:
///
/// ```text
/// τ = 1 + 2 Σ ρ(k)   over lags k from 1 to M, with the least M ≥ 5 τ
/// ```
///
/// ρ is the mean autocorrelation of all chains about their common mean; the window is Sokal's (1997, in: Functional Integration,
/// NATO ASI B 361, 131). A mean over n steps of w chains has the variance σ²τ/(n w). The estimate is reliable for chains of at
/// least 50 τ; infinite if nothing moves.
pub(crate) fn time(chains: &[Vec<f64>]) -> f64 {
    let length = chains.first().map_or(0, Vec::len);
    let mean = chains.iter().flatten().sum::<f64>() / (length * chains.len()) as f64;
    let covariance = |lag: usize| {
        let products = |chain: &Vec<f64>| -> f64 {
            chain.iter().zip(&chain[lag..]).map(|(early, late)| (early - mean) * (late - mean)).sum()
        };
        // Divided by the length, not the number of products: late lags are noise.
        chains.iter().map(products).sum::<f64>() / (length * chains.len()) as f64
    };
    let variance = if length > 0 { covariance(0) } else { 0.0 };
    if variance <= 0.0 {
        return f64::INFINITY;
    }
    let mut time = 1.0;
    for lag in 1..length {
        time += 2.0 * covariance(lag) / variance;
        if lag as f64 >= WINDOW * time {
            break;
        }
    }
    time.max(1.0)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// x' = a x + noise: ρ(k) = aᵏ, τ = (1 + a)/(1 − a).
    #[test]
    fn the_time_of_an_autoregressive_chain_is_that_on_paper() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for a in [0.0, 0.5, 0.9] {
            let mut chain = || -> Vec<f64> {
                let mut x = 0.0;
                let mut next = || {
                    let noise: f64 = StandardNormal.sample(&mut random);
                    x = a * x + noise;
                    x
                };
                (0..5000).map(|_| next()).collect()
            };
            let chains: Vec<Vec<f64>> = (0..10).map(|_| chain()).collect();
            let expected = (1.0 + a) / (1.0 - a);
            let found = time(&chains);
            // √(2 (2 M + 1)/n) relative error, with M = 5 τ and n = 50 000 (Sokal 1997): at most 9 %.
            assert!((found / expected - 1.0).abs() < 0.2, "{found} {expected}");
        }
    }

    #[test]
    fn what_does_not_move_is_never_forgotten() {
        assert_eq!(time(&[vec![2.0; 10], vec![2.0; 10]]), f64::INFINITY);
        assert_eq!(time(&[]), f64::INFINITY);
    }
}
