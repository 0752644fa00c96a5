//! Proton spectra: detection of the program, and common properties.

use std::path::Path;

use super::columns::Columns;
use super::text::Source;
use super::{creme, omere, spenvis};
use crate::error::InputError;

/// A spectrum of protons before any shielding of ours: omnidirectional, cm-2.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectrumFile {
    /// The program that wrote it.
    pub program: Program,
    /// The quantity.
    pub quantity: Quantity,
    /// The time over which the values are summed.
    pub time: Time,
    /// The duration of the mission in the file, in s, if stated.
    pub duration_s: Option<f64>,
    /// The shield stated in the file, such as `ALUMINUM`. None if not stated: then it is unshielded.
    pub shield: Option<String>,
    /// Energies in MeV, positive, ascending; at least two.
    pub energies_mev: Vec<f64>,
    /// One for each energy, not negative: cm-2, cm-2 MeV-1, cm-2 s-1 or cm-2 s-1 MeV-1. Integral ones never rise with energy.
    pub values: Vec<f64>,
}

/// Programs that write spectra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// SPENVIS of ESA and BIRA-IASB.
    Spenvis,
    /// OMERE of TRAD and CNES.
    Omere,
    /// CREME96 of NRL and CREME-MC of Vanderbilt University.
    Creme,
    /// Any, as ECSV or CSV.
    Table,
}

impl Program {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Program::Spenvis => "SPENVIS",
            Program::Omere => "OMERE",
            Program::Creme => "CREME",
            Program::Table => "table",
        }
    }
}

/// The quantity of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// All protons above the energy.
    Integral,
    /// The protons per MeV at the energy.
    Differential,
}

/// The time over which the values of a spectrum are summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Time {
    /// The whole mission: a fluence.
    Mission,
    /// One second: a flux, the mean over the mission.
    PerSecond,
}

/// One point of a spectrum, and its line.
pub(super) struct Point {
    pub energy_mev: f64,
    /// In the unit of the file.
    pub value: f64,
    /// The line in the file, from 1.
    pub line: usize,
}

/// Reads a proton spectrum of SPENVIS, OMERE or CREME, or an ECSV or CSV table with the columns `energy_mev` and
/// `integral_cm2` or `differential_cm2_mev` (fluences of the mission), or `integral_cm2_s` or `differential_cm2_s_mev`
/// (fluxes), whose `meta` may have `duration_yr`. If there are both, the integral column is read.
///
/// # Errors
/// If the file cannot be read or contains no such spectrum: one message with file, line, column and value.
pub fn read_spectrum(path: impl AsRef<Path>) -> Result<SpectrumFile, InputError> {
    let source = Source::read(path.as_ref(), "spectrum")?;
    if spenvis::is_spenvis(&source.text) {
        spenvis::read(&source)
    } else if omere::is_omere(&source.text) {
        omere::read(&source)
    } else if creme::is_creme(&source.text) {
        creme::read(&source)
    } else {
        of_table(&source)
    }
}

/// The possible columns of a table, the preferred ones first.
const COLUMNS: [(&str, &str, Quantity, Time); 4] = [
    ("integral_cm2", "cm-2", Quantity::Integral, Time::Mission),
    ("integral_cm2_s", "cm-2 s-1", Quantity::Integral, Time::PerSecond),
    ("differential_cm2_mev", "cm-2 MeV-1", Quantity::Differential, Time::Mission),
    ("differential_cm2_s_mev", "cm-2 s-1 MeV-1", Quantity::Differential, Time::PerSecond),
];

fn of_table(source: &Source) -> Result<SpectrumFile, InputError> {
    let columns = Columns::of(source)?;
    let energies = columns.numbers("energy_mev", "MeV")?;
    let names = COLUMNS.map(|(name, ..)| name);
    let present = columns.present(&names);
    // Fluences and fluxes together are contradictory or ambiguous for the mission.
    let has = |time: Time| COLUMNS.iter().any(|column| column.3 == time && present.contains(&column.0));
    if has(Time::Mission) && has(Time::PerSecond) {
        let problem = format!("columns {} are fluences and fluxes, and only one of the two can be", present.join(", "));
        return Err(source.refuse(problem).with_help("give fluences of the mission (cm-2), or fluxes (cm-2 s-1)"));
    }
    let &name = present.first().ok_or_else(|| columns.absent(&names))?;
    let (_, unit, quantity, time) = COLUMNS.into_iter().find(|column| column.0 == name).expect("one of them");
    let values = columns.fluxes(name, unit)?;
    let lines = &columns.table().lines;
    let points = energies.into_iter().zip(values).zip(lines);
    let points = points.map(|((energy_mev, value), &line)| Point { energy_mev, value, line }).collect();
    let duration_s = match columns.table().meta("duration_yr").map(|cell| cell.number()) {
        None => None,
        Some(Some(years)) if years > 0.0 && years.is_finite() => Some(years * crate::io::unit::YEAR_S),
        Some(_) => {
            return Err(columns.fault(None, "meta.duration_yr", "the duration must be a positive number of years"));
        }
    };
    Spectrum { program: Program::Table, quantity, time, duration_s, shield: None, factor: 1.0, points }
        .checked(source, name)
}

/// A spectrum before it is checked.
pub(super) struct Spectrum {
    pub program: Program,
    pub quantity: Quantity,
    pub time: Time,
    pub duration_s: Option<f64>,
    pub shield: Option<String>,
    /// The conversion of the values to omnidirectional ones in our unit.
    pub factor: f64,
    pub points: Vec<Point>,
}

impl Spectrum {
    /// The checked spectrum: energies positive and ascending, values not negative, integral ones not rising. `column` is the file's
    /// name of the values.
    pub fn checked(self, source: &Source, column: &str) -> Result<SpectrumFile, InputError> {
        let at = |point: &Point, column: &str, value: f64, problem: &str| {
            source.refuse_value(point.line, column, &format!("{value:?}"), problem)
        };
        if self.points.len() < 2 {
            return Err(source.refuse(format!("a spectrum needs at least two energies, not {}", self.points.len())));
        }
        for point in &self.points {
            if !(point.energy_mev > 0.0 && point.energy_mev.is_finite()) {
                return Err(at(point, "energy", point.energy_mev, "an energy must be positive, in MeV"));
            }
            if !(point.value >= 0.0 && point.value.is_finite()) {
                return Err(at(point, column, point.value, "this must be a number that is not negative"));
            }
        }
        for pair in self.points.windows(2) {
            if pair[0].energy_mev >= pair[1].energy_mev {
                let problem = format!("energies must rise, and the one before is {:?} MeV", pair[0].energy_mev);
                return Err(at(&pair[1], "energy", pair[1].energy_mev, &problem));
            }
            if self.quantity == Quantity::Integral && pair[0].value < pair[1].value {
                let problem = "an integral spectrum, of all protons above an energy, must not rise with the energy";
                return Err(at(&pair[1], column, pair[1].value, problem));
            }
        }
        Ok(SpectrumFile {
            program: self.program,
            quantity: self.quantity,
            time: self.time,
            duration_s: self.duration_s,
            shield: self.shield,
            energies_mev: self.points.iter().map(|point| point.energy_mev).collect(),
            values: self.points.iter().map(|point| self.factor * point.value).collect(),
        })
    }
}
