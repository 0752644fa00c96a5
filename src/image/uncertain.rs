//! Pixels whose charge before the transfers is not determined by the frame read.
//!
//! A packet that meets more empty traps than it has electrons is emptied. The charge that leaves the detector in its place is what
//! traps release later, and does not depend on the packet: many images are read as the same frame. The residual of a correction,
//! observed − trail(image), is 0 for each of them and shows nothing. The captured electrons appear behind the packet, so that the
//! pixels there are uncertain by the amount wrongly attributed to them.
//!
//! So the correction is started again from other images, and where the result differs the pixel is uncertain. The image is first
//! changed slightly, ± at random from pixel to pixel, and read out: if every pixel keeps at least half of its own change, no packet
//! is nearly emptied and the correction has a unique result. The same holds if the reversed transfers recover every change to
//! within half of it. Otherwise the correction is started from three other images, with all pixels raised by the largest
//! displacement of charge in the frame, all lowered by it (to 0 at least), and either of these at random. Then only the uncertain
//! pixels are changed, all to the smallest and all to the largest charge among their results, until no others become uncertain.
//! This finds pixels far behind, affected through the state of the traps. The charges that fit the frame lie between the images at
//! which these corrections end.
//!
//! Valid for any readout that increases with each charge. It is a search: `tests/suite/images.rs` requires its error estimate to be
//! within a factor of 3.

use ndarray::{Array2, Zip};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::correct::{Corrected, ERROR_OVER_RESIDUAL, Residual, difference, solve_from, sum, without};
use super::invert::Transport;

/// Uncertain pixels of a corrected image.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertain {
    /// Pixels whose error may be larger than `error_e`.
    pub pixels: Array2<bool>,
    /// Error of all other pixels, e-, if the forward model is right, including for the charges of held pixels.
    pub error_e: f64,
    /// Residual of the forward model for all other pixels.
    pub left: Residual,
}

/// Maximum number of rounds in which the uncertain pixels are set to the ends of their ranges, to find others that depend on them.
const ROUNDS: usize = 3;

/// Share of its own change that a pixel keeps, or that is recovered, if its packet is not nearly emptied.
const KEPT: f64 = 0.5;

/// Finds the uncertain pixels of a correction. It takes one or two more readouts, or, if packets were emptied, up to nine
/// corrections with this number of iterations.
///
/// `transport`, `observed` and `held` are those of the correction; `accuracy_e` is the accuracy of each residual: the requested
/// one, and that of the readout itself.
///
/// # Errors
/// Those of the readout.
pub fn uncertain<T: Transport>(
    transport: &T,
    observed: &Array2<f64>,
    held: Option<&Array2<bool>>,
    corrected: &Corrected,
    (accuracy_e, iterations): (f64, usize),
) -> Result<Uncertain, T::Error> {
    let image = &corrected.image;
    // Always the same random numbers; any will do.
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let error_e = ERROR_OVER_RESIDUAL * accuracy_e.max(corrected.last().rms_e);
    let trail = |image: &Array2<f64>| transport.read(image, corrected.read_e);

    let step = Array2::from_shape_simple_fn(image.raw_dim(), || if random.random() { error_e } else { -error_e });
    // A held pixel has no step of its own, and one that is only added to the image read is as certain as all others together.
    let step = without(without(step, held), transport.added());
    // observed − left is the image as read.
    let change = sum(&difference(&trail(&sum(image, &step))?, observed), &corrected.left);
    let mut range = Range { image, low: image.clone(), high: image.clone(), error_e };
    if !is_kept(&change, &step) && !is_found_again(transport, corrected, &change, &step)? {
        let end_of = |start: Array2<f64>| {
            let start = image + &without(start - image, held);
            solve_from(start, observed, held, (accuracy_e, iterations), trail).map(|corrected| corrected.image)
        };
        let farthest_e = corrected.residuals[0].max_e;
        let raised = |charge: f64| charge + farthest_e;
        let lowered = |charge: f64| charge.min((charge - farthest_e).max(0.0));
        let either = image.mapv(|charge| if random.random() { raised(charge) } else { lowered(charge) });
        for start in [image.mapv(raised), image.mapv(lowered), either] {
            range.widen(&end_of(start)?);
        }
        for _ in 0..ROUNDS {
            let known = range.uncertain();
            for ends in [range.low.clone(), range.high.clone()] {
                let start = Zip::from(&known)
                    .and(&ends)
                    .and(image)
                    .map_collect(|known, end, at| if *known { *end } else { *at });
                range.widen(&end_of(start)?);
            }
            if range.uncertain() == known {
                break;
            }
        }
    }
    let mut pixels = range.uncertain();
    Zip::from(&mut pixels).and(&corrected.left).for_each(|uncertain, left| *uncertain |= left.abs() > 0.5 * error_e);
    let left = Residual::of(&without(corrected.left.clone(), Some(&pixels)));
    Ok(Uncertain { pixels, error_e, left })
}

/// Whether every pixel keeps enough of its own step in the image read.
fn is_kept(change: &Array2<f64>, step: &Array2<f64>) -> bool {
    Zip::from(change).and(step).all(|change, step| change * step >= KEPT * step * step)
}

/// Whether every pixel's step is recovered from the readout by reversing the transfers once more. With heavy damage, the effect of
/// the neighbours' steps on a pixel may hide its own, but all pixels together still determine it.
fn is_found_again<T: Transport>(
    transport: &T,
    corrected: &Corrected,
    change: &Array2<f64>,
    step: &Array2<f64>,
) -> Result<bool, T::Error> {
    let Some(turned) = &corrected.turned else { return Ok(false) };
    let Some(again) = transport.before(&sum(&turned.source_e, change), turned.allowed)? else { return Ok(false) };
    let image = &corrected.image;
    Ok(Zip::from(&again)
        .and(image)
        .and(step)
        .all(|again, image, step| *step == 0.0 || ((again - image) - step).abs() <= (1.0 - KEPT) * step.abs()))
}

/// Range of the charges at which corrections end.
struct Range<'a> {
    image: &'a Array2<f64>,
    low: Array2<f64>,
    high: Array2<f64>,
    error_e: f64,
}

impl Range<'_> {
    /// Extends the range by the result of one more correction.
    fn widen(&mut self, end: &Array2<f64>) {
        Zip::from(&mut self.low).and(&mut self.high).and(end).for_each(|low, high, end| {
            *low = low.min(*end);
            *high = high.max(*end);
        });
    }

    /// Pixels whose charges differ from those in the image.
    fn uncertain(&self) -> Array2<bool> {
        Zip::from(self.image)
            .and(&self.low)
            .and(&self.high)
            .map_collect(|at, low, high| (at - low).max(high - at) > 0.5 * self.error_e)
    }
}

impl Uncertain {
    /// Number of uncertain pixels.
    pub fn count(&self) -> usize {
        self.pixels.iter().filter(|uncertain| **uncertain).count()
    }
}
