//! Amplifiers of a frame: for each, its pixels, its position, the meaning of its values, and its traps.
//!
//! A frame has one amplifier unless a table lists several ([`super::amplifier_table`]). Amplifiers share no packets, so each part
//! of a frame is read out separately. Pixels that no amplifier reads keep their values.

use std::ops::Range;

use ndarray::{Array2, ArrayView2, s};

use super::frame::{self, Geometry};
use super::mask;
use super::noise;
use super::trap_map::Factors;
use super::unit::Scale;
use crate::error::InputError;
use crate::model::Device;

/// The part of a frame that one amplifier reads, and how.
#[derive(Clone, Debug)]
pub struct Amplifier {
    /// Its name in reports; none if it is the only one.
    pub name: Option<String>,
    /// Its rows of the frame.
    pub rows: Range<usize>,
    /// Its columns of the frame.
    pub columns: Range<usize>,
    /// How these pixels lie on the detector.
    pub geometry: Geometry,
    /// The meaning of their values.
    pub scale: Scale,
    /// Value at which its converter saturates, in the unit of the frame.
    pub saturated_dn: Option<f64>,
    /// Read noise, e- rms, if known.
    pub read_noise_e: Option<f64>,
    /// The traps and wells of its pixels.
    pub device: Device,
    /// Factors on the densities of the traps of its pixels.
    pub factors: Option<Factors>,
}

impl Amplifier {
    /// The same pixels of a frame.
    pub fn part<'a, T>(&self, frame: &'a Array2<T>) -> ArrayView2<'a, T> {
        frame.slice(s![self.rows.clone(), self.columns.clone()])
    }

    /// Reads its part (e-), with trails; `allowed_e`: allowed error, e-.
    fn read(&self, part_e: &Array2<f64>, allowed_e: Option<f64>) -> Result<Array2<f64>, InputError> {
        frame::read_with(&self.device, &self.geometry, part_e, self.factors.as_ref(), allowed_e)
    }

    /// Copies values (rows and columns of the part) into a frame.
    pub fn put<T: Clone>(&self, part: &Array2<T>, frame: &mut Array2<T>) {
        frame.slice_mut(s![self.rows.clone(), self.columns.clone()]).assign(part);
    }

    /// Its pixels as FITS counts them, from 1: `[1:2048,1:2048]`.
    pub fn section(&self) -> String {
        section(&self.rows, &self.columns)
    }
}

/// Pixels as FITS counts them, from 1.
pub(super) fn section(rows: &Range<usize>, columns: &Range<usize>) -> String {
    format!("[{}:{},{}:{}]", columns.start + 1, columns.end, rows.start + 1, rows.end)
}

/// The amplifiers of one frame.
#[derive(Clone, Debug)]
pub struct Amplifiers(pub Vec<Amplifier>);

impl Amplifiers {
    /// One amplifier that reads all of a frame of this shape (rows, columns), whose values are electrons.
    pub fn one(device: &Device, geometry: Geometry, (rows, columns): (usize, usize)) -> Amplifiers {
        Amplifiers(vec![Amplifier {
            name: None,
            rows: 0..rows,
            columns: 0..columns,
            geometry,
            scale: Scale { gain_e_per_dn: 1.0, bias_dn: 0.0 },
            saturated_dn: None,
            read_noise_e: None,
            device: device.clone(),
            factors: None,
        }])
    }

    /// A frame with trails (e-, `[[row, column]]`), read by all amplifiers.
    ///
    /// # Errors
    /// If an effect has no value.
    pub fn read(&self, frame_e: &Array2<f64>) -> Result<Array2<f64>, InputError> {
        self.read_within(frame_e, None)
    }

    /// The same with an allowed error for each direction of transfer, e-; none: with the accuracy of the devices.
    ///
    /// # Errors
    /// If an effect has no value.
    pub fn read_within(&self, frame_e: &Array2<f64>, allowed_e: Option<f64>) -> Result<Array2<f64>, InputError> {
        let mut read_e = frame_e.clone();
        for amplifier in &self.0 {
            let part_e = amplifier.part(frame_e).to_owned();
            amplifier.put(&amplifier.read(&part_e, allowed_e)?, &mut read_e);
        }
        Ok(read_e)
    }

    /// Values of a frame (in its unit) → charges, e-; 0 for pixels that are not read.
    pub fn charge_e(&self, values: &Array2<f64>) -> Array2<f64> {
        self.scaled(values, |amplifier, value| amplifier.scale.charge_e(value))
    }

    /// Charges (e-) of a frame → values in its unit.
    pub fn values(&self, charge_e: &Array2<f64>) -> Array2<f64> {
        self.scaled(charge_e, |amplifier, charge_e| amplifier.scale.value(charge_e))
    }

    /// Values of a frame, each transformed for its amplifier; 0 for pixels that are not read.
    pub fn scaled(&self, values: &Array2<f64>, to: impl Fn(&Amplifier, f64) -> f64) -> Array2<f64> {
        self.each(values, 0.0, |amplifier, part| part.mapv(|value| to(amplifier, value)))
    }

    /// Pixels that an amplifier reads.
    pub fn covered(&self, frame: &Array2<f64>) -> Array2<bool> {
        self.each(frame, false, |_, part| Array2::from_elem(part.raw_dim(), true))
    }

    /// Pixels that hold light.
    pub fn lit(&self, frame: &Array2<f64>) -> Array2<bool> {
        self.each(frame, false, |amplifier, part| amplifier.geometry.lit(part.dim()))
    }

    /// Lit pixels at or above full well, or beyond the range of the converter.
    pub fn saturated(&self, charge_e: &Array2<f64>) -> Array2<bool> {
        self.each(charge_e, false, |amplifier, part| {
            let from_e = amplifier.saturated_dn.map_or(f64::INFINITY, |value| amplifier.scale.charge_e(value));
            let full = mask::saturated(&part.to_owned(), &amplifier.device.cloud, from_e);
            full & amplifier.geometry.lit(part.dim())
        })
    }

    /// The read noise (e-) that can be separated from charge, for pixels that count: see [`super::noise::separated`].
    ///
    /// # Errors
    /// If the read noise of an amplifier is unknown.
    pub fn read_noise(&self, charge_e: &Array2<f64>, count: &Array2<bool>) -> Result<Array2<f64>, InputError> {
        let mut noise_e = Array2::zeros(charge_e.raw_dim());
        for amplifier in &self.0 {
            let Some(read_noise_e) = amplifier.read_noise_e else {
                let name = amplifier.name.as_ref().map_or(String::new(), |name| format!(" of amplifier {name}"));
                return Err(InputError::new(
                    "cannot separate read noise",
                    format!("the read noise{name} is not known"),
                )
                .with_help("give --read-noise-e, or the column read_noise_e of a table of amplifiers"));
            };
            let (part_e, count) = (amplifier.part(charge_e).to_owned(), amplifier.part(count).to_owned());
            amplifier.put(&noise::separated(&part_e, &count, read_noise_e), &mut noise_e);
        }
        Ok(noise_e)
    }

    /// Electrons per unit of the frame, if it is the same everywhere.
    pub fn gain_e_per_dn(&self) -> Option<f64> {
        let gain = |amplifier: &Amplifier| amplifier.scale.gain_e_per_dn;
        let first = self.0.first().map(gain)?;
        self.0.iter().all(|amplifier| gain(amplifier) == first).then_some(first)
    }

    /// A frame composed of the results for each amplifier's part.
    fn each<T: Clone>(
        &self,
        frame: &Array2<f64>,
        elsewhere: T,
        of: impl Fn(&Amplifier, ArrayView2<f64>) -> Array2<T>,
    ) -> Array2<T> {
        let mut all = Array2::from_elem(frame.raw_dim(), elsewhere);
        for amplifier in &self.0 {
            amplifier.put(&of(amplifier, amplifier.part(frame)), &mut all);
        }
        all
    }
}
