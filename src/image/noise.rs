//! Noise added by the amplifier after the transfers: separated before a correction, and propagated through it.
//!
//! A correction treats the amplifier's contribution as trailed charge, and sharpens it. Existing pipelines therefore correct the
//! smoothest image that the read noise allows, and add the difference again (Anderson & Bedin 2010, PASP 122, 1035; CALACS). Here
//! the difference is that from the mean of the surrounding pixels, as far as read noise can explain it: with mean m and variance v
//! of the pixels around one of value x,
//!
//! ```text
//! noise = (x − m) · min(1, r/√v), but not beyond ±2r        r: read noise
//! ```
//!
//! Its rms in a flat sky is the read noise. Shot noise included in it is not corrected, which is a second-order effect; at the
//! edges of stars it is small compared with their charge.

use ndarray::{Array2, Axis, Zip, s};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use serde::Serialize;

/// Pixels on each side for the mean and variance, in rows and in columns.
const AROUND_PX: usize = 2;

/// Largest separated noise, relative to the read noise.
const MOST: f64 = 2.0;

/// Largest separation of pixels for which the correlation is reported.
const LAGS: usize = 5;

/// White amplifier noise after a correction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseAfter {
    /// Its rms over that of the noise before.
    pub ratio_rms: f64,
    /// Correlation of pixels of a column 1, 2, ... rows apart.
    pub correlation_rows: Vec<f64>,
    /// Correlation of pixels of a row 1, 2, ... columns apart.
    pub correlation_columns: Vec<f64>,
}

/// Possible read noise in each pixel of an image (e-, `[[row, column]]`); 0 for pixels that do not count. These are not used for
/// others.
pub fn separated(image_e: &Array2<f64>, count: &Array2<bool>, read_noise_e: f64) -> Array2<f64> {
    let (rows, columns) = image_e.dim();
    let around = |at: usize, length: usize| at.saturating_sub(AROUND_PX)..(at + AROUND_PX + 1).min(length);
    let mut noise = Array2::zeros(image_e.raw_dim());
    Zip::indexed(&mut noise).and(image_e).and(count).par_for_each(|(row, column), noise, value, counts| {
        if !*counts {
            return;
        }
        let near = s![around(row, rows), around(column, columns)];
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        Zip::from(image_e.slice(near)).and(count.slice(near)).for_each(|near, counts| {
            if *counts {
                let difference = near - value;
                (n, sum, squares) = (n + 1.0, sum + difference, squares + difference * difference);
            }
        });
        let mean = sum / n;
        let rms = ((squares - n * mean * mean).max(0.0) / (n - 1.0_f64).max(1.0)).sqrt();
        let share = read_noise_e / rms.max(read_noise_e).max(f64::MIN_POSITIVE);
        *noise = (-mean * share).clamp(-MOST * read_noise_e, MOST * read_noise_e);
    });
    noise
}

/// Effect of a correction on white noise of the amplifier (`noise_e`, e- rms).
///
/// The correction is repeated on the observed image with noise from `seed`; the difference of the corrected images is compared with
/// the noise, over pixels that `count`.
///
/// # Errors
/// Those of the correction.
pub fn followed<E>(
    observed: &Array2<f64>,
    corrected: &Array2<f64>,
    count: &Array2<bool>,
    (noise_e, seed): (f64, u64),
    correct: impl Fn(&Array2<f64>) -> Result<Array2<f64>, E>,
) -> Result<NoiseAfter, E> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, noise_e).expect("a finite scatter");
    let noise = Array2::from_shape_simple_fn(observed.raw_dim(), || normal.sample(&mut random));
    let difference = correct(&(observed + &noise))? - corrected;
    let of = |values: &Array2<f64>| products(values, count, Axis(0), 0).0;
    let correlation = |along: Axis| {
        let of = |values: &Array2<f64>, lag| {
            let (products, squares) = products(values, count, along, lag);
            products / squares
        };
        // White noise is uncorrelated: the correlation of a sample is random, and the same after the correction.
        let of = |lag| of(&difference, lag) - of(&noise, lag);
        (1..=LAGS.min(difference.len_of(along).saturating_sub(1))).map(of).collect()
    };
    Ok(NoiseAfter {
        ratio_rms: (of(&difference) / of(&noise)).sqrt(),
        correlation_rows: correlation(Axis(0)),
        correlation_columns: correlation(Axis(1)),
    })
}

/// Sum of products of pixels at this lag, both of which count, and the geometric mean of the sums of the squares of either.
fn products(values: &Array2<f64>, count: &Array2<bool>, along: Axis, lag: usize) -> (f64, f64) {
    let cut = |from: usize, to: usize| ndarray::Slice::from(from..to);
    let length = values.len_of(along);
    let (first, second) = (cut(0, length - lag), cut(lag, length));
    let (mut products, mut of_first, mut of_second) = (0.0, 0.0, 0.0);
    Zip::from(values.slice_axis(along, first))
        .and(values.slice_axis(along, second))
        .and(count.slice_axis(along, first))
        .and(count.slice_axis(along, second))
        .for_each(|a, b, first, second| {
            if *first && *second {
                products += a * b;
                of_first += a * a;
                of_second += b * b;
            }
        });
    (products, (of_first * of_second).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn white(shape: (usize, usize), rms: f64, seed: u64) -> Array2<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, rms).unwrap();
        Array2::from_shape_simple_fn(shape, || normal.sample(&mut random))
    }

    fn rms(values: &Array2<f64>) -> f64 {
        values.mapv(|value| value * value).mean().unwrap().sqrt()
    }

    #[test]
    fn noise_of_a_flat_sky_is_separated_and_of_stars_no_more_than_it_can_be() {
        let all = Array2::from_elem((80, 80), true);
        let noise = white((80, 80), 4.0, 1);
        let noise_left = separated(&(&noise + 60.0), &all, 4.0);
        // Mean and variance of 25 pixels have sampling errors.
        assert!(rms(&(&noise_left - &noise)) < 0.35 * 4.0, "{}", rms(&(&noise_left - &noise)));
        let shot = white((80, 80), 12.0, 2);
        let of_both = rms(&separated(&(&noise + &shot), &all, 4.0));
        assert!((of_both - 4.0).abs() < 0.3, "{of_both}");
        let stars = separated(&noise.mapv(|noise| 100.0 * noise.abs()), &all, 4.0);
        assert!(stars.iter().all(|noise| noise.abs() <= 8.0));
        assert_eq!(separated(&noise, &Array2::from_elem((80, 80), false), 4.0), Array2::<f64>::zeros((80, 80)));
    }

    #[test]
    fn what_becomes_of_noise_is_what_the_correction_does_to_it() {
        let observed = Array2::from_elem((200, 200), 100.0);
        let count = Array2::from_elem((200, 200), true);
        // A correction that doubles each pixel and subtracts the one below: lag 1 has −2/5.
        let correct = |image: &Array2<f64>| {
            let mut sharp = image * 2.0;
            let mut above = sharp.slice_mut(s![1.., ..]);
            above -= &image.slice(s![..199, ..]);
            Ok::<_, Infallible>(sharp)
        };
        let corrected = correct(&observed).unwrap();
        let after = followed(&observed, &corrected, &count, (3.0, 1), correct).unwrap();
        assert!((after.ratio_rms - 5.0_f64.sqrt()).abs() < 0.02, "{after:?}");
        assert!((after.correlation_rows[0] + 0.4).abs() < 0.02, "{after:?}");
        let others = after.correlation_rows[1..].iter().chain(&after.correlation_columns);
        others.for_each(|correlation| assert!(correlation.abs() < 0.02, "{after:?}"));
    }
}
