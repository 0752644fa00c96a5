//! Rows → Parquet.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::sync::Arc;

use chrono::{Datelike, NaiveDate};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use super::grid::{Grid, Holds};
use crate::io::table::Cell;

/// Key of the fingerprint in a file's metadata.
const FINGERPRINT: &str = "ctiplan.sweep";

/// Fingerprint of the sweep whose result is in a file.
pub(super) fn fingerprint(file: File) -> Option<String> {
    let reader = SerializedFileReader::new(file).ok()?;
    let known = reader.metadata().file_metadata().key_value_metadata()?;
    known.iter().find(|entry| entry.key == FINGERPRINT)?.value.clone()
}

/// Writes rows into a file, in groups.
pub(super) struct ParquetWriter<'a> {
    holds: Vec<Holds>,
    writer: Box<SerializedFileWriter<BufWriter<&'a mut File>>>,
}

impl<'a> ParquetWriter<'a> {
    pub fn new(file: &'a mut File, grid: &Grid) -> io::Result<ParquetWriter<'a>> {
        let columns = grid.columns();
        let fields = columns.iter().map(|(name, holds)| field(name, *holds)).collect::<Result<Vec<_>, _>>();
        let schema = fields.and_then(|fields| Type::group_type_builder("sweep").with_fields(fields).build());
        let said = [(FINGERPRINT, grid.fingerprint.as_str()), ("ctiplan.version", env!("CARGO_PKG_VERSION"))];
        let said = said.map(|(key, value)| KeyValue::new(key.to_string(), value.to_string())).to_vec();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(format!("ctiplan version {}", env!("CARGO_PKG_VERSION")))
            .set_key_value_metadata(Some(said))
            .build();
        let writer = schema
            .and_then(|schema| SerializedFileWriter::new(BufWriter::new(file), Arc::new(schema), Arc::new(properties)));
        let holds = columns.into_iter().map(|(_, holds)| holds).collect();
        Ok(ParquetWriter { holds, writer: Box::new(writer.map_err(plain)?) })
    }

    pub fn write(&mut self, rows: &[Vec<Cell>]) -> io::Result<()> {
        if rows.is_empty() {
            return Ok(());
        }
        row_group(&mut self.writer, &self.holds, rows).map_err(plain)
    }

    pub fn finish(self) -> io::Result<()> {
        self.writer.into_inner().map_err(plain)?.flush()
    }
}

/// The error of a file, without the library's own words around it.
fn plain(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(error) => io::Error::other(error),
        },
        error => io::Error::other(error),
    }
}

fn field(name: &str, holds: Holds) -> Result<Arc<Type>, ParquetError> {
    let (physical, logical) = match holds {
        Holds::Numbers => (Physical::DOUBLE, None),
        Holds::Integers => (Physical::INT64, None),
        Holds::Words => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Holds::Days => (Physical::INT32, Some(LogicalType::Date)),
    };
    let builder = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
    Ok(Arc::new(builder.with_logical_type(logical).build()?))
}

fn row_group<W: Write + Send>(
    writer: &mut SerializedFileWriter<W>,
    holds: &[Holds],
    rows: &[Vec<Cell>],
) -> Result<(), ParquetError> {
    let mut group = writer.next_row_group()?;
    for (column, holds) in holds.iter().enumerate() {
        let cells = || rows.iter().map(move |row| &row[column]);
        match holds {
            Holds::Numbers => write_column::<DoubleType, W>(&mut group, cells(), |cell| match cell {
                Cell::Number(number) => Some(*number),
                _ => None,
            }),
            Holds::Integers => write_column::<Int64Type, W>(&mut group, cells(), |cell| match cell {
                Cell::Integer(integer) => Some(*integer),
                _ => None,
            }),
            Holds::Words => write_column::<ByteArrayType, W>(&mut group, cells(), |cell| match cell {
                Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                _ => None,
            }),
            Holds::Days => write_column::<Int32Type, W>(&mut group, cells(), |cell| match cell {
                Cell::Text(text) => text.parse().ok().map(days_since_1970),
                _ => None,
            }),
        }?;
    }
    group.close()?;
    Ok(())
}

fn write_column<'c, T: parquet::data_type::DataType, W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    cells: impl Iterator<Item = &'c Cell>,
    value: impl Fn(&Cell) -> Option<T::T>,
) -> Result<(), ParquetError> {
    let values: Vec<Option<T::T>> = cells.map(value).collect();
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let values: Vec<T::T> = values.into_iter().flatten().collect();
    let mut column = group.next_column()?.expect("as many columns as the schema has");
    column.typed::<T>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

fn days_since_1970(day: NaiveDate) -> i32 {
    day.num_days_from_ce() - NaiveDate::default().num_days_from_ce()
}
