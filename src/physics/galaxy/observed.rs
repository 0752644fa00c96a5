//! Sersic galaxies through a PSF → flux, size and ellipticity under a round weight, without an image.
//!
//! A mixture of Gaussians under a Gaussian weight is a mixture of Gaussians. With V the covariance of a component, and W = σ² 1
//! that of the weight:
//!
//! ```text
//! flux ∝ det(1 + V W⁻¹)^−½        variances V (1 + V W⁻¹)⁻¹
//! ```
//!
//! Mixtures are tabulated over the Sersic index, and a pixel is a Gaussian of its variance, 1/12 px². Size and ellipticity differ
//! by one or two per cent from those of an image, since components of the PSF are merged: they are coordinates for interpolation,
//! not results.

use super::Ellipse;
use super::mixture::{moffat, sersic};
use crate::mission::Psf;

/// Mixtures per unit of ln n.
const PER_LOG: f64 = 48.0;

/// Number of components of the PSF merged into one.
const TOGETHER: usize = 3;

/// Variance of a pixel, px².
const PIXEL: f64 = 1.0 / 12.0;

/// Sizes and ellipticities of galaxies with Sersic indices in a range.
#[derive(Clone, Debug)]
pub struct Observed {
    /// Weights and variances (px²) of the PSF.
    psf: Vec<(f64, f64)>,
    /// Weights and variances of galaxies of half-light radius 1, at indices evenly spaced in their logarithm.
    galaxies: Vec<Vec<(f64, f64)>>,
    /// Logarithm of the smallest index.
    least: f64,
}

impl Observed {
    /// For Sersic indices in a range.
    pub fn new(psf: &Psf, [least, largest]: [f64; 2]) -> Observed {
        let steps = ((largest / least).ln() * PER_LOG).ceil() as usize;
        let index = |step: usize| (least * (step as f64 / PER_LOG).exp()).min(largest);
        let galaxies = (0..=steps).map(|step| sersic(index(step), 1.0)).collect();
        let merged = |some: &[(f64, f64)]| {
            let weight: f64 = some.iter().map(|(weight, _)| weight).sum();
            (weight, some.iter().map(|(weight, variance)| weight * variance).sum::<f64>() / weight)
        };
        let mut parts = moffat(psf.fwhm_px, psf.moffat_beta);
        parts.sort_by(|a, b| a.1.total_cmp(&b.1));
        Observed { psf: parts.chunks(TOGETHER).map(merged).collect(), galaxies, least: least.ln() }
    }

    /// Share of the flux, size (px) and ellipticity (e1, e2) under a weight of `weight_px` (σ).
    pub fn shape(&self, sersic_index: f64, half_light_px: f64, ellipticity: [f64; 2], weight_px: f64) -> [f64; 4] {
        let place = ((sersic_index.ln() - self.least) * PER_LOG).max(0.0);
        let last = self.galaxies.len() - 1;
        let low = (place as usize).min(last);
        let share = place - low as f64;
        let at = |node: usize| self.of(&self.galaxies[node], half_light_px, Ellipse::of(ellipticity), weight_px);
        let shape = at(low);
        if share <= 0.0 || low == last {
            return shape;
        }
        let next = at(low + 1);
        [0, 1, 2, 3].map(|member| shape[member] + share * (next[member] - shape[member]))
    }

    fn of(&self, galaxy: &[(f64, f64)], half_light_px: f64, ellipse: Ellipse, weight_px: f64) -> [f64; 4] {
        let (area, weight_area) = (half_light_px * half_light_px, weight_px * weight_px);
        let [mut flux, mut xx, mut xy, mut yy] = [0.0; 4];
        for (weight, variance) in galaxy {
            let variance = variance * area / weight_area;
            for (psf_weight, psf_variance) in &self.psf {
                // V W⁻¹
                let round = (psf_variance + PIXEL) / weight_area;
                let (x, y) = (variance * ellipse.xx + round, variance * ellipse.yy + round);
                let mixed = variance * ellipse.xy;
                // One division, which takes as long as all else.
                let inverse = 1.0 / ((1.0 + x) * (1.0 + y) - mixed * mixed);
                let share = weight * psf_weight * inverse.sqrt();
                flux += share;
                // V (1 + V)⁻¹ = 1 − (1 + V)⁻¹
                xx += share * (1.0 - (1.0 + y) * inverse);
                yy += share * (1.0 - (1.0 + x) * inverse);
                xy += share * mixed * inverse;
            }
        }
        let trace = xx + yy;
        [flux, weight_px * (0.5 * trace / flux).sqrt(), (xx - yy) / trace, 2.0 * xy / trace]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::galaxy::{LensedGalaxy, Profile};
    use crate::physics::shape::Moments;

    #[test]
    fn sizes_and_ellipticities_are_about_those_of_images() {
        let psf = Psf { fwhm_px: 2.91, moffat_beta: 3.5 };
        let observed = Observed::new(&psf, [0.5, 4.5]);
        for (sersic_index, half_light_px, ellipticity) in
            [(0.5, 2.0, [0.3, 0.1]), (1.03, 1.2, [-0.2, 0.4]), (4.37, 3.0, [0.1, -0.2])]
        {
            let galaxy =
                LensedGalaxy { sersic_index, half_light_px, ellipticity, shear: [0.0; 2], psf_shear: [0.0; 2] };
            let image = Profile::lensed(&galaxy, &psf, 1e-6).stamp(27, 0.0, 0.0);
            let moments = Moments::of(&image, 5.4).unwrap();
            let [share, size_px, e1, e2] = observed.shape(sersic_index, half_light_px, ellipticity, 5.4);
            // A Moffat PSF in seven components has a size 1.1 % too large under this weight.
            assert!((size_px / moments.size_px - 1.0).abs() < 0.015, "{size_px} {}", moments.size_px);
            assert!((share / moments.flux_e - 1.0).abs() < 0.015, "{share} {}", moments.flux_e);
            assert!((e1 - moments.e1).abs() < 0.01 && (e2 - moments.e2).abs() < 0.01, "{e1} {e2} {moments:?}");
        }
    }
}
