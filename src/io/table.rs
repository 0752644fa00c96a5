//! Tables of measurements: ECSV, the Enhanced CSV of astropy.table, and plain CSV.
//!
//! [ECSV](https://github.com/astropy/astropy-APEs/blob/main/APE6.rst) is CSV with a YAML header, in comment lines, that gives the
//! datatype and unit of each column and metadata for all rows (`meta`). Tables are read as in astropy, with the same values: an
//! empty cell is missing regardless of its datatype, blanks around a cell are ignored, and the columns in which astropy keeps parts
//! of a `Quantity`, `Time` or masked column become one column again. The header is read as YAML 1.2, in which `1.78e8` is a number
//! as intended; in astropy's YAML 1.1 it is a string.
//!
//! Parquet is read by its columns (see `parquet.rs`); without the feature `parquet` it is refused.
//!
//! Plain CSV is any file that does not begin with `# %ECSV`: leading lines `# key: value` are its `meta`, a unit may follow a name
//! in brackets, and datatypes are inferred from the cells. Where semicolons or tabs delimit, a comma may be the decimal point.
//!
//! A number is converted from the unit in the header by `Table::conversion`, for every kind of table, and a point in time by
//! [`Cell::moment`].

#[cfg(feature = "parquet")]
mod arrow_schema;
mod columns;
mod csv;
mod ecsv;
mod moment;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(not(feature = "parquet"))]
#[path = "table/parquet_left_out.rs"]
mod parquet;
mod serialized;
mod time_scale;
mod write;

use std::path::Path;

pub use columns::{Cell, Column, Datatype, Meta, Table, Time};
pub use moment::NotADate;
#[cfg(not(feature = "parquet"))]
pub(crate) use parquet::left_out;

use crate::error::InputError;
use crate::io::{foreign, input};

/// How a Parquet file begins.
const PARQUET: &[u8] = b"PAR1";

impl Table {
    /// Reads a table from a file: ECSV, plain CSV, or Parquet, recognised by its first bytes.
    ///
    /// # Errors
    /// If the file cannot be read, or is not such a table: one message with line, column and value.
    pub fn read(path: impl AsRef<Path>) -> Result<Table, InputError> {
        let table = Table { name: path.as_ref().display().to_string(), ..Table::default() };
        let bytes = input::bytes(path.as_ref(), input::MOST_OF_A_TABLE).map_err(|problem| table.refuse(problem))?;
        if bytes.starts_with(PARQUET) {
            let mut table = table;
            table.read_parquet(bytes)?;
            return Ok(table);
        }
        if let Some((problem, help)) = foreign::kind(&bytes) {
            return Err(table.refuse(problem).with_help(help));
        }
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
