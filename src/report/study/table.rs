//! Rows of a study → a text table, JSON, CSV.

use chrono::NaiveDate;
use comfy_table::Table;
use serde::Serialize;
use serde_json::{Map, Value};

use super::estimate::{error_of_date, known_date, plus_minus, scientific};
use crate::report::{keep_errors, or_dash, significant, table};
use crate::study::Estimate;

/// Rows of one kind, and the values shown.
#[derive(Clone, Debug)]
pub struct DataTable {
    /// Its key in JSON.
    pub name: &'static str,
    /// Its title; may be empty.
    pub title: String,
    /// Columns, in order.
    pub columns: Vec<Column>,
    /// Rows: values by the keys of the columns.
    pub rows: Vec<Map<String, Value>>,
    /// Whether it is only for programs: too long to be read.
    pub programs_only: bool,
}

/// One column.
#[derive(Clone, Debug)]
pub struct Column {
    /// Key with its unit, for programs.
    pub key: String,
    /// Heading with its unit, for text tables; a column without one is only for programs.
    pub head: String,
    /// Number format in text tables.
    pub digits: Digits,
    /// Key of the standard errors, if its values are estimated from draws: errors of numbers in their unit, of dates in days.
    pub error_key: Option<String>,
}

/// Number format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// This number of decimals.
    Fixed(usize),
    /// This number of decimals, with an exponent.
    Scientific(usize),
    /// This number of significant digits, without an exponent if that is readable.
    Significant(usize),
}

/// A numeric column.
pub(super) fn column(key: impl Into<String>, head: impl Into<String>, digits: Digits) -> Column {
    Column { key: key.into(), head: head.into(), digits, error_key: None }
}

/// A column of text or dates.
pub(super) fn words(key: impl Into<String>, head: impl Into<String>) -> Column {
    column(key, head, Digits::Fixed(0))
}

impl Column {
    /// The same with values estimated from draws, whose errors have their own key.
    pub(super) fn with_error(self, key: impl Into<String>) -> Column {
        Column { error_key: Some(key.into()), ..self }
    }

    /// A value of a row in text form.
    fn shown(&self, row: &Map<String, Value>) -> String {
        let error = self.error_key.as_ref().map(|key| row.get(key).and_then(Value::as_f64));
        match (row.get(&self.key), error) {
            (Some(Value::String(words)), Some(error_d)) => match words.parse::<NaiveDate>() {
                Ok(date) => format!("{}\n{}", known_date(date, error_d), error_d.map_or("+- ?".into(), error_of_date)),
                Err(_) => words.clone(),
            },
            (Some(Value::String(words)), None) => words.clone(),
            (value, error) => or_dash(value.and_then(Value::as_f64).map(|value| match error.flatten() {
                Some(error) => self.estimate(Estimate { value, error }),
                None => self.number(value),
            })),
        }
    }

    fn estimate(&self, estimate: Estimate) -> String {
        match self.digits {
            Digits::Scientific(_) => scientific(estimate),
            _ => plus_minus(estimate),
        }
    }

    fn number(&self, number: f64) -> String {
        match self.digits {
            Digits::Fixed(decimals) => format!("{number:.decimals$}"),
            Digits::Scientific(decimals) => format!("{number:.decimals$e}"),
            Digits::Significant(digits) => significant(number, digits),
        }
    }
}

impl DataTable {
    /// A table of rows that serialise to values by their keys.
    pub(super) fn of<R: Serialize>(
        name: &'static str,
        rows: impl IntoIterator<Item = R>,
        columns: Vec<Column>,
    ) -> DataTable {
        let values = |row: R| match serde_json::to_value(row) {
            Ok(Value::Object(values)) => values,
            other => unreachable!("a row serialises to values by their keys: {other:?}"),
        };
        let rows = rows.into_iter().map(values).collect();
        let table = DataTable { name, title: String::new(), columns, rows, programs_only: false };
        let is_misspelt = |key: &&String| table.rows.iter().all(|row| !row.contains_key(*key));
        let misspelt = table.keys().find(is_misspelt).filter(|_| !table.rows.is_empty());
        debug_assert!(misspelt.is_none(), "no row of `{name}` has {misspelt:?}");
        table
    }

    /// The same with a title.
    pub(super) fn titled(self, title: impl Into<String>) -> DataTable {
        DataTable { title: title.into(), ..self }
    }

    /// Keys of its values: those of the columns, each followed by that of its errors.
    fn keys(&self) -> impl Iterator<Item = &String> {
        self.columns.iter().flat_map(|column| [Some(&column.key), column.error_key.as_ref()]).flatten()
    }

    /// Rows with only the values of the columns; null for missing values.
    pub(super) fn json(&self) -> Value {
        let value = |row: &Map<String, Value>, key: &String| (key.clone(), row.get(key).cloned().unwrap_or_default());
        let row = |row: &Map<String, Value>| Value::Object(self.keys().map(|key| value(row, key)).collect());
        self.rows.iter().map(row).collect()
    }

    /// The keys, and the rows.
    pub(super) fn csv(&self) -> Vec<Vec<String>> {
        let value = |value: Option<&Value>| match value {
            Some(Value::String(words)) => words.clone(),
            value => value.and_then(Value::as_f64).map_or(String::new(), |number| number.to_string()),
        };
        let mut records = vec![self.keys().cloned().collect::<Vec<_>>()];
        records.extend(self.rows.iter().map(|row| self.keys().map(|key| value(row.get(key))).collect()));
        records
    }

    /// As a text table.
    pub(super) fn text(&self) -> Table {
        let read = || self.columns.iter().filter(|column| !column.head.is_empty());
        let mut shown = table(&read().map(|column| column.head.as_str()).collect::<Vec<_>>());
        for row in &self.rows {
            shown.add_row(read().map(|column| column.shown(row)));
        }
        keep_errors(&mut shown);
        shown
    }
}
