//! `ctiplan measure`: tables of measurements from frames.

use std::path::{Path, PathBuf};

use chrono::NaiveDateTime;
use clap::{Args, Subcommand, ValueEnum};

use super::frame_argument::{Gain, Layout, bits, keyword};
use super::frames::years;
use super::number_argument::{at_least_0, finite, positive, whole};
use super::{Failure, Outcome, Output, print, progress};
use crate::cli::file_argument::{InputFile, OutputFile, Overwrite};
use crate::error::InputError;
use crate::image::AmplifierTable;
use crate::io::atomic_file;
use crate::measure::bias::BiasSource;
use crate::measure::exposure::{Frames, Reading, Source, WhenSource, date};
use crate::measure::{Measured, dipoles, eper, injection, trails};
use crate::report::MeasureReport;

#[derive(Debug, Args)]
pub(super) struct Measure {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Debug, Subcommand)]
enum Kind {
    /// Extended pixel edge response (and first pixel response) of flat fields with overscan rows
    Eper(Eper),
    /// Trails behind warm and hot pixels, stacked in bins of signal, transfers and background
    Trails(Trails),
    /// Trails behind blocks of injected charge, and the charge of their first rows
    Injection(Injection),
    /// Dipoles of trap pumping in flat fields, at all phase times
    Dipoles(Dipoles),
}

impl Measure {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        match &self.kind {
            Kind::Eper(command) => command.run(),
            Kind::Trails(command) => command.run(),
            Kind::Injection(command) => command.run(),
            Kind::Dipoles(command) => command.run(),
        }
    }
}

#[derive(Debug, Args)]
struct Eper {
    #[command(flatten)]
    input: Input,
    /// Rows behind the edge to measure [default: overscan rows that the bias does not need, up to 50]
    #[arg(long, value_name = "ROWS", value_parser = whole(1_u32..=100_000))]
    trail_px: Option<u32>,
    /// Last rows of the flat of which its level is the mean [default: 20, or a quarter of the image]
    #[arg(long, value_name = "ROWS", value_parser = whole(1_u32..=100_000))]
    level_rows: Option<u32>,
    /// Groups of columns to measure apart, by the level of the flat: for flats that are brighter on one side
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1_u32..=1000))]
    column_groups: u32,
    /// Write the charge in the first row, too, into this file, as observable packet_charge
    #[arg(long, value_name = "FILE")]
    first_pixel: Option<OutputFile>,
    /// Write the CTI of the edge, too, into this file, as observable cti
    #[arg(long, value_name = "FILE")]
    cti: Option<OutputFile>,
    /// Pixels behind the edge whose charge is counted for a CTI, such as 1-2 or 1-2,3-8 [default: 1,2-3,4-7,...]
    #[arg(long, value_name = "FIRST-LAST", requires = "cti", value_delimiter = ',', value_parser = pixels)]
    cti_px: Vec<(usize, usize)>,
}

/// Pixels from the first to the last, `3-8`, or a single one.
fn pixels(text: &str) -> Result<(usize, usize), String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let number = |text: &str| text.trim().parse().ok().filter(|pixel| (1..=100_000).contains(pixel));
    let range = number(first).zip(number(last)).filter(|(first, last)| first <= last);
    range.ok_or_else(|| "pixels behind the edge are needed, from 1, such as 1-2".into())
}

impl Eper {
    fn run(&self) -> Result<Outcome, Failure> {
        let eper = eper::Eper {
            trail_px: self.trail_px.map(|rows| rows as usize),
            level_rows: self.level_rows.map(|rows| rows as usize),
            groups: self.column_groups as usize,
            first_pixel: self.first_pixel.is_some(),
            cti_px: self.cti.is_some().then(|| self.cti_px.clone()),
        };
        let more = [self.first_pixel.as_deref(), self.cti.as_deref()];
        self.input.run(&more, |frames, progress| eper.measure(frames, progress))
    }
}

#[derive(Debug, Args)]
struct Trails {
    #[command(flatten)]
    input: Input,
    /// Pixels of a trail; as many in front of a warm pixel give the level without a trail
    #[arg(long, value_name = "PIXELS", default_value_t = 15, value_parser = whole(1_u32..=10_000))]
    trail_px: u32,
    /// Least charge of a warm pixel above the background, e-
    #[arg(long, value_name = "E", default_value_t = 300.0, value_parser = positive)]
    threshold_e: f64,
    /// Bins of signal and of background in a factor of ten
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = whole(1_u32..=100))]
    bins_per_decade: u32,
    /// Bins of transfers, of equal numbers of rows
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = whole(1_u32..=1000))]
    transfer_bins: u32,
    /// Fewest warm pixels of a bin; smaller bins are left out
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = whole(5_u32..=1_000_000))]
    fewest_px: u32,
    /// Exposures at most so many days after the one before are of one date
    #[arg(long, value_name = "DAYS", default_value_t = 10.0, value_parser = at_least_0)]
    epoch_days: f64,
    /// Write the charge of the packets as it was read (signal_read_e), from which the model finds that before transfer
    #[arg(long)]
    signal_as_read: bool,
}

impl Trails {
    fn run(&self) -> Result<Outcome, Failure> {
        let trails = trails::Trails {
            trail_px: self.trail_px as usize,
            threshold_e: self.threshold_e,
            bins_per_decade: self.bins_per_decade as usize,
            transfer_bins: self.transfer_bins as usize,
            fewest: self.fewest_px as usize,
            epoch_days: self.epoch_days,
            signal_as_read: self.signal_as_read,
        };
        self.input.run(&[], |frames, progress| trails.measure(frames, progress))
    }
}

#[derive(Debug, Args)]
struct Injection {
    #[command(flatten)]
    input: Input,
    /// First row of the first block, from 0, in the order of readout; without it: blocks are found by their brightness
    #[arg(long, value_name = "ROW", requires_all = ["block_px", "period_px"], value_parser = whole(..=1_000_000_u32))]
    first_row: Option<u32>,
    /// Rows of a block
    #[arg(long, value_name = "ROWS", requires = "first_row", value_parser = whole(1_u32..=100_000))]
    block_px: Option<u32>,
    /// Rows from the first of a block to the first of the next
    #[arg(long, value_name = "ROWS", requires = "first_row", value_parser = whole(2_u32..=1_000_000))]
    period_px: Option<u32>,
    /// Rows behind a block to measure [default: all that the background does not need]
    #[arg(long, value_name = "ROWS", value_parser = whole(1_u32..=100_000))]
    trail_px: Option<u32>,
    /// Last rows of a block of which its charge is the mean [default: half of them]
    #[arg(long, value_name = "ROWS", value_parser = whole(1_u32..=100_000))]
    level_rows: Option<u32>,
    /// Groups of columns to measure apart, by their charge
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1_u32..=1000))]
    column_groups: u32,
    /// Rows that give the background
    #[arg(long, value_name = "ROWS", default_value = "gap")]
    background_from: BackgroundFrom,
    /// Write the charge in the first row of each block, too, into this file, as observable packet_charge
    #[arg(long, value_name = "FILE")]
    first_pixel: Option<OutputFile>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum BackgroundFrom {
    /// The last quarter of the gap behind each block
    Gap,
    /// The rows in front of the first block
    Front,
}

impl Injection {
    fn run(&self) -> Result<Outcome, Failure> {
        let pattern = match (self.first_row, self.block_px, self.period_px) {
            (Some(first), Some(block), Some(period)) if block < period => Some(injection::Pattern {
                first_row: first as usize,
                block_px: block as usize,
                period_px: period as usize,
            }),
            (Some(_), Some(block), Some(period)) => {
                let problem = format!("blocks of {block} rows every {period} rows leave none between them");
                return Err(InputError::new("cannot use --period-px", problem).with_help("give a larger one").into());
            }
            _ => None,
        };
        let injection = injection::Injection {
            pattern,
            trail_px: self.trail_px.map(|rows| rows as usize),
            level_rows: self.level_rows.map(|rows| rows as usize),
            groups: self.column_groups as usize,
            in_front: matches!(self.background_from, BackgroundFrom::Front),
            first_pixel: self.first_pixel.is_some(),
        };
        self.input.run(&[self.first_pixel.as_deref()], |frames, progress| injection.measure(frames, progress))
    }
}

#[derive(Debug, Args)]
struct Dipoles {
    #[command(flatten)]
    input: Input,
    /// Time of one phase, ms
    #[arg(long, value_name = "MS", value_parser = positive, conflicts_with = "phase_time_keyword")]
    phase_time_ms: Option<f64>,
    /// Header keyword of the time of one phase, ms
    #[arg(long, value_name = "KEYWORD")]
    phase_time_keyword: Option<String>,
    /// Pumping cycles
    #[arg(long, value_name = "N", value_parser = positive, conflicts_with = "cycles_keyword")]
    cycles: Option<f64>,
    /// Header keyword of the pumping cycles
    #[arg(long, value_name = "KEYWORD")]
    cycles_keyword: Option<String>,
    /// A pair of pixels counts from this number of sigma of its noise
    #[arg(long, value_name = "SIGMA", default_value_t = 6.0, value_parser = positive)]
    threshold_sigma: f64,
    /// Frames in which a dipole must be found; it is measured in all
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = whole(1_u32..=100_000))]
    found_in: u32,
    /// Species of the traps, by its name in the mission; needed by validate if that has several
    #[arg(long, value_name = "NAME")]
    species: Option<String>,
}

impl Dipoles {
    fn run(&self) -> Result<Outcome, Failure> {
        let dipoles = dipoles::Dipoles {
            threshold_sigma: self.threshold_sigma,
            found_in: self.found_in as usize,
            species: self.species.clone(),
        };
        let phase_time_ms = source(self.phase_time_ms, self.phase_time_keyword.as_deref());
        let cycles = source(self.cycles, self.cycles_keyword.as_deref());
        self.input.run(&[], |frames, progress| {
            let reading = Reading { phase_time_ms, cycles, ..frames.reading.clone() };
            dipoles.measure(&Frames { reading, ..frames.clone() }, progress)
        })
    }
}

/// Input, what headers do not state, and output.
#[derive(Debug, Args)]
struct Input {
    /// FITS files to read
    #[arg(value_name = "IN.fits", required = true)]
    input: Vec<InputFile>,
    /// Measurement file to write (ECSV)
    #[arg(value_name = "OUT.ecsv")]
    output: OutputFile,
    /// Table of the camera's amplifiers (ECSV or CSV), a row each: HDU, corner, sections, gain, bias
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = [
            "hdu", "corner", "split", "prescan_px", "overscan_columns", "overscan_rows", "transfers_before",
            "gain_e_per_dn", "gain_keyword", "saturated_dn",
        ]
    )]
    amplifiers: Option<InputFile>,
    #[command(flatten)]
    layout: Layout,
    #[command(flatten)]
    gain: Gain,
    /// Bias: value of a pixel without charge, in the unit of the frame; without it: that of the table of amplifiers, or measured
    /// in the overscan
    #[arg(long, value_name = "DN", value_parser = finite)]
    bias_dn: Option<f64>,
    /// Pixels from which the bias is measured [default: the first of these that the frame has]
    #[arg(long, value_name = "PIXELS", conflicts_with = "bias_dn")]
    bias_from: Option<BiasFrom>,
    /// Bits of data quality (DQ, FLG) of pixels to leave out; by default 1, 2, 256 and 2048 for HST/ACS, and none for others
    #[arg(long, value_name = "BITS", value_parser = bits)]
    dq_bad: Option<u32>,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    output_format: Output,
}

/// Under which conditions the frames were taken.
#[derive(Debug, Args)]
struct Conditions {
    /// Date of the exposures, such as 2030-06-01 or 2030-06-01T12:00:00; without it: DATE-OBS, or MJD-OBS
    #[arg(long, value_name = "DATE", value_parser = a_date, conflicts_with_all = ["date_keyword", "at", "dose_mev_g", "dose_keyword"])]
    date: Option<NaiveDateTime>,
    /// Header keyword of the date, or of the Julian date, modified or not
    #[arg(long, value_name = "KEYWORD", conflicts_with_all = ["at", "dose_mev_g", "dose_keyword"])]
    date_keyword: Option<String>,
    /// Time of the exposures, years since launch; with a dose: since the irradiation
    #[arg(long, value_name = "YEARS", value_parser = years)]
    at: Option<f64>,
    /// Dose of the traps, MeV/g: for a detector irradiated in a laboratory
    #[arg(long, value_name = "DOSE", value_parser = at_least_0, conflicts_with = "dose_keyword")]
    dose_mev_g: Option<f64>,
    /// Header keyword of that dose
    #[arg(long, value_name = "KEYWORD")]
    dose_keyword: Option<String>,
    /// Temperature of the detector, K; without it: the mission's
    #[arg(long, value_name = "KELVIN", value_parser = positive, conflicts_with = "temperature_keyword")]
    temperature_k: Option<f64>,
    /// Header keyword of the temperature, K
    #[arg(long, value_name = "KEYWORD")]
    temperature_keyword: Option<String>,
    /// Time between two parallel transfers, ms; without it: the mission's
    #[arg(long, value_name = "MS", value_parser = positive, conflicts_with = "line_time_keyword")]
    line_time_ms: Option<f64>,
    /// Header keyword of the line time, ms
    #[arg(long, value_name = "KEYWORD")]
    line_time_keyword: Option<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum BiasFrom {
    /// The last half of the overscan columns
    Columns,
    /// The prescan columns
    Prescan,
    /// The last half of the overscan rows
    Rows,
}

impl Input {
    /// Measures, writes the tables (those after the first into `more`), and reports.
    fn run(
        &self,
        more: &[Option<&Path>],
        measure: impl FnOnce(&Frames, &dyn Fn(usize)) -> Result<Measured, InputError>,
    ) -> Result<Outcome, Failure> {
        let outputs: Vec<&Path> = [Some(&*self.output)].iter().chain(more).copied().flatten().collect();
        for output in &outputs {
            atomic_file::refuse_unwritable(output)?;
        }
        let files: Vec<PathBuf> = self.input.iter().map(|file| file.to_path_buf()).collect();
        let bar = progress(files.len() as u64, "files");
        let measured = measure(&Frames { files, reading: self.reading()?, ..Frames::default() }, &|done| {
            bar.set_position(done as u64)
        });
        bar.finish_and_clear();
        let measured = measured?;
        for (output, (_, table)) in outputs.iter().zip(&measured.tables) {
            atomic_file::write(output, table.to_ecsv())?;
        }
        let files = outputs.iter().map(|path| path.display().to_string()).collect();
        print(&MeasureReport { measured, files }, &self.output_format)?;
        Ok(Outcome::Done)
    }

    fn reading(&self) -> Result<Reading, InputError> {
        let from = |from: BiasFrom| match from {
            BiasFrom::Columns => BiasSource::OverscanColumns,
            BiasFrom::Prescan => BiasSource::Prescan,
            BiasFrom::Rows => BiasSource::OverscanRows,
        };
        let said = &self.conditions;
        Ok(Reading {
            amplifiers: self.amplifiers.as_ref().map(AmplifierTable::read).transpose()?,
            hdus: self.layout.hdus(),
            unit: self.gain.unit(None),
            bias: self.bias_dn.map(BiasSource::Given).or(self.bias_from.map(from)),
            geometry: self.layout.geometry(),
            dq_bad: self.dq_bad,
            when: said.when(),
            temperature_k: source(said.temperature_k, said.temperature_keyword.as_deref()),
            line_time_ms: source(said.line_time_ms, said.line_time_keyword.as_deref()),
            ..Reading::default()
        })
    }
}

impl Conditions {
    fn when(&self) -> WhenSource {
        let dose = source(self.dose_mev_g, self.dose_keyword.as_deref());
        match (self.date, &self.date_keyword, dose, self.at) {
            (Some(date), ..) => WhenSource::Date(date),
            (_, Some(name), ..) => WhenSource::Keyword(keyword(name)),
            (_, _, Source::Mission, Some(t_yr)) => WhenSource::Since(t_yr),
            (_, _, Source::Mission, None) => WhenSource::Header,
            (_, _, dose, t_yr) => WhenSource::Dose(dose, t_yr),
        }
    }
}

fn source(given: Option<f64>, name: Option<&str>) -> Source {
    match (given, name) {
        (Some(value), _) => Source::Given(value),
        (_, Some(name)) => Source::Keyword(keyword(name)),
        _ => Source::Mission,
    }
}

fn a_date(text: &str) -> Result<NaiveDateTime, String> {
    date(text).ok_or_else(|| "a date of 1969 to 2200 is needed, 2030-06-01 or 2030-06-01T12:00:00".to_string())
}
