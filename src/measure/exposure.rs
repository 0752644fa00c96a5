//! FITS frames → exposures: the signal read by one amplifier, in electrons above the bias, in the order of readout, with the
//! conditions from headers or options.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::path::PathBuf;

use chrono::{Datelike, NaiveDateTime};
use fitsio_pure::value::Value;
use ndarray::{Array2, s};
use serde_json::{Value as Json, json};

use super::bias::{Bias, BiasSource};
use super::statistic::{Mean, clipped};
use crate::error::InputError;
use crate::image::amplifier_table::Place;
use crate::image::fits::{Fits, Hdu, HduKind};
use crate::image::selection::left_out;
use crate::image::unit::number_of;
use crate::image::{AmplifierTable, Bits, Choice, Companions, Geometry, Transfers, Unit, frames};
use crate::io::table::{Cell, Time};
use crate::warning::Warning;

/// How frames are interpreted.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// Images to use; none: all that hold charge.
    pub hdus: Vec<Choice>,
    /// The meaning of their values; its bias is not used.
    pub unit: Unit,
    /// The bias; none: the best source in the frame.
    pub bias: Option<BiasSource>,
    /// How the frames lie on the detector.
    pub geometry: Geometry,
    /// Table of the camera's amplifiers, in place of HDUs, unit and geometry.
    pub amplifiers: Option<AmplifierTable>,
    /// Bits of data quality of pixels to leave out; none: those of the instrument.
    pub dq_bad: Option<u32>,
    /// When they were taken.
    pub when: WhenSource,
    /// Temperature of the detector, K.
    pub temperature_k: Source,
    /// Time between two parallel transfers, ms.
    pub line_time_ms: Source,
    /// Time of one phase of trap pumping, ms.
    pub phase_time_ms: Source,
    /// Cycles of trap pumping.
    pub cycles: Source,
}

/// Source of a number.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Source {
    /// Not given: that of the mission is used, if it has one.
    #[default]
    Mission,
    /// An option.
    Given(f64),
    /// A keyword of the header.
    Keyword(String),
}

/// Source of the time of an exposure.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum WhenSource {
    /// `DATE-OBS`, or `MJD-OBS`.
    #[default]
    Header,
    /// Another keyword of the header: a date, or a Julian date, modified or not.
    Keyword(String),
    /// A date.
    Date(NaiveDateTime),
    /// Years since launch.
    Since(f64),
    /// Dose that created the traps, MeV/g, and years since it was given.
    Dose(Source, Option<f64>),
}

/// When an exposure was taken, as written in a measurement file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum When {
    /// On a date.
    Date(NaiveDateTime),
    /// Years since launch.
    Since(f64),
    /// With the traps created by a dose (MeV/g), and years since it was given.
    Dose(f64, Option<f64>),
}

/// The part of a frame read by one amplifier.
#[derive(Clone, Debug)]
pub struct Exposure {
    /// Its data other than the pixels.
    pub about: About,
    /// Charge above the bias, e-, `[[row, column]]` in the order of readout; NaN if a pixel has none or is saturated.
    pub charge_e: Array2<f64>,
    /// Columns of the image.
    pub columns: Range<usize>,
    /// Rows of the image; those behind are overscan.
    pub rows: usize,
}

/// Data of an exposure other than its pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct About {
    /// Its number among all exposures, from 1.
    pub number: usize,
    /// The file as given.
    pub file: String,
    /// Index of the HDU in the file.
    pub hdu: usize,
    /// The amplifier, from 1: those of lower rows first, from the left; for a table, its row.
    pub amplifier: usize,
    /// Its name in the table of amplifiers, if there is one.
    pub amplifier_name: Option<String>,
    /// Electrons per unit of the frame.
    pub gain_e_per_dn: f64,
    /// Step of the values, e-: one electron, or one DN if that is larger and the file contains integers.
    pub quantum_e: f64,
    /// The bias.
    pub bias: Bias,
    /// When it was taken.
    pub when: When,
    /// Temperature of the detector, K, if given.
    pub temperature_k: Option<f64>,
    /// Time between two parallel transfers, ms, if given.
    pub line_time_ms: Option<f64>,
    /// Time of one phase of trap pumping, ms, if given.
    pub phase_time_ms: Option<f64>,
    /// Cycles of trap pumping, if given.
    pub cycles: Option<f64>,
    /// How its pixels lie on the detector.
    pub geometry: Geometry,
    /// Number of pixels without a value, or saturated.
    pub missing_px: usize,
    /// Equal in frames with the same charges.
    pub(super) fingerprint: u64,
}

impl Exposure {
    /// Clipped mean of some columns in some rows, e-; None if too few pixels have a value.
    pub(super) fn mean(&self, rows: impl Iterator<Item = usize>, columns: &[usize]) -> Option<Mean> {
        let charges = rows.flat_map(|row| columns.iter().map(move |column| self.charge_e[[row, *column]]));
        clipped(charges, self.about.quantum_e)
    }
}

impl About {
    /// 1-sigma error of the bias, e-.
    pub fn bias_sigma_e(&self) -> f64 {
        self.bias.sigma_dn * self.gain_e_per_dn
    }

    /// Its place: file, HDU, amplifier.
    pub fn place(&self) -> String {
        let number = self.amplifier.to_string();
        format!("{}, HDU {}, amplifier {}", self.file, self.hdu, self.amplifier_name.as_ref().unwrap_or(&number))
    }

    /// Rows between the frame and the register.
    pub fn rows_before(&self) -> u32 {
        self.geometry.rows_before
    }

    /// HDU and amplifier, if distinguished in a table.
    pub fn sensor(&self) -> Vec<(&'static str, usize)> {
        let numbers = vec![("hdu", self.hdu), ("amplifier", self.amplifier)];
        if self.amplifier_name.is_some() { numbers } else { Vec::new() }
    }

    /// The same for the `meta` of a table, as JSON.
    pub fn json(&self) -> Json {
        json!({
            "exposure": self.number,
            "file": self.file,
            "hdu": self.hdu,
            "amplifier": self.amplifier,
            "amplifier_name": self.amplifier_name,
            "time": self.when.words(),
            "temperature_k": self.temperature_k,
            "line_time_ms": self.line_time_ms,
            "phase_time_ms": self.phase_time_ms,
            "cycles": self.cycles,
            "gain_e_per_dn": self.gain_e_per_dn,
            "bias_dn": self.bias.dn,
            "bias_sigma_dn": self.bias.sigma_dn,
            "bias_slope_dn_per_row": self.bias.line.map(|line| line.slope_dn),
            "bias_from": self.bias.source.words(),
            "bias_px": self.bias.pixels,
            "bias_rejected_px": self.bias.rejected_px,
            "read_noise_e": self.bias.noise_dn.map(|noise| noise * self.gain_e_per_dn),
            "missing_px": self.missing_px,
        })
    }
}

impl When {
    /// Years since launch, if given so; otherwise since the dose was given.
    pub fn t_yr(self) -> Option<f64> {
        match self {
            When::Date(_) => None,
            When::Since(t_yr) => Some(t_yr),
            When::Dose(_, t_yr) => t_yr,
        }
    }

    /// Dose that created the traps, MeV/g, if given.
    pub fn dose_mev_g(self) -> Option<f64> {
        if let When::Dose(dose_mev_g, _) = self { Some(dose_mev_g) } else { None }
    }

    /// In words.
    pub fn words(self) -> String {
        match self {
            When::Date(date) => date_words(date),
            When::Since(t_yr) => format!("{t_yr} yr"),
            When::Dose(dose_mev_g, _) => format!("{dose_mev_g:e} MeV/g"),
        }
    }
}

/// A day, with the time if it is not midnight.
pub(super) fn date_words(date: NaiveDateTime) -> String {
    let day = date.date().to_string();
    if date.date().and_hms_opt(0, 0, 0) == Some(date) { day } else { date.format("%Y-%m-%dT%H:%M:%S").to_string() }
}

/// A date in common or header notation, of a year in which frames are taken.
pub fn date(text: &str) -> Option<NaiveDateTime> {
    Cell::Text(text.to_string()).moment(None).ok().filter(in_years)
}

/// Frames in files and in memory.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// The files.
    pub files: Vec<PathBuf>,
    /// Frames without a file, behind those of the files.
    pub arrays: Vec<FrameArray>,
    /// How they are interpreted.
    pub reading: Reading,
}

/// A frame in memory, without a header.
#[derive(Clone, Debug)]
pub struct FrameArray {
    /// Its name in messages.
    pub name: String,
    /// Values, `[[row, column]]`, row 0 the lowest.
    pub values_dn: Array2<f64>,
    /// Whether the values were integers.
    pub integers: bool,
}

impl Frames {
    /// Images of the files that might be frames, and are left out.
    ///
    /// # Errors
    /// If a file is not a FITS file, or a unit cannot be read.
    pub(super) fn left_out(&self) -> Result<Vec<Warning>, InputError> {
        let mut warnings = Vec::new();
        if self.reading.amplifiers.is_some() || !self.reading.hdus.is_empty() {
            return Ok(warnings);
        }
        for file in &self.files {
            let name = file.display().to_string();
            let hdus = Fits::open(file)?.hdus;
            let left_out = left_out(&hdus, &[]).map_err(|error| cannot_measure(&name, error))?;
            let doubtful = left_out.into_iter().filter(|(_, why)| why.is_doubtful());
            warnings.extend(doubtful.map(|(index, why)| Warning::ImageLeftOut {
                name: format!("{name}, {}", hdus[index]),
                why: why.to_string(),
            }));
        }
        Ok(warnings)
    }

    /// Passes every exposure to `visit`, one after another: one frame at a time is in memory. `progress` is given the number of
    /// files done.
    ///
    /// # Errors
    /// If a file is not a FITS file or has no image, or a gain, bias or time is missing; errors of `visit`.
    pub fn each(
        &self,
        progress: &dyn Fn(usize),
        mut visit: impl FnMut(Exposure) -> Result<(), InputError>,
    ) -> Result<(), InputError> {
        let mut number = 0;
        let reading = &self.reading;
        for (done, file) in self.files.iter().enumerate() {
            progress(done);
            let name = file.display().to_string();
            let mut fits = Fits::open(file)?;
            for index in reading.chosen(&fits.hdus).map_err(|error| cannot_measure(&name, error))? {
                let mut values_dn = fits.pixels(index)?.physical();
                let left_out = reading.left_out(&mut fits, index).map_err(|error| cannot_measure(&name, error))?;
                if let Some(left_out) = left_out {
                    values_dn.zip_mut_with(&left_out, |value, out| {
                        if *out {
                            *value = f64::NAN
                        }
                    });
                }
                let frame = Frame { name: &name, hdu: index, hdus: &fits.hdus, values_dn };
                reading.each(frame, &mut number, &mut visit)?;
            }
        }
        for (done, array) in self.arrays.iter().enumerate() {
            progress(self.files.len() + done);
            let hdus = [Hdu::without_header(array.values_dn.dim(), array.integers)];
            let frame = Frame { name: &array.name, hdu: 0, hdus: &hdus, values_dn: array.values_dn.clone() };
            reading.each(frame, &mut number, &mut visit)?;
        }
        Ok(())
    }
}

/// A frame with its headers.
struct Frame<'a> {
    name: &'a str,
    /// Index of its HDU in the file.
    hdu: usize,
    hdus: &'a [Hdu],
    values_dn: Array2<f64>,
}

/// The part of a frame read by one amplifier, in the order of readout, and the meaning of its values.
struct Part {
    /// From 1.
    number: usize,
    name: Option<String>,
    values_dn: Array2<f64>,
    geometry: Geometry,
    gain_e_per_dn: f64,
    bias: Option<BiasSource>,
    saturated_dn: Option<f64>,
}

fn cannot_measure(name: &str, error: InputError) -> InputError {
    InputError { refused: format!("cannot measure on `{name}`: {}", error.refused), ..error }
}

/// Data of a frame from its header or an option.
#[derive(Clone)]
struct Known {
    when: When,
    temperature_k: Option<f64>,
    line_time_ms: Option<f64>,
    phase_time_ms: Option<f64>,
    cycles: Option<f64>,
}

impl Reading {
    /// The bias source to be used.
    ///
    /// # Errors
    /// If none is given, and the frames have none.
    fn bias(&self, part: &Part) -> Result<BiasSource, InputError> {
        part.bias.or(self.bias).or_else(|| BiasSource::of(&part.geometry)).ok_or_else(|| {
            let error = InputError::new("no bias is known", "the frame has no overscan and no prescan by its options");
            error.with_help(match self.amplifiers {
                None => "give --bias-dn (0 if it is subtracted), --overscan-columns, --prescan-px or --overscan-rows",
                Some(_) => {
                    "give --bias-dn (0 if it is subtracted), or bias_dn, prescan or overscan in the table of amplifiers"
                }
            })
        })
    }

    /// Pixels of a frame that its data quality marks as saturated or bad; None if it has none, or no bit is asked for.
    ///
    /// # Errors
    /// If bits are given, and the frame has no data quality.
    fn left_out(&self, fits: &mut Fits, index: usize) -> Result<Option<Array2<bool>>, InputError> {
        let bits = match self.dq_bad {
            Some(bad) => Bits { bad: Some(bad), saturated: Some(0), uncertain: 0 },
            None => Bits::default().of(&fits.hdus[0])?,
        };
        if (bits.bad, bits.saturated) == (Some(0), Some(0)) {
            return Ok(None);
        }
        let quality = match self.dq_bad {
            Some(bits) => Some(Companions::quality_for(&fits.hdus, index, &format!("use --dq-bad {bits}"))?),
            None => Companions::of(&fits.hdus, index).quality,
        };
        let Some(quality) = quality else { return Ok(None) };
        let flagged = bits.flagged(&fits.pixels(quality)?);
        Ok(Some(flagged.bad | flagged.saturated))
    }

    /// The images of a file that are frames, by their indices.
    fn chosen(&self, hdus: &[Hdu]) -> Result<Vec<usize>, InputError> {
        Ok(match &self.amplifiers {
            Some(table) => table.places(hdus, Transfers::Parallel)?.into_iter().map(|(hdu, _)| hdu).collect(),
            None => frames(hdus, &self.hdus, &self.geometry, &self.unit)?.into_iter().map(|(hdu, _)| hdu).collect(),
        })
    }

    /// The part read by each amplifier of a frame.
    fn parts(&self, frame: &Frame) -> Result<Vec<Part>, InputError> {
        let Frame { hdu, hdus, values_dn, .. } = frame;
        let Some(table) = &self.amplifiers else {
            self.geometry.check(values_dn.dim())?;
            let scale = self.unit.scale(&hdus[*hdu], &hdus[0])?;
            let part = |(place, values_dn)| Part {
                number: place + 1,
                name: None,
                values_dn,
                geometry: self.geometry,
                gain_e_per_dn: scale.gain_e_per_dn,
                bias: None,
                saturated_dn: self.unit.saturated_dn,
            };
            return Ok(self.geometry.amplifiers(values_dn).into_iter().enumerate().map(part).collect());
        };
        let of_frame = table.places(hdus, Transfers::Parallel)?.into_iter().filter(|(index, _)| index == hdu);
        let part = |place: Place| Part {
            number: place.index + 1,
            name: Some(place.name),
            values_dn: place.geometry.amplifiers(&values_dn.slice(s![place.rows, place.columns]).to_owned()).remove(0),
            geometry: place.geometry,
            gain_e_per_dn: place.gain_e_per_dn,
            bias: place.bias_dn.map(BiasSource::Given),
            saturated_dn: place.saturated_dn,
        };
        Ok(of_frame.flat_map(|(_, places)| places).map(part).collect())
    }

    /// Passes the part read by each amplifier of a frame to `visit`; `number` counts them.
    fn each(
        &self,
        frame: Frame,
        number: &mut usize,
        visit: &mut impl FnMut(Exposure) -> Result<(), InputError>,
    ) -> Result<(), InputError> {
        let of_frame = |error| cannot_measure(frame.name, error);
        let hdu = &frame.hdus[frame.hdu];
        let parts = self.parts(&frame).map_err(of_frame)?;
        let known = self.known(hdu, &frame.hdus[0]).map_err(of_frame)?;
        for part in parts {
            *number += 1;
            visit(self.exposure(hdu, known.clone(), (*number, frame.name), part).map_err(of_frame)?)?;
        }
        Ok(())
    }

    fn known(&self, hdu: &Hdu, primary: &Hdu) -> Result<Known, InputError> {
        let number = |source: &Source, what: &str| match source {
            Source::Mission => Ok(None),
            Source::Given(value) => Ok(Some(*value)),
            Source::Keyword(keyword) => {
                let value = number_of(keyword, hdu, primary, &format!("give --{what} instead"))?;
                let refused = || InputError::new(hdu.to_string(), format!("{keyword} = {value}: {what} is above 0"));
                if value > 0.0 {
                    return Ok(Some(value));
                }
                let celsius = "if this is in degrees Celsius, add 273.15 and give --temperature-k";
                Err(if what == "temperature-k" { refused().with_help(celsius) } else { refused() })
            }
        };
        Ok(Known {
            when: self.when(hdu, primary)?,
            temperature_k: number(&self.temperature_k, "temperature-k")?,
            line_time_ms: number(&self.line_time_ms, "line-time-ms")?,
            phase_time_ms: number(&self.phase_time_ms, "phase-time-ms")?,
            cycles: number(&self.cycles, "cycles")?,
        })
    }

    fn when(&self, hdu: &Hdu, primary: &Hdu) -> Result<When, InputError> {
        let dose_help = "give --dose-mev-g instead";
        match &self.when {
            WhenSource::Date(date) => Ok(When::Date(*date)),
            WhenSource::Since(t_yr) => Ok(When::Since(*t_yr)),
            WhenSource::Dose(Source::Given(dose_mev_g), t_yr) => Ok(When::Dose(*dose_mev_g, *t_yr)),
            WhenSource::Dose(Source::Keyword(keyword), t_yr) => {
                let dose_mev_g = number_of(keyword, hdu, primary, dose_help)?;
                if dose_mev_g < 0.0 {
                    let problem = format!("{keyword} = {dose_mev_g}: a dose of 0 MeV/g or more is needed");
                    return Err(InputError::new(hdu.to_string(), problem).with_help(dose_help));
                }
                Ok(When::Dose(dose_mev_g, *t_yr))
            }
            WhenSource::Dose(Source::Mission, _) | WhenSource::Header => {
                let found = ["DATE-OBS", "MJD-OBS"].into_iter().find_map(|keyword| moment(keyword, hdu, primary));
                found.unwrap_or_else(|| {
                    let problem = "its header has neither DATE-OBS nor MJD-OBS, and no time was given";
                    let help = "give --date, --date-keyword, --at (years since launch), or --dose-mev-g";
                    Err(InputError::new(hdu.to_string(), problem).with_help(help))
                })
            }
            WhenSource::Keyword(keyword) => moment(keyword, hdu, primary).unwrap_or_else(|| {
                let problem = format!("neither its header nor the primary one has {keyword}");
                Err(InputError::new(hdu.to_string(), problem).with_help("give --date instead"))
            }),
        }
    }

    /// The part read by an amplifier, with its bias subtracted, given its number among all exposures and its file.
    fn exposure(
        &self,
        hdu: &Hdu,
        known: Known,
        (number, file): (usize, &str),
        part: Part,
    ) -> Result<Exposure, InputError> {
        let Part { gain_e_per_dn, geometry, values_dn: ref part_dn, .. } = part;
        let integers = matches!(hdu.kind, HduKind::Image { bitpix, .. } if bitpix > 0);
        let quantum_e = if integers { gain_e_per_dn.max(1.0) } else { 1.0 };
        let source = self.bias(&part)?;
        let bias = source.measure(&geometry, part_dn, quantum_e / gain_e_per_dn).ok_or_else(|| {
            let problem = format!("no bias is known: the frame has no pixels for the {}", source.words());
            InputError::new(hdu.to_string(), problem).with_help("give --bias-dn, or the sizes of overscan and prescan")
        })?;
        let saturated_dn = part.saturated_dn.unwrap_or(f64::INFINITY);
        let charge = |row: usize, value: f64| {
            let holds = value.is_finite() && value < saturated_dn;
            if holds { (value - bias.dn_in(row)) * gain_e_per_dn } else { f64::NAN }
        };
        let charge_e = Array2::from_shape_fn(part_dn.dim(), |(row, column)| charge(row, part_dn[[row, column]]));
        let (rows, columns) = geometry.image(part_dn.dim());
        let about = About {
            number,
            file: file.to_string(),
            hdu: hdu.index,
            amplifier: part.number,
            amplifier_name: part.name,
            gain_e_per_dn,
            quantum_e,
            bias,
            when: known.when,
            temperature_k: known.temperature_k,
            line_time_ms: known.line_time_ms,
            phase_time_ms: known.phase_time_ms,
            cycles: known.cycles,
            geometry,
            missing_px: charge_e.iter().filter(|charge| charge.is_nan()).count(),
            fingerprint: fingerprint(&charge_e),
        };
        Ok(Exposure { about, charge_e, columns, rows: rows.end })
    }
}

/// A number that differs between frames with different charges.
fn fingerprint(charge_e: &Array2<f64>) -> u64 {
    let mut hasher = DefaultHasher::new();
    charge_e.iter().for_each(|charge| charge.to_bits().hash(&mut hasher));
    hasher.finish()
}

/// The time under a keyword; None if there is no such keyword.
fn moment(keyword: &str, hdu: &Hdu, primary: &Hdu) -> Option<Result<When, InputError>> {
    let of_keyword = |keyword: &str| match hdu.read(keyword) {
        Ok(None) => primary.read(keyword),
        found => found,
    };
    let found = match of_keyword(keyword) {
        Ok(None | Some(Value::Undefined)) => return None,
        Ok(Some(Value::String(text))) => {
            // Older headers have the time of day apart.
            let apart = keyword == "DATE-OBS" && !text.contains('T');
            let time = match if apart { of_keyword("TIME-OBS") } else { Ok(None) } {
                Ok(Some(Value::String(time))) => Some(time.trim()),
                Ok(_) => None,
                Err(error) => return Some(Err(error)),
            };
            let day = day_month_year(text).unwrap_or_else(|| text.trim().to_string());
            let whole = time.and_then(|time| date(&format!("{day}T{time}")));
            (whole.or_else(|| date(&day)), format!("'{text}'"))
        }
        Ok(Some(_)) => match number_of(keyword, hdu, primary, "give --date instead") {
            Ok(days) => (day_of(days), days.to_string()),
            Err(error) => return Some(Err(error)),
        },
        Err(error) => return Some(Err(error)),
    };
    let (date, said) = found;
    Some(date.map(When::Date).ok_or_else(|| {
        InputError::new(
            hdu.to_string(),
            format!(
                "{keyword} = {said} is not a date as FITS writes it, 2030-06-01T12:00:00, 31/12/99 or a (modified) Julian date, \
                 of {} to {}",
                YEARS.start(),
                YEARS.end()
            ),
        )
        .with_help("give --date, or another keyword with --date-keyword")
    }))
}

/// Years in which frames are taken: from the first CCDs, which are of 1969, to long after any mission that is planned.
const YEARS: std::ops::RangeInclusive<i32> = 1969..=2200;

/// Julian date of the day 0 of modified ones.
const FIRST_MJD: f64 = 2_400_000.5;

/// The date of a Julian date, or a modified one: no day of [`YEARS`] has the same number in both.
fn day_of(days: f64) -> Option<NaiveDateTime> {
    let mjd = if days > FIRST_MJD { days - FIRST_MJD } else { days };
    let time = Time { format: "mjd".into(), scale: "utc".into() };
    Cell::Number(mjd).moment(Some(&time)).ok().filter(in_years)
}

/// A day as FITS had it before 2000, `DD/MM/YY` of 19YY, in the notation since then.
fn day_month_year(text: &str) -> Option<String> {
    let parts: Vec<&str> = text.trim().split('/').collect();
    let [day, month, year] = parts[..] else { return None };
    let digits = |part: &str| part.len() == 2 && part.bytes().all(|digit| digit.is_ascii_digit());
    [day, month, year].into_iter().all(digits).then(|| format!("19{year}-{month}-{day}"))
}

fn in_years(date: &NaiveDateTime) -> bool {
    YEARS.contains(&date.year())
}
