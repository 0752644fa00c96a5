//! Solar proton events, as ECSV: fluences above energies, and the time that was observed.

use std::path::Path;

use chrono::NaiveDateTime;

use super::columns::Columns;
use super::dose_history::{dates, rising_dates};
use super::text::Source;
use crate::error::InputError;
use crate::io::table::{Cell, NotADate};

/// A file of solar proton events.
#[derive(Clone, Debug, PartialEq)]
pub struct SolarEventsFile {
    /// Start of the observations; None if the file continues the record of the program.
    pub observed_from: Option<NaiveDateTime>,
    /// End of the observations.
    pub observed_to: NaiveDateTime,
    /// Times without good data: start and end, in order.
    pub gaps: Vec<(NaiveDateTime, NaiveDateTime)>,
    /// Events, row by row, in order.
    pub events: Vec<SolarEventRow>,
}

/// An event.
#[derive(Clone, Debug, PartialEq)]
pub struct SolarEventRow {
    /// Its start.
    pub start: NaiveDateTime,
    /// Its end.
    pub end: NaiveDateTime,
    /// The satellite, whose calibration error is common to its events.
    pub satellite: String,
    /// Energy (MeV, ascending) and omnidirectional fluence above it, cm⁻²; at least two.
    pub above_cm2: Vec<(f64, f64)>,
}

/// Reads events from ECSV: columns `start`, `end`, `satellite`, and at least two of `above_10_mev_cm2` with any energies; in the
/// header's `meta`, `observed_to`, and where needed `observed_from` and `gaps` (`2003-12-01/2003-12-10`, blank between several).
///
/// # Errors
/// If the file cannot be read or is not such a table: one message with file, line, column and value.
pub fn read_solar_events(path: impl AsRef<Path>) -> Result<SolarEventsFile, InputError> {
    events(&Source::read(path.as_ref(), "solar events")?)
}

/// The same for a text with a name.
pub(crate) fn parse_solar_events(name: &str, text: &str) -> Result<SolarEventsFile, InputError> {
    events(&Source::of(name, text, "solar events"))
}

fn events(source: &Source) -> Result<SolarEventsFile, InputError> {
    let columns = Columns::of(source)?;
    let energies = energies(source, &columns)?;
    let (starts, ends) = (rising_dates(&columns, "start")?, dates(&columns, "end")?);
    let satellites = columns.table().column("satellite").ok_or_else(|| columns.absent(&["satellite"]))?;
    let observed_from = meta(source, &columns, "observed_from")?;
    let observed_to = meta(source, &columns, "observed_to")?.ok_or_else(|| {
        source
            .refuse("meta has no observed_to: the end of the observations, after which the Sun is drawn")
            .with_help("write observed_to: '2025-12-31' in the header's meta")
    })?;
    let row = |row: usize| {
        let fault = |column: &str, problem: String| Err(columns.fault(Some(row), column, problem));
        if ends[row] <= starts[row] {
            return fault("end", format!("this is not after the start, {}", starts[row]));
        }
        if ends[row] > observed_to {
            return fault("end", format!("this is after the end of the observations, {observed_to}"));
        }
        if observed_from.is_some_and(|from| starts[row] < from) {
            return fault("start", "this is before the start of the observations".into());
        }
        let above_cm2 = fluences(&columns, &energies, row)?;
        if above_cm2.len() < 2 {
            return fault(&energies[0].column, "an event needs its fluence above two energies at least".into());
        }
        let satellite = satellites.cells[row].text().unwrap_or("unknown").to_string();
        Ok(SolarEventRow { start: starts[row], end: ends[row], satellite, above_cm2 })
    };
    let events = (0..columns.table().rows()).map(row).collect::<Result<Vec<_>, _>>()?;
    Ok(SolarEventsFile { observed_from, observed_to, gaps: gaps(source, &columns)?, events })
}

/// A column of fluences above an energy.
struct Above {
    column: String,
    mev: f64,
    /// From the unit in its header to cm⁻².
    factor: f64,
}

/// Columns of fluences, by energy.
fn energies(source: &Source, columns: &Columns) -> Result<Vec<Above>, InputError> {
    let number = |text: &str| text.parse::<f64>().ok().filter(|mev| mev.is_finite());
    let energy = |name: &str| number(name.strip_prefix("above_")?.strip_suffix("_mev_cm2")?);
    let named = columns.table().columns.iter().filter_map(|column| Some((column.name.clone(), energy(&column.name)?)));
    let above = |(column, mev): (String, f64)| Ok(Above { factor: columns.flux_factor(&column, "cm-2")?, column, mev });
    let mut energies = named.map(above).collect::<Result<Vec<_>, InputError>>()?;
    energies.sort_by(|a, b| a.mev.total_cmp(&b.mev));
    if energies.len() < 2 || energies[0].mev <= 0.0 {
        let problem = "fluences above two energies at least are needed";
        return Err(source.refuse(problem).with_help("name their columns above_10_mev_cm2, above_100_mev_cm2"));
    }
    Ok(energies)
}

/// Fluences of a row, in cm⁻²; without those that are missing.
fn fluences(columns: &Columns, energies: &[Above], row: usize) -> Result<Vec<(f64, f64)>, InputError> {
    let fluence = |Above { column, mev, factor }: &Above| {
        let cell = &columns.table().column(column)?.cells[row];
        let fault = |problem: &str| Err(columns.fault(Some(row), column, problem));
        Some(match cell {
            Cell::Missing => return None,
            cell => match cell.number().filter(|number| number.is_finite()) {
                Some(number) if number < 0.0 => fault("this must not be negative"),
                Some(number) => Ok((*mev, factor * number)),
                None => fault("a number is needed here"),
            },
        })
    };
    energies.iter().filter_map(fluence).collect()
}

/// A date of `meta`; None if it is absent.
fn meta(source: &Source, columns: &Columns, name: &str) -> Result<Option<NaiveDateTime>, InputError> {
    let Some(cell) = columns.table().meta(name) else { return Ok(None) };
    match cell.moment(None) {
        Ok(moment) => Ok(Some(moment)),
        Err(NotADate { problem, .. }) => {
            Err(source.refuse(format!("meta.{name}: {problem}")).with_help("write it in quotes: '2025-12-31'"))
        }
    }
}

fn gaps(source: &Source, columns: &Columns) -> Result<Vec<(NaiveDateTime, NaiveDateTime)>, InputError> {
    let Some(cell) = columns.table().meta("gaps") else { return Ok(Vec::new()) };
    let moment = |text: &str| Cell::Text(text.to_string()).moment(None).ok();
    let gap = |word: &str| {
        let (from, to) = word.split_once('/')?;
        Some((moment(from)?, moment(to)?)).filter(|(from, to)| from < to)
    };
    let words = cell.text().unwrap_or("").split_whitespace().map(gap).collect::<Option<Vec<_>>>();
    words.filter(|gaps| !gaps.is_empty()).ok_or_else(|| {
        source
            .refuse("meta.gaps is not a list of times")
            .with_help("write gaps: '2003-12-01/2003-12-10 2024-06-23/2024-06-26'")
    })
}
