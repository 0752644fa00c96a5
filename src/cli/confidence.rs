//! The confidence by which missions are ranked.

use clap::Args;

use super::number_argument::{probability, whole};
use crate::plan::date_distribution::Confidence;

/// Options of commands that rank missions.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Confident {
    /// Rank by how long budgets are kept with this probability, such as 0.9, instead of in the design case: the Sun and [uncertainty] are drawn
    #[arg(long, value_name = "P", value_parser = probability)]
    confidence: Option<f64>,
    /// Draws of each mission, with --confidence
    #[arg(long, value_name = "N", requires = "confidence", default_value_t = 400)]
    #[arg(value_parser = whole(20_u32..=65_536))]
    samples: u32,
}

impl Confident {
    /// The requested confidence, if any.
    pub fn confidence(self) -> Option<Confidence> {
        self.confidence.map(|probability| Confidence { probability, samples: self.samples })
    }
}
