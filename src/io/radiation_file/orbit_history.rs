//! Orbits that change: elements at dates, as ECSV or CSV.

use std::path::Path;

use super::columns::Columns;
use super::dose_history::{self, Times};
use super::text::Source;
use crate::error::InputError;
use crate::io::table::Cell;

/// Elements of an orbit around the Earth at a date.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElementsRow {
    /// Lowest altitude above a sphere of 6371 km, km.
    pub perigee_km: f64,
    /// Highest altitude, km.
    pub apogee_km: f64,
    /// Inclination, degrees.
    pub inclination_deg: f64,
    /// Argument of perigee, degrees; None: uniformly distributed.
    pub argument_of_perigee_deg: Option<f64>,
}

/// An orbit as in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct OrbitHistoryFile {
    /// Times, row by row, ascending.
    pub times: Times,
    /// The elements at each of them.
    pub elements: Vec<ElementsRow>,
}

/// Reads the elements of an orbit from ECSV or CSV with the columns `t_yr` (years since launch) or `date`, `perigee_km` and
/// `apogee_km` (within the allowed range, km), `inclination_deg`, and where it is held `argument_of_perigee_deg`.
///
/// # Errors
/// If the file cannot be read or is not such a table: one message with file, line, column and value.
pub fn read_orbit_history(path: impl AsRef<Path>, allowed_km: [f64; 2]) -> Result<OrbitHistoryFile, InputError> {
    let source = Source::read(path.as_ref(), "orbit")?;
    let columns = Columns::of(&source)?;
    let times = dose_history::times(&columns)?;
    let perigees = altitudes(&columns, "perigee_km", allowed_km)?;
    let apogees = altitudes(&columns, "apogee_km", allowed_km)?;
    if let Some(row) = (0..perigees.len()).find(|row| perigees[*row] > apogees[*row]) {
        let problem = format!("this must not be above the apogee, {} km", apogees[row]);
        return Err(columns.fault(Some(row), "perigee_km", problem));
    }
    let inclinations = degrees(&columns, "inclination_deg", [0.0, 180.0])?;
    let inclinations = inclinations.ok_or_else(|| columns.absent(&["inclination_deg"]))?;
    let arguments = degrees(&columns, "argument_of_perigee_deg", [-360.0, 360.0])?;
    let elements = (0..perigees.len()).map(|row| ElementsRow {
        perigee_km: perigees[row],
        apogee_km: apogees[row],
        inclination_deg: inclinations[row],
        argument_of_perigee_deg: arguments.as_ref().map(|arguments| arguments[row]),
    });
    Ok(OrbitHistoryFile { times, elements: elements.collect() })
}

fn altitudes(columns: &Columns, name: &'static str, [least, greatest]: [f64; 2]) -> Result<Vec<f64>, InputError> {
    let altitudes = columns.numbers(name, "km")?;
    match altitudes.iter().position(|km| !(least..=greatest).contains(km)) {
        Some(row) => {
            Err(columns.fault(Some(row), name, format!("allowed: {least} to {greatest} km above the surface")))
        }
        None => Ok(altitudes),
    }
}

/// A column of angles; None if there is none.
fn degrees(columns: &Columns, name: &str, [least, greatest]: [f64; 2]) -> Result<Option<Vec<f64>>, InputError> {
    let Some(column) = columns.table().column(name) else { return Ok(None) };
    let conversion = columns.conversion(name, &["deg"])?;
    let angle = |(row, cell): (usize, &Cell)| match cell.number().map(|angle| conversion.apply(angle)) {
        Some(angle) if (least..=greatest).contains(&angle) => Ok(angle),
        _ => Err(columns.fault(Some(row), name, format!("allowed: {least} to {greatest} degrees"))),
    };
    column.cells.iter().enumerate().map(angle).collect::<Result<_, _>>().map(Some)
}
