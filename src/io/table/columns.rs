//! Content of a table of measurements, independent of the format: columns of cells, and metadata for all rows.

use std::collections::HashSet;
use std::fmt;

use saphyr::Scalar;
use serde_json::Value;

use crate::error::{InputError, shortened};
use crate::io::unit::{self, Conversion};

/// A table of measurements: columns of equal length, and metadata for all rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The path as given, for messages.
    pub name: String,
    /// Metadata for all rows, in the order of the file.
    pub meta: Vec<Meta>,
    /// Columns in the order of the file.
    pub columns: Vec<Column>,
    /// Line of each row in the file, from 1. Empty if the table was not read from a file.
    pub lines: Vec<usize>,
    /// Line of the column names, from 1.
    pub header_line: usize,
}

/// One entry of the header's `meta`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Meta {
    /// Its key.
    pub name: String,
    /// Its value: a mapping or a list is [`Cell::Other`].
    pub value: Cell,
    /// Its line in the file, from 1.
    pub line: Option<usize>,
}

/// A column of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// Its unique name.
    pub name: String,
    /// Its unit as written in the file, such as `MeV / g`. None if there is none or it is dimensionless.
    pub unit: Option<String>,
    /// Datatype of its cells.
    pub datatype: Datatype,
    /// Content of each cell with several values, as JSON: `float64[2]`, `float64[null]` or `json`.
    pub subtype: Option<String>,
    /// Its description.
    pub description: Option<String>,
    /// Python print format. The file has all digits.
    pub format: Option<String>,
    /// The time format of its cells, if it is a time column for astropy.
    pub time: Option<Time>,
    /// Its values.
    pub cells: Vec<Cell>,
    /// The line that declares it, from 1.
    pub line: Option<usize>,
}

/// A time format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Time {
    /// astropy's name of the format: `iso`, `isot` and others are text, `mjd`, `jd` (days), `decimalyear` and others are numbers.
    pub format: String,
    /// The time scale, such as `utc` or `tt`.
    pub scale: String,
}

/// Datatype of the cells of a column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Datatype {
    /// True or False.
    Bool,
    /// Integers of this number of bits.
    Int(u8),
    /// Unsigned integers of this number of bits.
    Uint(u8),
    /// Floats of this number of bits.
    Float(u8),
    /// Text, including dates and JSON.
    #[default]
    Text,
}

/// A value of a table or of its `meta`.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Cell {
    /// No value.
    #[default]
    Missing,
    /// A number, possibly NaN or infinite.
    Number(f64),
    /// An integer.
    Integer(i64),
    /// True or False.
    Truth(bool),
    /// Text.
    Text(String),
    /// Anything else: lists, mappings, integers beyond 64 bits with sign. NaN and infinities in there are the words `nan`, `inf`
    /// and `-inf`.
    Other(Value),
}

/// The key under which astropy lists the parts of columns.
pub(super) const PARTS: &str = "__serialized_columns__";

impl Table {
    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.cells.len())
    }

    /// The column with this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// The value of `meta` under this key.
    pub fn meta(&self, name: &str) -> Option<&Cell> {
        self.meta.iter().find(|meta| meta.name == name).map(|meta| &meta.value)
    }

    /// An error in this table for a row (from 0) and column, for one of them, or for a key of `meta`, written `meta.KEY` if a
    /// column has the same name: `line 17: sigma = -0.1`, `line 9: meta.transfers = 0`.
    pub fn fault(&self, row: Option<usize>, column: Option<&str>, problem: impl Into<String>) -> InputError {
        InputError { place: self.place(row, column), ..self.refuse(problem) }
    }

    /// `line 17: sigma = -0.1`
    fn place(&self, row: Option<usize>, column: Option<&str>) -> Option<String> {
        let at = |row: usize| match self.lines.get(row) {
            Some(line) => format!("line {line}"),
            None => format!("row {}", row + 1),
        };
        let Some(name) = column else { return row.map(at) };
        if let Some(column) = self.column(name) {
            if let Some(row) = row {
                return Some(format!("{}: {name} = {}", at(row), column.cells.get(row).unwrap_or(&Cell::Missing)));
            }
            let unit = column.unit.as_ref().map_or(String::new(), |unit| format!(" [{unit}]"));
            return Some(format!("{}column {name}{unit}", line_before(column.line)));
        }
        let key = name.strip_prefix("meta.").unwrap_or(name);
        let meta = self.meta.iter().find(|meta| meta.name == key)?;
        Some(format!("{}meta.{key} = {}", line_before(meta.line), meta.value))
    }

    /// The conversion of a column's values into the first of these units; the others stand for the same number.
    ///
    /// # Errors
    /// If the unit in the header is not one that converts.
    pub(crate) fn conversion(&self, column: &str, ours: &[&str]) -> Result<Conversion, InputError> {
        let Some(found) = self.column(column) else { return Ok(Conversion::default()) };
        if found.time.is_some() {
            let problem = "it is a Time of astropy, and a number is needed here";
            return Err(self.fault(None, Some(column), problem).with_help("call points in time `date`"));
        }
        self.conversion_of(found.unit.as_deref(), ours, column)
    }

    /// The same for a stated unit at a place, as in [`Table::fault`].
    pub(crate) fn conversion_of(
        &self,
        stated: Option<&str>,
        ours: &[&str],
        at: &str,
    ) -> Result<Conversion, InputError> {
        unit::conversion(stated, ours).map_err(|(problem, help)| {
            let fault = self.fault(None, Some(at), problem);
            InputError { help: help.map(str::to_string), ..fault }
        })
    }

    /// An error without a location.
    pub(super) fn refuse(&self, problem: impl Into<String>) -> InputError {
        InputError::new(format!("cannot use measurements `{}`", self.name), problem)
    }

    /// An error in a line of the text.
    pub(super) fn refuse_line(&self, text: &str, line: usize, problem: impl Into<String>) -> InputError {
        let written = text.lines().nth(line.saturating_sub(1)).unwrap_or("").trim();
        InputError { place: Some(format!("line {line}: {}", shortened(written))), ..self.refuse(problem) }
    }

    /// Checks that no column or key is duplicate, and that all columns have names.
    pub(super) fn check_names(&self) -> Result<(), InputError> {
        let mut known = HashSet::new();
        for (index, column) in self.columns.iter().enumerate() {
            if column.name.is_empty() {
                let problem = format!("column {} of {} has no name", index + 1, self.columns.len());
                let place = Some(format!("line {}", self.header_line));
                let help = "give it a name; of pandas it is the index: df.to_csv(FILE, index=False) leaves it out";
                return Err(InputError { place, ..self.refuse(problem) }.with_help(help));
            }
            if column.name.contains(char::is_control) {
                let problem = format!("the name of column {} holds an end of a line, a tab or the like", index + 1);
                let place = Some(format!("{}column {:?}", line_before(column.line), shortened(&column.name)));
                return Err(
                    InputError { place, ..self.refuse(problem) }.with_help("look for a quote that is not closed")
                );
            }
            if !known.insert(column.name.as_str()) {
                let problem = format!("duplicate name `{}`", column.name);
                let place = Some(format!("{}column {}", line_before(column.line), column.name));
                return Err(InputError { place, ..self.refuse(problem) });
            }
        }
        known.clear();
        for meta in &self.meta {
            if meta.name.contains(char::is_control) {
                let problem = "the key holds an end of a line, a tab or another control character";
                let place = Some(format!("{}meta.{:?}", line_before(meta.line), shortened(&meta.name)));
                return Err(InputError { place, ..self.refuse(problem) });
            }
            if !known.insert(meta.name.as_str()) {
                let place = Some(format!("{}meta.{} = {}", line_before(meta.line), meta.name, meta.value));
                let problem = format!("duplicate key `{}` in meta", meta.name);
                return Err(InputError { place, ..self.refuse(problem) });
            }
        }
        Ok(())
    }
}

impl Column {
    /// Whether a cell contains JSON: a list, or a Python object.
    pub(super) fn is_nested(&self) -> bool {
        self.subtype.as_ref().is_some_and(|subtype| subtype == "json" || subtype.contains('['))
    }
}

impl Datatype {
    /// Its name in ECSV, such as `float64`.
    pub fn name(self) -> String {
        match self {
            Datatype::Bool => "bool".to_string(),
            Datatype::Int(bits) => format!("int{bits}"),
            Datatype::Uint(bits) => format!("uint{bits}"),
            Datatype::Float(bits) => format!("float{bits}"),
            Datatype::Text => "string".to_string(),
        }
    }
}

impl Cell {
    /// The number, even if given as text in a column or a header.
    pub fn number(&self) -> Option<f64> {
        match self {
            Cell::Number(number) => Some(*number),
            Cell::Integer(integer) => Some(*integer as f64),
            Cell::Text(text) => text.trim().parse().ok(),
            Cell::Other(value) => value.as_f64(),
            Cell::Missing | Cell::Truth(_) => None,
        }
    }

    /// The number with its unit, if it has one: in `meta`, astropy keeps a `Quantity` as `{value, unit}`.
    pub fn quantity(&self) -> Option<(f64, Option<&str>)> {
        match self {
            Cell::Other(Value::Object(parts)) => {
                Some((parts.get("value")?.as_f64()?, parts.get("unit").and_then(Value::as_str)))
            }
            _ => self.number().map(|number| (number, None)),
        }
    }

    /// The text.
    pub fn text(&self) -> Option<&str> {
        match self {
            Cell::Text(text) => Some(text),
            _ => None,
        }
    }
}

impl From<Value> for Cell {
    fn from(value: Value) -> Cell {
        match value {
            Value::Null => Cell::Missing,
            Value::Bool(truth) => Cell::Truth(truth),
            Value::String(text) => Cell::Text(text),
            Value::Number(number) => match number.as_i64() {
                Some(integer) => Cell::Integer(integer),
                None => Cell::Number(number.as_f64().unwrap_or(f64::NAN)),
            },
            other => Cell::Other(other),
        }
    }
}

/// As shown in messages: text in quotes, at most some 60 characters.
impl fmt::Display for Cell {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cell::Missing => write!(out, "(empty)"),
            Cell::Number(number) => write!(out, "{}", float(*number)),
            Cell::Integer(integer) => write!(out, "{integer}"),
            Cell::Truth(truth) => write!(out, "{}", word(*truth)),
            Cell::Text(text) => write!(out, "\"{}\"", shortened(&text.replace(['\n', '\r'], " "))),
            Cell::Other(value) => write!(out, "{}", shortened(&value.to_string())),
        }
    }
}

/// `line 9: ` if the line is known.
fn line_before(line: Option<usize>) -> String {
    line.map_or(String::new(), |line| format!("line {line}: "))
}

/// The shortest text that reads back as the same number, in Python and in Rust.
pub(super) fn float(number: f64) -> String {
    if number.is_nan() { "nan".to_string() } else { format!("{number:?}") }
}

/// True or False, as in Python.
pub(super) fn word(truth: bool) -> &'static str {
    if truth { "True" } else { "False" }
}

/// The value of a YAML scalar.
pub(super) fn scalar(value: &Scalar) -> Cell {
    match value {
        Scalar::Null => Cell::Missing,
        Scalar::Boolean(truth) => Cell::Truth(*truth),
        Scalar::Integer(integer) => Cell::Integer(*integer),
        Scalar::FloatingPoint(number) => Cell::Number(number.0),
        Scalar::String(text) => Cell::Text(text.to_string()),
    }
}
