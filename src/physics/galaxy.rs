//! Galaxy and PSF → image.
//!
//! Both profiles are continuous mixtures of Gaussians with positive weights, exactly:
//!
//! ```text
//! Moffat  (1 + r²/a²)^−β     = ∫ ds  s^(β−1) e^−s / Γ(β)  exp(−s r²/a²)
//! Sersic  exp(−b (r/R)^(1/n)) = ∫ dS  p(S)               exp(−S b^2n r²/R²),  p: one-sided stable law of index 1/2n
//! ```
//!
//! so a sum over logarithmically spaced widths converges exponentially. Shear and convolution become arithmetic on variances, and
//! the integral over a pixel is a product of two differences of error functions. No intermediate grid is sampled: there is no
//! aliasing and no ringing, and cusps and wings cost nothing extra.

mod mixture;
pub mod observed;
pub mod population_law;
pub mod snr;

use ndarray::Array2;

use crate::mission::{Galaxy, Psf};
use mixture::{Component, moffat, sersic};

/// A galaxy as seen by the telescope: Gaussians in descending order of flux, with weights that add up to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    components: Vec<Component>,
    /// Flux of a component that is neglected.
    negligible: f64,
}

/// A galaxy with lensing shear and the shape of the PSF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensedGalaxy {
    /// Sersic index, 0.5 to 8.
    pub sersic_index: f64,
    /// Circularised half-light radius before the PSF, px.
    pub half_light_px: f64,
    /// Intrinsic ellipticity (e1, e2), of length (a² − b²)/(a² + b²).
    pub ellipticity: [f64; 2],
    /// Reduced shear (g1, g2) before the PSF, at constant area.
    pub shear: [f64; 2],
    /// The same for the PSF.
    pub psf_shear: [f64; 2],
}

/// Variances of a Gaussian of unit area: the shape of an ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ellipse {
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Ellipse {
    const ROUND: Ellipse = Ellipse { xx: 1.0, xy: 0.0, yy: 1.0 };

    /// The ellipse of an ellipticity of length (a² − b²)/(a² + b²).
    fn of([e1, e2]: [f64; 2]) -> Ellipse {
        if e2 == 0.0 {
            // Axis ratio a/b = √((1+e)/(1−e)) and unchanged area: variances times a/b in x, b/a in y.
            let stretch = ((1.0 + e1) / (1.0 - e1)).sqrt();
            return Ellipse { xx: stretch, xy: 0.0, yy: 1.0 / stretch };
        }
        let root = (1.0 - e1 * e1 - e2 * e2).sqrt();
        Ellipse { xx: (1.0 + e1) / root, xy: e2 / root, yy: (1.0 - e1) / root }
    }

    /// A V Aᵀ with A = (1 + g1, g2; g2, 1 − g1)/√(1 − g²).
    fn sheared(self, [g1, g2]: [f64; 2]) -> Ellipse {
        let norm = 1.0 - g1 * g1 - g2 * g2;
        let (p, m) = (1.0 + g1, 1.0 - g1);
        Ellipse {
            xx: (p * p * self.xx + 2.0 * p * g2 * self.xy + g2 * g2 * self.yy) / norm,
            xy: (p * g2 * self.xx + (p * m + g2 * g2) * self.xy + g2 * m * self.yy) / norm,
            yy: (g2 * g2 * self.xx + 2.0 * g2 * m * self.xy + m * m * self.yy) / norm,
        }
    }
}

impl Profile {
    /// A Sersic profile of index `sersic_index` (0.5 to 8) and circularised half-light radius (px), sheared to
    /// ellipticity `e1` = (a² − b²)/(a² + b²) at constant area, then convolved with a Moffat PSF.
    pub fn new(sersic_index: f64, half_light_px: f64, e1: f64, fwhm_px: f64, moffat_beta: f64) -> Profile {
        let (galaxy, psf) = (sersic(sersic_index, half_light_px), moffat(fwhm_px, moffat_beta));
        Profile::convolved(&galaxy, Ellipse::of([e1, 0.0]), &psf, Ellipse::ROUND, NEGLIGIBLE)
    }

    /// A lensed galaxy through a mission's PSF. Components of less than `negligible` of the flux are omitted.
    pub fn lensed(galaxy: &LensedGalaxy, psf: &Psf, negligible: f64) -> Profile {
        Profile::convolved(
            &sersic(galaxy.sersic_index, galaxy.half_light_px),
            Ellipse::of(galaxy.ellipticity).sheared(galaxy.shear),
            &moffat(psf.fwhm_px, psf.moffat_beta),
            Ellipse::ROUND.sheared(galaxy.psf_shear),
            negligible,
        )
    }

    /// The convolution of two mixtures of round Gaussians (weights and variances), each with a shape.
    fn convolved(
        galaxy: &[(f64, f64)],
        of_galaxy: Ellipse,
        psf: &[(f64, f64)],
        of_psf: Ellipse,
        negligible: f64,
    ) -> Profile {
        let mut components: Vec<Component> = galaxy
            .iter()
            .flat_map(|&(weight, variance)| {
                psf.iter().map(move |&(psf_weight, psf_variance)| Component {
                    weight: weight * psf_weight,
                    variance_x: variance * of_galaxy.xx + psf_variance * of_psf.xx,
                    variance_y: variance * of_galaxy.yy + psf_variance * of_psf.yy,
                    covariance: variance * of_galaxy.xy + psf_variance * of_psf.xy,
                })
            })
            .filter(|component| component.weight > negligible)
            .collect();
        components.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let total: f64 = components.iter().map(|component| component.weight).sum();
        for component in &mut components {
            component.weight /= total;
        }
        Profile { components, negligible }
    }

    /// Profile of a mission's galaxy through its PSF.
    pub fn of(galaxy: &Galaxy, psf: &Psf) -> Profile {
        Profile::new(galaxy.sersic_index, galaxy.half_light_px, galaxy.e1, psf.fwhm_px, psf.moffat_beta)
    }

    /// Share of the flux in every pixel of a square stamp of 2 `half_px` + 1 pixels, `image[[y, x]]`, with the galaxy
    /// `dx_px`, `dy_px` from the centre of the central pixel. Integrated over the pixels.
    pub fn stamp(&self, half_px: usize, dx_px: f64, dy_px: f64) -> Array2<f64> {
        self.stamps(half_px, &[dx_px], &[dy_px]).remove(0)
    }

    /// The same at every combination of positions, those in y varying fastest.
    pub fn stamps(&self, half_px: usize, dx_px: &[f64], dy_px: &[f64]) -> Vec<Array2<f64>> {
        let pixels = 2 * half_px + 1;
        let terms: Vec<usize> = self.components.iter().map(|component| self.terms(component)).collect();
        let rows = terms.iter().sum();
        let lanes = |offset_px: &f64, variance: fn(&Component) -> f64, factor: fn(&Component) -> (f64, f64)| {
            let mut lanes = Array2::zeros((rows, pixels));
            let mut rows = lanes.rows_mut().into_iter();
            for (component, terms) in self.components.iter().zip(&terms) {
                let centre_px = half_px as f64 + offset_px;
                let (mut weight, power) = factor(component);
                let shares: Vec<f64> = pixel_shares(pixels, centre_px, variance(component)).collect();
                let higher = hermite_shares(pixels, centre_px, variance(component), *terms - 1);
                for shares in std::iter::once(shares).chain(higher) {
                    let mut lane = rows.next().expect("a row for each term");
                    lane.iter_mut().zip(shares).for_each(|(share, pixel)| *share = weight * pixel);
                    weight *= power;
                }
            }
            lanes
        };
        let across: Vec<Array2<f64>> =
            dx_px.iter().map(|dx_px| lanes(dx_px, |component| component.variance_x, |_| (1.0, 1.0))).collect();
        let factor = |component: &Component| (component.weight, component.correlation());
        let along: Vec<Array2<f64>> =
            dy_px.iter().map(|dy_px| lanes(dy_px, |component| component.variance_y, factor)).collect();
        // Σ over components of y-share × x-share: one product of matrices.
        across.iter().flat_map(|across| along.iter().map(|along| along.t().dot(across))).collect()
    }

    /// Number of terms of Mehler's series for a component: until ρᵏ is below the neglected part of its flux.
    fn terms(&self, component: &Component) -> usize {
        let correlation = component.correlation().abs();
        if correlation == 0.0 {
            return 1;
        }
        let needed = ((self.negligible / component.weight).min(0.5).ln() / correlation.ln()).ceil();
        1 + (needed as usize).min(MOST_TERMS)
    }

    /// Share of the flux within a circle (px) around the centre.
    pub fn within(&self, radius_px: f64) -> f64 {
        self.components.iter().map(|component| component.weight * component.within(radius_px)).sum()
    }
}

/// Components of less flux are omitted, and the rest renormalised.
const NEGLIGIBLE: f64 = 1e-8;

/// Share of a Gaussian around `centre_px` in each of the pixels 0, 1, ... (centres at whole numbers).
fn pixel_shares(pixels: usize, centre_px: f64, variance_px2: f64) -> impl Iterator<Item = f64> {
    let scale = 1.0 / (2.0 * variance_px2).sqrt();
    let mut left = libm::erf((-0.5 - centre_px) * scale);
    (0..pixels).map(move |pixel| {
        let right = libm::erf((pixel as f64 + 0.5 - centre_px) * scale);
        let share = 0.5 * (right - left);
        left = right;
        share
    })
}

/// Maximum number of terms of Mehler's series: a correlation of 0.9, to 1e-6.
const MOST_TERMS: usize = 128;

/// Terms 1 to `terms` of Mehler's series (1866) for the bivariate normal distribution, integrated over pixels: a sum of products of
/// a function of x and one of y, as for a galaxy along the axes.
///
/// ```text
/// φ(x, y; ρ) = φ(x) φ(y) Σ ρᵏ hₖ(x) hₖ(y),   hₖ = Heₖ/√k!,   ∫ φ hₖ dx = −φ hₖ₋₁/√k
/// ```
fn hermite_shares(pixels: usize, centre_px: f64, variance_px2: f64, terms: usize) -> impl Iterator<Item = Vec<f64>> {
    let sigma_px = variance_px2.sqrt();
    let edges = if terms == 0 { 0 } else { pixels + 1 };
    let edges: Vec<f64> = (0..edges).map(|edge| (edge as f64 - 0.5 - centre_px) / sigma_px).collect();
    // φ hₖ₋₁ and φ hₖ₋₂ at the edges.
    let density = |edge: &f64| (-0.5 * edge * edge).exp() / std::f64::consts::TAU.sqrt();
    let mut last: Vec<f64> = edges.iter().map(density).collect();
    let mut before = vec![0.0; last.len()];
    (1..=terms).map(move |term| {
        let root = (term as f64).sqrt();
        let shares = last.windows(2).map(|pair| (pair[0] - pair[1]) / root).collect();
        for ((edge, last), before) in edges.iter().zip(&mut last).zip(&mut before) {
            let next = (edge * *last - (term as f64 - 1.0).sqrt() * *before) / root;
            (*before, *last) = (*last, next);
        }
        shares
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// e1 and e2 of a galaxy by unweighted second moments of its stamp.
    fn unweighted(profile: &Profile) -> [f64; 2] {
        let stamp = profile.stamp(40, 0.3, -0.2);
        let mut sums = [0.0; 3];
        for ((y, x), share) in stamp.indexed_iter() {
            let (y, x) = (y as f64 - 39.8, x as f64 - 40.3);
            sums = [sums[0] + share * x * x, sums[1] + share * x * y, sums[2] + share * y * y];
        }
        [(sums[0] - sums[2]) / (sums[0] + sums[2]), 2.0 * sums[1] / (sums[0] + sums[2])]
    }

    #[test]
    fn a_galaxy_turned_by_45_degrees_is_the_same_galaxy() {
        let psf = Psf { fwhm_px: 0.02, moffat_beta: 60.0 };
        let turned = |ellipticity, shear| LensedGalaxy {
            sersic_index: 0.5,
            half_light_px: 5.0,
            ellipticity,
            shear,
            psf_shear: [0.0; 2],
        };
        let moments = |galaxy: &LensedGalaxy| unweighted(&Profile::lensed(galaxy, &psf, NEGLIGIBLE));
        // A Gaussian of 4.2 px: its pixels add 1/12 px² to both variances.
        for e in [0.05, 0.4, 0.8] {
            let (along, diagonal) = (moments(&turned([e, 0.0], [0.0; 2])), moments(&turned([0.0, e], [0.0; 2])));
            assert!((along[0] - diagonal[1]).abs() < 1e-6, "{along:?} {diagonal:?}");
            assert!(along[1].abs() < 1e-9 && diagonal[0].abs() < 1e-6, "{along:?} {diagonal:?}");
        }
        // A round galaxy sheared by g has the ellipticity 2g/(1 + g²).
        let g: f64 = 0.1;
        let [sheared, elliptical] =
            [turned([0.0; 2], [0.0, g]), turned([0.0, 2.0 * g / (1.0 + g * g)], [0.0; 2])].map(|of| moments(&of)[1]);
        assert!((sheared - elliptical).abs() < 1e-9, "{sheared} {elliptical}");
    }

    #[test]
    fn shear_of_a_galaxy_and_its_psf_alike_is_that_of_their_image() {
        let psf = Psf { fwhm_px: 2.91, moffat_beta: 3.5 };
        let at = |ellipticity: [f64; 2], shear, psf_shear| {
            let galaxy = LensedGalaxy { sersic_index: 1.0, half_light_px: 1.5, ellipticity, shear, psf_shear };
            Profile::lensed(&galaxy, &psf, NEGLIGIBLE)
        };
        let image = at([0.3, 0.2], [0.02, -0.01], [0.0; 2]).stamp(20, 0.1, 0.2);
        assert!((image.sum() - 1.0).abs() < 0.02);
        // Mirrored in x: e2 and g2 change sign.
        let mirrored = at([0.3, -0.2], [0.02, 0.01], [0.0; 2]).stamp(20, -0.1, 0.2);
        for ((y, x), share) in image.indexed_iter() {
            assert!((share - mirrored[[y, 40 - x]]).abs() < 1e-8, "{y} {x}");
        }
        // Both with the same shear: equal to a larger shear of the galaxy in a round PSF in the limit of a small PSF.
        let both = unweighted(&at([0.0; 2], [0.05, 0.0], [0.05, 0.0]));
        let one = unweighted(&at([0.0; 2], [0.05, 0.0], [0.0; 2]));
        assert!(both[0] > one[0] && one[0] > 0.0, "{both:?} {one:?}");
    }

    #[test]
    fn half_the_light_is_within_the_half_light_radius() {
        // Through a PSF that is far smaller than the galaxy.
        for n in [0.5, 0.6, 1.0, 2.5, 4.0, 6.0, 8.0] {
            let within = Profile::new(n, 10.0, 0.0, 0.01, 20.0).within(10.0);
            assert!((within - 0.5).abs() < 1e-4, "n = {n}: {within}");
        }
    }

    #[test]
    fn half_the_peak_is_at_half_the_width_of_the_psf() {
        let profile = Profile::new(1.0, 1e-4, 0.0, 100.0, 2.5);
        let stamp = profile.stamp(50, 0.0, 0.0);
        // Pixels of 1 % of the width: the mean over one differs from its centre by 1e-4.
        assert!((stamp[[50, 100]] / stamp[[50, 50]] - 0.5).abs() < 2e-4);
    }

    #[test]
    fn a_stamp_is_symmetric_and_holds_the_flux() {
        let profile = Profile::new(1.0, 1.0, 0.4, 2.0, 4.0);
        let stamp = profile.stamp(60, 0.0, 0.0);
        assert!((stamp.sum() - 1.0).abs() < 1e-4);
        for (pixel, flux) in stamp.indexed_iter() {
            assert!((flux - stamp[[120 - pixel.0, 120 - pixel.1]]).abs() < 1e-15);
        }
    }
}
