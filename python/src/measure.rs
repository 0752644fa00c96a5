//! Frames → tables of measurements.

use std::path::PathBuf;

use ctiplan::error::InputError;
use ctiplan::image::{AmplifierTable, Unit};
use ctiplan::measure::bias::BiasSource;
use ctiplan::measure::exposure::{FrameArray, Frames, Reading, Source, WhenSource, date};
use ctiplan::measure::{Measured, dipoles, eper, injection, trails};
use ctiplan::report::{Format, MeasureReport, Report};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::detector::Layout;
use crate::work;

/// A frame: in a file, or as name, values, and whether these were whole numbers.
#[derive(FromPyObject)]
pub enum Given<'py> {
    /// In a file.
    File(PathBuf),
    /// In memory.
    Array((String, PyReadonlyArray2<'py, f64>, bool)),
}

/// What headers do not tell.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Told {
    amplifiers: Option<PathBuf>,
    gain: Option<f64>,
    gain_keyword: Option<String>,
    saturated_dn: Option<f64>,
    bias: Option<f64>,
    bias_from: Option<String>,
    dq_bad: Option<u32>,
    date: Option<String>,
    t_yr: Option<f64>,
    dose_mev_g: Option<f64>,
    temperature_k: Option<f64>,
    line_time_ms: Option<f64>,
    phase_time_ms: Option<f64>,
    pumping_cycles: Option<f64>,
}

/// The way of measuring, and its options.
#[derive(FromPyObject)]
pub enum Way {
    /// Edges of flat fields.
    #[pyo3(annotation = "eper")]
    Eper(Edges),
    /// Blocks of injected charge.
    #[pyo3(annotation = "injection")]
    Injection(Injected),
    /// Trails of warm pixels.
    #[pyo3(annotation = "trails")]
    Trails(Warm),
    /// Dipoles of trap pumping.
    #[pyo3(annotation = "dipoles")]
    Dipoles(Pumped),
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Injected {
    pattern: Option<(usize, usize, usize)>,
    injection_trail_px: Option<usize>,
    level_rows: Option<usize>,
    column_groups: usize,
    in_front: bool,
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Edges {
    eper_trail_px: Option<usize>,
    level_rows: Option<usize>,
    column_groups: usize,
    cti_px: Vec<(usize, usize)>,
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Warm {
    trail_px: usize,
    threshold_e: f64,
    bins_per_decade: usize,
    transfer_bins: usize,
    fewest_px: usize,
    epoch_days: f64,
    signal_as_read: bool,
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Pumped {
    threshold_sigma: f64,
    found_in: usize,
    species: Option<String>,
}

/// Tables (observable, text of an ECSV file), the report as text, and as JSON.
type Answer = (Vec<(String, String)>, String, String);

/// Measures frames.
#[pyfunction]
pub fn measure(
    py: Python<'_>,
    frames: Vec<Given<'_>>,
    layout: Layout,
    told: Told,
    way: Way,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Answer> {
    let (mut files, mut arrays) = (Vec::new(), Vec::new());
    for frame in frames {
        match frame {
            Given::File(path) => files.push(path),
            Given::Array((name, values, integers)) => {
                arrays.push(FrameArray { name, values_dn: values.as_array().to_owned(), integers });
            }
        }
    }
    work::run(py, progress, |watch| {
        watch.stage("frames", (files.len() + arrays.len()) as u64);
        let measured = way.measure(&Frames { files, arrays, reading: told.reading(&layout)? }, &|_| watch.advance())?;
        let named = |(observable, table): &(ctiplan::physics::observable::Observable, ctiplan::io::table::Table)| {
            (observable.name().to_string(), table.to_ecsv())
        };
        let tables = measured.tables.iter().map(named).collect();
        let report = MeasureReport { measured, files: Vec::new() };
        Ok((tables, report.render(Format::Text), report.render(Format::Json)))
    })
}

impl Told {
    fn reading(&self, layout: &Layout) -> Result<Reading, InputError> {
        let given = |value: Option<f64>| value.map_or(Source::Mission, Source::Given);
        let above_0 = [
            ("gain", self.gain),
            ("temperature_k", self.temperature_k),
            ("line_time_ms", self.line_time_ms),
            ("phase_time_ms", self.phase_time_ms),
            ("pumping_cycles", self.pumping_cycles),
        ];
        for (name, value) in above_0 {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return Err(InputError::new(format!("cannot use {name} = {value}"), "a number above 0 is needed"));
            }
        }
        Ok(Reading {
            amplifiers: self.amplifiers.as_ref().map(AmplifierTable::read).transpose()?,
            unit: Unit {
                gain_e_per_dn: self.gain,
                gain_keyword: self.gain_keyword.clone(),
                saturated_dn: self.saturated_dn,
                ..Unit::default()
            },
            bias: self.bias()?,
            dq_bad: self.dq_bad,
            geometry: layout.geometry()?,
            when: self.when()?,
            temperature_k: given(self.temperature_k),
            line_time_ms: given(self.line_time_ms),
            phase_time_ms: given(self.phase_time_ms),
            cycles: given(self.pumping_cycles),
            ..Reading::default()
        })
    }

    fn bias(&self) -> Result<Option<BiasSource>, InputError> {
        Ok(match (self.bias, self.bias_from.as_deref()) {
            (Some(bias), _) => Some(BiasSource::Given(bias)),
            (None, None) => None,
            (None, Some("columns")) => Some(BiasSource::OverscanColumns),
            (None, Some("prescan")) => Some(BiasSource::Prescan),
            (None, Some("rows")) => Some(BiasSource::OverscanRows),
            (None, Some(other)) => {
                let problem = "allowed: columns, prescan, rows, or None";
                return Err(InputError::new(format!("cannot use bias_from = \"{other}\""), problem));
            }
        })
    }

    fn when(&self) -> Result<WhenSource, InputError> {
        let on = |text: &String| {
            date(text).ok_or_else(|| {
                InputError::new(
                    format!("cannot use date = \"{text}\""),
                    "a date is needed, such as 2030-06-01T12:00:00",
                )
            })
        };
        Ok(match (&self.date, self.dose_mev_g, self.t_yr) {
            (Some(text), ..) => WhenSource::Date(on(text)?),
            (None, Some(dose_mev_g), t_yr) => WhenSource::Dose(Source::Given(dose_mev_g), t_yr),
            (None, None, Some(t_yr)) => WhenSource::Since(t_yr),
            (None, None, None) => WhenSource::Header,
        })
    }
}

impl Way {
    fn measure(self, frames: &Frames, progress: &dyn Fn(usize)) -> Result<Measured, InputError> {
        match self {
            Way::Eper(Edges { eper_trail_px, level_rows, column_groups, cti_px }) => {
                let (trail_px, groups, cti_px) = (eper_trail_px, column_groups, Some(cti_px));
                eper::Eper { trail_px, level_rows, groups, first_pixel: true, cti_px }.measure(frames, progress)
            }
            Way::Trails(warm) => {
                let way = trails::Trails {
                    trail_px: warm.trail_px,
                    threshold_e: warm.threshold_e,
                    bins_per_decade: warm.bins_per_decade,
                    transfer_bins: warm.transfer_bins,
                    fewest: warm.fewest_px,
                    epoch_days: warm.epoch_days,
                    signal_as_read: warm.signal_as_read,
                };
                way.measure(frames, progress)
            }
            Way::Injection(Injected { pattern, injection_trail_px, level_rows, column_groups, in_front }) => {
                let blocks = |(first_row, block_px, period_px)| injection::Pattern { first_row, block_px, period_px };
                let (trail_px, groups, pattern) = (injection_trail_px, column_groups, pattern.map(blocks));
                injection::Injection { pattern, trail_px, level_rows, groups, in_front, first_pixel: true }
                    .measure(frames, progress)
            }
            Way::Dipoles(Pumped { threshold_sigma, found_in, species }) => {
                dipoles::Dipoles { threshold_sigma, found_in, species }.measure(frames, progress)
            }
        }
    }
}
