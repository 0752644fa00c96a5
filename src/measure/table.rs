//! Measurements → the table of a measurement file, with the origin of its numbers in `meta`.

use serde_json::{Map, Value as Json, json};

use super::exposure::{About, When, date_words};
use crate::io::table::{Cell, Column, Datatype, Meta, Table};
use crate::physics::observable::Observable;

/// One row of a measurement file.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Conditions of the row, by name.
    pub conditions: Vec<(&'static str, f64)>,
    /// When it was taken.
    pub when: When,
    /// Temperature of the detector, K, if given.
    pub temperature_k: Option<f64>,
    /// Time between two parallel transfers, ms, if given.
    pub line_time_ms: Option<f64>,
    /// The value, in the unit of the observable.
    pub value: f64,
    /// Its 1-sigma error.
    pub sigma: f64,
    /// The part of it that other rows have in common, and the number of their group; none if it is exactly 0.
    pub common: Option<(f64, usize)>,
    /// Its origin: numbers of pixels, the exposure.
    pub from: Vec<(&'static str, usize)>,
}

/// Columns of measurement files: name, unit, and meaning.
const COLUMNS: [(&str, &str, &str); 29] = [
    ("trail_px", "pix", "pixel behind the charge; 1 is next to it"),
    ("signal_e", "electron", "charge before transfer, above the background"),
    ("sigma_signal_e", "electron", "1-sigma error of signal_e"),
    ("signal_read_e", "electron", "charge read in the pixel, above the background"),
    ("background_e", "electron", "background per pixel"),
    ("block_px", "pix", "rows of the block"),
    ("preceding_e", "electron", "charge of the block ahead, above the background; 0 for the first block"),
    ("preceding_px", "pix", "rows from the last one of the block ahead to the first one of the block"),
    ("first_px", "pix", "first pixel behind the block"),
    ("last_px", "pix", "last pixel behind the block"),
    ("transfers", "", "parallel transfers"),
    ("row_px", "pix", "row of the first pixel, from 0, in the order of readout"),
    ("column_px", "pix", "column, from 0, in the order of readout"),
    ("half", "", "+1 if the bright pixel is nearer the register, -1 if it is farther"),
    ("flat_e", "electron", "charge of the flat field near the dipole"),
    ("phase_time_ms", "ms", "time of one phase"),
    ("pumping_cycles", "", "cycles of trap pumping"),
    ("date", "", "time of the exposure"),
    ("t_yr", "yr", "time since launch"),
    ("dose_mev_g", "MeV / g", "dose of the traps"),
    ("temperature_k", "K", "temperature of the detector"),
    ("line_time_ms", "ms", "time between two parallel transfers"),
    ("common_group", "", "rows with the same number have the error sigma_common in common"),
    ("exposure", "", "number of the exposure in meta.exposures"),
    ("hdu", "", "HDU of the frame"),
    ("amplifier", "", "row of the table of amplifiers, from 1"),
    ("block", "", "number of the block, from the register"),
    ("pixels_used", "", "pixels of which the value is the mean"),
    ("pixels_rejected", "", "pixels rejected as outliers"),
];

/// Origin of a table's numbers.
pub(super) struct Origin<'a> {
    /// The measured quantity.
    pub observable: Observable,
    /// The command's word for the method.
    pub kind: &'static str,
    /// Options, as interpreted.
    pub options: Json,
    /// Numbers of used and rejected items.
    pub counts: &'a [(&'static str, usize)],
    /// The exposures.
    pub exposures: &'a [About],
}

/// The table of a measurement file.
pub(super) fn table(name: &str, origin: &Origin, rows: &[Measurement]) -> Table {
    let mut columns: Vec<Column> = Vec::new();
    let mut put = |name: &'static str, cells: Vec<Cell>| {
        if cells.iter().any(|cell| *cell != Cell::Missing) {
            columns.push(column(name, origin.observable, cells));
        }
    };
    let number = |value: Option<f64>| value.map_or(Cell::Missing, Cell::Number);
    for (name, _) in rows.first().map(|row| row.conditions.clone()).unwrap_or_default() {
        let of = |row: &Measurement| row.conditions.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        put(name, rows.iter().map(|row| number(of(row))).collect());
    }
    let date = |row: &Measurement| match row.when {
        When::Date(date) => Cell::Text(date_words(date)),
        _ => Cell::Missing,
    };
    put("date", rows.iter().map(date).collect());
    put("t_yr", rows.iter().map(|row| number(row.when.t_yr())).collect());
    put("dose_mev_g", rows.iter().map(|row| number(row.when.dose_mev_g())).collect());
    put("temperature_k", rows.iter().map(|row| number(row.temperature_k)).collect());
    put("line_time_ms", rows.iter().map(|row| number(row.line_time_ms)).collect());
    put("value", rows.iter().map(|row| Cell::Number(row.value)).collect());
    put("sigma", rows.iter().map(|row| Cell::Number(row.sigma)).collect());
    put("sigma_common", rows.iter().map(|row| number(row.common.map(|(sigma, _)| sigma))).collect());
    put("common_group", rows.iter().map(|row| number(row.common.map(|(_, group)| group as f64))).collect());
    for (name, _) in rows.first().map(|row| row.from.clone()).unwrap_or_default() {
        let of = |row: &Measurement| row.from.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        put(name, rows.iter().map(|row| number(of(row).map(|value| value as f64))).collect());
    }
    Table { name: name.to_string(), meta: meta(origin), columns, ..Table::default() }
}

fn meta(origin: &Origin) -> Vec<Meta> {
    let entry = |name: &str, value| Meta { name: name.into(), value, line: None };
    let version = env!("CARGO_PKG_VERSION");
    let counts: Map<String, Json> =
        origin.counts.iter().map(|(name, count)| (name.to_string(), json!(count))).collect();
    vec![
        entry("observable", Cell::Text(origin.observable.name().into())),
        entry("measured_by", Cell::Text(format!("ctiplan {version} measure {}", origin.kind))),
        entry("options", Cell::Other(origin.options.clone())),
        entry("counts", Cell::Other(Json::Object(counts))),
        entry("exposures", Cell::Other(Json::Array(origin.exposures.iter().map(About::json).collect()))),
    ]
}

fn column(name: &str, observable: Observable, cells: Vec<Cell>) -> Column {
    let known = COLUMNS.iter().find(|(known, ..)| *known == name);
    let unit_of_values = match observable.unit() {
        "e-" => "electron",
        unit => unit,
    };
    let (unit, description) = known.map_or((unit_of_values, None), |(_, unit, words)| (*unit, Some(words.to_string())));
    let whole = |cell: &Cell| matches!(cell, Cell::Number(number) if number.fract() == 0.0 && number.abs() < 1e15);
    // A condition whose values happen to be integers remains real; counts are integers by nature.
    let counts = unit.is_empty() && known.is_some() || unit == "pix";
    let (datatype, cells) = if matches!(cells[0], Cell::Text(_)) {
        (Datatype::Text, cells)
    } else if counts && cells.iter().all(whole) {
        let integer = |cell: Cell| cell.number().map_or(Cell::Missing, |number| Cell::Integer(number as i64));
        (Datatype::Int(64), cells.into_iter().map(integer).collect())
    } else {
        (Datatype::Float(64), cells)
    };
    let unit = (!unit.is_empty()).then(|| unit.to_string());
    Column { name: name.into(), unit, datatype, description, cells, ..Column::default() }
}
