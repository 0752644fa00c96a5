//! Ellipticity of noisy images: bounded, so that it has a mean.
//!
//! ```text
//! (e1, e2) = (A, C) / max(T, √(A² + C²))     A = Σ I w (x² − y²),  C = Σ I w 2xy,  T = Σ I w (x² + y²)
//! ```
//!
//! Without noise |(A, C)| is less than T, and this is the ellipticity of [`super::Moments`]. Noise may bring T close to 0 or below
//! it: the plain ratio then has no mean (it has the tails of a Cauchy distribution; Israel, Kitching & Massey 2015,
//! arXiv:1512.05591). A survey rejects such objects. Here |e| is bounded by 1, the largest ellipticity of any non-negative image,
//! so that no object is lost and there is no selection.
//!
//! A, C and T are sums over many pixels, and nearly normal. The mean of the bounded ellipticity over their noise is then a
//! three-dimensional integral, computed with Sobol points. The points are the same for every integral: differences of two means are
//! far more accurate than each.

use std::sync::OnceLock;

use ndarray::{Array2, ArrayView2};
use statrs::distribution::{ContinuousCDF, Normal};

use super::{Moments, Sums, lane};
use crate::numeric::sample_points::{Sample, Sampling};

/// A, C and T of an image, e- px².
pub type Quadrupoles = [f64; 3];

/// Covariances of A, C and T, e-² px⁴.
pub type Covariance = [[f64; 3]; 3];

/// Points of the integral over the noise; each is used with both signs.
const POINTS: u64 = 2048;

/// A, C and T of each column of `image[[y, x]]` with a weight of `weight_px` (σ) on a centroid (`[x, y]`, px from the centre of the
/// image).
pub fn quadrupoles_of_columns(image: ArrayView2<f64>, weight_px: f64, [x_px, y_px]: [f64; 2]) -> Vec<Quadrupoles> {
    let (rows, columns) = image.dim();
    let middle = |pixels: usize| (pixels as f64 - 1.0) / 2.0;
    let across = lane(columns, weight_px, middle(columns) + x_px);
    let along = lane(rows, weight_px, middle(rows) + y_px);
    let mut sums = vec![[0.0; 3]; columns];
    for (row, (y, weight)) in image.rows().into_iter().zip(along) {
        for (charge_e, sum) in row.iter().zip(&mut sums) {
            let weighted = weight * charge_e;
            *sum = [sum[0] + weighted, sum[1] + weighted * y, sum[2] + weighted * y * y];
        }
    }
    let quadrupoles = |((x, weight), [flux, first, second]): ((f64, f64), [f64; 3])| {
        let (xx, xy) = (x * x * flux, x * first);
        [weight * (xx - second), weight * 2.0 * xy, weight * (xx + second)]
    };
    across.into_iter().zip(sums).map(quadrupoles).collect()
}

/// Covariances of A, C and T of an image whose pixels have independent noise of these variances (e-²).
pub fn covariance(variance_e2: ArrayView2<f64>, weight_px: f64, [x_px, y_px]: [f64; 2]) -> Covariance {
    let (rows, columns) = variance_e2.dim();
    let middle = |pixels: usize| (pixels as f64 - 1.0) / 2.0;
    let across = lane(columns, weight_px, middle(columns) + x_px);
    let along = lane(rows, weight_px, middle(rows) + y_px);
    let mut sums = [[0.0; 3]; 3];
    for (row, (y, weight_y)) in variance_e2.rows().into_iter().zip(along) {
        for (variance, (x, weight_x)) in row.iter().zip(&across) {
            let share = variance * (weight_y * weight_x).powi(2);
            let member = [x * x - y * y, 2.0 * x * y, x * x + y * y];
            for (sums, a) in sums.iter_mut().zip(member) {
                for (sum, b) in sums.iter_mut().zip(member) {
                    *sum += share * a * b;
                }
            }
        }
    }
    sums
}

/// The bounded ellipticity.
pub fn ellipticity([a, c, t]: Quadrupoles) -> [f64; 2] {
    let length = t.max(a.hypot(c));
    if length > 0.0 { [a / length, c / length] } else { [0.0; 2] }
}

/// Mean of the bounded ellipticity if A, C and T are normal with these means and covariances.
pub fn mean_ellipticity(mean: &Quadrupoles, covariance: &Covariance) -> [f64; 2] {
    let root = cholesky(covariance);
    let mut sum = [0.0; 2];
    for point in points() {
        for sign in [1.0, -1.0] {
            let mut drawn = *mean;
            for (drawn, row) in drawn.iter_mut().zip(&root) {
                *drawn += sign * (row[0] * point[0] + row[1] * point[1] + row[2] * point[2]);
            }
            let e = ellipticity(drawn);
            sum = [sum[0] + e[0], sum[1] + e[1]];
        }
    }
    sum.map(|sum| sum / (2 * POINTS) as f64)
}

/// Maximum number of steps of a fitted centroid.
const STEPS: usize = 20;

/// Moments of a noisy image with the bounded ellipticity. The centroid is fitted from `start_px` (`[x, y]`, px from the centre of
/// the image) in at most 20 steps, and no further away than the width of the weight. None if the weighted flux is not positive.
pub fn fitted(image: &Array2<f64>, weight_px: f64, start_px: [f64; 2]) -> Option<Moments> {
    let middle = [image.ncols(), image.nrows()].map(|pixels| (pixels as f64 - 1.0) / 2.0);
    let sums_at = |[x, y]: [f64; 2]| Sums::of(image, weight_px, middle[1] + y, middle[0] + x);
    let mut at = start_px;
    let mut sums = sums_at(at);
    for _ in 0..STEPS {
        if sums.flux.is_nan() || sums.flux <= 0.0 {
            return None;
        }
        let step = sums.newton(weight_px);
        at = within(start_px, [at[0] + step[0], at[1] + step[1]], weight_px);
        sums = sums_at(at);
        if step[0].hypot(step[1]) < 1e-9 {
            break;
        }
    }
    let (a, c, t) = (sums.xx - sums.yy, 2.0 * sums.xy, sums.xx + sums.yy);
    let [e1, e2] = ellipticity([a, c, t]);
    let size_px = (0.5 * t / sums.flux).max(0.0).sqrt();
    (sums.flux > 0.0).then_some(Moments { flux_e: sums.flux, x_px: at[0], y_px: at[1], size_px, e1, e2 })
}

/// The point of a disc around a centre that is closest to `place`.
fn within(centre: [f64; 2], place: [f64; 2], radius: f64) -> [f64; 2] {
    let offset = [place[0] - centre[0], place[1] - centre[1]];
    let factor = (radius / offset[0].hypot(offset[1])).min(1.0);
    [centre[0] + factor * offset[0], centre[1] + factor * offset[1]]
}

/// Normal deviates in three dimensions, evenly spread.
fn points() -> &'static [[f64; 3]] {
    static POINTS_OF_ALL: OnceLock<Vec<[f64; 3]>> = OnceLock::new();
    POINTS_OF_ALL.get_or_init(|| {
        let normal = Normal::new(0.0, 1.0).expect("a width of 1");
        let sample = Sample::new(Sampling::Sobol, 1, POINTS, 3);
        let deviates = |point| {
            let places = sample.places(point);
            [0, 1, 2].map(|dimension| normal.inverse_cdf(places[dimension]))
        };
        (0..POINTS).map(deviates).collect()
    })
}

/// L of Σ = L Lᵀ; rows of directions without noise are 0.
fn cholesky(covariance: &Covariance) -> [[f64; 3]; 3] {
    let mut root = [[0.0_f64; 3]; 3];
    for row in 0..3 {
        for column in 0..=row {
            let known: f64 = (0..column).map(|k| root[row][k] * root[column][k]).sum();
            let left = covariance[row][column] - known;
            root[row][column] = match row == column {
                true => left.max(0.0).sqrt(),
                false if root[column][column] > 0.0 => left / root[column][column],
                false => 0.0,
            };
        }
    }
    root
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::physics::shape::Moments;

    #[test]
    fn without_noise_it_is_the_ellipticity_of_the_moments() {
        let image = Array2::from_shape_fn((41, 41), |(y, x)| {
            let (y, x) = (y as f64 - 20.3, x as f64 - 19.6);
            (-0.5 * (x * x / 6.0 + y * y / 9.0 + 0.03 * x * y)).exp()
        });
        let moments = Moments::of(&image, 4.0).unwrap();
        let columns = quadrupoles_of_columns(image.view(), 4.0, [moments.x_px, moments.y_px]);
        let total = columns.iter().fold([0.0; 3], |sum, column| [0, 1, 2].map(|member| sum[member] + column[member]));
        for [e1, e2] in [ellipticity(total), mean_ellipticity(&total, &[[0.0; 3]; 3])] {
            assert!((e1 - moments.e1).abs() < 1e-9 && (e2 - moments.e2).abs() < 1e-9);
        }
    }

    #[test]
    fn little_noise_shifts_the_mean_as_the_second_derivative_says() {
        // E[A/T] = A/T (1 + σ_T²/T²) to second order for independent A and T.
        let covariance = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 4.0]];
        let [e1, e2] = mean_ellipticity(&[20.0, 0.0, 100.0], &covariance);
        assert!((e1 / 0.2 - 1.0 - 4e-4).abs() < 2e-6, "{e1}");
        assert!(e2.abs() < 1e-6, "{e2}");
    }

    #[test]
    fn a_mean_stays_bounded_and_its_differences_converge() {
        // Signal-to-noise ratio of T: 1.5.
        let covariance = [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 1.0]];
        let mean = |a: f64| mean_ellipticity(&[a, 0.0, 1.5], &covariance)[0];
        let slope = |step: f64| (mean(step) - mean(-step)) / (2.0 * step);
        assert!(mean(1e6) <= 1.0);
        // The same slope for steps that differ by a factor of 100.
        assert!((slope(1e-3) / slope(1e-1) - 1.0).abs() < 0.01, "{} {}", slope(1e-3), slope(1e-1));
    }
}
