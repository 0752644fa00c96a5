//! Dose-depth curves: displacement damage dose against the shielding in front.
//!
//! Other programs usually write another dose against depth: the ionising one in rad (SHIELDOSE-2 in SPENVIS 4.6.11, `Dose` in
//! `rad`; the `.dos` of OMERE 5.9, columns in `rad`), or equivalent fluences (OMERE 5.9, `.fle`). Neither can be converted to
//! displacement damage dose, so both are rejected with the reason.

use std::path::Path;

use super::columns::Columns;
use super::text::Source;
use super::{Depths, Doses, omere, spenvis};
use crate::error::InputError;
use crate::io::unit::IONISING;

/// A dose-depth curve as in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseDepth {
    /// The shielding, row by row, ascending; at least two.
    pub depths: Depths,
    /// The dose over the mission, or the dose rate; as many as depths.
    pub doses: Doses,
}

/// The possible names of the dose column.
const DOSES: [&str; 2] = ["dose_mev_g", "dose_mev_g_yr"];

/// Reads a dose-depth curve from ECSV or CSV with the columns `thickness_mm` or `areal_density_g_cm2`, and `dose_mev_g`
/// (displacement damage dose over the mission, MeV/g) or `dose_mev_g_yr` (MeV/g/yr). Units in a header are converted.
///
/// # Errors
/// If the file cannot be read or is not such a table, or its dose is ionising: one message with file, line, column and value.
pub fn read_dose_depth(path: impl AsRef<Path>) -> Result<DoseDepth, InputError> {
    let source = Source::read(path.as_ref(), "dose-depth curve")?;
    if spenvis::is_spenvis(&source.text) || omere::is_omere(&source.text) {
        return Err(of_a_program(&source));
    }
    let columns = Columns::of(&source)?;
    if let Some(error) = ionising(&columns) {
        return Err(error);
    }
    columns.check_two_rows()?;
    let depths = columns.depths()?;
    let name = if matches!(depths, Depths::ThicknessMm(_)) { "thickness_mm" } else { "areal_density_g_cm2" };
    columns.check_rising(name, depths.values())?;
    let doses = columns.doses(DOSES[0], DOSES[1])?;
    Ok(DoseDepth { depths, doses })
}

const NOT_DISPLACEMENT: &str = "this is ionising dose, not displacement damage dose";
const ADVICE: &str = "displacement damage dose is in MeV/g: columns thickness_mm,dose_mev_g";

/// Why the output of a program is not a dose-depth curve of displacement damage.
fn of_a_program(source: &Source) -> InputError {
    let is_ionising = |unit: &str| IONISING.contains(&unit.to_lowercase().as_str());
    let stated = |line: &str| match line.strip_prefix('#') {
        Some(comment) => comment.split_whitespace().any(|word| is_ionising(word.trim_matches(['(', ')', '[', ']']))),
        // 'Dose','rad', 5,'Dose in Si'
        None => line.split(',').nth(1).is_some_and(|unit| is_ionising(unit.trim_matches([' ', '\'']))),
    };
    match source.text.lines().position(stated) {
        Some(index) => source.refuse_line(index + 1, NOT_DISPLACEMENT).with_help(ADVICE),
        None => source
            .refuse("no dose-depth curve is read from outputs of SPENVIS and OMERE")
            .with_help("write depth and displacement damage dose as a table: columns thickness_mm,dose_mev_g"),
    }
}

/// An error for a table whose columns, by names or units, contain only ionising dose.
fn ionising(columns: &Columns) -> Option<InputError> {
    let is_ionising = |name: &str| words(name).any(|word| IONISING.contains(&word.as_str()) || word == "tid");
    if let Some(name) = columns.present(&DOSES).first() {
        let unit = columns.table().column(name)?.unit.as_ref()?;
        return is_ionising(unit).then(|| columns.fault(None, name, NOT_DISPLACEMENT).with_help(ADVICE));
    }
    let found = columns
        .table()
        .columns
        .iter()
        .find(|column| is_ionising(&column.name) || column.unit.as_deref().is_some_and(is_ionising))?;
    Some(columns.fault(None, &found.name, NOT_DISPLACEMENT).with_help(ADVICE))
}

/// The words of a line in lower case.
fn words(line: &str) -> impl Iterator<Item = String> {
    line.split(|letter: char| !letter.is_alphabetic()).map(str::to_lowercase)
}
