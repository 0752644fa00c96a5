//! Temperature histories: the temperature of a detector against time, as ECSV or CSV.

use std::path::Path;

use super::columns::Columns;
use super::dose_history::{self, Times};
use super::text::Source;
use crate::error::InputError;
use crate::io::table::Cell;

/// A temperature history as in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureHistoryFile {
    /// Start times, row by row, ascending; at least one.
    pub times: Times,
    /// The temperature from then on, K; as many as times.
    pub temperatures_k: Vec<f64>,
}

/// The column of temperatures.
const COLUMN: &str = "temperature_k";

/// Reads a temperature history from ECSV or CSV with the columns `t_yr` (years since launch) or `date`, and `temperature_k` (K, or
/// degrees Celsius if stated in the header), all within the allowed range, K.
///
/// # Errors
/// If the file cannot be read or is not such a table: one message with file, line, column and value.
pub fn read_temperature_history(
    path: impl AsRef<Path>,
    allowed_k: [f64; 2],
) -> Result<TemperatureHistoryFile, InputError> {
    let source = Source::read(path.as_ref(), "temperature history")?;
    let columns = Columns::of(&source)?;
    let times = dose_history::times(&columns)?;
    Ok(TemperatureHistoryFile { times, temperatures_k: temperatures_k(&columns, allowed_k)? })
}

fn temperatures_k(columns: &Columns, [coldest_k, warmest_k]: [f64; 2]) -> Result<Vec<f64>, InputError> {
    let column = columns.table().column(COLUMN).ok_or_else(|| columns.absent(&[COLUMN]))?;
    let conversion = columns.conversion(COLUMN, &["K"])?;
    let kelvin = |(row, cell): (usize, &Cell)| {
        let fault = |problem: String| columns.fault(Some(row), COLUMN, problem);
        let number = cell.number().ok_or_else(|| fault("a number is needed here".into()))?;
        let kelvin = conversion.apply(number);
        if (coldest_k..=warmest_k).contains(&kelvin) {
            return Ok(kelvin);
        }
        let refusal = fault(format!("allowed: {coldest_k} to {warmest_k} K"));
        Err(if number < 0.0 { refusal.with_help("degrees Celsius need the unit deg_C in the header") } else { refusal })
    };
    column.cells.iter().enumerate().map(kelvin).collect()
}
