//! Processing of one file: frames and their companions, each processed before the first of its HDUs is written.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use fitsio_pure::header::Card;
use ndarray::{Array2, Zip};

use super::amplifier::Amplifiers;
use super::companions::{Bits, Companions};
use super::fits::{Fits, Hdu, Pixels};
use super::{CompanionsDone, FrameDone, Job, QualityDone, Task, amplifier_table, cards, errors, fits};
use crate::error::InputError;

/// Results for a frame.
pub(super) struct Worked {
    pub done: FrameDone,
    /// Charges before, e-, with an estimate for missing pixels.
    pub before_e: Array2<f64>,
    /// Charges afterwards, e-.
    pub after_e: Array2<f64>,
    /// Pixels that keep their values.
    pub kept: Array2<bool>,
}

/// The option of a correction that needs data quality.
fn needed(job: &Job) -> Option<String> {
    let given = |bits: Option<u32>, option: &str| bits.filter(|bits| *bits != 0).map(|bits| format!("{option} {bits}"));
    let bits = job.bits;
    let option = given(Some(bits.uncertain), "set --dq-set")
        .or(given(bits.bad, "use --dq-bad"))
        .or(given(bits.saturated, "use --dq-saturated"));
    option.filter(|_| job.task != Task::Readout)
}

/// A file whose frames are processed.
pub(super) struct Work<'a> {
    job: &'a Job,
    pub fits: &'a mut Fits,
    frames: Vec<(usize, Amplifiers, Companions)>,
    bits: Bits,
    dose_mev_g: f64,
    /// HDUs ready to be written: pixels, and cards for the header.
    ready: BTreeMap<usize, (Pixels, Vec<Card>)>,
    /// Results for the frames.
    pub done: BTreeMap<usize, FrameDone>,
}

impl<'a> Work<'a> {
    /// # Errors
    /// If an option needs data quality, and a frame has none that can be used.
    pub fn new(
        job: &'a Job,
        fits: &'a mut Fits,
        frames: Vec<amplifier_table::Frame>,
        dose_mev_g: f64,
    ) -> Result<Work<'a>, InputError> {
        let bits = job.bits.of(&fits.hdus[0])?;
        let needed = needed(job);
        let mut with = Vec::new();
        for (index, amplifiers) in frames {
            let mut companions = match job.task {
                Task::Correct { .. } => Companions::of(&fits.hdus, index),
                Task::Readout => Companions::default(),
            };
            if !job.propagate_errors {
                companions.errors = None;
            }
            if let Some(option) = &needed {
                companions.quality = Some(Companions::quality_for(&fits.hdus, index, option)?);
            }
            with.push((index, amplifiers, companions));
        }
        Ok(Work { job, fits, frames: with, bits, dose_mev_g, ready: BTreeMap::new(), done: BTreeMap::new() })
    }

    /// Writes the whole file, and returns the number of bytes after its last HDU. `progress` is given the number of HDUs done,
    /// their total, and the current step.
    ///
    /// # Errors
    /// As [`Work::write`].
    pub fn write_all(
        &mut self,
        out: &mut (impl Write + Seek),
        progress: &dyn Fn(usize, usize, &str),
    ) -> Result<std::io::Result<u64>, InputError> {
        let all = self.fits.hdus.len();
        for index in 0..all {
            let name = self.fits.hdus[index].to_string();
            let status = |what: &str| progress(index, all, &format!("{name}{what}"));
            if let Err(error) = self.write(index, &status, out)? {
                return Ok(Err(error));
            }
        }
        Ok(self.write_marks(out).and_then(|()| self.fits.copy_rest(out)))
    }

    /// Writes an HDU: processed, if it is a frame or a companion of one, otherwise unchanged.
    ///
    /// # Errors
    /// Those of reading and of the readout. (`Ok(Err(_))`: writing failed.)
    fn write(
        &mut self,
        index: usize,
        status: &dyn Fn(&str),
        out: &mut (impl Write + Seek),
    ) -> Result<std::io::Result<()>, InputError> {
        let concerned = self
            .frames
            .iter()
            .position(|(frame, _, companions)| *frame == index || companions.has(index))
            .filter(|place| !self.done.contains_key(&self.frames[*place].0));
        if let Some(place) = concerned {
            self.process(place, status)?;
        }
        Ok(match self.ready.remove(&index) {
            Some((pixels, cards)) => self.fits.hdus[index].write(&pixels, &cards, out),
            None => self.fits.copy(index, out),
        })
    }

    /// Processes a frame with its companions.
    fn process(&mut self, place: usize, status: &dyn Fn(&str)) -> Result<(), InputError> {
        let (index, amplifiers, companions) = self.frames[place].clone();
        let mut pixels = self.fits.pixels(index)?;
        let quality = companions.quality.map(|quality| self.fits.pixels(quality)).transpose()?;
        let flagged = quality.as_ref().map(|quality| self.bits.flagged(quality));
        let mut worked = self.job.frame(&mut pixels, &amplifiers, flagged.as_ref(), status)?;
        let mut beside = CompanionsDone::default();
        if let Some(errors) = companions.errors {
            status(", propagating errors");
            let ratio = self.errors(errors, index, &amplifiers, &worked)?;
            beside.errors = Some((errors, ratio));
        }
        if let (Some(at), Some(mut quality), Some(flagged)) = (companions.quality, quality, flagged) {
            let count = |mask: &Array2<bool>| mask.iter().filter(|is| **is).count();
            let mut set_px = 0;
            if let (true, Some(uncertain)) = (self.bits.uncertain != 0, &worked.done.uncertain) {
                let hdu = &self.fits.hdus[at];
                set_px = self.bits.mark(&mut quality, &uncertain.pixels, hdu)?;
                let header = format!(
                    "ctiplan {}: bit {} set in {set_px} pixels whose correction is uncertain",
                    env!("CARGO_PKG_VERSION"),
                    self.bits.uncertain
                );
                self.ready.insert(at, (quality, cards(&header)));
            }
            beside.quality = Some(QualityDone {
                hdu: at,
                bad_px: count(&flagged.bad),
                saturated_px: count(&flagged.saturated),
                set_px,
            });
        }
        worked.done.beside = beside;
        let header = self.job.header(&worked.done, self.dose_mev_g);
        self.ready.insert(index, (pixels, header));
        self.done.insert(index, worked.done);
        Ok(())
    }

    /// Propagates the errors of a frame through its correction. Returns the ratio of their root mean squares, after and before.
    fn errors(&mut self, at: usize, frame: usize, amplifiers: &Amplifiers, worked: &Worked) -> Result<f64, InputError> {
        let mut pixels = self.fits.pixels(at)?;
        let before = pixels.physical();
        let sigma_e = amplifiers.scaled(&before, |amplifier, value| value * amplifier.scale.gain_e_per_dn);
        let after_e = errors::propagated(amplifiers, &worked.after_e, &worked.kept, &sigma_e)?;
        let after = amplifiers.scaled(&after_e, |amplifier, sigma_e| sigma_e / amplifier.scale.gain_e_per_dn);
        let changed = Zip::from(&after_e)
            .and(&sigma_e)
            .and(&after)
            .map_collect(|after_e, before_e, after| (after_e.is_finite() && after_e != before_e).then_some(*after));
        let squares = |of: &Array2<f64>| {
            let counted = of.iter().zip(&changed).filter(|(_, changed)| changed.is_some());
            counted.map(|(value, _)| value * value).sum::<f64>()
        };
        // Errors that are all 0 are not amplified.
        let before = squares(&sigma_e);
        let ratio = if before > 0.0 { (squares(&after_e) / before).sqrt() } else { 1.0 };
        pixels.set(changed.iter().copied());
        let header = format!(
            "ctiplan {}: errors propagated through the correction of {}, x {ratio:.4} rms",
            env!("CARGO_PKG_VERSION"),
            self.fits.hdus[frame]
        );
        self.ready.insert(at, (pixels, cards(&header)));
        Ok(ratio)
    }

    /// Writes the extensions that mark uncertain pixels, unless data quality has a bit for them.
    ///
    /// # Errors
    /// If writing fails.
    fn write_marks(&self, out: &mut (impl Write + Seek)) -> std::io::Result<()> {
        for (index, frame) in &self.done {
            let uncertain = frame.uncertain.as_ref().filter(|uncertain| uncertain.count() > 0);
            if let (Some(uncertain), 0) = (uncertain, self.bits.uncertain) {
                let of: &Hdu = &self.fits.hdus[*index];
                fits::write_mask(&super::marks(of), of.index, &uncertain.pixels, out)?;
            }
        }
        Ok(())
    }
}
