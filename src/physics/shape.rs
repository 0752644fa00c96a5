//! Image → flux, position, size and ellipticity.
//!
//! ```text
//! I_ij = Σ I w x_i x_j / Σ I w     e1 = (Ixx − Iyy)/(Ixx + Iyy)     e2 = 2 Ixy/(Ixx + Iyy)     d = √((Ixx + Iyy)/2)
//! ```
//!
//! with a round Gaussian weight w centred on the weighted centroid, which is iterated to convergence (Rhodes, Refregier & Groth
//! 2000, ApJ 536, 79; Rhodes et al. 2010, section 5). The PSF is not deconvolved: only changes are of interest.

pub mod bounded;

use ndarray::Array2;

/// Weighted moments of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Σ I w, e-.
    pub flux_e: f64,
    /// Centroid along the columns' index, px from the centre of the image.
    pub x_px: f64,
    /// Centroid along the rows' index (away from the register), px from the centre of the image.
    pub y_px: f64,
    /// d, px.
    pub size_px: f64,
    /// Elongation along x (positive) or y (negative).
    pub e1: f64,
    /// Elongation along the diagonals.
    pub e2: f64,
}

/// Maximum number of centroid steps before an image counts as having no centroid.
const PATIENCE: usize = 500;

/// Ratio of the weighted flux after a step to that before, below which a step of Newton's method has gone past the centroid: 1, less
/// the rounding of a sum.
const LEAST_RISE: f64 = 1.0 - 1e-12;

impl Moments {
    /// Moments of `image[[y, x]]` with a weight of `weight_px` (σ), starting at the centre of the image.
    ///
    /// None if the image has no centroid: no flux, or noise that makes the weight drift away.
    pub fn of(image: &Array2<f64>, weight_px: f64) -> Option<Moments> {
        Moments::near(image, weight_px, [0.0, 0.0])
    }

    /// The same, starting from an approximate centroid (`[x, y]`, px from the centre of the image).
    pub(crate) fn near(image: &Array2<f64>, weight_px: f64, [mut x, mut y]: [f64; 2]) -> Option<Moments> {
        let (rows, columns) = image.dim();
        let middle = ((rows as f64 - 1.0) / 2.0, (columns as f64 - 1.0) / 2.0);
        let sums_at = |[x, y]: [f64; 2]| Sums::of(image, weight_px, middle.0 + y, middle.1 + x);
        let inside = |[x, y]: [f64; 2]| y.abs() < middle.0 + 1.0 && x.abs() < middle.1 + 1.0;
        let mut sums = sums_at([x, y]);
        for _ in 0..PATIENCE {
            if sums.flux.is_nan() || sums.flux <= 0.0 {
                return None;
            }
            let to = |step: [f64; 2]| [x + step[0], y + step[1]];
            let newton = sums.newton(weight_px);
            let (mut step, mut next) = (newton, sums_at(to(newton)));
            if !(inside(to(newton)) && next.flux >= LEAST_RISE * sums.flux) {
                step = sums.plain();
                next = sums_at(to(step));
            }
            [x, y] = to(step);
            if !inside([x, y]) {
                return None;
            }
            sums = next;
            if step[0].abs().max(step[1].abs()) < 1e-10 {
                return sums.moments([x, y]);
            }
        }
        None
    }

    /// The moments of the mirror image in x.
    pub(crate) fn mirrored(&self) -> Moments {
        Moments { x_px: -self.x_px, e2: -self.e2, ..*self }
    }
}

/// Weighted sums around a point.
struct Sums {
    flux: f64,
    x: f64,
    y: f64,
    xx: f64,
    yy: f64,
    xy: f64,
}

impl Sums {
    /// Moments with this centroid (px from the centre of the image); None without a size.
    fn moments(&self, [x_px, y_px]: [f64; 2]) -> Option<Moments> {
        let (xx, yy, xy) = (self.xx / self.flux, self.yy / self.flux, self.xy / self.flux);
        let trace = xx + yy;
        (trace > 0.0).then(|| Moments {
            flux_e: self.flux,
            x_px,
            y_px,
            size_px: (trace / 2.0).sqrt(),
            e1: (xx - yy) / trace,
            e2: 2.0 * xy / trace,
        })
    }

    /// The step to the weighted mean. As the derivative of Σ I w by the centre of w is Σ I w x/σ², it climbs to a maximum of the
    /// weighted flux from anywhere (mean shift: Cheng 1995, IEEE PAMI 17, 790), if slowly; Newton's method is faster near by.
    fn plain(&self) -> [f64; 2] {
        [self.x / self.flux, self.y / self.flux]
    }

    /// Step of the centroid in x and in y by Newton's method: if the weight moves by c, the centroid moves by I/σ² c.
    fn newton(&self, weight_px: f64) -> [f64; 2] {
        let step = |first: f64, second: f64| {
            let gain = (1.0 - second / self.flux / (weight_px * weight_px)).clamp(0.1, 1.0);
            first / self.flux / gain
        };
        [step(self.x, self.xx), step(self.y, self.yy)]
    }

    fn of(image: &Array2<f64>, weight_px: f64, centre_y: f64, centre_x: f64) -> Sums {
        // The weight is a product of one in x and one in y, so that all sums are matrix products.
        let [across, along] = [(image.ncols(), centre_x), (image.nrows(), centre_y)].map(|(pixels, centre)| {
            let lane = lane(pixels, weight_px, centre).into_iter();
            let powers = lane.flat_map(|(offset, weight)| [weight, weight * offset, weight * offset * offset]);
            Array2::from_shape_vec((pixels, 3), powers.collect()).expect("three powers of each pixel")
        });
        let sums = along.t().dot(&image.dot(&across));
        Sums {
            flux: sums[[0, 0]],
            x: sums[[0, 1]],
            y: sums[[1, 0]],
            xx: sums[[0, 2]],
            yy: sums[[2, 0]],
            xy: sums[[1, 1]],
        }
    }
}

/// Offsets of a row's pixels from a centre (px from its first pixel), and their weights: a round Gaussian is a product of one in x
/// and one in y.
fn lane(pixels: usize, weight_px: f64, centre: f64) -> Vec<(f64, f64)> {
    let of = |pixel: usize| {
        let offset = pixel as f64 - centre;
        (offset, (-0.5 * (offset / weight_px).powi(2)).exp())
    };
    (0..pixels).map(of).collect()
}

/// Change of weighted moments: trailed minus untrailed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeChange {
    /// Change of e1; negative along the transfers.
    pub delta_e1: f64,
    /// Change of e2.
    pub delta_e2: f64,
    /// Change of the centroid along x, px.
    pub delta_x_px: f64,
    /// Change of the centroid along y, px; positive away from the register.
    pub delta_y_px: f64,
    /// Relative change of the size.
    pub delta_size: f64,
    /// Relative change of the weighted flux.
    pub delta_flux: f64,
}

impl ShapeChange {
    /// The change from `before` to `after`.
    pub fn between(before: &Moments, after: &Moments) -> ShapeChange {
        ShapeChange {
            delta_e1: after.e1 - before.e1,
            delta_e2: after.e2 - before.e2,
            delta_x_px: after.x_px - before.x_px,
            delta_y_px: after.y_px - before.y_px,
            delta_size: after.size_px / before.size_px - 1.0,
            delta_flux: after.flux_e / before.flux_e - 1.0,
        }
    }

    /// |Δe|, the length of (Δe1, Δe2).
    pub fn magnitude(&self) -> f64 {
        self.delta_e1.hypot(self.delta_e2)
    }

    /// This change and `factor` times another.
    pub(crate) fn plus(self, other: &ShapeChange, factor: f64) -> ShapeChange {
        self.combine(*other, |a, b| a + factor * b)
    }

    /// Applies an operation to every member of two changes.
    fn combine(self, other: ShapeChange, operation: impl Fn(f64, f64) -> f64) -> ShapeChange {
        ShapeChange {
            delta_e1: operation(self.delta_e1, other.delta_e1),
            delta_e2: operation(self.delta_e2, other.delta_e2),
            delta_x_px: operation(self.delta_x_px, other.delta_x_px),
            delta_y_px: operation(self.delta_y_px, other.delta_y_px),
            delta_size: operation(self.delta_size, other.delta_size),
            delta_flux: operation(self.delta_flux, other.delta_flux),
        }
    }

    /// Mean of changes, and its standard error for each member (NaN for fewer than two).
    pub fn mean_and_error(changes: &[ShapeChange]) -> (ShapeChange, ShapeChange) {
        let n = changes.len() as f64;
        let sum = |values: &mut dyn Iterator<Item = ShapeChange>| {
            values.fold(ShapeChange::default(), |sum, change| sum.combine(change, |a, b| a + b))
        };
        let scaled = |change: ShapeChange, factor: f64| change.combine(change, |value, _| value * factor);
        let mean = scaled(sum(&mut changes.iter().copied()), 1.0 / n);
        let squares =
            sum(&mut changes.iter().map(|change| change.combine(mean, |value, mean| (value - mean) * (value - mean))));
        let error = squares.combine(squares, |square, _| (square / (n - 1.0) / n).sqrt());
        (mean, error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(sigma_x: f64, sigma_y: f64, dx: f64, dy: f64) -> Array2<f64> {
        Array2::from_shape_fn((81, 81), |(y, x)| {
            let (y, x) = (y as f64 - 40.0 - dy, x as f64 - 40.0 - dx);
            (-0.5 * ((x / sigma_x).powi(2) + (y / sigma_y).powi(2))).exp()
        })
    }

    #[test]
    fn a_gaussian_has_the_moments_known_on_paper() {
        let moments = Moments::of(&gaussian(2.0, 3.0, 0.3, -0.4), 5.0).unwrap();
        // Product of Gaussians: 1/σ² = 1/σ_image² + 1/σ_weight².
        let (xx, yy) = (1.0 / (1.0 / 4.0 + 1.0 / 25.0), 1.0 / (1.0 / 9.0 + 1.0 / 25.0));
        assert!((moments.e1 - (xx - yy) / (xx + yy)).abs() < 1e-9);
        assert!((moments.size_px - f64::sqrt((xx + yy) / 2.0)).abs() < 1e-9);
        assert!(moments.e2.abs() < 1e-12);
        assert!((moments.x_px - 0.3).abs() < 1e-9 && (moments.y_px + 0.4).abs() < 1e-9);
        let flux = std::f64::consts::TAU * (xx * yy).sqrt();
        assert!((moments.flux_e / flux - 1.0).abs() < 1e-9);
    }

    #[test]
    fn e2_sees_the_diagonal() {
        let image = Array2::from_shape_fn((81, 81), |(y, x)| {
            let (y, x) = (y as f64 - 40.0, x as f64 - 40.0);
            let (along, across) = ((x + y) / 2_f64.sqrt(), (x - y) / 2_f64.sqrt());
            (-0.5 * ((along / 3.0).powi(2) + (across / 2.0).powi(2))).exp()
        });
        let moments = Moments::of(&image, 5.0).unwrap();
        assert!(moments.e1.abs() < 1e-12 && moments.e2 > 0.1);
    }

    /// A trail of any length has a centroid, and the same one from wherever the weight starts.
    #[test]
    fn the_centroid_of_a_long_trail_is_found() {
        for length_px in [1.0, 5.0, 10.0, 20.0, 30.0, 60.0] {
            let image = Array2::from_shape_fn((121, 61), |(y, x)| {
                let (y, x) = (y as f64 - 50.0, x as f64 - 30.0);
                let trail = if y < 0.0 { 0.0 } else { (-y / length_px).exp() / length_px };
                (-0.5 * x * x).exp() * ((-0.5 * y * y).exp() * 0.2 + trail)
            });
            let found = [-20.0, -10.0, 0.0, 5.0].map(|y| Moments::near(&image, 6.0, [0.0, y]).map(|found| found.y_px));
            assert!(
                found.iter().all(|y| y.is_some_and(|y| (y - found[2].unwrap()).abs() < 1e-6)),
                "{length_px} {found:?}"
            );
        }
    }

    #[test]
    fn nothing_has_no_moments() {
        assert_eq!(Moments::of(&Array2::zeros((21, 21)), 3.0), None);
        assert_eq!(Moments::of(&Array2::from_elem((21, 21), -1.0), 3.0), None);
        assert_eq!(Moments::of(&Array2::from_elem((21, 21), f64::NAN), 3.0), None);
    }
}
