use clap::Args;

use super::Options;
use crate::cli::number_argument::{probability, whole};
use crate::error::InputError;
use crate::plan::date_distribution::Confidence;
use crate::study::requirement;

#[derive(Debug, Args)]
pub(super) struct Requirement {
    /// Also find what keeps the budget with this probability, with the Sun and [uncertainty] drawn; 0: leave that out
    #[arg(long, alias = "confidence", value_name = "P", default_value = "0.9", value_parser = probability_or_none)]
    probability: f64,
    /// Draws of each mission
    #[arg(long, alias = "draws", value_name = "N", default_value_t = 1000, value_parser = whole(20_u32..=65_536))]
    samples: u32,
}

impl Options for Requirement {
    type Study = requirement::Requirement;

    fn study(&self, _: &[&str]) -> Result<requirement::Requirement, InputError> {
        let asked =
            (self.probability > 0.0).then_some(Confidence { probability: self.probability, samples: self.samples });
        Ok(requirement::Requirement { confidence: asked })
    }
}

fn probability_or_none(text: &str) -> Result<f64, String> {
    if text.trim() == "0" { Ok(0.0) } else { probability(text) }
}
