//! Floors of systematic errors, which do not average down with the number of measurements.
//!
//! ```text
//! σ² = σ_row² + floor² + (share value)²
//! ```
//!
//! `floor` is that of the file (`meta.floor`, in the unit of the value), `share` that of the mission (`[fit] floor`). Both are
//! assumed to be independent from row to row, and add in quadrature.

use super::Reader;
use super::units::Unit;
use crate::error::InputError;

impl Reader<'_> {
    /// The floor of a row's error, in the observable's unit: that of the file and that of the mission, in quadrature.
    ///
    /// # Errors
    /// If the file's floor is not a number, or negative.
    pub(super) fn floor(&self, row: usize, value: f64) -> Result<f64, InputError> {
        let relative = self.mission.fit.floor * value;
        Ok(self.floor_of_file(row)?.hypot(relative))
    }

    /// The file's floor, in the observable's unit: a column if there is one, otherwise `meta.floor`, otherwise 0.
    fn floor_of_file(&self, row: usize) -> Result<f64, InputError> {
        let unit = Unit::of(self.observable);
        let Some((floor, place)) = self.number_by(row, "floor", unit, |conversion, theirs| conversion.scale(theirs))?
        else {
            return Ok(0.0);
        };
        if floor.is_finite() && floor >= 0.0 {
            return Ok(floor);
        }
        let problem = format!("the floor of errors is a number from 0 on; this is {floor}{}", unit.behind());
        let help = "give the systematic error of each value (1 sigma), in the unit of the value";
        Err(self.table.fault(Some(row), Some(&place), problem).with_help(help))
    }
}
