//! Tables as Parquet files: columns by name, `meta` as the file's metadata.
//!
//! Parquet itself has no units: column names carry them, or the header that astropy keeps beside its columns
//! (`table_meta_yaml`), or the schema of pyarrow. Flat columns of numbers, booleans, dates and text are read; nested types are
//! rejected. Of pandas, an index that numbers the rows is left out, and `attrs` are `meta`.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use bytes::Bytes;
use chrono::{DateTime, Utc};
use parquet::basic::{Compression, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, KeyValue};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::record::Field;
use parquet::schema::types::Type;
use serde_json::Value;

use super::{Cell, Column, Datatype, Meta, Table, arrow_schema};
use crate::error::InputError;

/// The header of ECSV that astropy keeps among the metadata.
const ASTROPY: &str = "table_meta_yaml";

/// The columns as pyarrow describes them.
const ARROW: &str = "ARROW:schema";

/// What pandas keeps there: JSON about the table, and `attrs` of a DataFrame.
const PANDAS: &str = "pandas";
const PANDAS_ATTRS: &str = "PANDAS_ATTRS";

/// The name that pandas gives to an index without a name.
const PANDAS_INDEX: &str = "__index_level_";

/// Metadata for internal use by programs, and the beginning of keys for the lengths of astropy's texts.
const PRIVATE: [&str; 5] = [ARROW, ASTROPY, PANDAS, PANDAS_ATTRS, "table::"];

/// Rows per group when writing.
const GROUP: usize = 1 << 17;

impl Table {
    /// Fills the table from the bytes of a file.
    pub(super) fn read_parquet(&mut self, bytes: Vec<u8>) -> Result<(), InputError> {
        // The library panics on some invalid numbers in a damaged file.
        let read = catch_unwind(AssertUnwindSafe(|| self.read_columns(bytes)));
        let (columns, said) = read.unwrap_or_else(|_| Err(self.refuse("it is a damaged Parquet file")))?;
        self.columns = columns;
        let of = |key: &str| said.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str());
        for (name, unit) in of(ARROW).map(arrow_schema::units).unwrap_or_default() {
            if let Some(column) = self.columns.iter_mut().find(|column| column.name == name) {
                column.unit = Some(unit);
            }
        }
        if let Some(yaml) = of(ASTROPY) {
            self.describe(yaml)?;
        }
        self.of_pandas(of(PANDAS), of(PANDAS_ATTRS))?;
        let is_private = |key: &str| PRIVATE.iter().any(|private| key.starts_with(private));
        // Ours have `meta` in the header, and each entry by itself for programs that do not know of it.
        let others: Vec<_> = said.iter().filter(|(key, _)| !is_private(key) && self.meta(key).is_none()).collect();
        self.meta.extend(others.into_iter().map(|(key, value)| Meta {
            name: key.clone(),
            value: Cell::Text(value.clone()),
            line: None,
        }));
        self.check_names()
    }

    /// What pandas says: `attrs`, and an index that numbers the rows.
    fn of_pandas(&mut self, about: Option<&str>, attrs: Option<&str>) -> Result<(), InputError> {
        let json =
            |text: Option<&str>| text.and_then(|text| serde_json::from_str::<Value>(text).ok()).unwrap_or_default();
        let about = json(about);
        let attrs = if attrs.is_some() { json(attrs) } else { about["attributes"].clone() };
        for (name, value) in attrs.as_object().into_iter().flatten() {
            self.meta.push(Meta { name: name.clone(), value: Cell::from(value.clone()), line: None });
        }
        let is_index = |column: &Column| column.name.starts_with(PANDAS_INDEX);
        let is_number = |cell: &Cell| matches!(cell, Cell::Integer(_));
        self.columns.retain(|column| !(is_index(column) && column.cells.iter().all(is_number)));
        match self.columns.iter().find(|column| is_index(column)) {
            None => Ok(()),
            Some(column) => Err(self
                .fault(None, Some(&column.name), "it is the index of pandas, without a name")
                .with_help("give it one, df.index.name = \"date\", or leave it out: df.reset_index(drop=True)")),
        }
    }

    fn read_columns(&self, bytes: Vec<u8>) -> Result<Contents, InputError> {
        let length = bytes.len() as i64;
        let refused = |error: ParquetError| {
            let fault = self.refuse(format!("it is not a Parquet file that can be read: {error}"));
            if error.to_string().contains("Disabled feature") {
                return fault.with_help("write it with another compression, such as snappy, zstd, gzip or lz4");
            }
            fault
        };
        let reader = SerializedFileReader::new(Bytes::from(bytes)).map_err(refused)?;
        let parts = reader.metadata().row_groups().iter().flat_map(|group| group.columns());
        let lies_within = |part: &ColumnChunkMetaData| {
            let start = part.dictionary_page_offset().unwrap_or_else(|| part.data_page_offset());
            let size = part.compressed_size();
            start >= 0 && size >= 0 && start.checked_add(size).is_some_and(|end| end <= length)
        };
        if !parts.into_iter().all(lies_within) {
            return Err(self.refuse("it is a damaged Parquet file: a column lies beyond its end"));
        }
        let about = reader.metadata().file_metadata();
        let mut columns: Vec<Column> = Vec::new();
        for field in about.schema_descr().root_schema().get_fields() {
            if !field.is_primitive() {
                let problem =
                    format!("column {} holds lists or groups; numbers, truths or words are needed", field.name());
                return Err(self.refuse(problem));
            }
            columns.push(Column { name: field.name().to_string(), ..Column::default() });
        }
        let said = about.key_value_metadata().into_iter().flatten();
        let said = said.filter_map(|entry| Some((entry.key.clone(), entry.value.clone()?))).collect();
        let fields = about.schema_descr().columns().iter();
        let in_ns: Vec<bool> = fields.map(|field| is_in_nanoseconds(field.logical_type_ref())).collect();
        for row in reader.get_row_iter(None).map_err(refused)? {
            let fields = row.map_err(refused)?.into_columns();
            for ((column, (_, field)), in_ns) in columns.iter_mut().zip(fields).zip(&in_ns) {
                column.cells.push(if *in_ns { nanoseconds(&field) } else { cell(field) });
            }
        }
        columns.iter_mut().for_each(|column| column.datatype = datatype(&column.cells));
        Ok((columns, said))
    }

    /// The table as the bytes of a Parquet file, with its header as astropy keeps it.
    ///
    /// # Errors
    /// If a column has several values in a cell.
    pub fn to_parquet(&self) -> Result<Vec<u8>, InputError> {
        if let Some(column) = self.columns.iter().find(|column| column.is_nested()) {
            return Err(self.fault(None, Some(&column.name), "its cells hold lists, which are not written as Parquet"));
        }
        self.written().map_err(|error| self.refuse(format!("it cannot be written as Parquet: {error}")))
    }

    fn written(&self) -> Result<Vec<u8>, ParquetError> {
        let fields = self.columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("table").with_fields(fields).build()?;
        let text = |value: &Cell| if let Cell::Text(text) = value { text.clone() } else { value.to_string() };
        let header = KeyValue::new(ASTROPY.to_string(), self.header_yaml());
        let meta = self.meta.iter().map(|meta| KeyValue::new(meta.name.clone(), text(&meta.value)));
        let said = meta.chain([header]).collect();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(format!("ctiplan version {}", env!("CARGO_PKG_VERSION")))
            .set_key_value_metadata(Some(said))
            .build();
        let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
        for start in (0..self.rows()).step_by(GROUP) {
            let mut group = writer.next_row_group()?;
            for column in &self.columns {
                write_column(&mut group, column.datatype, &column.cells[start..(start + GROUP).min(self.rows())])?;
            }
            group.close()?;
        }
        writer.into_inner()
    }
}

/// Columns, and metadata by key.
type Contents = (Vec<Column>, Vec<(String, String)>);

/// Whether 64-bit integers are times in nanoseconds since 1970, which the library leaves as numbers.
fn is_in_nanoseconds(kind: Option<&LogicalType>) -> bool {
    matches!(kind, Some(LogicalType::Timestamp(time)) if time.unit == TimeUnit::NANOS)
}

fn nanoseconds(field: &Field) -> Cell {
    match field {
        Field::Long(number) => date(Some(DateTime::from_timestamp_nanos(*number))),
        _ => Cell::Missing,
    }
}

/// A point in time as text. Without a time zone it is taken as UTC.
fn date(time: Option<DateTime<Utc>>) -> Cell {
    time.map_or(Cell::Missing, |time| Cell::Text(time.format("%Y-%m-%dT%H:%M:%S%.f").to_string()))
}

fn cell(field: Field) -> Cell {
    match field {
        Field::Null => Cell::Missing,
        Field::Bool(truth) => Cell::Truth(truth),
        Field::Byte(number) => Cell::Integer(number.into()),
        Field::Short(number) => Cell::Integer(number.into()),
        Field::Int(number) => Cell::Integer(number.into()),
        Field::Long(number) => Cell::Integer(number),
        Field::UByte(number) => Cell::Integer(number.into()),
        Field::UShort(number) => Cell::Integer(number.into()),
        Field::UInt(number) => Cell::Integer(number.into()),
        Field::ULong(number) => i64::try_from(number).map_or(Cell::Number(number as f64), Cell::Integer),
        Field::Float16(number) => Cell::Number(number.into()),
        Field::Float(number) => Cell::Number(number.into()),
        Field::Double(number) => Cell::Number(number),
        Field::Str(text) => Cell::Text(text),
        Field::TimestampMillis(number) => date(DateTime::from_timestamp_millis(number)),
        Field::TimestampMicros(number) => date(DateTime::from_timestamp_micros(number)),
        // Dates, times of day and decimals as the library writes them.
        other => Cell::Text(other.to_string().trim_matches('"').to_string()),
    }
}

/// The datatype of cells, some of which may be missing.
fn datatype(cells: &[Cell]) -> Datatype {
    match cells.iter().find(|cell| **cell != Cell::Missing) {
        Some(Cell::Number(_)) | None => Datatype::Float(64),
        Some(Cell::Integer(_)) => Datatype::Int(64),
        Some(Cell::Truth(_)) => Datatype::Bool,
        Some(_) => Datatype::Text,
    }
}

fn field(column: &Column) -> Result<Arc<Type>, ParquetError> {
    let (physical, logical) = match column.datatype {
        Datatype::Float(_) => (Physical::DOUBLE, None),
        Datatype::Int(_) | Datatype::Uint(_) => (Physical::INT64, None),
        Datatype::Bool => (Physical::BOOLEAN, None),
        Datatype::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let builder = Type::primitive_type_builder(&column.name, physical).with_repetition(Repetition::OPTIONAL);
    Ok(Arc::new(builder.with_logical_type(logical).build()?))
}

fn write_column(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    datatype: Datatype,
    cells: &[Cell],
) -> Result<(), ParquetError> {
    match datatype {
        Datatype::Float(_) => write_cells::<DoubleType>(group, cells, Cell::number),
        Datatype::Int(_) | Datatype::Uint(_) => write_cells::<Int64Type>(group, cells, |cell| match cell {
            Cell::Integer(integer) => Some(*integer),
            _ => None,
        }),
        Datatype::Bool => write_cells::<BoolType>(group, cells, |cell| match cell {
            Cell::Truth(truth) => Some(*truth),
            _ => None,
        }),
        Datatype::Text => write_cells::<ByteArrayType>(group, cells, |cell| match cell {
            Cell::Missing => None,
            Cell::Text(text) => Some(ByteArray::from(text.as_str())),
            other => Some(ByteArray::from(other.to_string().as_str())),
        }),
    }
}

fn write_cells<T: parquet::data_type::DataType>(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    cells: &[Cell],
    value: impl Fn(&Cell) -> Option<T::T>,
) -> Result<(), ParquetError> {
    let values: Vec<Option<T::T>> = cells.iter().map(value).collect();
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let values: Vec<T::T> = values.into_iter().flatten().collect();
    let mut column = group.next_column()?.expect("as many columns as the schema has");
    column.typed::<T>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let text = "# mission: SNAP\nname,transfers,flux_e,e1\na,10,1150.25,0.1\n\"b, c\",20,,nan\n,30,1e5,-0.3\n";
        Table::parse("galaxies.csv", text).unwrap()
    }

    fn read(bytes: Vec<u8>) -> Result<Table, InputError> {
        let mut table = Table { name: "galaxies.parquet".into(), ..Table::default() };
        table.read_parquet(bytes).map(|()| table)
    }

    #[test]
    fn a_table_comes_back_from_parquet() {
        let (table, back) = (table(), read(table().to_parquet().unwrap()).unwrap());
        for (column, back) in table.columns.iter().zip(&back.columns) {
            assert_eq!((&column.name, column.datatype), (&back.name, back.datatype));
            // NaN is not equal to itself.
            assert_eq!(format!("{:?}", column.cells), format!("{:?}", back.cells));
        }
        assert_eq!(back.meta("mission"), Some(&Cell::Text("SNAP".into())));
        let place = back.fault(Some(1), Some("transfers"), "wrong").place;
        assert_eq!(place.unwrap(), "row 2: transfers = 20");
    }

    #[test]
    fn what_is_no_parquet_file_is_refused() {
        let whole = table().to_parquet().unwrap();
        for length in [4, 8, whole.len() / 2, whole.len() - 1] {
            let error = read(whole[..length].to_vec()).unwrap_err();
            assert!(error.problem.contains("not a Parquet file"), "{error}");
        }
    }
}
