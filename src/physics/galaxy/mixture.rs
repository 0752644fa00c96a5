//! Profiles as sums of Gaussians.

use std::f64::consts::{LN_2, PI};
use std::num::NonZeroUsize;
use std::sync::Arc;

use gauss_quad::GaussLegendre;
use statrs::function::gamma::{gamma_ur, ln_gamma};

use crate::numeric::recent::Recent;

/// One elliptical Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Component {
    /// Share of the flux.
    pub weight: f64,
    /// Variance along x, px².
    pub variance_x: f64,
    /// Variance along y, px².
    pub variance_y: f64,
    /// Covariance of x and y, px²; 0 if the axes are those of the ellipse.
    pub covariance: f64,
}

impl Component {
    /// Share of the flux within a circle.
    pub fn within(&self, radius_px: f64) -> f64 {
        // In polar coordinates the radial integral is elementary, and the angular one periodic and smooth.
        let angles = 64;
        let per_angle = (0..angles).map(|k| {
            let (sine, cosine) = (2.0 * PI * k as f64 / angles as f64).sin_cos();
            let q = self.inverse(cosine, sine);
            -(-0.5 * radius_px * radius_px * q).exp_m1() / q
        });
        per_angle.sum::<f64>() / (angles as f64 * self.determinant().sqrt())
    }

    /// Correlation of x and y.
    pub fn correlation(&self) -> f64 {
        self.covariance / (self.variance_x * self.variance_y).sqrt()
    }

    /// Determinant of the covariance matrix, px⁴.
    fn determinant(&self) -> f64 {
        self.variance_x * self.variance_y - self.covariance * self.covariance
    }

    /// Quadratic form of the inverse covariance matrix for a unit vector, px⁻².
    fn inverse(&self, cosine: f64, sine: f64) -> f64 {
        if self.covariance == 0.0 {
            return cosine * cosine / self.variance_x + sine * sine / self.variance_y;
        }
        let along = cosine * cosine * self.variance_y + sine * sine * self.variance_x;
        (along - 2.0 * sine * cosine * self.covariance) / self.determinant()
    }
}

/// Step in the logarithm of the variance. The sum over widths differs from the integral by about exp(−π²/step) of the peak, 7e-8,
/// times a power of π²/step.
const LOG_STEP: f64 = 0.6;

/// Flux neglected at the ends of a mixture.
const TAIL: f64 = 1e-7;

/// Moffat profile of unit flux: weights and variances (px²). β above 1.
pub(super) fn moffat(fwhm_px: f64, beta: f64) -> Vec<(f64, f64)> {
    // I ∝ (1 + r²/a²)^−β is one half at r = FWHM/2.
    let a2 = (fwhm_px / 2.0).powi(2) / (LN_2 / beta).exp_m1();
    // Flux of the component exp(−s r²/a²): Gamma law of index β − 1 in s, here per unit of ln s.
    let density = |log_s: f64| ((beta - 1.0) * log_s - log_s.exp() - ln_gamma(beta - 1.0)).exp();
    // For large β the distribution is narrow in ln s: as 1/√(β−1).
    let step = LOG_STEP / (1.0 + (beta - 1.0) / 4.0).sqrt();
    sum(step, (beta - 1.0).ln(), density)
        .into_iter()
        .map(|(weight, log_s)| (weight, a2 / (2.0 * log_s.exp())))
        .collect()
}

/// Sersic profile of unit flux: weights and variances (px²). Index from 0.5.
pub(super) fn sersic(index: f64, half_light_px: f64) -> Vec<(f64, f64)> {
    // The same galaxy is computed with several shears and sizes.
    static KNOWN: Recent<f64, Arc<Vec<(f64, f64)>>> = Recent::new(64);
    let round = KNOWN.get(index, |index| Arc::new(round_sersic(*index)));
    round.iter().map(|(weight, variance)| (*weight, half_light_px * half_light_px * variance)).collect()
}

/// The same for half-light radius 1.
fn round_sersic(index: f64) -> Vec<(f64, f64)> {
    let b = half_light_coefficient(index);
    // exp(−S b^2n r²/R²) has the variance R²/(2 b^2n S).
    let variance = |log_s: f64| 0.5 * (-2.0 * index * b.ln() - log_s).exp();
    let gamma = 1.0 / (2.0 * index);
    if gamma > NARROW {
        return vec![(1.0, variance(0.0))];
    }
    // Law of ln S by Kanter's representation S = (A(φ)/E)^((1−γ)/γ), with φ uniform in 0 to π and E exponential:
    // p = γ/(1−γ) · mean over φ of x e^−x,  x = A(φ) S^(−γ/(1−γ)). The flux of a component goes as 1/S, and their sum
    // as Γ(1 + 1/γ).
    let steepness = gamma / (1.0 - gamma);
    let legendre = GaussLegendre::new(NonZeroUsize::new(48).expect("48 points"));
    let log_a = |phi: f64| {
        steepness * (gamma * phi).sin().ln() + ((1.0 - gamma) * phi).sin().ln() - phi.sin().ln() / (1.0 - gamma)
    };
    // A(φ) is needed at the same φ for every S. Only the range where x is a few matters: x diverges towards π.
    let parts = 8;
    let nodes = (0..parts).flat_map(|part| {
        let width = 1.0 / f64::from(parts);
        legendre.iter().map(move |(node, weight)| ((f64::from(part) + 0.5 + 0.5 * node) * width, 0.5 * weight * width))
    });
    let nodes: Vec<(f64, f64)> = nodes.map(|(share, weight)| (log_a(PI * share), weight)).collect();
    let log_norm = ln_gamma(1.0 + 1.0 / gamma);
    let density = |log_s: f64| {
        let integrand = |log_a: f64| {
            let log_x = log_a - steepness * log_s;
            // e^−x is negligible beyond.
            if log_x > LARGE_LOG { 0.0 } else { (log_x - log_x.exp() - log_s - log_norm).exp() }
        };
        steepness * nodes.iter().map(|(log_a, weight)| weight * integrand(*log_a)).sum::<f64>()
    };
    let step = LOG_STEP * (2.0 * index - 1.0).min(1.0);
    // The flux is largest where x at φ = 0, the smallest x, is about 1/γ.
    let log_a0 = steepness * gamma.ln() + (1.0 - gamma).ln();
    let middle = (log_a0 + gamma.ln()) / steepness;
    sum(step, middle, density).into_iter().map(|(weight, log_s)| (weight, variance(log_s))).collect()
}

/// Indices 1/2n above this are replaced by the Gaussian, n = 0.5: the distribution of S is then narrower than 1 %.
const NARROW: f64 = 0.999;

/// Logarithm of an x for which e^−x underflows.
const LARGE_LOG: f64 = 7.0;

/// b of exp(−b (r/R)^(1/n)) for which R is the half-light radius: P(2n, b) = 1/2 (Ciotti & Bertin 1999, eq. 4).
fn half_light_coefficient(index: f64) -> f64 {
    let (mut low, mut high) = (1e-3, 2.0 * index + 1.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if gamma_ur(2.0 * index, middle) > 0.5 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Nodes of the trapezoidal rule for a density over a logarithm, from near its centre out to its tails.
fn sum(step: f64, middle: f64, density: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let mut nodes = Vec::new();
    for direction in [-1.0, 1.0] {
        let mut rising = true;
        let mut before = 0.0;
        for k in 0..4000 {
            if direction < 0.0 && k == 0 {
                continue;
            }
            let place = middle + direction * step * k as f64;
            let weight = step * density(place);
            nodes.push((weight, place));
            rising = rising && weight > before;
            before = weight;
            if !rising && weight < TAIL * step {
                break;
            }
        }
    }
    let total: f64 = nodes.iter().map(|(weight, _)| weight).sum();
    nodes.iter_mut().for_each(|node| node.0 /= total);
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_gaussians_are_the_profiles() {
        let surface = |mixture: &[(f64, f64)], r2: f64| -> f64 {
            mixture
                .iter()
                .map(|(weight, variance)| weight / (2.0 * PI * variance) * (-r2 / (2.0 * variance)).exp())
                .sum()
        };
        for beta in [1.5, 2.5, 3.5, 10.0, 60.0] {
            let mixture = moffat(2.0, beta);
            let a2 = 1.0 / (LN_2 / beta).exp_m1();
            let peak = (beta - 1.0) / (PI * a2);
            for r in [0.0, 0.3, 1.0, 2.0, 5.0] {
                let exact = peak * (1.0 + r * r / a2).powf(-beta);
                assert!(
                    (surface(&mixture, r * r) - exact).abs() < 2e-5 * peak,
                    "beta {beta}, r {r}: {} {exact}",
                    surface(&mixture, r * r)
                );
            }
        }
        for n in [0.5, 0.55, 0.7, 1.0, 2.0, 4.0, 6.0, 8.0] {
            let mixture = sersic(n, 1.0);
            let b = half_light_coefficient(n);
            // Flux of exp(−b r^(1/n)): 2π n Γ(2n) / b^2n
            let norm = b.powf(2.0 * n) / (2.0 * PI * n * ln_gamma(2.0 * n).exp());
            for r in [0.1_f64, 0.3, 1.0, 2.0, 5.0] {
                let exact = norm * (-b * r.powf(1.0 / n)).exp();
                let there = surface(&mixture, r * r);
                // Relative to the value at a tenth of the half-light radius: cusps have no peak value.
                let scale = norm * (-b * 0.1_f64.powf(1.0 / n)).exp();
                assert!((there - exact).abs() < 5e-5 * scale, "n {n}, r {r}: {there} {exact}");
            }
        }
    }
}
