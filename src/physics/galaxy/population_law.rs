//! Distribution of the galaxies of a deep survey from space: magnitudes, sizes, Sersic indices and ellipticities.
//!
//! ```text
//! dN/dm ∝ 10^(0.374 m)                                        magnitudes of a band like F606W or VIS
//! log10(r_half/arcsec) = x0(m) + s(m) z                       z: skew normal of shape −0.58
//!     x0 = 2.0738 − 0.10831 m,  s = 0.69013 − 0.021479 m;  up to 4.5 arcsec
//! |g|: Rayleigh's law of width 0.25, up to 0.7, any direction
//! Sersic index: log-normal, median 1.2, σ of the logarithm 1, from 0.5 to 4.5
//! ```
//!
//! Source: the public scripts (megalut, runs/euclid-like) of Tewes et al. 2019 (A&A 621, A36), who fitted galaxies of GEMS,
//! observed with the same camera as COSMOS (Rix et al. 2004, ApJS 152, 163). There |g| ends at 0.9 (2 % are above 0.7), and the
//! index begins at 0.3; profiles here begin at 0.5. Size, index and ellipticity are independent of each other.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, LogNormal, StandardNormal};

/// d log10(dN/dm)/dm.
const COUNTS: f64 = 0.374;

/// Shape parameter of the skew normal distribution of the logarithm of sizes.
const SKEW: f64 = -0.58;

/// Largest half-light radius, arcsec.
const LARGEST_ARCSEC: f64 = 4.5;

/// Width of the Rayleigh distribution of |g|, and the largest |g|.
const RAYLEIGH: f64 = 0.25;
const FLATTEST: f64 = 0.7;

/// Median and width of the logarithm of the Sersic index, and its range.
const INDEX: (f64, f64) = (1.2, 1.0);
const INDICES: [f64; 2] = [0.5, 4.5];

/// A galaxy of the law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnGalaxy {
    /// Magnitude.
    pub magnitude: f64,
    /// Circularised half-light radius before the PSF, arcsec.
    pub half_light_arcsec: f64,
    /// Sersic index.
    pub sersic_index: f64,
    /// Ellipticity (e1, e2), of length (a² − b²)/(a² + b²).
    pub ellipticity: [f64; 2],
}

impl DrawnGalaxy {
    /// Draws a galaxy between two magnitudes, the brighter one first.
    pub fn draw([bright, faint]: [f64; 2], random: &mut impl Rng) -> DrawnGalaxy {
        let magnitude = {
            let [low, high] = [0.0, COUNTS * (faint - bright)].map(|exponent: f64| 10_f64.powf(exponent));
            bright + (low + random.random::<f64>() * (high - low)).log10() / COUNTS
        };
        let mut deviate = || -> f64 { StandardNormal.sample(random) };
        let skew = SKEW / (1.0 + SKEW * SKEW).sqrt();
        let z = skew * deviate().abs() + (1.0 - skew * skew).sqrt() * deviate();
        let log_size = 2.0738 - 0.10831 * magnitude + (0.69013 - 0.021479 * magnitude).max(0.0) * z;
        let g = bounded(|| RAYLEIGH * deviate().hypot(deviate()), [0.0, FLATTEST]);
        let direction = std::f64::consts::TAU * random.random::<f64>();
        // |g| = (a − b)/(a + b).
        let e = 2.0 * g / (1.0 + g * g);
        let index = LogNormal::new(INDEX.0.ln(), INDEX.1).expect("a positive width");
        DrawnGalaxy {
            magnitude,
            half_light_arcsec: 10_f64.powf(log_size).min(LARGEST_ARCSEC),
            sersic_index: bounded(|| index.sample(random), INDICES),
            ellipticity: [e * direction.cos(), e * direction.sin()],
        }
    }
}

/// The first draw within a range.
fn bounded(mut draw: impl FnMut() -> f64, [low, high]: [f64; 2]) -> f64 {
    loop {
        let drawn = draw();
        if (low..=high).contains(&drawn) {
            return drawn;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn draws_have_the_law() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let galaxies: Vec<DrawnGalaxy> = (0..20_000).map(|_| DrawnGalaxy::draw([20.0, 24.5], &mut random)).collect();
        let share = |of: fn(&DrawnGalaxy) -> bool| galaxies.iter().filter(|galaxy| of(galaxy)).count() as f64 / 2e4;
        // (10^(0.374·3.5) − 1)/(10^(0.374·4.5) − 1)
        assert!((share(|galaxy| galaxy.magnitude < 23.5) - 0.4109).abs() < 0.015);
        let log = |galaxy: &DrawnGalaxy| galaxy.half_light_arcsec.log10();
        let near: Vec<f64> = galaxies.iter().filter(|galaxy| galaxy.magnitude > 24.4).map(log).collect();
        // Mean of the skew normal at 24.45: x0 + s δ √(2/π).
        let mean = near.iter().sum::<f64>() / near.len() as f64;
        let expected = 2.0738 - 0.10831 * 24.45 + (0.69013 - 0.021479 * 24.45) * -0.5017 * 0.79788;
        assert!((mean - expected).abs() < 0.02, "{mean} {expected}");
        // The median of the Rayleigh distribution truncated at 0.7: 2 % are above.
        let g = |galaxy: &DrawnGalaxy| {
            let e = galaxy.ellipticity[0].hypot(galaxy.ellipticity[1]);
            e / (1.0 + (1.0 - e * e).sqrt())
        };
        let flat = galaxies.iter().filter(|galaxy| g(galaxy) > 0.25 * (2.0 * 2.0_f64.ln()).sqrt()).count() as f64 / 2e4;
        assert!((flat - 0.49).abs() < 0.015, "{flat}");
        assert!(galaxies.iter().all(|galaxy| (0.5..=4.5).contains(&galaxy.sersic_index)));
    }
}
