//! Shielding by sectors: material by solid angle, as found by ray tracing.

use std::path::Path;

use super::Depths;
use super::columns::Columns;
use super::text::Source;
use crate::error::InputError;

/// Shielding by sectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Sectors {
    /// The fraction of the solid angle of each sector; their sum is 1.
    pub weights: Vec<f64>,
    /// The material in front, as many as weights.
    pub depths: Depths,
}

/// Reads sectors from ECSV or CSV with the columns `weight` (solid angle in any unit or scale) and `thickness_mm` or
/// `areal_density_g_cm2`, converted from the unit in the header.
///
/// # Errors
/// If the file cannot be read or is not such a table, or the weights are zero: one message with file, line, column and value.
pub fn read_sectors(path: impl AsRef<Path>) -> Result<Sectors, InputError> {
    let source = Source::read(path.as_ref(), "sectors")?;
    let columns = Columns::of(&source)?;
    let mut weights = columns.numbers_in("weight", &["sr", ""])?;
    let depths = columns.depths()?;
    let sum: f64 = weights.iter().sum();
    if sum == 0.0 || !sum.is_finite() {
        return Err(columns.fault(None, "weight", format!("the sum of the weights is {sum}, and must be positive")));
    }
    weights.iter_mut().for_each(|weight| *weight /= sum);
    Ok(Sectors { weights, depths })
}
