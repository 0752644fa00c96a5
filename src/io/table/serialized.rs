//! Columns that astropy keeps in parts (`__serialized_columns__`): a `Quantity`, a `Time`, a masked column and others.

use chrono::DateTime;
use serde_json::{Map, Value};

use super::columns::{Cell, Column, Datatype, PARTS, Table, Time};
use crate::error::InputError;

/// Classes of astropy whose one part, and its mask, are the column: numbers with a unit, or text.
const PLAIN: [&str; 11] = [
    "",
    "Column",
    "MaskedColumn",
    "MaskedNDArray",
    "Quantity",
    "MaskedQuantity",
    "Distance",
    "Angle",
    "Longitude",
    "Latitude",
    "Time",
];

/// A time difference, which becomes a number of days or seconds.
const DIFFERENCE: &str = "TimeDelta";

/// How attributes of a `Time` begin that are computed from the others.
const CACHED: &str = "_delta_";

/// A description of parts.
type Parts = Map<String, Value>;

impl Table {
    /// Joins columns that are parts of another one.
    ///
    /// # Errors
    /// If a part is missing, or the column is of a class that cannot become one of numbers or text.
    pub(super) fn assemble(&mut self) -> Result<(), InputError> {
        let Some(index) = self.meta.iter().position(|meta| meta.name == PARTS) else { return Ok(()) };
        let Cell::Other(Value::Object(wholes)) = self.meta[index].value.clone() else {
            return Err(self.fault(None, Some(PARTS), "this must be a mapping"));
        };
        for (name, parts) in &wholes {
            if let Value::Object(parts) = parts {
                self.join(name, parts)?;
            }
        }
        self.meta.remove(index);
        Ok(())
    }

    /// Joins the parts of one column.
    fn join(&mut self, name: &str, parts: &Parts) -> Result<(), InputError> {
        let class = class(parts);
        if !PLAIN.contains(&class) && class != DIFFERENCE {
            return Err(self.refuse_class(name, class));
        }
        let (mut mask, mut data) = (None, Vec::new());
        for (attribute, part) in parts {
            let Value::Object(part) = part else { continue };
            let column = match part.get("name") {
                Some(Value::String(column)) => column.clone(),
                _ if part.contains_key("__class__") => {
                    let inner = format!("{name}.{attribute}");
                    self.join(&inner, part)?;
                    inner
                }
                _ if part.values().any(Value::is_object) => return Err(self.refuse_class(name, "structured column")),
                _ => continue,
            };
            if self.column(&column).is_none() {
                let problem = format!("there is no column `{column}` for `{name}`");
                return Err(self.fault(None, Some(PARTS), problem));
            }
            // Differences of scales that astropy has computed, such as TDB - TT.
            if class == "Time" && attribute.starts_with(CACHED) {
                self.take(&column);
                continue;
            }
            if attribute == "mask" { mask = Some(column) } else { data.push((attribute.as_str(), column)) }
        }
        data.sort();
        match data.as_slice() {
            [(_, column)] => {
                let mask = mask.and_then(|mask| self.take(&mask));
                let Some(column) = self.columns.iter_mut().find(|other| other.name == *column) else { return Ok(()) };
                column.name = name.to_string();
                column.describe(parts);
                column.hide(mask.as_ref());
            }
            [("jd1", first), ("jd2", second)] => {
                let Some(second) = self.take(second) else { return Ok(()) };
                let Some(first) = self.columns.iter_mut().find(|other| other.name == *first) else { return Ok(()) };
                first.name = name.to_string();
                first.join_julian(&second, parts);
            }
            [] => {}
            _ => return Err(self.refuse_class(name, class)),
        }
        let named = self.column(name);
        let is_number = named.is_none_or(|column| column.unit.is_some() && column.datatype != Datatype::Text);
        if class == DIFFERENCE && !is_number { Err(self.refuse_class(name, class)) } else { Ok(()) }
    }

    /// An error for a column of a class that is not read.
    fn refuse_class(&self, name: &str, class: &str) -> InputError {
        // That of the column as a whole, of which this may be an inner part.
        let name = name.split('.').next().unwrap_or(name);
        let (problem, help) = match class {
            DIFFERENCE => (
                "it is a TimeDelta of astropy in a format that is not read".to_string(),
                format!("write days: t[\"{name}\"] = t[\"{name}\"].to(\"d\")"),
            ),
            "SkyCoord" => (
                "it is a SkyCoord of astropy, which is not read".to_string(),
                format!(
                    "write its coordinates as columns, t[\"ra\"] = t[\"{name}\"].ra, or leave it out: del t[\"{name}\"]"
                ),
            ),
            "structured column" | "Time" => (
                "it has several values in a cell, which are not read".to_string(),
                format!("write each as a column, and a Time as text: t[\"{name}\"].format = \"isot\""),
            ),
            _ => (
                format!("it is a {class} of astropy, which is not read"),
                format!("write it as numbers with a unit, or leave it out: del t[\"{name}\"]"),
            ),
        };
        InputError { place: Some(format!("column {name}")), ..self.refuse(problem) }.with_help(help)
    }

    /// Removes a column from the table.
    fn take(&mut self, name: &str) -> Option<Column> {
        let index = self.columns.iter().position(|column| column.name == name)?;
        Some(self.columns.remove(index))
    }
}

/// The name of a class, without its module.
fn class(parts: &Parts) -> &str {
    words(parts, "__class__").rsplit('.').next().unwrap_or("")
}

fn words<'a>(parts: &'a Parts, key: &str) -> &'a str {
    parts.get(key).and_then(Value::as_str).unwrap_or("")
}

impl Column {
    /// Sets unit or time format from the description of the whole.
    fn describe(&mut self, parts: &Parts) {
        let unit = match (class(parts), words(parts, "format")) {
            (DIFFERENCE, "jd") => "d",
            (DIFFERENCE, "sec") => "s",
            _ => words(parts, "unit"),
        };
        self.unit = self.unit.take().or(Some(unit.to_string()).filter(|unit| !unit.is_empty()));
        if class(parts) == "Time" {
            self.time = Some(Time { format: words(parts, "format").into(), scale: words(parts, "scale").into() });
        }
    }

    /// Sets cells to missing where a mask is true.
    fn hide(&mut self, mask: Option<&Column>) {
        for (cell, mask) in self.cells.iter_mut().zip(mask.iter().flat_map(|mask| &mask.cells)) {
            match (cell, mask) {
                (cell, Cell::Truth(true)) => *cell = Cell::Missing,
                (Cell::Other(value), Cell::Other(mask)) => hide(value, mask),
                _ => {}
            }
        }
    }

    /// Joins a number of days with its second part: a Julian date, or a difference in days.
    fn join_julian(&mut self, second: &Column, parts: &Parts) {
        let is_time = class(parts) == "Time";
        for (first, second) in self.cells.iter_mut().zip(&second.cells) {
            let joined = first.number().zip(second.number()).and_then(|(jd1, jd2)| match is_time {
                true => date(jd1, jd2).map(Cell::Text),
                false => Some(Cell::Number(jd1 + jd2)),
            });
            *first = joined.unwrap_or(Cell::Missing);
        }
        if is_time {
            self.datatype = Datatype::Text;
            self.time = Some(Time { format: "iso".to_string(), scale: words(parts, "scale").into() });
        } else {
            self.unit = Some("d".to_string());
        }
    }
}

/// Sets null where the mask is true.
fn hide(value: &mut Value, mask: &Value) {
    match (value, mask) {
        (value, Value::Bool(true)) => *value = Value::Null,
        (Value::Array(values), Value::Array(masks)) => {
            values.iter_mut().zip(masks).for_each(|(value, mask)| hide(value, mask));
        }
        _ => {}
    }
}

/// A time or a time difference of `meta`, in the two parts of astropy: the date in its scale, or a quantity in days.
pub(super) fn of_meta(tag: &str, parts: &Parts) -> Option<Value> {
    let days = |key| parts.get(key).and_then(Value::as_f64);
    let (jd1, jd2) = days("jd1").zip(days("jd2"))?;
    match tag {
        "astropy.time.Time" => date(jd1, jd2).map(Value::from),
        "astropy.time.TimeDelta" => Some(serde_json::json!({ "value": jd1 + jd2, "unit": "d" })),
        _ => None,
    }
}

/// The date and time of a Julian date in two parts, as written by astropy. Leap seconds, which are negligible here, are not
/// counted.
fn date(jd1: f64, jd2: f64) -> Option<String> {
    const UNIX_EPOCH: f64 = 2_440_587.5;
    let milliseconds = (((jd1 - UNIX_EPOCH) + jd2) * 86_400e3).round();
    let time = DateTime::from_timestamp_millis(milliseconds.is_finite().then_some(milliseconds as i64)?)?;
    Some(time.format("%Y-%m-%d %H:%M:%S%.3f").to_string())
}
