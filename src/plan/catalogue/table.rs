//! The changes of a catalogue as columns of its table.

use super::Catalogue;
use crate::error::InputError;
use crate::io::table::{Cell, Column, Datatype, Meta, Table};
use crate::physics::shape::ShapeChange;

/// A quantity of a change.
type Quantity = fn(&ShapeChange) -> f64;

/// Columns that are added, with unit, meaning and quantity.
const COLUMNS: [(&str, Option<&str>, &str, Quantity); 6] = [
    ("delta_e1", None, "change of e1", |change| change.delta_e1),
    ("delta_e2", None, "change of e2", |change| change.delta_e2),
    ("delta_x_px", Some("pix"), "change of the centroid along x", |change| change.delta_x_px),
    ("delta_y_px", Some("pix"), "change of the centroid along y, away from the register", |change| change.delta_y_px),
    ("delta_size", None, "change of the size over the size", |change| change.delta_size),
    ("delta_flux", None, "change of the weighted flux over the weighted flux", |change| change.delta_flux),
];

/// Column that says how a change was computed.
const COMPUTED: &str = "computed";

impl Catalogue {
    /// The table of galaxies with the columns `delta_e1`, `delta_e2`, `delta_x_px`, `delta_y_px`, `delta_size`, `delta_flux` (missing
    /// where no shape is left) and `computed` (`readout` or `emulator`).
    ///
    /// # Errors
    /// Where it has such a column already.
    ///
    /// # Panics
    /// If it has another number of rows than the catalogue.
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
