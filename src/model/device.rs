//! A detector at one time: charge in, charge out.

use ndarray::{Array2, ArrayView1, Axis};

use super::effects::Effects;
use super::shear::farther;
use crate::error::InputError;
use crate::mission::{SceneBefore, Store, Survey};
use crate::physics::accuracy::Purpose;
use crate::physics::conditions::Conditions;
use crate::physics::damage::SpeciesState;
use crate::physics::observable::{Observable, Probe};
use crate::physics::shape::ShapeChange;
use crate::readout::{Clock, Cloud, Downstream, FrameTransfer, Method, Persistence, Readout};

/// Traps, wells, registers and amplifier under given conditions.
#[derive(Clone, Debug)]
pub struct Device {
    /// The true conditions, with the dose that made the traps.
    pub at: Conditions,
    /// Traps of the pixels.
    pub traps: Vec<SpeciesState>,
    /// Heights of charge clouds in the pixels.
    pub cloud: Cloud,
    /// The phases of a pixel.
    pub clock: Clock,
    /// The store that frames are shifted into before they are read.
    pub store: Option<Store>,
    /// The cadence of exposures, if traps keep charge from earlier ones.
    pub persistence: Option<Survey>,
    /// Method by which transfers are computed.
    pub method: Method,
    /// Serial registers with traps.
    pub(super) registers: Vec<Register>,
    /// Effects on charges and values.
    pub(super) effects: Effects,
}

/// A serial register under given conditions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Register {
    pub traps: Vec<SpeciesState>,
    /// Time between two serial transfers, ms.
    pub pixel_time_ms: f64,
    /// Serial transfers of the object.
    pub transfers: u32,
}

/// The surroundings of the columns that are read out, in their rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Beside {
    /// The image is a stamp around an object that makes the serial register's transfers. The number is that of the columns
    /// between its centre and its edge; background lies beyond.
    Stamp(usize),
    /// Background alone: the image is one column.
    Background,
    /// The same charge again: the image is one column of a flat field.
    Same,
}

impl Device {
    /// The parallel readout of the image region, at the line time.
    pub fn readout(&self) -> Readout {
        self.readout_at(self.at.line_time_ms)
    }

    /// The image region at a time between two transfers.
    fn readout_at(&self, line_time_ms: f64) -> Readout {
        let readout = self.readout_of(&self.traps, line_time_ms);
        Readout { traps: self.clock.spread(&readout.traps), ..readout }
    }

    /// The frame transfer through the store, if there is one.
    fn frame_transfer(&self) -> Option<FrameTransfer> {
        let Store { rows, burst_line_time_ms, trap_ratio } = self.store?;
        let stored = |line_time_ms: f64| {
            let mut readout = self.readout_at(line_time_ms);
            readout.traps.iter_mut().for_each(|trap| trap.density_per_px *= trap_ratio);
            readout
        };
        Some(FrameTransfer {
            image: self.readout_at(burst_line_time_ms),
            burst: stored(burst_line_time_ms),
            store: stored(self.at.line_time_ms),
            rows,
        })
    }

    /// The readout after earlier exposures, if traps keep their charge.
    fn after_exposures(&self) -> Option<Persistence> {
        let survey = self.persistence.as_ref()?;
        let before = survey.persistence?;
        let line_time_s = 1e-3 * self.at.line_time_ms;
        let readout_s = f64::from(before.rows) * line_time_s;
        Some(Persistence {
            readout: self.readout(),
            frames: before.exposures,
            same_scene: before.scene == SceneBefore::Same,
            rows: before.rows,
            dead_transfers: readout_s.max(survey.slew_s) / line_time_s,
            exposure_transfers: survey.exposure_s / line_time_s,
        })
    }

    /// The longest release time of the pixels, in units of the shortest time between two transfers.
    pub(super) fn longest_release_transfers(&self) -> f64 {
        let line_time_ms = self.at.line_time_ms;
        let shortest_ms = self.store.map_or(line_time_ms, |store| store.burst_line_time_ms.min(line_time_ms));
        self.traps.iter().map(|species| species.release_ms / shortest_ms).fold(0.0, f64::max)
    }

    /// Charges (e-, `[[row, column]]`) after all parallel transfers, behind n rows of a background of each column, e-.
    pub(super) fn clocked(&self, charge_e: &Array2<f64>, rows: i64, background_e: &[f64]) -> Array2<f64> {
        if let Some(repeated) = self.after_exposures() {
            return repeated.parallel_after_each(charge_e, rows, background_e);
        }
        match self.frame_transfer() {
            Some(transfer) => transfer.parallel_after_each(charge_e, rows, background_e),
            None => self.readout().parallel_after_each(charge_e, rows, background_e),
        }
    }

    /// Serial registers with traps, each with the transfers of the object.
    pub fn serial(&self) -> Vec<(Readout, u32)> {
        let of = |register: &Register| (self.readout_of(&register.traps, register.pixel_time_ms), register.transfers);
        self.registers.iter().map(of).collect()
    }

    /// Traps of the pixels, then those of the serial registers.
    pub fn species(&self) -> impl Iterator<Item = &SpeciesState> {
        self.traps.iter().chain(self.registers.iter().flat_map(|register| &register.traps))
    }

    /// Transfers in one step.
    fn readout_of(&self, traps: &[SpeciesState], transfer_ms: f64) -> Readout {
        Readout {
            traps: traps.iter().map(|species| species.trap(transfer_ms)).collect(),
            cloud: self.cloud.clone(),
            method: self.method,
        }
    }

    /// The charges (e-, `[[row, column]]`, background included) as read out.
    ///
    /// # Errors
    /// If an effect has no value, here and below.
    pub fn read(
        &self,
        charge_e: &Array2<f64>,
        downstream: Downstream,
        beside: Beside,
    ) -> Result<Array2<f64>, InputError> {
        let before_e = self.before(charge_e.clone())?;
        let clocked_e = self.clocked(&before_e, downstream.rows, &vec![downstream.charge_e; before_e.ncols()]);
        self.after(&before_e, clocked_e, beside)
    }

    /// The charges (e-) that are clocked out, for the collected ones.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn before(&self, mut charge_e: Array2<f64>) -> Result<Array2<f64>, InputError> {
        self.effects.apply(|effect| effect.charge(&mut charge_e, &self.at))?;
        Ok(charge_e)
    }

    /// The charges (e-) as read out, for those that were clocked out and those before.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn after(
        &self,
        before_e: &Array2<f64>,
        clocked_e: Array2<f64>,
        beside: Beside,
    ) -> Result<Array2<f64>, InputError> {
        self.amplified(before_e, self.through_registers(clocked_e, beside))
    }

    /// Charges (e-) that were clocked out, as they leave the serial registers.
    pub(super) fn through_registers(&self, clocked_e: Array2<f64>, beside: Beside) -> Array2<f64> {
        self.serial().iter().fold(clocked_e, |charge_e, (readout, transfers)| {
            self.through_serial(readout, *transfers, &charge_e, beside)
        })
    }

    /// Charges (e-) at the amplifier output, given those before the first transfer.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn amplified(&self, before_e: &Array2<f64>, mut read_e: Array2<f64>) -> Result<Array2<f64>, InputError> {
        self.effects.apply(|effect| effect.read(before_e, &mut read_e, &self.at))?;
        Ok(read_e)
    }

    /// Whether a mirror image in x is read as the mirror image: if all columns are identical and independent. A serial register
    /// with traps trails towards +x; random traps differ from column to column.
    pub fn is_mirror_symmetric(&self) -> bool {
        !self.has_serial_traps() && !self.method.is_random()
    }

    /// Ratio of the numbers of traps of this device and another one, if they differ in nothing else. None if they do, or the other
    /// one has no traps.
    pub(crate) fn traps_over(&self, other: &Device) -> Option<f64> {
        let bare = |species: &SpeciesState| SpeciesState { density_per_px: 0.0, ..species.clone() };
        let alike = self.at.but_for_dose() == other.at.but_for_dose()
            && self.cloud == other.cloud
            && self.store == other.store
            && self.persistence == other.persistence
            && self.species().map(bare).eq(other.species().map(bare));
        let densities = |device: &Device| device.species().map(|species| species.density_per_px).collect::<Vec<f64>>();
        let (ours, theirs) = (densities(self), densities(other));
        let factor = ours.iter().sum::<f64>() / theirs.iter().sum::<f64>();
        let proportional =
            || ours.iter().zip(&theirs).all(|(ours, theirs)| (ours - factor * theirs).abs() <= 1e-9 * ours);
        (alike && factor.is_finite() && proportional()).then_some(factor)
    }

    /// The same device for an object `columns` columns farther from the amplifier, in all serial registers; None if it is not on
    /// the detector.
    pub(super) fn columns_farther(mut self, columns: i64) -> Option<Device> {
        for register in &mut self.registers {
            register.transfers = farther(register.transfers, columns)?;
        }
        Some(self)
    }

    /// Whether charge moves from one column to another: a serial register has traps.
    pub fn has_serial_traps(&self) -> bool {
        self.registers.iter().flat_map(|register| &register.traps).any(|species| species.density_per_px > 0.0)
    }

    /// Columns of background needed to represent those of an image of this width: one, unless columns interact in a serial
    /// register.
    pub fn columns_of_background(&self, width_px: usize) -> usize {
        if self.has_serial_traps() { width_px } else { 1 }
    }

    /// The same device without randomness.
    pub fn expected(&self) -> Device {
        self.by(self.method.expected())
    }

    /// The same device, computed by another method.
    pub fn by(&self, method: Method) -> Device {
        Device { method, ..self.clone() }
    }

    /// The same device, read out with the accuracy that a purpose needs: never finer than its own.
    pub fn fit_for(&self, purpose: Purpose) -> Device {
        match self.method {
            Method::Fast { relative } => self.by(Method::Fast { relative: purpose.relative(relative) }),
            Method::Exact | Method::CarriedTraps | Method::Fractional { .. } | Method::MonteCarlo { .. } => {
                self.clone()
            }
        }
    }

    /// The same device with more or fewer traps: factors on the densities of all species of the pixels, and of the serial
    /// registers.
    pub fn with_traps_times(&self, pixels: f64, registers: f64) -> Device {
        let mut device = self.clone();
        device.traps.iter_mut().for_each(|species| species.density_per_px *= pixels);
        let serial = device.registers.iter_mut().flat_map(|register| &mut register.traps);
        serial.for_each(|species| species.density_per_px *= registers);
        device
    }

    /// The same device with only one of its species (by index).
    pub fn with_species(&self, index: usize) -> Device {
        Device { traps: vec![self.traps[index].clone()], ..self.clone() }
    }

    /// The same device without traps in the image: registers and amplifiers alone.
    pub fn without_traps(&self) -> Device {
        Device { traps: Vec::new(), ..self.clone() }
    }

    /// Dose since launch as its monitor sees it, MeV/g.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn dose_mev_g(&self) -> Result<f64, InputError> {
        let dose_mev_g = self.at.dose_mev_g.expect("a device knows the dose behind its traps");
        self.observed(dose_mev_g, Observable::Dose, &self.at)
    }

    /// The measured value for a true one.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn observed(&self, mut value: f64, observable: Observable, at: &Conditions) -> Result<f64, InputError> {
        self.effects.apply(|effect| effect.value(&mut value, observable, at))?;
        Ok(value)
    }

    /// The measured change of shape for a true one.
    ///
    /// # Errors
    /// As [`Device::read`].
    pub fn observed_change(&self, mut change: ShapeChange) -> Result<ShapeChange, InputError> {
        for observable in Observable::ALL {
            if let Probe::Galaxy(member) = observable.card().probe {
                let value = member(&mut change);
                *value = self.observed(*value, observable, &self.at)?;
            }
        }
        Ok(change)
    }

    fn through_serial(&self, readout: &Readout, transfers: u32, image: &Array2<f64>, beside: Beside) -> Array2<f64> {
        let rows_before = i64::from(transfers) - 1;
        let background_e = self.at.background_e;
        if let Beside::Stamp(half_px) = beside {
            let downstream = Downstream { rows: rows_before - half_px as i64, charge_e: background_e };
            return readout.serial(image, downstream);
        }
        let mut read = image.clone();
        for rows in about_as_bright(image.column(0)) {
            let some = image.select(Axis(0), &rows);
            let downstream_e: Vec<f64> = match beside {
                Beside::Same => some.iter().copied().collect(),
                _ => vec![background_e; rows.len()],
            };
            let clocked = readout.serial_after_each(&some, rows_before, &downstream_e);
            for (row, charge_e) in rows.into_iter().zip(clocked) {
                read[[row, 0]] = charge_e;
            }
        }
        read
    }
}

/// Ratio of the charges of rows that are read side by side: accuracy is relative to the brightest of them.
const ABOUT_AS_BRIGHT: f64 = 1.1;

/// Indices of the rows of a column (e-), grouped by similar charge.
fn about_as_bright(charge_e: ArrayView1<f64>) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..charge_e.len()).collect();
    order.sort_by(|a, b| charge_e[*a].total_cmp(&charge_e[*b]));
    let mut together: Vec<Vec<usize>> = Vec::new();
    for row in order {
        match together.last_mut() {
            Some(rows) if charge_e[row] <= ABOUT_AS_BRIGHT * charge_e[rows[0]] => rows.push(row),
            _ => together.push(vec![row]),
        }
    }
    together
}
