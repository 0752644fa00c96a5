//! Trailed image → image before the transfers, by inverting the forward model.
//!
//! ```text
//! image₀     = observed
//! image_k+1  = image_k + (observed − trail(image_k))
//! ```
//!
//! Each step removes the trails left by the previous step: the error decreases by about the fraction of the charge that is
//! displaced. The residual, observed − trail(image), is known and is kept for every step. If the transfers can be reversed,
//! [`super::invert()`] gives the same result in fewer steps.
//!
//! Sources: Bristow 2003 (STIS model-based charge transfer inefficiency correction); Massey et al. 2010 (MNRAS 401, 371), section
//! 4; Rhodes et al. 2010 (PASP 122, 439) for its benefit. As valid as the forward model: a trap missing from the model leaves its
//! trail, and noise added after the transfers is sharpened as if it had been trailed.

use ndarray::{Array2, Zip};
use serde::Serialize;

use super::invert::{Columns, invert};
use crate::numeric::parallel;
use crate::readout::{Allowed, Downstream, Readout};

/// Stopping criterion of a correction: the first of the accuracies reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Largest residual of a pixel, as a fraction of the largest before the first step.
    pub relative: f64,
    /// Error of the image, e- rms; 0 if only the residual counts.
    pub error_e: f64,
    /// Maximum number of steps.
    pub iterations: usize,
}

/// Errors of residuals add up: the error of the image may be this factor times the residual, and that of a pixel this factor times
/// their scatter.
pub(super) const ERROR_OVER_RESIDUAL: f64 = 10.0;

impl Stop {
    /// Until the largest residual is this fraction of the largest before the first step.
    pub fn at_residual(relative: f64, iterations: usize) -> Stop {
        Stop { relative, error_e: 0.0, iterations }
    }

    /// Until the error of the image, e- rms, is this small.
    pub fn at_error(error_e: f64, iterations: usize) -> Stop {
        Stop { relative: 0.0, error_e, iterations }
    }

    /// Whether a residual is small enough, given the first one. The error of the image is assumed to be ten times its residual.
    pub fn is_reached(self, residual: Residual, first: Residual) -> bool {
        residual.max_e <= self.relative * first.max_e || ERROR_OVER_RESIDUAL * residual.rms_e <= self.error_e
    }
}

/// observed − trail(image) over the corrected pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// Root mean square, e-.
    pub rms_e: f64,
    /// Largest magnitude, e-.
    pub max_e: f64,
}

/// The source image whose reversal gave an image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Turned {
    pub source_e: Array2<f64>,
    pub allowed: Allowed,
}

/// An image without its trails.
#[derive(Clone, Debug, PartialEq)]
pub struct Corrected {
    /// Charges before the transfers, e-, `[[row, column]]`.
    pub image: Array2<f64>,
    /// Residuals of the forward model: before the first step (the trails themselves, as first estimated), and after each accepted
    /// step.
    pub residuals: Vec<Residual>,
    /// Whether the last residual is within the requested error.
    pub converged: bool,
    /// The last residual pixel by pixel, e-: observed − trail(image); 0 for held pixels.
    pub left: Array2<f64>,
    /// Present if the image was found by reversing the transfers.
    pub(super) turned: Option<Turned>,
    /// Allowed error of the readout in the comparison, e-; None: as accurate as the readout.
    pub(super) read_e: Option<f64>,
}

impl Corrected {
    /// An image that is read and compared for the first time.
    fn begin<E>(
        image: Array2<f64>,
        observed: &Array2<f64>,
        held: Option<&Array2<bool>>,
        trail: impl Fn(&Array2<f64>) -> Result<Array2<f64>, E>,
    ) -> Result<Corrected, E> {
        let left = without(difference(observed, &trail(&image)?), held);
        Ok(Corrected {
            image,
            residuals: vec![Residual::of(&left)],
            converged: false,
            left,
            turned: None,
            read_e: None,
        })
    }

    /// Number of accepted steps.
    pub fn iterations(&self) -> usize {
        self.residuals.len() - 1
    }

    /// The last residual.
    pub fn last(&self) -> Residual {
        *self.residuals.last().expect("a correction starts with a residual")
    }
}

/// Removes the trails of a parallel readout from an image.
///
/// `observed[[row, column]]`, e-, as read, row 0 nearest the register; see [`Readout::parallel`]. A random readout
/// ([`crate::readout::Method::MonteCarlo`]) is inverted in the mean.
pub fn correct(readout: &Readout, observed: &Array2<f64>, downstream: Downstream, stop: Stop) -> Corrected {
    let readout = &readout.expected();
    invert(&Columns { readout, downstream }, observed, None, stop).unwrap_or_else(|never| match never {})
}

/// The same for any readout: finds the image that `trail` maps to the observed one.
///
/// Pixels that are `held` keep their observed values: they take part in the readout, and their residual does not count.
///
/// # Errors
/// Those of the readout.
pub fn solve<E>(
    observed: &Array2<f64>,
    held: Option<&Array2<bool>>,
    stop: Stop,
    trail: impl Fn(&Array2<f64>) -> Result<Array2<f64>, E>,
) -> Result<Corrected, E> {
    let start = Corrected::begin(observed.clone(), observed, held, &trail)?;
    go_on(start, observed, held, stop, trail)
}

/// The same from a first image other than the observed one, until the largest residual is `wanted_e`.
///
/// # Errors
/// Those of the readout, here and below.
pub(super) fn solve_from<E>(
    image: Array2<f64>,
    observed: &Array2<f64>,
    held: Option<&Array2<bool>>,
    (wanted_e, iterations): (f64, usize),
    trail: impl Fn(&Array2<f64>) -> Result<Array2<f64>, E>,
) -> Result<Corrected, E> {
    let start = Corrected::begin(image, observed, held, &trail)?;
    let relative = if wanted_e < start.residuals[0].max_e { wanted_e / start.residuals[0].max_e } else { 1.0 };
    go_on(start, observed, held, Stop::at_residual(relative, iterations), trail)
}

/// The image that `trail` maps to the observed one, after a fixed number of steps, all accepted: terms linear in the image stay
/// linear, as required for a mean over noise.
///
/// # Errors
/// Those of the readout.
pub fn iterated<E>(
    observed: &Array2<f64>,
    iterations: u32,
    trail: impl Fn(&Array2<f64>) -> Result<Array2<f64>, E>,
) -> Result<Array2<f64>, E> {
    let mut image = observed.clone();
    for _ in 0..iterations {
        let trailed = trail(&image)?;
        image = image + observed - trailed;
    }
    Ok(image)
}

/// Improves an image step by step until it is sufficiently accurate.
pub(super) fn go_on<E>(
    mut found: Corrected,
    observed: &Array2<f64>,
    held: Option<&Array2<bool>>,
    stop: Stop,
    trail: impl Fn(&Array2<f64>) -> Result<Array2<f64>, E>,
) -> Result<Corrected, E> {
    found.converged = stop.is_reached(found.last(), found.residuals[0]);
    while found.iterations() < stop.iterations && !found.converged {
        let image = sum(&found.image, &found.left);
        let left = without(difference(observed, &trail(&image)?), held);
        let residual = Residual::of(&left);
        // If a step improves nothing, the accuracy limit is reached.
        if !residual.is_below(found.last()) {
            break;
        }
        found.residuals.push(residual);
        found.converged = stop.is_reached(residual, found.residuals[0]);
        found = Corrected { image, left, turned: None, ..found };
    }
    Ok(found)
}

impl Residual {
    pub(super) fn of(left: &Array2<f64>) -> Residual {
        // Row by row, so that the sum does not depend on the number of threads.
        let rows = parallel::map(left.rows(), |row| {
            row.iter().fold((0.0_f64, 0.0), |(max, sum), value| (max.max(value.abs()), sum + value * value))
        });
        let (max_e, squares) = rows.iter().fold((0.0_f64, 0.0), |(max, sum), row| (max.max(row.0), sum + row.1));
        Residual { max_e, rms_e: (squares / left.len().max(1) as f64).sqrt() }
    }

    /// Whether the rms is less than another one's; false for NaN.
    pub(super) fn is_below(self, other: Residual) -> bool {
        self.rms_e < other.rms_e
    }
}

/// a − b, pixel by pixel.
pub(super) fn difference(a: &Array2<f64>, b: &Array2<f64>) -> Array2<f64> {
    Zip::from(a).and(b).par_map_collect(|a, b| a - b)
}

/// a + b, pixel by pixel.
pub(super) fn sum(a: &Array2<f64>, b: &Array2<f64>) -> Array2<f64> {
    Zip::from(a).and(b).par_map_collect(|a, b| a + b)
}

/// Values, set to 0 in some pixels.
pub(super) fn without(mut values: Array2<f64>, pixels: Option<&Array2<bool>>) -> Array2<f64> {
    if let Some(pixels) = pixels {
        Zip::from(&mut values).and(pixels).par_for_each(|value, without| {
            if *without {
                *value = 0.0;
            }
        });
    }
    values
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::readout::{Cloud, Method, Trap};

    fn damaged() -> Readout {
        Readout {
            traps: vec![Trap::new(0.3, 0.5), Trap::new(0.2, 6.0)],
            cloud: Cloud::new(100_000.0, 0.0, 0.5),
            method: Method::Exact,
        }
    }

    /// A sky of 40 e- with stars of up to 30 000 e-.
    fn field() -> Array2<f64> {
        let mut field = Array2::from_elem((120, 4), 40.0);
        for (row, column, charge_e) in [(30, 0, 30_000.0), (80, 1, 500.0), (110, 2, 4000.0), (111, 2, 900.0)] {
            field[[row, column]] += charge_e;
        }
        field
    }

    #[test]
    fn a_correction_gives_back_what_was_trailed() {
        let (readout, before) = (damaged(), field());
        let trailed = readout.parallel(&before, Downstream::NONE);
        let stop = Stop::at_residual(1e-6, 50);
        let corrected = correct(&readout, &trailed, Downstream::NONE, stop);
        assert!(corrected.converged, "{:?}", corrected.residuals);
        let moved = (&trailed - &before).iter().fold(0.0_f64, |max, value| max.max(value.abs()));
        let error = (&corrected.image - &before).iter().fold(0.0_f64, |max, value| max.max(value.abs()));
        // A residual of 1e-6 of the first, plus the steps that would follow.
        assert!(moved > 10.0 && error < 3e-6 * moved, "{error} e- of {moved} e-");
        for pair in corrected.residuals.windows(2) {
            assert!(pair[1].rms_e < 0.5 * pair[0].rms_e, "{:?}", corrected.residuals);
        }
    }

    #[test]
    fn a_step_that_helps_nothing_is_taken_back() {
        // No image is read out as this one: half the charge is lost in a way that no charge compensates.
        let observed = Array2::from_elem((3, 1), 10.0);
        let corrected =
            solve(&observed, None, Stop::at_residual(1e-3, 9), |_| Ok::<_, Infallible>(Array2::zeros((3, 1))));
        let corrected = corrected.unwrap();
        assert_eq!((corrected.iterations(), corrected.converged), (0, false));
        assert_eq!(corrected.image, observed);
    }

    #[test]
    fn a_pixel_that_is_held_stays() {
        let (readout, before) = (damaged(), field());
        let trailed = readout.parallel(&before, Downstream::NONE);
        let held = Array2::from_shape_fn(trailed.raw_dim(), |place| place == (30, 0));
        let stop = Stop::at_residual(1e-6, 50);
        let trail = |image: &Array2<f64>| Ok::<_, Infallible>(readout.parallel(image, Downstream::NONE));
        let corrected = solve(&trailed, Some(&held), stop, trail).unwrap();
        assert_eq!(corrected.image[[30, 0]], trailed[[30, 0]]);
        assert!((corrected.image[[80, 1]] - before[[80, 1]]).abs() < 1e-3);
    }
}
