//! The changes of a catalogue as columns of its table.

use super::{Catalogue, Epochs};
use crate::error::InputError;
use crate::io::table::{Cell, Column, Datatype, Meta, Table};
use crate::physics::shape::ShapeChange;

/// A quantity of a change.
type Quantity = fn(&ShapeChange) -> f64;

/// Added columns, with unit, meaning and quantity.
const COLUMNS: [(&str, Option<&str>, &str, Quantity); 6] = [
    ("delta_e1", None, "change of e1", |change| change.delta_e1),
    ("delta_e2", None, "change of e2", |change| change.delta_e2),
    ("delta_x_px", Some("pix"), "change of the centroid along x", |change| change.delta_x_px),
    ("delta_y_px", Some("pix"), "change of the centroid along y, away from the register", |change| change.delta_y_px),
    ("delta_size", None, "change of the size over the size", |change| change.delta_size),
    ("delta_flux", None, "change of the weighted flux over the weighted flux", |change| change.delta_flux),
];

/// Column of the time, if there are several.
const TIME: &str = "t_yr";

/// Column that states how a change was computed.
const COMPUTED: &str = "computed";

impl Epochs {
    /// The table of galaxies with the changes at all epochs. For one epoch, as [`Catalogue::with_changes`]; for several, all
    /// galaxies at the first time, then all at the second, and so on, with the time in column `t_yr`.
    ///
    /// # Errors
    /// If the table already has a column of such a name.
    pub fn with_changes(&self, table: &Table) -> Result<Table, InputError> {
        let [first, others @ ..] = &self.0[..] else { return Ok(table.clone()) };
        let mut all = first.with_changes(table.clone())?;
        if others.is_empty() {
            return Ok(all);
        }
        if let Some(column) = all.column(TIME) {
            let problem = "the table has this column already, which identifies the epochs of the result";
            return Err(table.fault(None, Some(&column.name), problem).with_help("rename it, or run one epoch"));
        }
        for catalogue in others {
            let more = catalogue.with_changes(table.clone())?;
            for (column, more) in all.columns.iter_mut().zip(more.columns) {
                column.cells.extend(more.cells);
            }
        }
        let times = self.0.iter().flat_map(|one| std::iter::repeat_n(Cell::Number(one.t_yr), one.galaxies));
        all.columns.push(Column {
            name: TIME.into(),
            unit: Some("yr".into()),
            datatype: Datatype::Float(64),
            description: Some("time since launch".into()),
            cells: times.collect(),
            ..Column::default()
        });
        all.meta.retain(|meta| meta.name != TIME);
        all.lines.clear();
        Ok(all)
    }
}

impl Catalogue {
    /// The table of galaxies with the columns `delta_e1`, `delta_e2`, `delta_x_px`, `delta_y_px`, `delta_size`, `delta_flux` (missing
    /// if no shape is left) and `computed` (`readout` or `emulator`).
    ///
    /// # Errors
    /// If it already has such a column.
    ///
    /// # Panics
    /// If its number of rows differs from that of the catalogue.
    pub fn with_changes(&self, mut table: Table) -> Result<Table, InputError> {
        assert_eq!(table.rows(), self.changes.len(), "the catalogue's own table");
        let names = COLUMNS.iter().map(|(name, ..)| *name).chain([COMPUTED]);
        if let Some(name) = names.into_iter().find(|name| table.column(name).is_some()) {
            let problem = "the table has this column already, which is one of the result's";
            return Err(table.fault(None, Some(name), problem).with_help("rename it, or use the catalogue without it"));
        }
        for (name, unit, description, of) in COLUMNS {
            let cell =
                |change: &Option<ShapeChange>| change.as_ref().map_or(Cell::Missing, |change| Cell::Number(of(change)));
            table.columns.push(Column {
                name: name.into(),
                unit: unit.map(String::from),
                datatype: Datatype::Float(64),
                description: Some(description.into()),
                cells: self.changes.iter().map(cell).collect(),
                ..Column::default()
            });
        }
        let computed = |emulated: &bool| Cell::Text(if *emulated { "emulator" } else { "readout" }.into());
        table.columns.push(Column {
            name: COMPUTED.into(),
            datatype: Datatype::Text,
            cells: self.is_emulated.iter().map(computed).collect(),
            ..Column::default()
        });
        let said = [("mission", Cell::Text(self.mission.clone())), ("t_yr", Cell::Number(self.t_yr))];
        for (name, value) in said.into_iter().filter(|(name, _)| table.meta(name).is_none()).collect::<Vec<_>>() {
            table.meta.push(Meta { name: name.into(), value, line: None });
        }
        Ok(table)
    }
}
