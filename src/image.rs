//! Whole images: charge transfer inefficiency added to the frames of a FITS file, or removed from them.
//!
//! ```text
//! FITS file ─▶ [fits] values ─▶ [unit] electrons ─▶ [mask] no gaps ─▶ [frame] as it is read ─▶ back to values ─▶ FITS file
//!                                  of each [amplifier]
//!                                                        │                       ▲
//!                                                        └──▶ [correct] ─────────┘   the readout, turned round
//! ```
//!
//! One HDU is in memory at a time. The processing of a frame is described in `docs/images.md`.

pub mod amplifier;
pub mod amplifier_table;
pub mod batch;
pub mod companions;
pub mod correct;
pub mod errors;
mod fingerprint;
pub mod fits;
pub mod frame;
pub mod invert;
mod json;
pub mod mask;
pub mod noise;
pub mod selection;
pub mod transport;
pub mod trap_map;
pub mod uncertain;
pub mod unit;
mod work;

pub use amplifier::{Amplifier, Amplifiers};
pub use amplifier_table::AmplifierTable;
pub use companions::{Bits, Companions};
pub use correct::{Corrected, Residual, Stop, correct, iterated};
pub use frame::{Corner, Geometry, Split, Transfers};
pub use invert::{Transport, invert};
pub use noise::NoiseAfter;
pub use selection::LeftOut;
pub(crate) use selection::frames;
pub use transport::FrameTransport;
pub use trap_map::TrapMap;
pub use uncertain::{Uncertain, uncertain};
pub use unit::Unit;

use std::cell::Cell;
use std::fmt;
use std::io::BufWriter;
use std::path::Path;
use std::str::FromStr;

use fitsio_pure::header::Card;
use fitsio_pure::value::Value;
use ndarray::{Array2, Zip};

use crate::error::InputError;
use crate::io::atomic_file::{self, Written};
use crate::model::{Device, Model};
use crate::physics::SpeciesState;
use crate::physics::conditions::Conditions;
use crate::readout::Method;
use crate::warning::Warning;
use companions::Flagged;
use fits::{Fits, Hdu, HduKind};

/// The processing of frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Task {
    /// Trails are added.
    Readout,
    /// Trails are removed.
    Correct {
        /// When the correction is complete.
        stop: Stop,
        /// White noise of the amplifier, e- rms, whose amplification is to be measured, and its seed.
        noise: Option<(f64, u64)>,
    },
}

/// Charge in pixels without light, e- and relative to that of the image, above which it is probably not the trail of the image.
const MOST_DARK_E: f64 = 5.0;
const MOST_DARK: f64 = 0.2;

/// Selection of HDUs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// By index in the file; 0 is the primary HDU.
    Index(usize),
    /// By EXTNAME: all with this name. `*.E.SCI` selects all with this ending.
    Name(String),
    /// By EXTNAME and EXTVER.
    Version(String, i64),
}

/// Frames to be read out or corrected.
pub struct Job {
    /// The task.
    pub task: Task,
    /// The mission with its effects.
    pub model: Model,
    /// The detector under the conditions of the frame.
    pub device: Device,
    /// How the frames lie on the detector.
    pub geometry: Geometry,
    /// The meaning of their values.
    pub unit: Unit,
    /// Images to process; none: all that hold charge.
    pub hdus: Vec<Choice>,
    /// Amplifiers of a camera, in place of geometry, unit and selection of images.
    pub amplifiers: Option<AmplifierTable>,
    /// The meaning of the data quality bits for a correction.
    pub bits: Bits,
    /// Factors on the densities of the pixels' traps, by column.
    pub trap_map: Option<TrapMap>,
    /// Read noise, e- rms, of amplifiers without an entry in the table.
    pub read_noise_e: Option<f64>,
    /// Read noise is separated before a correction, and added afterwards.
    pub separate_noise: bool,
    /// Errors beside a frame are propagated through its correction.
    pub propagate_errors: bool,
}

/// Results for a file.
#[derive(Clone, Debug)]
pub struct Done {
    /// Name of the mission.
    pub mission: String,
    /// Conditions, with the dose behind the traps.
    pub at: Conditions,
    /// Dose as measured by its monitor, MeV/g.
    pub dose_mev_g: f64,
    /// Traps of the pixels.
    pub traps: Vec<SpeciesState>,
    /// The method for the transfers.
    pub method: Method,
    /// The task.
    pub task: Task,
    /// How the frames lay, unless there is a table of amplifiers.
    pub geometry: Geometry,
    /// The table of amplifiers, as given.
    pub amplifiers: Option<String>,
    /// Each HDU, in the file's order.
    pub hdus: Vec<HduDone>,
    /// Warnings.
    pub warnings: Vec<Warning>,
}

/// Results for an HDU.
#[derive(Clone, Debug)]
pub struct HduDone {
    /// Index in the file.
    pub index: usize,
    /// EXTNAME.
    pub name: Option<String>,
    /// The frame, if it was one; None if the HDU was copied.
    pub frame: Option<FrameDone>,
    /// Why it was none, if it is an image and none were selected.
    pub left_out: Option<LeftOut>,
}

/// Results for a frame.
#[derive(Clone, Debug)]
pub struct FrameDone {
    /// Rows and columns.
    pub shape: (usize, usize),
    /// Electrons per unit of the frame; none if its amplifiers differ.
    pub gain_e_per_dn: Option<f64>,
    /// The amplifiers that read it.
    pub amplifiers: Amplifiers,
    /// Largest change of a pixel, e-.
    pub largest_change_e: f64,
    /// Median charges in pixels without light and in those of the image, e-, if there are any of the former.
    pub levels_e: Option<(f64, f64)>,
    /// Pixels without a value, which remain so.
    pub missing_px: usize,
    /// Pixels at or above full well, or beyond the range of the converter.
    pub saturated_px: usize,
    /// Pixels clipped to the range of their type.
    pub clipped_px: usize,
    /// For a correction: the residuals of the forward model, before it and after each step.
    pub residuals: Vec<Residual>,
    /// For a correction: pixels whose charge the frame does not determine.
    pub uncertain: Option<Uncertain>,
    /// For a correction: whether the last residual is within the requested error, except for the uncertain pixels.
    pub converged: bool,
    /// For a correction: the amplifier's noise afterwards.
    pub noise: Option<NoiseAfter>,
    /// Changes of its companion HDUs.
    pub beside: CompanionsDone,
}

/// Results for the companion HDUs of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompanionsDone {
    /// The HDU of errors, and the ratio of their root mean squares after and before.
    pub errors: Option<(usize, f64)>,
    /// Results for its data quality.
    pub quality: Option<QualityDone>,
}

/// Data quality of a frame.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct QualityDone {
    /// Its HDU.
    pub hdu: usize,
    /// Pixels flagged as bad.
    pub bad_px: usize,
    /// Pixels flagged as saturated.
    pub saturated_px: usize,
    /// Pixels in which the bit for uncertain pixels was set.
    pub set_px: usize,
}

impl CompanionsDone {
    /// Whether the values of an HDU have changed.
    pub fn changed(&self, hdu: usize) -> bool {
        self.errors.is_some_and(|(errors, _)| errors == hdu)
            || self.quality.is_some_and(|quality| quality.hdu == hdu && quality.set_px > 0)
    }
}

/// Pixels of a frame to be corrected.
struct Masks<'a> {
    /// Pixels that keep their values.
    kept: &'a Array2<bool>,
    /// Pixels that hold light, and are corrected.
    counted: Array2<bool>,
}

impl Job {
    /// Prepares a mission's detector for frames.
    ///
    /// `relative` is the accuracy of the readout ([`Method::Fast`]) in place of the mission's, which is meant for single galaxies;
    /// a mission with another method keeps it.
    ///
    /// # Errors
    /// If serial transfers are requested for a mission without serial traps, or parallel ones for a mission with a store or
    /// persistence, or a formula fails.
    pub fn new(
        task: Task,
        model: &Model,
        conditions: &Conditions,
        relative: f64,
        geometry: Geometry,
    ) -> Result<Job, InputError> {
        let device = model.device(conditions)?;
        if geometry.transfers.parallel() && device.store.is_some() {
            return Err(InputError::new(
                "cannot model the transfers of a frame",
                format!("mission \"{}\" has a store: frames are shifted into it first", model.mission.mission.name),
            )
            .with_help("frame transfer is modelled for galaxies and measurements; remove [readout.store] for frames"));
        }
        if geometry.transfers.parallel() && device.persistence.is_some() {
            return Err(InputError::new(
                "cannot model the transfers of a frame",
                format!(
                    "mission \"{}\" keeps charge from exposures before, which are not given",
                    model.mission.mission.name
                ),
            )
            .with_help(
                "persistence is modelled for galaxies and measurements; remove [survey.persistence] for frames",
            ));
        }
        if geometry.transfers.serial() && device.serial().is_empty() {
            return Err(InputError::new(
                "cannot model serial transfers",
                format!("mission \"{}\" has no traps in the serial register", model.mission.mission.name),
            )
            .with_help("add [effects.serial-traps] with pixel_time_ms and traps: see `ctiplan effects serial-traps`"));
        }
        let device = match device.method {
            Method::Fast { .. } => device.by(Method::Fast { relative }),
            _ if task != Task::Readout => device.expected(),
            _ => device,
        };
        Ok(Job {
            task,
            model: model.clone(),
            device,
            geometry,
            unit: Unit::default(),
            hdus: Vec::new(),
            amplifiers: None,
            bits: Bits::default(),
            trap_map: None,
            read_noise_e: None,
            separate_noise: false,
            propagate_errors: true,
        })
    }

    /// Processes a file. `progress` is given the number of HDUs done, their total, and the current step.
    ///
    /// # Errors
    /// If the input is not a FITS file or contains no frame, a unit is unknown, a formula fails, or the output cannot be written,
    /// is the input, or already exists and must not be overwritten.
    pub fn run(
        &self,
        input: &Path,
        output: &Path,
        overwrite: bool,
        progress: &dyn Fn(usize, usize, &str),
    ) -> Result<Done, InputError> {
        atomic_file::refuse_clashes(&[Written::File(output)], &[input])?;
        if !overwrite {
            atomic_file::refuse_existing(output)?;
        }
        refuse_packed(output)?;
        let mut fits = Fits::open(input)?;
        let frames = self.frames(&fits.hdus, input)?;
        let mut done = Done {
            mission: self.model.mission.mission.name.clone(),
            at: self.device.at.clone(),
            dose_mev_g: self.device.dose_mev_g()?,
            traps: self.device.traps.clone(),
            method: self.device.method,
            task: self.task,
            geometry: self.geometry,
            amplifiers: self.amplifiers.as_ref().map(|table| table.name.clone()),
            hdus: Vec::new(),
            warnings: self.model.history().warnings(self.device.at.t_yr),
        };
        let mut work = work::Work::new(self, &mut fits, frames, done.dose_mev_g)?;
        let bytes_after = Cell::new(0);
        atomic_file::write_by(output, overwrite, |out| {
            let refusal = atomic_file::refusal(output);
            if !is_gzip(output) {
                bytes_after.set(work.write_all(out, progress)?.map_err(refusal)?);
                return Ok(());
            }
            let mut plain = BufWriter::new(tempfile::tempfile().map_err(&refusal)?);
            bytes_after.set(work.write_all(&mut plain, progress)?.map_err(&refusal)?);
            let plain = plain.into_inner().map_err(|error| refusal(error.into_error()))?;
            fits::pack(plain, out).map_err(refusal)
        })?;
        let bytes = bytes_after.get();
        done.warnings.extend((bytes > 0).then_some(Warning::AfterLastHdu { bytes }));
        let mut frames = work.done;
        let left_out = match self.amplifiers {
            None => selection::left_out(&fits.hdus, &self.hdus)?,
            Some(_) => Vec::new(),
        };
        for hdu in &fits.hdus {
            let frame = frames.remove(&hdu.index);
            let left_out = left_out.iter().find(|(index, _)| *index == hdu.index).map(|(_, why)| *why);
            let doubtful = left_out.filter(|why| why.is_doubtful());
            done.warnings
                .extend(doubtful.map(|why| Warning::ImageLeftOut { name: hdu.to_string(), why: why.to_string() }));
            done.warnings.extend(frame.iter().flat_map(|frame| self.warnings(hdu, frame)));
            if frame.is_some() && self.task != Task::Readout {
                done.warnings.extend(Companions::unfit(&fits.hdus, hdu.index).into_iter().map(|(beside, unfit)| {
                    let (name, frame) = (beside.to_string(), hdu.to_string());
                    Warning::CompanionNotUsed { name, frame, why: unfit.why, help: unfit.help }
                }));
            }
            done.hdus.push(HduDone { index: hdu.index, name: hdu.name(), frame, left_out });
        }
        Ok(done)
    }

    /// The frames of a file with the amplifiers that read them.
    fn frames(&self, hdus: &[Hdu], input: &Path) -> Result<Vec<amplifier_table::Frame>, InputError> {
        let mut frames = self.frames_without_map(hdus, input)?;
        for (index, amplifiers) in &mut frames {
            let Some(map) = &self.trap_map else { break };
            let factors = map.of(&hdus[*index], image_shape(&hdus[*index])?, self.device.method)?;
            for amplifier in &mut amplifiers.0 {
                amplifier.factors = Some(factors.part(amplifier.rows.clone(), amplifier.columns.clone()));
            }
        }
        Ok(frames)
    }

    fn frames_without_map(&self, hdus: &[Hdu], input: &Path) -> Result<Vec<amplifier_table::Frame>, InputError> {
        let place = |error: InputError| {
            let refused = format!("cannot use `{}`: {}", input.display(), error.refused);
            InputError { refused, ..error }
        };
        if let Some(table) = &self.amplifiers {
            let mut frames = table.frames(hdus, self.geometry.transfers, &self.device).map_err(place)?;
            for amplifier in frames.iter_mut().flat_map(|(_, amplifiers)| &mut amplifiers.0) {
                amplifier.read_noise_e = amplifier.read_noise_e.or(self.read_noise_e);
            }
            return Ok(frames);
        }
        let frames = frames(hdus, &self.hdus, &self.geometry, &self.unit).map_err(place)?;
        for (index, _) in &frames {
            unit::refuse_unknown_bias(&hdus[*index], &self.geometry, self.unit.bias_dn)
                .map_err(|error| place(error.with_help("give --bias-dn: 0 if it is subtracted")))?;
        }
        let of = |(index, scale): (usize, unit::Scale)| {
            let (rows, columns) = image_shape(&hdus[index]).expect("an image, as was checked");
            let amplifier = Amplifier {
                name: None,
                rows: 0..rows,
                columns: 0..columns,
                geometry: self.geometry,
                scale,
                saturated_dn: self.unit.saturated_dn,
                read_noise_e: self.read_noise_e,
                device: self.device.clone(),
                factors: None,
            };
            (index, Amplifiers(vec![amplifier]))
        };
        Ok(frames.into_iter().map(of).collect())
    }

    /// Error of a readout over the largest displacement of charge: usually ten times smaller than requested (`docs/images.md`).
    fn accuracy(&self) -> f64 {
        if let Method::Fast { relative } = self.device.method { 0.1 * relative } else { 0.0 }
    }

    /// Warnings about a frame.
    fn warnings(&self, hdu: &Hdu, frame: &FrameDone) -> Vec<Warning> {
        let (name, task) = (hdu.to_string(), self.task.word());
        let before = |line: &str| line.starts_with("ctiplan") && line.contains(&format!("{task}:"));
        let mut warnings = Vec::new();
        let keyword = if self.task == Task::Readout { "CTIADDED" } else { "CTICORR" };
        if hdu.history().any(before) || hdu.value(keyword).is_some() {
            warnings.push(Warning::DoneBefore { name: name.clone(), task });
        }
        let bias_left = |(dark_e, lit_e): &(f64, f64)| *dark_e > MOST_DARK_E && *dark_e > MOST_DARK * lit_e;
        if let Some((dark_e, lit_e)) = frame.levels_e.filter(bias_left) {
            warnings.push(Warning::DarkPixelsHoldCharge { name: name.clone(), dark_e, lit_e });
        }
        let (Some(first), Some(uncertain)) = (frame.residuals.first(), &frame.uncertain) else { return warnings };
        if !frame.converged {
            warnings.push(Warning::NotCorrected { name: name.clone(), max_e: uncertain.left.max_e, of_e: first.max_e });
        }
        let pixels = uncertain.count();
        if pixels > 0 {
            let marked = marks(hdu);
            warnings.push(Warning::UncertainPixels { name, pixels, error_e: uncertain.error_e, marked });
        }
        warnings
    }

    /// Processes one frame in memory (e-, `[[row, column]]`, row 0 the lowest; NaN for missing pixels, which remain so), read by
    /// one amplifier. Returns the charges afterwards, e-.
    ///
    /// # Errors
    /// If the frame does not fit the geometry, or a formula fails.
    pub fn array(&self, frame_e: &Array2<f64>) -> Result<(Array2<f64>, FrameDone), InputError> {
        self.geometry.check(frame_e.dim())?;
        let mut amplifiers = Amplifiers::one(&self.device, self.geometry, frame_e.dim());
        amplifiers.0[0].read_noise_e = self.read_noise_e;
        if let Some(map) = &self.trap_map {
            amplifiers.0[0].factors = Some(map.of_array(frame_e.dim(), self.device.method)?);
        }
        let work::Worked { done, mut after_e, kept, .. } = self.charges(frame_e.clone(), &amplifiers, None, &|_| ())?;
        Zip::from(&mut after_e).and(frame_e).and(&kept).for_each(|after, before, kept| {
            if *kept || before.is_nan() {
                *after = *before;
            }
        });
        Ok((after_e, done))
    }

    /// Processes one frame.
    fn frame(
        &self,
        pixels: &mut fits::Pixels,
        amplifiers: &Amplifiers,
        flagged: Option<&Flagged>,
        status: &dyn Fn(&str),
    ) -> Result<work::Worked, InputError> {
        let charge_e = amplifiers.charge_e(&pixels.physical());
        let mut worked = self.charges(charge_e, amplifiers, flagged, status)?;
        // An unchanged pixel keeps its exact bits.
        let changed = Zip::from(&worked.before_e)
            .and(&worked.after_e)
            .and(&worked.kept)
            .and(&amplifiers.values(&worked.after_e))
            .map_collect(|before, after, kept, value| (!kept && after != before).then_some(*value));
        worked.done.clipped_px = pixels.set(changed.into_iter());
        Ok(worked)
    }

    /// Processes the charges of a frame, e-; NaN for missing pixels.
    fn charges(
        &self,
        mut before_e: Array2<f64>,
        amplifiers: &Amplifiers,
        flagged: Option<&Flagged>,
        status: &dyn Fn(&str),
    ) -> Result<work::Worked, InputError> {
        if let Some(flagged) = flagged {
            Zip::from(&mut before_e).and(&flagged.bad).for_each(|charge_e, bad| {
                if *bad {
                    *charge_e = f64::NAN;
                }
            });
        }
        let missing = mask::fill(&mut before_e);
        let (covered, lit) = (amplifiers.covered(&before_e), amplifiers.lit(&before_e));
        let mut saturated = amplifiers.saturated(&before_e);
        if let Some(flagged) = flagged {
            saturated = saturated | &flagged.saturated & &lit;
        }
        Zip::from(&mut saturated).and(&missing).for_each(|full, missing| *full &= !*missing);
        let count = |mask: &Array2<bool>| mask.iter().filter(|is| **is).count();
        let mut done = FrameDone {
            shape: before_e.dim(),
            gain_e_per_dn: amplifiers.gain_e_per_dn(),
            amplifiers: amplifiers.clone(),
            largest_change_e: 0.0,
            levels_e: mask::levels_e(&before_e, &covered, &lit),
            missing_px: count(&missing),
            saturated_px: count(&saturated),
            clipped_px: 0,
            residuals: Vec::new(),
            uncertain: None,
            converged: true,
            noise: None,
            beside: CompanionsDone::default(),
        };
        let mut kept = missing;
        Zip::from(&mut kept).and(&covered).for_each(|kept, covered| *kept |= !*covered);
        let after_e = match self.task {
            Task::Readout => amplifiers.read(&before_e)?,
            Task::Correct { stop, noise } => {
                Zip::from(&mut kept).and(&saturated).for_each(|kept, full| *kept |= *full);
                let masks = Masks { kept: &kept, counted: lit & !&kept };
                self.corrected(&before_e, amplifiers, &masks, (stop, noise), &mut done, status)?
            }
        };
        Zip::from(&before_e).and(&after_e).and(&kept).for_each(|before, after, kept| {
            if !*kept {
                done.largest_change_e = done.largest_change_e.max((after - before).abs());
            }
        });
        Ok(work::Worked { done, before_e, after_e, kept })
    }

    /// Removes the trails of a frame's charges, e-.
    fn corrected(
        &self,
        before_e: &Array2<f64>,
        amplifiers: &Amplifiers,
        masks: &Masks,
        (stop, noise): (Stop, Option<(f64, u64)>),
        done: &mut FrameDone,
        status: &dyn Fn(&str),
    ) -> Result<Array2<f64>, InputError> {
        let separated = |frame_e: &Array2<f64>| {
            self.separate_noise.then(|| amplifiers.read_noise(frame_e, &masks.counted)).transpose()
        };
        let without = |frame_e: &Array2<f64>, noise_e: &Option<Array2<f64>>| match noise_e {
            Some(noise_e) => frame_e - noise_e,
            None => frame_e.clone(),
        };
        let with = |image_e: Array2<f64>, noise_e: &Option<Array2<f64>>| match noise_e {
            Some(noise_e) => image_e + noise_e,
            None => image_e,
        };
        let solve = |observed: &Array2<f64>, what: &str| {
            let status = |said: &str| status(&format!(", {what}{said}"));
            invert(&FrameTransport::new(amplifiers, observed, &status), observed, Some(masks.kept), stop)
        };
        let noise_e = separated(before_e)?;
        let observed_e = without(before_e, &noise_e);
        let corrected = solve(&observed_e, "")?;
        if let Some(noise) = noise {
            let again = |noisy: &Array2<f64>| {
                let noise_e = separated(noisy)?;
                solve(&without(noisy, &noise_e), "with noise, ").map(|corrected| with(corrected.image, &noise_e))
            };
            let image_e = with(corrected.image.clone(), &noise_e);
            done.noise = Some(noise::followed(before_e, &image_e, &masks.counted, noise, again)?);
        }
        status(", looking for emptied packets");
        let moved_e = corrected.residuals[0].max_e;
        let accuracy_e = if stop.error_e > 0.0 { stop.error_e } else { moved_e * stop.relative.max(self.accuracy()) };
        let transport = FrameTransport::new(amplifiers, &observed_e, &|_| ());
        let goal = (accuracy_e, stop.iterations);
        let uncertain = uncertain(&transport, &observed_e, Some(masks.kept), &corrected, goal)?;
        done.converged = corrected.converged || stop.is_reached(uncertain.left, corrected.residuals[0]);
        (done.residuals, done.uncertain) = (corrected.residuals, Some(uncertain));
        Ok(with(corrected.image, &noise_e))
    }

    /// Header cards for the record.
    fn header(&self, frame: &FrameDone, dose_mev_g: f64) -> Vec<Card> {
        let mut cards = self.keywords(frame, dose_mev_g);
        cards.extend(self.history(frame, dose_mev_g));
        cards
    }

    /// The mission's name as written to headers.
    fn name_in_header(&self) -> String {
        plain(&self.model.mission.mission.name).chars().take(MOST_TEXT).collect()
    }

    /// The processing as keywords with values and units, for programs.
    fn keywords(&self, frame: &FrameDone, dose_mev_g: f64) -> Vec<Card> {
        let text = |text: &str| Value::String(text.into());
        let done = match self.task {
            Task::Readout => ("CTIADDED", "CTI trails added by"),
            Task::Correct { .. } => ("CTICORR", "CTI trails removed by"),
        };
        let mut keys = vec![
            (done.0, text(concat!("ctiplan ", env!("CARGO_PKG_VERSION"))), done.1),
            ("CTIMISS", text(&self.name_in_header()), "mission of the CTI model"),
            ("CTIYEAR", Value::Float(self.device.at.t_yr), "[yr] time since launch of the CTI model"),
            ("CTIDOSE", Value::Float(dose_mev_g), "[MeV/g] dose of the CTI model"),
            (fingerprint::KEYWORD, text(&self.fingerprint()), "hash of CTI model and options"),
        ];
        if let Some(uncertain) = &frame.uncertain {
            let (left, iterations) = (uncertain.left, frame.residuals.len().saturating_sub(1));
            keys.extend([
                ("CTIITER", Value::Integer(iterations as i64), "iterations of the CTI correction"),
                ("CTIRMS", Value::Float(left.rms_e), "[e-] rms residual of the CTI model"),
                ("CTIMAX", Value::Float(left.max_e), "[e-] largest residual of the CTI model"),
                ("CTIUNCER", Value::Integer(uncertain.count() as i64), "[px] pixels of uncertain CTI correction"),
            ]);
        }
        let card = |(keyword, value, comment): (&str, Value, &str)| Card {
            comment: Some(comment.to_string()),
            ..Card::new(keyword, value).expect("a keyword of capitals")
        };
        keys.into_iter().map(card).collect()
    }

    fn history(&self, frame: &FrameDone, dose_mev_g: f64) -> Vec<Card> {
        let at = &self.device.at;
        let mut history = vec![format!(
            "ctiplan {} {}: charge transfer inefficiency {}, {} transfers",
            env!("CARGO_PKG_VERSION"),
            self.task.word(),
            if self.task == Task::Readout { "added" } else { "taken out" },
            match self.geometry.transfers {
                Transfers::Parallel => "parallel",
                Transfers::Serial => "serial",
                Transfers::Both => "parallel and serial",
            }
        )];
        history.push(format!(
            "mission {}, {} yr after launch, dose {:.4e} MeV/g, {} K, {} ms per row",
            self.model.mission.mission.name, at.t_yr, dose_mev_g, at.temperature_k, at.line_time_ms
        ));
        history.extend(frame.amplifiers.0.iter().flat_map(history_of));
        if let Some(map) = &self.trap_map {
            history.push(format!("trap densities times the factors in {}", map.name));
        }
        if self.separate_noise {
            let noise = |amplifier: &Amplifier| amplifier.read_noise_e.unwrap_or(0.0).to_string();
            let noises: Vec<String> = frame.amplifiers.0.iter().map(noise).collect();
            history.push(format!("read noise of {} e- separated before the correction", noises.join(", ")));
        }
        if let (Some(first), Some(uncertain)) = (frame.residuals.first(), &frame.uncertain) {
            let last = uncertain.left;
            history.push(format!(
                "iterations: {}; residual of the model {:.3e} e- rms, largest {:.3e} e- (before: {:.3e} and {:.3e})",
                frame.residuals.len() - 1,
                last.rms_e,
                last.max_e,
                first.rms_e,
                first.max_e
            ));
            let pixels = uncertain.count();
            if pixels > 0 {
                history.push(format!(
                    "{pixels} pixels, not counted there, are uncertain by more than {:.3e} e-",
                    uncertain.error_e
                ));
            }
        }
        history.iter().flat_map(|line| cards(line)).collect()
    }
}

/// Refuses to write a file whose name says that it is compressed in a way that is not written.
fn refuse_packed(output: &Path) -> Result<(), InputError> {
    let ending = output.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    if !["bz2", "Z", "z", "xz", "zst", "zip"].contains(&ending) {
        return Ok(());
    }
    let problem = format!("files are written plain, or compressed with gzip, and not as .{ending}");
    Err(InputError::new(format!("cannot write `{}`", output.display()), problem)
        .with_help("give a name that ends in .fits or .fits.gz"))
}

/// Whether a file is compressed with gzip, by its name.
fn is_gzip(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"))
}

/// Header entries on an amplifier.
fn history_of(amplifier: &Amplifier) -> [String; 2] {
    let (geometry, scale) = (&amplifier.geometry, amplifier.scale);
    let name = amplifier.name.as_ref().map(|name| format!("amplifier {name} {}: ", amplifier.section()));
    let name = name.unwrap_or_default();
    let traps = amplifier.device.traps.iter().map(|trap| format!("{} {:.4e}", trap.name, trap.density_per_px));
    let lies = format!(
        "{name}gain {} e-/DN, bias {} DN, {}; before the frame {} rows of {} e- and {} columns; prescan {} columns, \
         overscan {} columns and {} rows",
        scale.gain_e_per_dn,
        scale.bias_dn,
        geometry.sides(),
        geometry.rows_before,
        geometry.charge_before_e,
        geometry.columns_before,
        geometry.prescan_columns,
        geometry.overscan_columns,
        geometry.overscan_rows
    );
    [format!("{name}traps per pixel: {}", traps.collect::<Vec<_>>().join(", ")), lies]
}

/// Rows and columns of an image that can be processed.
///
/// # Errors
/// If the HDU is not an image of two axes, or its pixels have an unsupported type.
pub(crate) fn image_shape(hdu: &Hdu) -> Result<(usize, usize), InputError> {
    let refusal = |problem: &str, help: &str| Err(InputError::new(hdu.to_string(), problem).with_help(help));
    match hdu.kind {
        HduKind::Image { bitpix: 64, .. } => refusal(
            "its pixels are integers of 64 bits, which are not computed with exactly",
            "write the image as 32-bit integers or 64-bit floats, or leave it out with --hdu",
        ),
        HduKind::Image { rows, columns, .. } => Ok((rows, columns)),
        HduKind::OtherAxes(axes) => refusal(
            &format!("it has {axes} {}; a frame has two, columns and rows", if axes == 1 { "axis" } else { "axes" }),
            "write each plane of a cube as an image of its own, or leave it out with --hdu",
        ),
        HduKind::Compressed => refusal(
            "it is compressed by tiles in another way than RICE_1, GZIP_1 and GZIP_2",
            "unpack the file first, with funpack or astropy",
        ),
        HduKind::Empty => refusal("it has no data", "choose others with --hdu"),
        HduKind::NoImage => refusal("it is not an image", "choose others with --hdu"),
    }
}

/// The name of the extension that marks the uncertain pixels of a frame.
fn marks(hdu: &Hdu) -> String {
    format!("{}.{}", hdu.name().unwrap_or_else(|| format!("HDU{}", hdu.index)), selection::UNCERTAIN)
}

/// Maximum length of a text in a card with a comment.
const MOST_TEXT: usize = 36;

/// A text in the characters that FITS allows; others become `?`.
fn plain(text: &str) -> String {
    text.chars().map(|letter| if (' '..='~').contains(&letter) { letter } else { '?' }).collect()
}

/// A text as HISTORY cards, later lines indented.
fn cards(text: &str) -> Vec<Card> {
    let mut lines = vec![String::new()];
    for word in plain(text).split_whitespace() {
        let line = lines.last_mut().expect("one line at least");
        if line.is_empty() {
            line.push_str(word);
        } else if line.len() + 1 + word.len() <= 71 {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(format!("  {word}"));
        }
    }
    // Column 9 is left blank by convention.
    lines.into_iter().map(|line| fits::history(&format!(" {line}"))).collect()
}

impl Task {
    /// The command's word for it.
    pub fn word(self) -> &'static str {
        match self {
            Task::Readout => "readout",
            Task::Correct { .. } => "correct",
        }
    }
}

impl Choice {
    fn is(&self, hdu: &Hdu) -> bool {
        match self {
            Choice::Index(index) => hdu.index == *index,
            Choice::Name(name) => hdu.name().is_some_and(|known| is_called(&known, name)),
            Choice::Version(name, version) => {
                hdu.version() == *version && hdu.name().is_some_and(|known| is_called(&known, name))
            }
        }
    }
}

/// Whether an EXTNAME is the one selected, or has the ending after `*`.
fn is_called(name: &str, meant: &str) -> bool {
    let (name, meant) = (name.to_ascii_uppercase(), meant.to_ascii_uppercase());
    meant.strip_prefix('*').map_or(name == meant, |end| name.ends_with(end))
}

impl fmt::Display for Choice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Choice::Index(index) => write!(out, "{index}"),
            Choice::Name(name) => write!(out, "{name}"),
            Choice::Version(name, version) => write!(out, "{name},{version}"),
        }
    }
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Choice, String> {
        match text.trim() {
            "" => Err("the number or the EXTNAME of an HDU is needed".into()),
            text => Ok(match (text.parse(), text.rsplit_once(',')) {
                (Ok(index), _) => Choice::Index(index),
                (_, Some((name, version))) => {
                    let version = version.trim().parse();
                    let version =
                        version.map_err(|_| format!("`{text}`: behind the comma an EXTVER is needed, such as SCI,2"));
                    Choice::Version(name.trim().into(), version?)
                }
                _ => Choice::Name(text.into()),
            }),
        }
    }
}

/// The example of the page on images, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../docs/images.md")]
struct Page;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn history_fits_its_cards() {
        let lines: Vec<String> =
            cards(&"a mission at 5 µm, twelve ".repeat(9)).into_iter().filter_map(|card| card.comment).collect();
        assert!(lines.len() > 2 && lines.iter().all(|line| line.len() <= 72 && line.is_ascii()), "{lines:?}");
        assert!(lines[0].starts_with(" a mission at 5 ?m") && lines[1].starts_with("   "));
    }

    #[test]
    fn an_hdu_is_a_number_or_a_name() {
        assert_eq!("3".parse(), Ok(Choice::Index(3)));
        assert_eq!(" SCI".parse(), Ok(Choice::Name("SCI".into())));
        assert_eq!("SCI, 2".parse(), Ok(Choice::Version("SCI".into(), 2)));
        assert!("SCI,B".parse::<Choice>().is_err());
        assert!(is_called("1-1.E.SCI", "*.e.sci") && !is_called("1-1.F.SCI", "*.E.SCI"));
        assert!("".parse::<Choice>().is_err());
    }
}
