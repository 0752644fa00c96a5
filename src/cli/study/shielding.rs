use clap::Args;

use super::{Options, list, numbers};
use crate::error::InputError;
use crate::study::shielding;

#[derive(Debug, Args)]
pub(super) struct Shielding {
    /// Thicknesses of aluminium, mm
    #[arg(long, value_name = "MM", default_value_t = list(&shielding::Shielding::default().thicknesses_mm))]
    thickness_mm: String,
    /// Probabilities that the solar proton fluence is not exceeded
    #[arg(long, value_name = "SHARES", default_value_t = list(&shielding::Shielding::default().confidences))]
    confidence: String,
}

impl Options for Shielding {
    type Study = shielding::Shielding;

    fn study(&self, _: &[&str]) -> Result<shielding::Shielding, InputError> {
        Ok(shielding::Shielding {
            thicknesses_mm: numbers("shielding.thickness_mm", &self.thickness_mm)?,
            confidences: numbers("environment.confidence", &self.confidence)?,
        })
    }
}
