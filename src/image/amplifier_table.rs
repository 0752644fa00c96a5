//! Tables of amplifiers: an ECSV or CSV file with one row for each amplifier of a camera.
//!
//! ```text
//! table ─▶ rows, read once ─▶ with the HDUs of a file ─▶ amplifiers of each frame
//! ```
//!
//! Columns are listed in `docs/images.md`. Sections are in FITS notation, `[1:2048,1:2048]`: columns, then rows, counted from 1,
//! both ends included. Instead of a number, a cell may name the header keyword that holds it: `keyword:ATODGNA`.

mod columns;
mod section;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use super::amplifier::{Amplifier, Amplifiers};
use super::fits::{Hdu, HduKind};
use super::frame::{Corner, Geometry, Transfers};
use super::unit::{Scale, Unit, number_of, refuse_unknown_bias};
use super::{Choice, image_shape};
use crate::error::InputError;
use crate::io::table::Table;
use crate::model::Device;
use columns::{Cells, Value};
use section::Section;

/// The amplifiers of a camera, from a table.
#[derive(Clone, Debug)]
pub struct AmplifierTable {
    /// The path as given.
    pub name: String,
    table: Table,
    rows: Vec<Row>,
}

/// One amplifier, before the HDU is known.
#[derive(Clone, Debug)]
struct Row {
    hdu: Choice,
    name: String,
    corner: Corner,
    /// Its pixels of the HDU; none: all.
    section: Option<Value<Section>>,
    /// Its pixels of the image; none: all but prescan and overscan.
    data_section: Option<Value<Section>>,
    prescan_columns: usize,
    overscan_columns: usize,
    overscan_rows: usize,
    rows_before: u32,
    columns_before: u32,
    charge_before_e: f64,
    gain_e_per_dn: Option<Value<f64>>,
    read_noise_e: Option<Value<f64>>,
    bias_dn: Option<Value<f64>>,
    saturated_dn: Option<Value<f64>>,
    density_factor: f64,
    serial_density_factor: f64,
    /// Densities at the time of the exposure, per px, by the name of the species.
    densities_per_px: BTreeMap<String, f64>,
}

/// An HDU, by its index, with its amplifiers.
pub type Frame = (usize, Amplifiers);

/// An amplifier of a frame as given by its row, without the traps.
pub(crate) struct Place {
    /// Index of its row in the table.
    pub index: usize,
    pub name: String,
    /// Its rows and columns of the frame.
    pub rows: Range<usize>,
    pub columns: Range<usize>,
    pub geometry: Geometry,
    pub gain_e_per_dn: f64,
    /// In the unit of the frame, if given.
    pub bias_dn: Option<f64>,
    /// In the unit of the frame, if given.
    pub saturated_dn: Option<f64>,
    pub read_noise_e: Option<f64>,
}

impl Place {
    /// Whether it shares a pixel with another amplifier.
    fn overlaps(&self, other: &Place) -> bool {
        let meet = |a: &Range<usize>, b: &Range<usize>| a.start < b.end && b.start < a.end;
        meet(&self.rows, &other.rows) && meet(&self.columns, &other.columns)
    }

    /// Adds the traps of its pixels.
    fn with(self, device: Device) -> Amplifier {
        Amplifier {
            name: Some(self.name),
            rows: self.rows,
            columns: self.columns,
            geometry: self.geometry,
            scale: Scale { gain_e_per_dn: self.gain_e_per_dn, bias_dn: self.bias_dn.unwrap_or(0.0) },
            saturated_dn: self.saturated_dn,
            read_noise_e: self.read_noise_e,
            device,
            factors: None,
        }
    }
}

impl AmplifierTable {
    /// Reads a table.
    ///
    /// # Errors
    /// If the file cannot be read, a column is unknown or missing, or a cell is invalid: one message with line, column and value.
    pub fn read(path: impl AsRef<Path>) -> Result<AmplifierTable, InputError> {
        let name = path.as_ref().display().to_string();
        let refused = format!("cannot use amplifiers `{name}`");
        let read = || {
            let table = Table::read(path)?;
            let rows = columns::rows(&table)?;
            Ok((table, rows))
        };
        let (table, rows) = read().map_err(|error: InputError| InputError { refused, ..error })?;
        Ok(AmplifierTable { name, table, rows })
    }

    /// The content of all rows, as a text for comparisons.
    pub(super) fn contents(&self) -> String {
        format!("{:?}", self.rows)
    }

    /// The frames of a file with their amplifiers, in the file's order: the HDUs named in the rows. `device` is the mission's.
    ///
    /// # Errors
    /// If a row names no HDU of the file, or one that is not an image; if a section does not fit it, amplifiers overlap, or a
    /// keyword or the bias of counts is missing.
    pub(crate) fn frames(&self, hdus: &[Hdu], transfers: Transfers, device: &Device) -> Result<Vec<Frame>, InputError> {
        let with_traps = |hdu: usize, place: Place| {
            refuse_unknown_bias(&hdus[hdu], &place.geometry, place.bias_dn).map_err(|error| {
                let help = "give bias_dn in the table: 0 if it is subtracted".to_string();
                InputError { place: Some(error.refused.clone()), help: Some(help), ..self.refused(error) }
            })?;
            let device = self.device(place.index, device)?;
            Ok(place.with(device))
        };
        let frame = |(hdu, places): (usize, Vec<Place>)| {
            let amplifiers: Result<Vec<Amplifier>, InputError> =
                places.into_iter().map(|place| with_traps(hdu, place)).collect();
            Ok((hdu, Amplifiers(amplifiers?)))
        };
        self.places(hdus, transfers)?.into_iter().map(frame).collect()
    }

    /// The same without traps.
    ///
    /// # Errors
    /// As [`AmplifierTable::frames`].
    pub(crate) fn places(&self, hdus: &[Hdu], transfers: Transfers) -> Result<Vec<(usize, Vec<Place>)>, InputError> {
        let mut frames: BTreeMap<usize, Vec<Place>> = BTreeMap::new();
        for (index, row) in self.rows.iter().enumerate() {
            let mut named = hdus.iter().filter(|hdu| row.hdu.is(hdu)).peekable();
            if named.peek().is_none() {
                let known: Vec<String> = hdus.iter().map(Hdu::to_string).collect();
                let problem = format!("the file has no such HDU; it has {}", known.join(", "));
                return Err(self.fault(index, "hdu", problem));
            }
            for hdu in named {
                let place = self.place(index, hdu, &hdus[0], transfers)?;
                let others = frames.entry(hdu.index).or_default();
                if let Some(other) = others.iter().find(|other| other.overlaps(&place)) {
                    let section = super::amplifier::section(&place.rows, &place.columns);
                    let problem = format!("in {hdu}, its pixels {section} overlap those of {}", other.name);
                    return Err(self.fault(index, "hdu", problem).with_help("give each its own section"));
                }
                others.push(place);
            }
        }
        Ok(frames.into_iter().collect())
    }

    /// The amplifier of a row in an HDU.
    fn place(&self, index: usize, hdu: &Hdu, primary: &Hdu, transfers: Transfers) -> Result<Place, InputError> {
        let row = &self.rows[index];
        let cells = Cells { table: &self.table, row: index };
        if matches!(hdu.kind, HduKind::Empty | HduKind::NoImage) {
            return Err(self.fault(index, "hdu", format!("{hdu} is not an image")));
        }
        let shape = image_shape(hdu).map_err(|error| self.refused(error))?;
        let own = |error: InputError| self.refused(error);
        let section = row.section.as_ref().map(|section| section.of(hdu)).transpose().map_err(own)?;
        let section = section.unwrap_or(Section::whole(shape));
        let (rows, columns) =
            section.within(shape).map_err(|problem| self.fault(index, "section", format!("{hdu}: {problem}")))?;
        let geometry = self.geometry(index, hdu, transfers, (&rows, &columns))?;
        geometry
            .check((rows.len(), columns.len()))
            .map_err(|error| self.fault(index, "hdu", format!("{hdu}, {}: {}", error.refused, error.problem)))?;
        let number = |value: &Option<Value<f64>>, column: &str| match value {
            None => Ok(None),
            Some(Value::Given(number)) => Ok(Some(*number)),
            Some(Value::Keyword(keyword)) => {
                number_of(keyword, hdu, primary, &format!("give a number in column {column}"))
                    .and_then(|number| {
                        cells.allowed(column, number).map_err(|_| {
                            InputError::new(
                                hdu.to_string(),
                                format!("{keyword} = {number} is not allowed for {column}"),
                            )
                        })
                    })
                    .map(Some)
                    .map_err(|error| InputError { place: Some(error.refused.clone()), ..self.refused(error) })
            }
        };
        let unit = Unit {
            gain_e_per_dn: number(&row.gain_e_per_dn, "gain_e_per_dn")?,
            gain_keyword: None,
            bias_dn: None,
            saturated_dn: None,
        };
        let scale = unit.scale(hdu, primary).map_err(|error| {
            let help = "give gain_e_per_dn in the table, or correct BUNIT".to_string();
            InputError { place: Some(error.refused.clone()), help: Some(help), ..self.refused(error) }
        })?;
        Ok(Place {
            index,
            name: row.name.clone(),
            rows,
            columns,
            geometry,
            gain_e_per_dn: scale.gain_e_per_dn,
            bias_dn: number(&row.bias_dn, "bias_dn")?,
            saturated_dn: number(&row.saturated_dn, "saturated_dn")?,
            read_noise_e: number(&row.read_noise_e, "read_noise_e")?,
        })
    }

    /// How an amplifier's pixels lie on the detector.
    fn geometry(
        &self,
        index: usize,
        hdu: &Hdu,
        transfers: Transfers,
        (rows, columns): (&Range<usize>, &Range<usize>),
    ) -> Result<Geometry, InputError> {
        let row = &self.rows[index];
        let geometry = Geometry {
            transfers,
            corner: row.corner,
            prescan_columns: row.prescan_columns,
            overscan_columns: row.overscan_columns,
            overscan_rows: row.overscan_rows,
            rows_before: row.rows_before,
            charge_before_e: row.charge_before_e,
            columns_before: row.columns_before,
            ..Geometry::default()
        };
        let Some(data) = &row.data_section else { return Ok(geometry) };
        let fault = |problem: String| self.fault(index, "data_section", format!("{hdu}: {problem}"));
        let (data_rows, data_columns) =
            data.of(hdu).map_err(|error| self.refused(error))?.inside((rows, columns)).map_err(&fault)?;
        let around = |all: &Range<usize>, image: &Range<usize>, reversed: bool| {
            let (low, high) = (image.start - all.start, all.end - image.end);
            if reversed { (high, low) } else { (low, high) }
        };
        let (prescan_columns, overscan_columns) = around(columns, &data_columns, row.corner.is_right());
        let (rows_first, overscan_rows) = around(rows, &data_rows, row.corner.is_upper());
        if rows_first > 0 {
            return Err(fault(format!("{rows_first} rows are read before the first row of the image"))
                .with_help("leave them out with column section"));
        }
        Ok(Geometry { prescan_columns, overscan_columns, overscan_rows, ..geometry })
    }

    /// The mission's detector with the traps of an amplifier.
    fn device(&self, index: usize, device: &Device) -> Result<Device, InputError> {
        let row = &self.rows[index];
        let mut device = device.with_traps_times(row.density_factor, row.serial_density_factor);
        for (name, density_per_px) in &row.densities_per_px {
            match device.traps.iter_mut().find(|species| species.name == *name) {
                Some(species) => species.density_per_px = *density_per_px,
                None => {
                    let known: Vec<&str> = device.traps.iter().map(|species| species.name.as_str()).collect();
                    let problem = format!("the mission has no such species; it has {}", known.join(", "));
                    return Err(self.fault(index, &format!("{}{name}", columns::DENSITY), problem));
                }
            }
        }
        Ok(device)
    }

    fn fault(&self, row: usize, column: &str, problem: String) -> InputError {
        let column = if self.table.column(column).is_some() { column } else { "hdu" };
        self.refused(self.table.fault(Some(row), Some(column), problem))
    }

    fn refused(&self, error: InputError) -> InputError {
        InputError { refused: format!("cannot use amplifiers `{}`", self.name), ..error }
    }
}
