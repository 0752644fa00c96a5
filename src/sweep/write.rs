//! Rows → Parquet or CSV.
//!
//! Both contain the same columns with the same values, to the last bit. Days are dates in Parquet; missing values are null there
//! and empty cells in CSV. The sweep's fingerprint is a column, and in Parquet also metadata of the file.

use std::fs::File;
use std::io;
use std::path::Path;

use super::grid::Grid;
#[cfg(feature = "parquet")]
use super::parquet::{self, ParquetWriter};
use crate::error::InputError;
#[cfg(not(feature = "parquet"))]
use crate::io::table;
use crate::io::table::Cell;

/// A file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColumnKind {
    #[cfg(feature = "parquet")]
    Parquet,
    Csv,
}

impl ColumnKind {
    /// From the suffix of the file's name.
    pub fn of(path: &Path) -> Result<ColumnKind, InputError> {
        match path.extension().and_then(|extension| extension.to_str()) {
            #[cfg(feature = "parquet")]
            Some("parquet") => Ok(ColumnKind::Parquet),
            #[cfg(not(feature = "parquet"))]
            Some("parquet") => Err(table::left_out(InputError::new(format!("cannot write `{}`", path.display()), ""))),
            Some("csv") => Ok(ColumnKind::Csv),
            _ => Err(InputError::new(
                format!("cannot write `{}`", path.display()),
                "the name of the result must end in .parquet or .csv",
            )),
        }
    }

    /// Fingerprint of the sweep whose result is in a file, empty if it is not a result; None if there is no file.
    pub fn fingerprint(self, path: &Path) -> Result<Option<String>, InputError> {
        let refuse = |error: io::Error| InputError::new(format!("cannot use `{}`", path.display()), error.to_string());
        let file = match File::open(path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(refuse(error)),
        };
        if file.metadata().map_err(refuse)?.is_dir() {
            return Err(InputError::new(format!("cannot use `{}`", path.display()), "this is a folder, not a file"));
        }
        Ok(Some(match self {
            #[cfg(feature = "parquet")]
            ColumnKind::Parquet => parquet::fingerprint(file).unwrap_or_default(),
            ColumnKind::Csv => of_csv(file).unwrap_or_default(),
        }))
    }
}

fn of_csv(file: File) -> Option<String> {
    let mut reader = csv::Reader::from_reader(file);
    (reader.headers().ok()?.get(0)? == "sweep").then_some(())?;
    Some(reader.records().next()?.ok()?.get(0)?.to_string())
}

/// A cell as text; numbers in the shortest form that reads back the same.
pub(super) fn written(cell: &Cell) -> String {
    match cell {
        Cell::Number(number) => format!("{number:?}"),
        Cell::Integer(integer) => integer.to_string(),
        Cell::Text(text) => text.clone(),
        _ => String::new(),
    }
}

/// Writes rows into a file, in batches.
pub(super) enum TableWriter<'a> {
    Csv(Box<csv::Writer<&'a mut File>>),
    #[cfg(feature = "parquet")]
    Parquet(ParquetWriter<'a>),
}

impl<'a> TableWriter<'a> {
    pub fn new(kind: ColumnKind, file: &'a mut File, grid: &Grid) -> io::Result<TableWriter<'a>> {
        match kind {
            ColumnKind::Csv => {
                let mut writer = csv::Writer::from_writer(file);
                writer.write_record(grid.columns().iter().map(|(name, _)| name))?;
                Ok(TableWriter::Csv(Box::new(writer)))
            }
            #[cfg(feature = "parquet")]
            ColumnKind::Parquet => Ok(TableWriter::Parquet(ParquetWriter::new(file, grid)?)),
        }
    }

    pub fn write(&mut self, rows: &[Vec<Cell>]) -> io::Result<()> {
        match self {
            TableWriter::Csv(writer) => {
                rows.iter().try_for_each(|row| writer.write_record(row.iter().map(written)).map_err(io::Error::from))
            }
            #[cfg(feature = "parquet")]
            TableWriter::Parquet(writer) => writer.write(rows),
        }
    }

    pub fn finish(self) -> io::Result<()> {
        match self {
            TableWriter::Csv(mut writer) => writer.flush(),
            #[cfg(feature = "parquet")]
            TableWriter::Parquet(writer) => writer.finish(),
        }
    }
}
