//! The amplifiers of a frame as the transport of a correction: forward and reverse.

use std::cell::Cell;

use ndarray::Array2;

use super::amplifier::Amplifiers;
use super::frame;
use super::invert::Transport;
use crate::error::InputError;
use crate::readout::Allowed;

/// Charge of a frame from where it was collected to its amplifiers, and back.
pub struct FrameTransport<'a> {
    amplifiers: &'a Amplifiers,
    dark: Array2<bool>,
    status: &'a dyn Fn(&str),
    readouts: Cell<usize>,
}

impl<'a> FrameTransport<'a> {
    /// For frames like this one; `status` is given the current step.
    pub fn new(amplifiers: &'a Amplifiers, frame: &Array2<f64>, status: &'a dyn Fn(&str)) -> FrameTransport<'a> {
        let dark = amplifiers.covered(frame) & !amplifiers.lit(frame);
        FrameTransport { amplifiers, dark, status, readouts: Cell::new(0) }
    }
}

impl Transport for FrameTransport<'_> {
    type Error = InputError;

    fn read(&self, image_e: &Array2<f64>, allowed_e: Option<f64>) -> Result<Array2<f64>, InputError> {
        self.readouts.set(self.readouts.get() + 1);
        (self.status)(&format!("readout {}", self.readouts.get()));
        self.amplifiers.read_within(image_e, allowed_e)
    }

    fn before(&self, read_e: &Array2<f64>, allowed: Allowed) -> Result<Option<Array2<f64>>, InputError> {
        (self.status)("transfers in the opposite order");
        let mut before_e = read_e.clone();
        for amplifier in &self.amplifiers.0 {
            let part_e = amplifier.part(read_e).to_owned();
            match frame::before(&amplifier.device, &amplifier.geometry, &part_e, amplifier.factors.as_ref(), allowed) {
                Some(part_e) => amplifier.put(&part_e, &mut before_e),
                None => return Ok(None),
            }
        }
        Ok(Some(before_e))
    }

    fn added(&self) -> Option<&Array2<bool>> {
        Some(&self.dark)
    }
}
