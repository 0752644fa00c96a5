//! Galaxy and PSF → image.
//!
//! Both profiles are continuous mixtures of Gaussians with positive weights, exactly:
//!
//! ```text
//! Moffat  (1 + r²/a²)^−β     = ∫ ds  s^(β−1) e^−s / Γ(β)  exp(−s r²/a²)
//! Sersic  exp(−b (r/R)^(1/n)) = ∫ dS  p(S)               exp(−S b^2n r²/R²),  p: one-sided stable law of index 1/2n
//! ```
//!
//! so a sum over logarithmically spaced widths converges exponentially, shearing and convolving become arithmetic on
//! variances, and the integral over a pixel is a product of two differences of error functions. Nothing is sampled on a
//! grid in between: there is no aliasing, no ringing, and a cusp or a wing costs nothing.

mod mixture;
pub mod snr;

use ndarray::Array2;

use crate::mission::{Galaxy, Psf};
use mixture::{Component, moffat, sersic};

/// A galaxy as the telescope sees it: Gaussians, heaviest in flux first, whose weights add up to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    components: Vec<Component>,
}

impl Profile {
    /// A Sersic profile of index `sersic_index` (0.5 to 8) and circularised half-light radius (px), sheared to
    /// ellipticity `e1` = (a² − b²)/(a² + b²) at constant area, then convolved with a Moffat PSF.
    pub fn new(sersic_index: f64, half_light_px: f64, e1: f64, fwhm_px: f64, moffat_beta: f64) -> Profile {
        let galaxy = sersic(sersic_index, half_light_px);
        let psf = moffat(fwhm_px, moffat_beta);
        // An ellipse of axis ratio a/b = √((1+e)/(1−e)) and unchanged area: variances times a/b in x, b/a in y.
        let stretch = ((1.0 + e1) / (1.0 - e1)).sqrt();
        let mut components: Vec<Component> = galaxy
            .iter()
            .flat_map(|&(weight, variance)| {
                psf.iter().map(move |&(psf_weight, psf_variance)| Component {
                    weight: weight * psf_weight,
                    variance_x: variance * stretch + psf_variance,
                    variance_y: variance / stretch + psf_variance,
                })
            })
            .filter(|component| component.weight > NEGLIGIBLE)
            .collect();
        components.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let total: f64 = components.iter().map(|component| component.weight).sum();
        for component in &mut components {
            component.weight /= total;
        }
        Profile { components }
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

    /// The same at every combination of positions, those in y fastest.
    pub fn stamps(&self, half_px: usize, dx_px: &[f64], dy_px: &[f64]) -> Vec<Array2<f64>> {
        let pixels = 2 * half_px + 1;
        let lanes = |offset_px: &f64, weight: fn(&Component) -> f64, variance: fn(&Component) -> f64| {
            let mut lanes = Array2::zeros((self.components.len(), pixels));
            for (component, mut lane) in self.components.iter().zip(lanes.rows_mut()) {
                let shares = pixel_shares(pixels, half_px as f64 + offset_px, variance(component));
                for (share, pixel) in lane.iter_mut().zip(shares) {
                    *share = weight(component) * pixel;
                }
            }
            lanes
        };
        let across: Vec<Array2<f64>> =
            dx_px.iter().map(|dx_px| lanes(dx_px, |_| 1.0, |component| component.variance_x)).collect();
        let along: Vec<Array2<f64>> = dy_px
            .iter()
            .map(|dy_px| lanes(dy_px, |component| component.weight, |component| component.variance_y))
            .collect();
        // Σ over components of y-share × x-share: one product of matrices.
        across.iter().flat_map(|across| along.iter().map(|along| along.t().dot(across))).collect()
    }

    /// Share of the flux within a circle (px) around the centre.
    pub fn within(&self, radius_px: f64) -> f64 {
        self.components.iter().map(|component| component.weight * component.within(radius_px)).sum()
    }
}

/// Components of less flux than this are left out, and the rest renormalised.
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

#[cfg(test)]
mod tests {
    use super::*;

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
