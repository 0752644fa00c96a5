use clap::Args;

use super::{Options, list, numbers};
use crate::cli::number_argument::{probability, whole};
use crate::error::InputError;
use crate::plan::date_distribution::Confidence;
use crate::study::shielding;

#[derive(Debug, Args)]
pub(super) struct Shielding {
    /// Thicknesses of aluminium, mm
    #[arg(long, value_name = "MM", default_value_t = list(&shielding::Shielding::default().thicknesses_mm))]
    thickness_mm: String,
    /// Confidences of ESP: that the solar proton fluence is not exceeded (`environment.confidence`)
    #[arg(long, alias = "confidence", value_name = "SHARES", default_value_t = list(&shielding::Shielding::default().confidences))]
    esp_confidence: String,
    /// Also draw the Sun and [uncertainty] behind each shield, and rank by how long budgets are kept with this probability, such as 0.9
    #[arg(long, value_name = "P", value_parser = probability)]
    probability: Option<f64>,
    /// Draws behind each shield, with --probability
    #[arg(long, alias = "draws", value_name = "N", requires = "probability", default_value_t = 400)]
    #[arg(value_parser = whole(20_u32..=65_536))]
    samples: u32,
}

impl Options for Shielding {
    type Study = shielding::Shielding;

    fn study(&self, _: &[&str]) -> Result<shielding::Shielding, InputError> {
        Ok(shielding::Shielding {
            thicknesses_mm: numbers("shielding.thickness_mm", &self.thickness_mm)?,
            confidences: numbers("environment.confidence", &self.esp_confidence)?,
            probability: self.probability.map(|probability| Confidence { probability, samples: self.samples }),
        })
    }
}
