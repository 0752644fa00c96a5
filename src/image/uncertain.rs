//! Pixels whose charge before the transfers does not follow from what was read.
//!
//! A packet that meets more empty traps than it has electrons is emptied. What leaves the detector in its place is then what
//! traps give back later, and does not depend on what the packet held: many images are read as the same frame. The residual
//! of a correction, observed − trail(image), is 0 for each of them and shows nothing. The electrons that were caught come out
//! behind the packet, so that the pixels there are uncertain too, by as much as they are counted as someone else's.
//!
//! So the correction is begun again elsewhere, and where it ends elsewhere the pixel is uncertain. The image is first moved by
//! little, ± at random from pixel to pixel, and read out: where every pixel keeps half of its own change or more, no packet is
//! near being emptied and the correction has one end. Otherwise it is begun at three other images, with all pixels raised by
//! the largest displacement of charge in the frame, all lowered by it (to 0 at least), and either of these at random. The
//! charges that fit the frame lie between the images it ends at.
//!
//! Holds for any readout that grows with each charge, and to the factor of 2 that [`uncertain`] is tested for; charges that
//! are further off together than each by itself are not searched for.

use ndarray::{Array2, Zip};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::correct::{Corrected, Residual, solve_from, without};

/// What is uncertain of a corrected image.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertain {
    /// Pixels whose error may be larger than `error_e`.
    pub pixels: Array2<bool>,
    /// Error of all other pixels, e-, if the forward model is right.
    pub error_e: f64,
    /// What the forward model leaves unexplained of all other pixels.
    pub left: Residual,
}

/// Errors of residuals add up: so many of those that were asked for, or of their scatter, may be the error of a pixel.
const ERROR_OVER_RESIDUAL: f64 = 10.0;

/// Share of its own change that a pixel keeps if its packet is not near being emptied.
const KEPT: f64 = 0.5;

/// Finds the uncertain pixels of a correction, which is the work of up to three more, or of one readout.
///
/// `observed`, `held` and `trail` are those of the correction; `accuracy_e` is how well each residual is known: what was asked
/// for, and the accuracy of the readout itself.
///
/// # Errors
/// Those of the readout.
pub fn uncertain<E>(
    observed: &Array2<f64>,
    held: Option<&Array2<bool>>,
    corrected: &Corrected,
    accuracy_e: f64,
    iterations: usize,
    trail: impl Fn(&Array2<f64>) -> Result<Array2<f64>, E>,
) -> Result<Uncertain, E> {
    let image = &corrected.image;
    // Always the same numbers: any will do.
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let error_e = ERROR_OVER_RESIDUAL * accuracy_e.max(corrected.last().rms_e);

    let mut pixels = Array2::from_elem(image.raw_dim(), false);
    let step = Array2::from_shape_simple_fn(image.raw_dim(), || if random.random() { error_e } else { -error_e });
    let step = without(step, held);
    // observed − left is what the image is read as. A pixel that is held has no step of its own.
    let change = trail(&(image + &step))? - observed + &corrected.left;
    if Zip::from(&change).and(&step).any(|change, step| *step != 0.0 && change / step < KEPT) {
        let farthest_e = corrected.residuals[0].max_e;
        let (raised, lowered) =
            (|charge: f64| charge + farthest_e, |charge: f64| charge.min((charge - farthest_e).max(0.0)));
        let either = image.mapv(|charge| if random.random() { raised(charge) } else { lowered(charge) });
        for start in [image.mapv(raised), image.mapv(lowered), either] {
            let start = image + &without(start - image, held);
            let other = solve_from(start, observed, held, accuracy_e, iterations, &trail)?.image;
            Zip::from(&mut pixels).and(&other).and(image).for_each(|uncertain, other, charge| {
                *uncertain |= (other - charge).abs() > 0.5 * error_e;
            });
        }
        Zip::from(&mut pixels)
            .and(&corrected.left)
            .for_each(|uncertain, left| *uncertain |= left.abs() > 0.5 * error_e);
    }
    let left = Residual::of(&without(corrected.left.clone(), Some(&pixels)));
    Ok(Uncertain { pixels, error_e, left })
}

impl Uncertain {
    /// Number of uncertain pixels.
    pub fn count(&self) -> usize {
        self.pixels.iter().filter(|uncertain| **uncertain).count()
    }
}
