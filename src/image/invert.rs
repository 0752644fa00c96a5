//! A correction that starts from the reversed transfers.
//!
//! ```text
//! source₀     = observed
//! image_k     = before(source_k)                       the transfers reversed, nearly exact
//! source_k+1  = source_k + (observed − trail(image_k))  the residual of the forward model
//! ```
//!
//! The charges before the transfers can be computed from those after them as directly as the other way round
//! ([`Readout::parallel_reversed`]), with a selectable error. The forward model then gives the residual, which is reversed as well.
//! An error decreases by the accuracy of the reversal, while in the plain iteration of [`super::correct()`] it decreases by the
//! relative size of the trails. (A defect correction: Stetter 1978, Numerische Mathematik 29, 425.)

use std::convert::Infallible;

use ndarray::{Array2, Zip};

use super::correct::{Corrected, Residual, Stop, Turned, difference, go_on, solve, sum, without};
use crate::readout::{Allowed, Downstream, Readout};

/// Charge from where it was collected to the amplifier, and back.
pub trait Transport {
    /// Its error type.
    type Error;

    /// An image as read: with an allowed error (e-, rms) if given, otherwise with the accuracy of the readout.
    ///
    /// # Errors
    /// If a formula fails.
    fn read(&self, image_e: &Array2<f64>, allowed_e: Option<f64>) -> Result<Array2<f64>, Self::Error>;

    /// The image before the readout, with an allowed error, if there is a fast method. None if there is none.
    ///
    /// # Errors
    /// If a formula fails.
    fn before(&self, read_e: &Array2<f64>, allowed: Allowed) -> Result<Option<Array2<f64>>, Self::Error>;

    /// Pixels whose values take part in no transfer and are only added to the image read; none if there are no such pixels.
    fn added(&self) -> Option<&Array2<bool>> {
        None
    }
}

/// Columns of an image behind some downstream rows.
pub struct Columns<'a> {
    /// Their traps and wells.
    pub readout: &'a Readout,
    /// What lies between them and the register.
    pub downstream: Downstream,
}

impl Transport for Columns<'_> {
    type Error = Infallible;

    fn read(&self, image_e: &Array2<f64>, allowed_e: Option<f64>) -> Result<Array2<f64>, Infallible> {
        Ok(match allowed_e {
            Some(error_e) => self.readout.parallel_within(image_e, self.downstream, Allowed { relative: 0.0, error_e }),
            None => self.readout.parallel(image_e, self.downstream),
        })
    }

    fn before(&self, read_e: &Array2<f64>, allowed: Allowed) -> Result<Option<Array2<f64>>, Infallible> {
        Ok(self.readout.parallel_reversed(read_e, self.downstream, allowed))
    }
}

/// Shares of the requested error allowed for the reversal and the readout.
const SHARE_OF_REVERSAL: f64 = 0.15;
const SHARE_OF_READOUT: f64 = 0.1;

/// Finds the image that is read as the observed one.
///
/// Pixels that are `held` keep their observed values: they take part in the readout, and their residual does not count. The first
/// residual is the change by the first reversal. If the transport cannot be reversed, or reversal no longer helps, the plain
/// iteration continues ([`super::correct::solve`]).
///
/// # Errors
/// Those of the transport.
pub fn invert<T: Transport>(
    transport: &T,
    observed: &Array2<f64>,
    held: Option<&Array2<bool>>,
    stop: Stop,
) -> Result<Corrected, T::Error> {
    let allowed = Allowed { relative: stop.relative, error_e: SHARE_OF_REVERSAL * stop.error_e };
    let before = |source_e: &Array2<f64>| -> Result<_, T::Error> {
        Ok(transport.before(source_e, allowed)?.map(|image| with_held(image, observed, held)))
    };
    let Some(image) = before(observed)? else {
        return solve(observed, held, stop, |image| transport.read(image, None));
    };
    let moved = Residual::of(&difference(observed, &image));
    let read_e = (stop.error_e > 0.0).then_some(SHARE_OF_READOUT * stop.error_e);
    let comparison = Comparison { transport, observed, held, stop, read_e };
    let (mut found, mut unexplained) = comparison.of(image, observed.clone(), allowed, vec![moved])?;
    while !found.converged && found.iterations() < stop.iterations {
        let Some(turned) = &found.turned else { break };
        let source_e = sum(&turned.source_e, &unexplained);
        let Some(image) = before(&source_e)? else { break };
        let (next, next_unexplained) = comparison.of(image, source_e, allowed, found.residuals.clone())?;
        if !next.last().is_below(found.last()) {
            break;
        }
        (found, unexplained) = (next, next_unexplained);
    }
    if found.converged || found.iterations() >= stop.iterations {
        return Ok(found);
    }
    go_on(found, observed, held, stop, |image| transport.read(image, read_e))
}

/// The data with which a reversal is compared.
struct Comparison<'a, T> {
    transport: &'a T,
    observed: &'a Array2<f64>,
    held: Option<&'a Array2<bool>>,
    stop: Stop,
    /// Allowed error of the readout, e-.
    read_e: Option<f64>,
}

impl<T: Transport> Comparison<'_, T> {
    /// An image from a source, as it is read, with the residuals of all pixels, including held ones.
    fn of(
        &self,
        mut image: Array2<f64>,
        source_e: Array2<f64>,
        allowed: Allowed,
        mut residuals: Vec<Residual>,
    ) -> Result<(Corrected, Array2<f64>), T::Error> {
        let mut unexplained = difference(self.observed, &self.transport.read(&image, self.read_e)?);
        if let Some(added) = self.transport.added() {
            // Nothing else depends on them, and they are read unchanged.
            Zip::from(&mut image).and(&mut unexplained).and(added).par_for_each(|image, unexplained, added| {
                if *added {
                    *image += std::mem::take(unexplained);
                }
            });
        }
        let left = without(unexplained.clone(), self.held);
        let residual = Residual::of(&left);
        residuals.push(residual);
        let converged = self.stop.is_reached(residual, residuals[0]);
        let turned = Some(Turned { source_e, allowed });
        Ok((Corrected { image, residuals, converged, left, turned, read_e: self.read_e }, unexplained))
    }
}

/// An image with the observed values in held pixels.
fn with_held(mut image: Array2<f64>, observed: &Array2<f64>, held: Option<&Array2<bool>>) -> Array2<f64> {
    if let Some(held) = held {
        Zip::from(&mut image).and(observed).and(held).par_for_each(|image, observed, held| {
            if *held {
                *image = *observed;
            }
        });
    }
    image
}
