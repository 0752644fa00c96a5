//! Tables of galaxies for a population.

use crate::error::{InputError, nearest};
use crate::io::table::Table;
use crate::mission::PopulationGalaxy;
use crate::mission::keys::{KEYS, Key};

/// Columns, with the key of a mission that has the same allowed values, and with units that stand for the same number.
const COLUMNS: [(&str, &str, &[&str]); 8] = [
    ("flux_e", "galaxies[].flux_e", &["e-"]),
    ("half_light_px", "galaxies[].half_light_px", &["px"]),
    ("sersic_index", "galaxies[].sersic_index", &[""]),
    ("e1", "galaxies[].e1", &[""]),
    ("e2", "galaxies[].e1", &[""]),
    ("weight_px", "galaxies[].weight_px", &["px"]),
    ("transfers", "readout.transfers", &["", "px", "ct"]),
    ("weight", "", &[""]),
];

/// Largest ellipticity of a galaxy.
const MOST_ELLIPTICAL: f64 = 0.95;

/// Reads galaxies of a population from ECSV or CSV, as [`of_table`].
///
/// # Errors
/// As [`of_table`], and if the file cannot be read or is not a table, or no galaxy has a weight.
pub(super) fn read(file: &str) -> Result<Vec<PopulationGalaxy>, InputError> {
    let table = Table::read(file).map_err(|error| refused(file, error))?;
    let galaxies = of_table(&table)?;
    if galaxies.iter().map(|galaxy| galaxy.weight).sum::<f64>() <= 0.0 {
        return Err(refusal(file, "the sum of the weights is 0".into()));
    }
    Ok(galaxies)
}

/// An error in a table, as one about galaxies.
fn refused(file: &str, error: InputError) -> InputError {
    InputError { refused: refusal(file, String::new()).refused, ..error }
}

fn refusal(file: &str, problem: String) -> InputError {
    InputError::new(format!("cannot read galaxies from {file}"), problem)
}

/// Galaxies of a table. Unknown columns are ignored, unless they resemble a known one.
///
/// # Errors
/// If it has no galaxy or no known column, or a value is not allowed: one message with file, line, column and value.
pub fn of_table(table: &Table) -> Result<Vec<PopulationGalaxy>, InputError> {
    of_columns(table).map_err(|error| refused(&table.name, error))
}

fn of_columns(table: &Table) -> Result<Vec<PopulationGalaxy>, InputError> {
    let refuse = |problem: String| refusal(&table.name, problem);
    if table.rows() == 0 {
        return Err(refuse("the table has no rows".into()));
    }
    let known = COLUMNS.map(|(name, ..)| name);
    let given = |name: &str| table.column(name).is_some();
    for column in table.columns.iter().filter(|column| !known.contains(&column.name.as_str())) {
        let free = known.iter().copied().filter(|name| !given(name));
        if let Some(near) = nearest(&column.name, free) {
            return Err(
                refuse(format!("no column is called `{}`", column.name)).with_help(format!("did you mean `{near}`?"))
            );
        }
    }
    if let Some(observable) = table.meta("observable") {
        let problem = format!("it is a table of measurements (observable: {observable})");
        return Err(refuse(problem).with_help("give a table of galaxies"));
    }
    if !known.iter().any(|name| given(name)) {
        return Err(refuse(format!("it has none of the columns {}", known.join(", "))));
    }
    let columns = COLUMNS.map(|(name, key, ours)| numbers(table, name, key, ours));
    let [flux_e, half_light_px, sersic_index, e1, e2, weight_px, transfers, weight] = columns;
    let (flux_e, half_light_px, sersic_index) = (flux_e?, half_light_px?, sersic_index?);
    let (e1, e2, weight_px, transfers, weight) = (e1?, e2?, weight_px?, transfers?, weight?);
    let galaxies: Vec<PopulationGalaxy> = (0..table.rows())
        .map(|row| PopulationGalaxy {
            flux_e: flux_e[row],
            half_light_px: half_light_px[row],
            sersic_index: sersic_index[row],
            e1: e1[row],
            e2: e2[row],
            weight_px: weight_px[row],
            transfers: transfers[row].map(|transfers| transfers as u32),
            weight: weight[row].unwrap_or(1.0),
        })
        .collect();
    let elliptical = |galaxy: &PopulationGalaxy| galaxy.e1.unwrap_or(0.0).hypot(galaxy.e2.unwrap_or(0.0));
    if let Some(row) = galaxies.iter().position(|galaxy| elliptical(galaxy) > MOST_ELLIPTICAL) {
        let problem = format!(
            "the ellipticity sqrt(e1^2 + e2^2) is {:.3}; allowed: up to {MOST_ELLIPTICAL}",
            elliptical(&galaxies[row])
        );
        return Err(table.fault(Some(row), Some("e2"), problem));
    }
    Ok(galaxies)
}

/// A column's values in our unit, all None if it is absent.
fn numbers(table: &Table, name: &str, key: &str, ours: &[&str]) -> Result<Vec<Option<f64>>, InputError> {
    let Some(column) = table.column(name) else { return Ok(vec![None; table.rows()]) };
    let conversion = table.conversion(name, ours)?;
    let key: Option<&Key> = KEYS.iter().find(|known| known.path == key);
    let number = |row: usize| {
        let fault = |problem: String| table.fault(Some(row), Some(name), problem);
        let value = column.cells[row].number().map(|theirs| conversion.apply(theirs)).filter(|value| value.is_finite());
        let value = value.ok_or_else(|| fault("a number is needed here".into()))?;
        match key {
            Some(key) if key.kind.refuses(value) => {
                let problem = format!("the {} is {value}; allowed: {}", key.what, key.kind.allowed(key.unit));
                Err(InputError { help: (key.help)(value), ..fault(problem) })
            }
            None if value < 0.0 => Err(fault(format!("the weight is {value}; allowed: from 0"))),
            _ => Ok(Some(value)),
        }
    };
    (0..table.rows()).map(number).collect()
}
