//! A detector as it is at one moment: charge in, charge out.

use std::sync::Arc;

use ndarray::{Array2, Axis};

use crate::conditions::Conditions;
use crate::damage::SpeciesState;
use crate::effect::Effect;
use crate::observable::Observable;
use crate::readout::{Downstream, Method, Readout};
use crate::shape::ShapeChange;

/// The coarsest readout that is chosen where nobody asked for it.
const COARSEST: f64 = 1e-2;

/// Traps, wells, registers and amplifier under given conditions.
#[derive(Clone, Debug)]
pub struct Device {
    /// The conditions as they really are, with the dose behind the traps.
    pub at: Conditions,
    /// Traps of the pixels.
    pub traps: Vec<SpeciesState>,
    /// The parallel readout.
    pub readout: Readout,
    /// Serial registers with traps, each with its number of transfers.
    pub serial: Vec<(Readout, u32)>,
    /// What else happens to charges and values.
    pub effects: Vec<Arc<dyn Effect>>,
}

/// What stands beside the columns that are read out, in their rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Beside {
    /// The image is a stamp around an object that makes the serial register's transfers; so many columns lie between its
    /// centre and its edge, and background beyond.
    Stamp(usize),
    /// Background alone: the image is one column.
    Background,
    /// The same charge again: the image is one column of a flat field.
    Same,
}

impl Device {
    /// The charges (e-, `[[row, column]]`, background included) as they are read.
    pub fn read(&self, charge_e: &Array2<f64>, downstream: Downstream, beside: Beside) -> Array2<f64> {
        let before_e = self.before(charge_e.clone());
        let clocked_e = self.readout.parallel(&before_e, downstream);
        self.after(&before_e, clocked_e, beside)
    }

    /// The charges (e-) that are clocked out, given those that were collected.
    pub fn before(&self, mut charge_e: Array2<f64>) -> Array2<f64> {
        for effect in &self.effects {
            effect.charge(&mut charge_e, &self.at);
        }
        charge_e
    }

    /// What is read of charges (e-) that were clocked out, given those before.
    pub fn after(&self, before_e: &Array2<f64>, mut read_e: Array2<f64>, beside: Beside) -> Array2<f64> {
        for (readout, transfers) in &self.serial {
            read_e = self.through_serial(readout, *transfers, &read_e, beside);
        }
        for effect in &self.effects {
            effect.read(before_e, &mut read_e, &self.at);
        }
        read_e
    }

    /// Columns of background that tell how those of an image so wide are read: one, unless they know of one another, in a
    /// serial register.
    pub fn columns_of_background(&self, width_px: usize) -> usize {
        let empty = |readout: &Readout| readout.traps.iter().all(|trap| trap.density_per_px == 0.0);
        if self.serial.iter().all(|(readout, _)| empty(readout)) { 1 } else { width_px }
    }

    /// The same device without chance.
    pub fn expected(&self) -> Device {
        let serial = self.serial.iter().map(|(readout, transfers)| (readout.expected(), *transfers)).collect();
        Device { readout: self.readout.expected(), serial, ..self.clone() }
    }

    /// The same device, computed by another method.
    pub fn by(&self, method: Method) -> Device {
        let with = |readout: &Readout| Readout { method, ..readout.clone() };
        let serial = self.serial.iter().map(|(readout, transfers)| (with(readout), *transfers)).collect();
        Device { readout: with(&self.readout), serial, ..self.clone() }
    }

    /// The same device, read out to a relative accuracy so many times coarser, but to 1 % at least (a coarser one is kept).
    pub fn coarser(&self, times: f64) -> Device {
        match self.readout.method {
            Method::Fast { relative } => {
                let coarser = (times * relative).min(COARSEST);
                self.by(Method::Fast { relative: relative.max(coarser) })
            }
            _ => self.clone(),
        }
    }

    /// What is measured of a value.
    pub fn observed(&self, mut value: f64, observable: Observable, at: &Conditions) -> f64 {
        for effect in &self.effects {
            effect.value(&mut value, observable, at);
        }
        value
    }

    /// What is measured of a change of shape.
    pub fn observed_change(&self, change: ShapeChange) -> ShapeChange {
        ShapeChange {
            delta_e1: self.observed(change.delta_e1, Observable::DeltaE1, &self.at),
            delta_y_px: self.observed(change.delta_y_px, Observable::DeltaY, &self.at),
            delta_flux: self.observed(change.delta_flux, Observable::DeltaFlux, &self.at),
            delta_size: self.observed(change.delta_size, Observable::DeltaSize, &self.at),
            ..change
        }
    }

    fn through_serial(&self, readout: &Readout, transfers: u32, image: &Array2<f64>, beside: Beside) -> Array2<f64> {
        let rows_before = i64::from(transfers) - 1;
        let background_e = self.at.background_e;
        if let Beside::Stamp(half_px) = beside {
            let downstream = Downstream { rows: rows_before - half_px as i64, charge_e: background_e };
            return readout.serial(image, downstream);
        }
        let mut read = image.clone();
        for mut row in read.axis_iter_mut(Axis(0)) {
            let charge_e = if beside == Beside::Same { row[0] } else { background_e };
            row[0] = readout.column(&[row[0]], Downstream { rows: rows_before, charge_e })[0];
        }
        read
    }
}
