//! Dose histories: displacement damage dose against time, as ECSV or CSV.

use std::path::Path;

use chrono::NaiveDateTime;

use super::Doses;
use super::columns::Columns;
use super::text::Source;
use crate::error::InputError;
use crate::io::table::{Cell, NotADate};

/// A dose history as in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseHistoryFile {
    /// Times, row by row, ascending; at least two.
    pub times: Times,
    /// The dose since launch, which never decreases, or the dose rate; as many as times.
    pub doses: Doses,
}

/// Times, ascending.
#[derive(Clone, Debug, PartialEq)]
pub enum Times {
    /// Years of 365.25 d since launch; not negative.
    SinceLaunchYr(Vec<f64>),
    /// Dates, with the time of day if given.
    Dates(Vec<NaiveDateTime>),
}

impl Times {
    /// The number of rows.
    pub fn rows(&self) -> usize {
        match self {
            Times::SinceLaunchYr(years) => years.len(),
            Times::Dates(dates) => dates.len(),
        }
    }
}

/// Reads a dose history from ECSV or CSV with the columns `t_yr` (years since launch) or `date`, and `dose_mev_g` (the dose since
/// launch, MeV/g) or `rate_mev_g_yr` (MeV/g/yr). Units in a header are converted.
///
/// # Errors
/// If the file cannot be read or is not such a table: one message with file, line, column and value.
pub fn read_dose_history(path: impl AsRef<Path>) -> Result<DoseHistoryFile, InputError> {
    let source = Source::read(path.as_ref(), "dose history")?;
    let columns = Columns::of(&source)?;
    columns.check_two_rows()?;
    let times = times(&columns)?;
    let doses = columns.doses("dose_mev_g", "rate_mev_g_yr")?;
    if let Doses::Total(totals) = &doses {
        columns.check_not_falling("dose_mev_g", totals)?;
    }
    Ok(DoseHistoryFile { times, doses })
}

/// Times, row by row: the column `t_yr` or `date`.
pub(super) fn times(columns: &Columns) -> Result<Times, InputError> {
    if columns.one_of(&["t_yr", "date"])? == "t_yr" {
        let years = columns.numbers("t_yr", "yr")?;
        columns.check_rising("t_yr", &years)?;
        return Ok(Times::SinceLaunchYr(years));
    }
    Ok(Times::Dates(rising_dates(columns, "date")?))
}

/// Dates, row by row, each after the one before.
pub(super) fn rising_dates(columns: &Columns, name: &str) -> Result<Vec<NaiveDateTime>, InputError> {
    let dates = dates(columns, name)?;
    columns.check_rising(name, &dates)?;
    Ok(dates)
}

/// Dates, row by row.
pub(super) fn dates(columns: &Columns, name: &str) -> Result<Vec<NaiveDateTime>, InputError> {
    let column = columns.table().column(name).ok_or_else(|| columns.absent(&[name]))?;
    let date = |(row, cell): (usize, &Cell)| {
        cell.moment(column.time.as_ref())
            .map_err(|NotADate { problem, help }| columns.fault(Some(row), name, problem).with_help(help))
    };
    column.cells.iter().enumerate().map(date).collect()
}
