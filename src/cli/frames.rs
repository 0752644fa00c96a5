//! `ctiplan readout` and `ctiplan correct`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::frame_argument::{Gain, Layout, bits};
use super::inputs::mission_with;
use super::number_argument::{at_least_0, finite, number, positive, whole};
use super::{Failure, Outcome, Output, print, progress};
use crate::cli::file_argument::InputFile;
use crate::error::InputError;
use crate::image::batch::{Batch, Existing};
use crate::image::{AmplifierTable, Bits, Geometry, Job, Stop, Task, Transfers, TrapMap};
use crate::io::atomic_file::{self, Written};
use crate::model::Model;
use crate::physics::accuracy::OF_FRAMES;
use crate::physics::conditions::Conditions;

#[derive(Debug, Args)]
pub(super) struct Readout {
    #[command(flatten)]
    frames: Frames,
}

#[derive(Debug, Args)]
pub(super) struct Correct {
    #[command(flatten)]
    frames: Frames,
    /// Largest number of iterations
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = whole(1_u32..=1000))]
    iterations: u32,
    /// Largest residual of the forward model at which iterations end, over its initial value
    #[arg(long, value_name = "FRACTION", default_value_t = 1e-4, value_parser = fraction)]
    tolerance: f64,
    /// Error (e- rms) of the corrected frame at which iterations end, instead of --tolerance
    #[arg(long, value_name = "E", value_parser = positive, conflicts_with = "tolerance")]
    tolerance_e: Option<f64>,
    /// Read noise (e- rms) for which the amplification by the correction is measured, by correcting each frame with added noise
    #[arg(long, value_name = "E", value_parser = positive)]
    noise_e: Option<f64>,
    /// Seed of that noise, instead of the mission's
    #[arg(long, value_name = "SEED", requires = "noise_e")]
    seed: Option<u64>,
    #[command(flatten)]
    beside: Beside,
}

/// Errors, data quality and read noise of frames.
#[derive(Debug, Args)]
struct Beside {
    /// Bits of data quality (DQ, FLG) that mark saturated pixels; by default 256 and 2048 for HST/ACS, and none for others
    #[arg(long, value_name = "BITS", value_parser = bits)]
    dq_saturated: Option<u32>,
    /// Bits of data quality that mark pixels without a measured value; by default 1 and 2 for HST/ACS, and none for others
    #[arg(long, value_name = "BITS", value_parser = bits)]
    dq_bad: Option<u32>,
    /// Bit of data quality that is set in uncertain pixels, instead of an extension that marks them
    #[arg(long, value_name = "BIT", value_parser = bit)]
    dq_set: Option<u32>,
    /// Read noise (e- rms) of amplifiers whose table names none
    #[arg(long, value_name = "E", value_parser = at_least_0)]
    read_noise_e: Option<f64>,
    /// Separate read noise before the correction and add it afterwards, so that it is not amplified
    #[arg(long)]
    separate_noise: bool,
    /// Copy errors (ERR, RMS) as they are, instead of propagating them through the correction
    #[arg(long)]
    keep_err: bool,
}

impl Readout {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        self.frames.run(|_| Task::Readout, None)
    }
}

impl Correct {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let iterations = self.iterations as usize;
        let stop = match self.tolerance_e {
            Some(error_e) => Stop::at_error(error_e, iterations),
            None => Stop::at_residual(self.tolerance, iterations),
        };
        let noise = |seed| self.noise_e.map(|noise_e| (noise_e, self.seed.unwrap_or(seed)));
        self.frames.run(|seed| Task::Correct { stop, noise: noise(seed) }, Some(&self.beside))
    }
}

/// Input, geometry on the detector, and output.
#[derive(Debug, Args)]
struct Frames {
    /// FITS file to read and FITS file to write, with all HDUs and their headers; with --out-folder: all are read
    #[arg(value_name = "IN.fits OUT.fits", required = true)]
    files: Vec<PathBuf>,
    /// Folder to write into, each file under its own name
    #[arg(long, value_name = "DIR")]
    out_folder: Option<PathBuf>,
    /// Keep files that are in the folder already, which are complete, and go on with the others
    #[arg(long, requires = "out_folder", conflicts_with = "overwrite")]
    resume: bool,
    /// Mission file (TOML)
    #[arg(long, value_name = "MISSION")]
    mission: InputFile,
    /// Value of a key, instead of the file's, such as detector.temperature_k=150; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Time of the exposure, years since launch
    #[arg(long, value_name = "YEARS", value_parser = years, required_unless_present = "dose_mev_g")]
    at: Option<f64>,
    /// Dose of the traps, MeV/g, instead of the mission's: for a detector irradiated in a laboratory --at years ago
    #[arg(long, value_name = "DOSE", value_parser = at_least_0)]
    dose_mev_g: Option<f64>,
    /// Directions of transfer to model; serial ones need [effects.serial-traps]
    #[arg(long, value_name = "AXIS", default_value = "parallel")]
    axis: Transfers,
    /// Table of the camera's amplifiers (ECSV or CSV), a row each: HDU, corner, sections, gain, read noise, traps
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = [
            "hdu", "corner", "split", "prescan_px", "overscan_columns", "overscan_rows", "transfers_before",
            "charge_before_e", "serial_transfers_before", "gain_e_per_dn", "gain_keyword", "saturated_dn", "bias_dn",
        ]
    )]
    amplifiers: Option<InputFile>,
    /// Factors on the densities of the pixels' traps: an image (FITS) with a factor for each column, row or block of pixels of the frame
    #[arg(long, value_name = "FILE")]
    trap_map: Option<InputFile>,
    #[command(flatten)]
    layout: Layout,
    /// Charge per pixel in those rows, e-: 0 if they are dark, the sky if the frame was cut out of a larger one
    #[arg(long, value_name = "E", default_value_t = 0.0, value_parser = at_least_0)]
    charge_before_e: f64,
    /// Pixels of the serial register between the frame's first column and the amplifier
    #[arg(long, value_name = "COLUMNS", default_value_t = 0, value_parser = whole(..=1_000_000_u32))]
    serial_transfers_before: u32,
    #[command(flatten)]
    gain: Gain,
    /// Bias: value of a pixel without charge, in the unit of the frame; needed (0 if it is subtracted) for counts with a prescan or an overscan
    #[arg(long, value_name = "DN", value_parser = finite)]
    bias_dn: Option<f64>,
    /// Accuracy of the readout, instead of accuracy.relative: error of a packet over the largest displacement of charge
    #[arg(long, value_name = "FRACTION", default_value_t = OF_FRAMES, value_parser = fraction)]
    relative: f64,
    /// Replace files to write if they exist
    #[arg(long, visible_alias = "force")]
    overwrite: bool,
    #[command(flatten)]
    output_format: Output,
}

impl Frames {
    fn run(&self, task: impl Fn(u64) -> Task, beside: Option<&Beside>) -> Result<Outcome, Failure> {
        let mission = mission_with(&self.mission, &self.set)?;
        let conditions =
            Conditions { dose_mev_g: self.dose_mev_g, ..Conditions::of(&mission, self.at.unwrap_or_default()) };
        let model = Model::new(&mission);
        let amplifiers = self.amplifiers.as_ref().map(AmplifierTable::read).transpose()?;
        let job = Job::new(task(mission.accuracy.seed), &model, &conditions, self.relative, self.geometry()?)?;
        let job = Job { unit: self.gain.unit(self.bias_dn), hdus: self.layout.hdus(), amplifiers, ..job };
        let bits = beside.map_or(Bits::default(), Beside::bits);
        let propagate_errors = beside.is_some_and(|beside| !beside.keep_err);
        let job = Job {
            bits,
            propagate_errors,
            read_noise_e: beside.and_then(|beside| beside.read_noise_e),
            trap_map: self.trap_map.as_ref().map(|file| TrapMap::read(file)).transpose()?,
            separate_noise: beside.is_some_and(|beside| beside.separate_noise),
            ..job
        };
        match &self.out_folder {
            None => self.one(&job),
            Some(folder) => self.many(&job, folder),
        }
    }

    /// Processes one file.
    fn one(&self, job: &Job) -> Result<Outcome, Failure> {
        let [input, output] = &self.files[..] else {
            let problem = format!("found {} files; one to read and one to write are needed", self.files.len());
            let refused = format!("cannot use `{}`", self.files[self.files.len() - 1].display());
            return Err(InputError::new(refused, problem).with_help("give --out-folder to process many files").into());
        };
        let inputs: Vec<&Path> = self.read_besides().chain([input.as_path()]).collect();
        atomic_file::refuse_clashes(&[Written::File(output)], &inputs)?;
        let bar = progress(0, "HDUs");
        let done = job.run(input, output, self.overwrite, &|done, all, what| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            bar.set_message(what.to_string());
        })?;
        bar.finish_and_clear();
        print(&done, &self.output_format)?;
        Ok(Outcome::Done)
    }

    /// Processes many files; those that fail are listed at the end.
    fn many(&self, job: &Job, folder: &Path) -> Result<Outcome, Failure> {
        let inputs: Vec<&Path> = self.files.iter().map(PathBuf::as_path).collect();
        for input in &inputs {
            let output = folder.join(input.file_name().unwrap_or_default());
            let besides: Vec<&Path> = self.read_besides().collect();
            atomic_file::refuse_clashes(&[Written::File(&output)], &besides)?;
        }
        let existing = match (self.overwrite, self.resume) {
            (true, _) => Existing::Replaced,
            (_, true) => Existing::Kept,
            _ => Existing::Refused,
        };
        let bar = progress(inputs.len() as u64, "files");
        let batch = Batch::run(job, &inputs, folder, existing, &|done, what| {
            bar.set_position(done as u64);
            bar.set_message(what.to_string());
        })?;
        bar.finish_and_clear();
        print(&batch, &self.output_format)?;
        batch.failure().map_or(Ok(Outcome::Done), |failure| Err(failure.into()))
    }

    /// Input files other than frames.
    fn read_besides(&self) -> impl Iterator<Item = &Path> {
        [Some(&self.mission), self.amplifiers.as_ref(), self.trap_map.as_ref()]
            .into_iter()
            .flatten()
            .map(|file| &**file)
    }

    fn geometry(&self) -> Result<Geometry, InputError> {
        if self.charge_before_e > 0.0 && self.layout.transfers_before == 0 {
            return Err(InputError::new(
                format!("cannot use --charge-before-e {}", self.charge_before_e),
                "there are no rows between the frame and the register",
            )
            .with_help("give their number with --transfers-before"));
        }
        Ok(Geometry {
            transfers: self.axis,
            charge_before_e: self.charge_before_e,
            columns_before: self.serial_transfers_before,
            ..self.layout.geometry()
        })
    }
}

impl Beside {
    fn bits(&self) -> Bits {
        Bits { saturated: self.dq_saturated, bad: self.dq_bad, uncertain: self.dq_set.unwrap_or(0) }
    }
}

fn bit(text: &str) -> Result<u32, String> {
    bits(text).ok().filter(|bits| bits.is_power_of_two()).ok_or_else(|| "one power of 2 is needed, such as 1024".into())
}

/// Years since launch.
pub(super) fn years(text: &str) -> Result<f64, String> {
    number(text, |years| (0.0..=1000.0).contains(&years), "a time of 0 to 1000 yr since launch is needed")
}

fn fraction(text: &str) -> Result<f64, String> {
    number(text, |fraction| (1e-12..1.0).contains(&fraction), "a fraction from 1e-12 to below 1 is needed")
}
