//! Values of a mission's keys that were drawn together, such as a sample of a posterior: a table ↔ missions.
//!
//! One column for each key, under its dotted name, and `log_posterior`; one row for each draw.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use toml::Value;

use crate::error::{InputError, nearest};
use crate::io::table::{Cell, Column, Datatype, Meta, Table};
use crate::mission::Mission;
use crate::mission_file::lookup;

/// The column that is not a key: the logarithm of the posterior, up to a constant.
pub const LOG_POSTERIOR: &str = "log_posterior";

/// The key in `meta` for the effective number of independent draws.
pub const EFFECTIVE_SAMPLES: &str = "effective_samples";

/// The key in `meta` that says whether the sample has converged.
pub const CONVERGED: &str = "converged";

/// The key in `meta` for the text of the fitted mission, as resolved.
pub const FITTED_MISSION: &str = "fitted_mission";

/// The key in `meta` that says whether the fit describes its data within their errors.
pub const DESCRIBES_DATA: &str = "describes_data";

/// Sections of a mission file on which a trap density or a readout depends: a posterior of a mission that differs in them is that
/// of another device.
const OF_THE_DEVICE: [&str; 5] = ["environment", "orbit", "shielding", "detector", "effects"];

/// A sample of a mission's keys, read from a table.
#[derive(Clone, Debug)]
pub struct MissionSample {
    /// Dotted keys, in the order of the columns.
    pub keys: Vec<String>,
    /// Effective number of independent draws, if stated in the table.
    pub effective_samples: Option<f64>,
    /// Whether the table says that the sample has converged; None if it does not say.
    pub converged: Option<bool>,
    /// Whether its fit describes the data within their errors; None if the table does not say.
    pub describes_data: Option<bool>,
    /// Dotted keys of the device, other than those drawn, in which the fitted mission differs from this one.
    pub differing: Vec<String>,
    table: Table,
}

/// The table of a sample: keys with their units, and one row for each draw, whose last value is the logarithm of the posterior.
pub fn table(keys: &[(&str, &str)], rows: &[Vec<f64>], meta: Vec<(&str, Cell)>) -> Table {
    let column = |(place, (name, unit)): (usize, &(&str, &str))| Column {
        name: (*name).to_string(),
        unit: (!unit.is_empty()).then(|| (*unit).to_string()),
        datatype: Datatype::Float(64),
        cells: rows.iter().map(|row| Cell::Number(row[place])).collect(),
        ..Column::default()
    };
    let meta = meta.into_iter().map(|(name, value)| Meta { name: name.into(), value, line: None });
    let columns = keys.iter().chain([&(LOG_POSTERIOR, "")]);
    Table { columns: columns.enumerate().map(column).collect(), meta: meta.collect(), ..Table::default() }
}

impl MissionSample {
    /// Reads a sample of a mission's keys.
    ///
    /// # Errors
    /// If the file is not a table, a column is not a key of the mission or has another unit, or a cell is not a number.
    pub fn read(path: impl AsRef<Path>, mission: &Mission) -> Result<MissionSample, InputError> {
        let refused = format!("cannot use posterior `{}`", path.as_ref().display());
        let table = Table::read(path).map_err(|error| InputError { refused: refused.clone(), ..error })?;
        MissionSample::of(table, mission).map_err(|error| InputError { refused, ..error })
    }

    fn of(mut table: Table, mission: &Mission) -> Result<MissionSample, InputError> {
        for place in 0..table.columns.len() {
            if table.columns[place].name != LOG_POSTERIOR {
                table.columns[place].cells = in_units_of_mission(&table, &table.columns[place], mission)?;
            }
        }
        let columns = || table.columns.iter().filter(|column| column.name != LOG_POSTERIOR);
        if columns().count() == 0 || table.rows() == 0 {
            let problem = "there is no draw of any key in it";
            return Err(table
                .fault(None, None, problem)
                .with_help("`ctiplan fit --posterior N --out FILE` writes one"));
        }
        let effective_samples = table.meta(EFFECTIVE_SAMPLES).and_then(Cell::number);
        let is_true = |name: &str| match table.meta(name) {
            Some(Cell::Truth(truth)) => Some(*truth),
            _ => None,
        };
        let (converged, describes_data) = (is_true(CONVERGED), is_true(DESCRIBES_DATA));
        let keys: Vec<String> = columns().map(|column| column.name.clone()).collect();
        let mut differing = Vec::new();
        if let Some(Cell::Text(text)) = table.meta(FITTED_MISSION) {
            let fitted: toml::Table = text.parse().map_err(|error: toml::de::Error| {
                table.fault(None, None, format!("`{FITTED_MISSION}` is not TOML: {}", error.message()))
            })?;
            let here = mission.to_table();
            for section in OF_THE_DEVICE {
                differences(section, fitted.get(section), here.get(section), &mut differing);
            }
            differing.retain(|key| !keys.contains(key));
        }
        Ok(MissionSample { keys, effective_samples, converged, describes_data, differing, table })
    }

    /// Number of draws.
    pub fn len(&self) -> usize {
        self.table.rows()
    }

    /// Whether there are no draws.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// At most `count` rows, evenly chosen; all if there are no more.
    pub fn chosen(&self, count: usize) -> Vec<usize> {
        let count = count.min(self.len());
        (0..count).map(|index| index * self.len() / count).collect()
    }

    /// The mission with the values of one row.
    ///
    /// # Errors
    /// If the values are invalid for the mission; names the row.
    pub fn mission(&self, mission: &Mission, row: usize) -> Result<Mission, InputError> {
        let value = |key: &String| -> Option<(String, Value)> {
            let number = self.table.column(key)?.cells[row].number()?;
            Some((key.clone(), Value::Float(number)))
        };
        let settings: Vec<(String, Value)> = self.keys.iter().filter_map(value).collect();
        mission.with(&settings).map_err(|error| self.fault(row, error))
    }

    /// The values of all keys in a row.
    pub(crate) fn values(&self, row: usize) -> Vec<f64> {
        let value = |key: &String| self.table.column(key).and_then(|column| column.cells[row].number());
        self.keys.iter().map(|key| value(key).unwrap_or(f64::NAN)).collect()
    }

    /// Values of a row on which neither the detector nor its dose depends.
    pub(crate) fn unseen(&self, row: usize) -> Vec<f64> {
        let unseen = |key: &&String| !["detector.", "environment."].iter().any(|section| key.starts_with(section));
        let value = |key: &String| self.table.column(key)?.cells[row].number();
        self.keys.iter().filter(unseen).filter_map(value).collect()
    }

    /// An error for a row, from the error of its mission.
    pub fn fault(&self, row: usize, error: InputError) -> InputError {
        let said = [error.place, Some(error.problem)].into_iter().flatten().collect::<Vec<_>>().join(": ");
        InputError {
            refused: format!("cannot use posterior `{}`", self.table.name),
            help: error.help,
            ..self.table.fault(Some(row), None, said)
        }
    }
}

/// Dotted keys below `key` in which two values differ; members of lists are called by their names.
fn differences(key: &str, a: Option<&Value>, b: Option<&Value>, found: &mut Vec<String>) {
    let members = |value: Option<&Value>| -> Option<BTreeMap<String, Value>> {
        match value? {
            Value::Table(table) => Some(table.clone().into_iter().collect()),
            Value::Array(list) => {
                list.iter().map(|member| Some((member.get("name")?.as_str()?.to_string(), member.clone()))).collect()
            }
            _ => None,
        }
    };
    let (Some(in_a), Some(in_b)) = (members(a), members(b)) else {
        if a != b {
            found.push(key.into());
        }
        return;
    };
    let names: BTreeSet<&String> = in_a.keys().chain(in_b.keys()).collect();
    for name in names {
        differences(&format!("{key}.{name}"), in_a.get(name), in_b.get(name), found);
    }
}

/// The cells of a column that is a key of the mission, as numbers in its unit.
fn in_units_of_mission(table: &Table, column: &Column, mission: &Mission) -> Result<Vec<Cell>, InputError> {
    let name = Some(column.name.as_str());
    let path = mission.path(&column.name).map_err(|(problem, help)| {
        let known = nearest(&column.name, [LOG_POSTERIOR]).map(|near| format!("did you mean `{near}`?"));
        InputError { help: help.or(known), ..table.fault(None, name, problem) }
    })?;
    let unit = lookup::find(&path).map_or("", |key| key.unit);
    // What is stated per pixel is what is in one.
    let in_a_pixel = unit.strip_suffix("per pixel").map(str::trim_end);
    let over_a_pixel = in_a_pixel.map(|whole| format!("{}/px", if whole.is_empty() { "1" } else { whole }));
    let ours: Vec<&str> = [Some(unit), in_a_pixel, over_a_pixel.as_deref()].into_iter().flatten().collect();
    let conversion = table.conversion(&column.name, &ours)?;
    let cell = |(row, cell): (usize, &Cell)| match cell.number().filter(|number| number.is_finite()) {
        Some(number) => Ok(Cell::Number(conversion.apply(number))),
        None => Err(table.fault(Some(row), name, "a number is needed here")),
    };
    column.cells.iter().enumerate().map(cell).collect()
}
