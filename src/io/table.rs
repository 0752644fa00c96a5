//! Tables of measurements: ECSV, the Enhanced CSV of astropy.table, and plain CSV.
//!
//! [ECSV](https://github.com/astropy/astropy-APEs/blob/main/APE6.rst) is CSV under a header in YAML, in comment lines,
//! that says the datatype and unit of each column and what holds for all rows (`meta`). Read is what astropy reads,
//! with the same values: an empty cell is missing whatever its datatype, blanks around a cell mean nothing, and the
//! columns in which astropy keeps parts of a `Quantity`, `Time` or masked column become one column again. The header is
//! read as YAML 1.2, to which `1.78e8` is the number that was meant, and not, as to astropy's YAML 1.1, a word.
//!
//! Plain CSV is any file that does not begin with `# %ECSV`: leading lines `# key: value` are its `meta`, a unit may
//! stand behind a name in brackets, and datatypes are taken from the cells.

mod csv;
mod ecsv;
mod write;

use std::collections::HashSet;
use std::fmt;
use std::path::Path;

use serde_json::Value;

use crate::error::{InputError, shortened};
use crate::io::input;

/// A table of measurements: columns of equal length, and what holds for all rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The path as given, for messages.
    pub name: String,
    /// What holds for all rows, in the order of the file.
    pub meta: Vec<Meta>,
    /// Columns in the order of the file.
    pub columns: Vec<Column>,
    /// Line of each row in the file, from 1. Empty where the table was not read.
    pub lines: Vec<usize>,
    /// Line of the names of the columns, from 1.
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
    /// Its name, which no other column has.
    pub name: String,
    /// Its unit as the file writes it, such as `MeV / g`. None where there is none or it is dimensionless.
    pub unit: Option<String>,
    /// What its cells hold.
    pub datatype: Datatype,
    /// What each cell holds where that is more than one value, as JSON: `float64[2]`, `float64[null]` or `json`.
    pub subtype: Option<String>,
    /// What it is, in words.
    pub description: Option<String>,
    /// How to print it, for Python. The file has all digits.
    pub format: Option<String>,
    /// How its cells name points in time, where astropy knows it as a column of times.
    pub time: Option<Time>,
    /// Its values.
    pub cells: Vec<Cell>,
    /// The line that declares it, from 1.
    pub line: Option<usize>,
}

/// How cells name points in time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Time {
    /// astropy's name of the format: `iso`, `isot` and others are texts, `mjd`, `jd` (days), `decimalyear` and others
    /// are numbers.
    pub format: String,
    /// The time scale, such as `utc` or `tt`.
    pub scale: String,
}

/// What the cells of a column hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Datatype {
    /// True or False.
    Bool,
    /// Whole numbers of so many bits.
    Int(u8),
    /// Whole numbers of so many bits that are not negative.
    Uint(u8),
    /// Numbers of so many bits.
    Float(u8),
    /// Words, also dates and JSON.
    #[default]
    Text,
}

/// A value of a table or of its `meta`.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Cell {
    /// Nothing.
    #[default]
    Missing,
    /// A number, possibly NaN or infinite.
    Number(f64),
    /// A whole number.
    Integer(i64),
    /// True or False.
    Truth(bool),
    /// Words.
    Text(String),
    /// Anything else: lists, mappings, whole numbers beyond 64 bits with sign. NaN and infinities in there are the
    /// words `nan`, `inf` and `-inf`.
    Other(Value),
}

impl Table {
    /// Reads a table from a file, ECSV or plain CSV.
    ///
    /// # Errors
    /// Where the file cannot be read, or is no such table: one message with line, column and value.
    pub fn read(path: impl AsRef<Path>) -> Result<Table, InputError> {
        let table = Table { name: path.as_ref().display().to_string(), ..Table::default() };
        let bytes = input::bytes(path.as_ref(), input::MOST_OF_A_TABLE).map_err(|problem| table.refuse(problem))?;
        let text = str::from_utf8(&bytes).map_err(|error| {
            let line = bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count() + 1;
            let wide = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
            let help = if wide { "it begins as UTF-16 does: save it as UTF-8" } else { "save it as UTF-8" };
            InputError { place: Some(format!("line {line}")), ..table.refuse("the file is not text in UTF-8") }
                .with_help(help)
        })?;
        Table::parse(&table.name, text)
    }

    /// Reads a table from text; `name` is for messages.
    ///
    /// # Errors
    /// As [`Table::read`].
    pub fn parse(name: &str, text: &str) -> Result<Table, InputError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut table = Table { name: name.to_string(), ..Table::default() };
        match text.lines().find(|line| !line.trim().is_empty()) {
            None => return Err(table.refuse("the file is empty")),
            Some(line) if ecsv::version(line).is_some() => table.read_ecsv(text)?,
            Some(_) => table.read_csv(text)?,
        }
        Ok(table)
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.cells.len())
    }

    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// What `meta` says under that key.
    pub fn meta(&self, name: &str) -> Option<&Cell> {
        self.meta.iter().find(|meta| meta.name == name).map(|meta| &meta.value)
    }

    /// A refusal of this table for what stands in a row (from 0) and column, in one of them, or under a key of `meta`,
    /// which is called `meta.KEY` where a column has its name: `line 17: sigma = -0.1`, `line 9: meta.transfers = 0`.
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

    /// A refusal without a place.
    fn refuse(&self, problem: impl Into<String>) -> InputError {
        InputError::new(format!("cannot use measurements `{}`", self.name), problem)
    }

    /// A refusal of a line of the text.
    fn refuse_line(&self, text: &str, line: usize, problem: impl Into<String>) -> InputError {
        let written = text.lines().nth(line.saturating_sub(1)).unwrap_or("").trim();
        InputError { place: Some(format!("line {line}: {}", shortened(written))), ..self.refuse(problem) }
    }

    /// No column and no key stands twice, and all columns have names.
    fn check_names(&self) -> Result<(), InputError> {
        let mut known = HashSet::new();
        for (index, column) in self.columns.iter().enumerate() {
            if column.name.is_empty() {
                let problem = format!("column {} of {} has no name", index + 1, self.columns.len());
                return Err(InputError { place: Some(format!("line {}", self.header_line)), ..self.refuse(problem) });
            }
            if column.name.contains(char::is_control) {
                let problem = format!("the name of column {} holds an end of a line, a tab or the like", index + 1);
                let place = Some(format!("{}column {:?}", line_before(column.line), shortened(&column.name)));
                return Err(
                    InputError { place, ..self.refuse(problem) }.with_help("look for a quote that is not closed")
                );
            }
            if !known.insert(column.name.as_str()) {
                let problem = format!("the name `{}` stands twice; names must differ", column.name);
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
                let problem = format!("the key `{}` stands twice in meta", meta.name);
                return Err(InputError { place, ..self.refuse(problem) });
            }
        }
        Ok(())
    }
}

impl Column {
    /// Whether a cell holds JSON: a list, or an object of Python.
    fn is_nested(&self) -> bool {
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
    /// The number, also where a column or a header has it as a word.
    pub fn number(&self) -> Option<f64> {
        match self {
            Cell::Number(number) => Some(*number),
            Cell::Integer(integer) => Some(*integer as f64),
            Cell::Text(text) => text.trim().parse().ok(),
            Cell::Other(value) => value.as_f64(),
            Cell::Missing | Cell::Truth(_) => None,
        }
    }

    /// The number with its unit, where it has one: in `meta`, astropy keeps a `Quantity` as `{value, unit}`.
    pub fn quantity(&self) -> Option<(f64, Option<&str>)> {
        match self {
            Cell::Other(Value::Object(parts)) => {
                Some((parts.get("value")?.as_f64()?, parts.get("unit").and_then(Value::as_str)))
            }
            _ => self.number().map(|number| (number, None)),
        }
    }

    /// The words.
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

/// As messages show it: words in quotes, at most some 60 characters.
impl fmt::Display for Cell {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cell::Missing => write!(out, "(empty)"),
            Cell::Number(number) => write!(out, "{}", write::float(*number)),
            Cell::Integer(integer) => write!(out, "{integer}"),
            Cell::Truth(truth) => write!(out, "{}", write::word(*truth)),
            Cell::Text(text) => write!(out, "\"{}\"", shortened(&text.replace(['\n', '\r'], " "))),
            Cell::Other(value) => write!(out, "{}", shortened(&value.to_string())),
        }
    }
}

/// `line 9: ` where the line is known.
fn line_before(line: Option<usize>) -> String {
    line.map_or(String::new(), |line| format!("line {line}: "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "# %ECSV 1.0\n# ---\n# datatype:\n# - {name: t_yr, unit: yr, datatype: float64}\n\
        # - {name: note, datatype: string}\n# meta: !!omap\n# - {observable: dose}\n# - {transfers: 0}\n\
        # schema: astropy-2.0\nt_yr note\n1.0  \"two \"\"words\"\"\"\n\n# a comment\n1.5 \"\"\n";

    #[test]
    fn cells_rows_and_meta_of_ecsv_have_values_and_lines() {
        let table = Table::parse("small", SMALL).unwrap();
        assert_eq!(table.column("t_yr").unwrap().cells, [Cell::Number(1.0), Cell::Number(1.5)]);
        assert_eq!(table.column("note").unwrap().cells, [Cell::Text("two \"words\"".into()), Cell::Missing]);
        assert_eq!((table.header_line, table.lines.as_slice()), (10, &[11, 14][..]));
        let place = |row, column| table.fault(row, column, "wrong").place.unwrap();
        assert_eq!(place(Some(1), Some("t_yr")), "line 14: t_yr = 1.5");
        assert_eq!(place(None, Some("t_yr")), "line 4: column t_yr [yr]");
        assert_eq!(place(None, Some("transfers")), "line 8: meta.transfers = 0");
    }

    #[test]
    fn plain_csv_has_meta_units_and_guessed_datatypes() {
        let text = "# observable: trail\r\n# 25 px\r\n# signal_e: 1e3,,\r\nk,value [e-],note\r\n\
            1, \"2\",\r\n2,nan,a\r\n,,\r\n";
        let table = Table::parse("plain", text).unwrap();
        assert_eq!(table.meta("observable"), Some(&Cell::Text("trail".into())));
        assert_eq!(table.meta("signal_e"), Some(&Cell::Number(1000.0)));
        let kinds: Vec<_> = table.columns.iter().map(|column| column.datatype).collect();
        assert_eq!(kinds, [Datatype::Int(64), Datatype::Float(64), Datatype::Text]);
        assert_eq!(table.column("value").unwrap().unit.as_deref(), Some("e-"));
        assert_eq!(table.lines, [5, 6]);
    }

    #[test]
    fn a_wrong_cell_is_refused_with_line_column_and_value() {
        let error = Table::parse("small", &SMALL.replace("1.5 ", "1,5 ")).unwrap_err();
        assert_eq!(error.place.unwrap(), "line 14: t_yr = \"1,5\"");
        assert_eq!(error.help.unwrap(), "with a decimal point: 1.5");
    }
}
