//! The probability by which missions are ranked. ESP's confidence is a key of the mission, and another quantity.

use clap::Args;

use super::number_argument::{probability, whole};
use crate::plan::date_distribution::Confidence;

/// Options of commands that rank missions.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Confident {
    /// Rank by how long budgets are kept with this probability, such as 0.9, instead of in the design case: the Sun and [uncertainty] are drawn
    #[arg(long, alias = "confidence", value_name = "P", value_parser = probability)]
    probability: Option<f64>,
    /// Draws of each mission, with --probability
    #[arg(long, alias = "draws", value_name = "N", requires = "probability", default_value_t = 400)]
    #[arg(value_parser = whole(20_u32..=65_536))]
    samples: u32,
}

impl Confident {
    /// The requested confidence, if any.
    pub fn confidence(self) -> Option<Confidence> {
        self.probability.map(|probability| Confidence { probability, samples: self.samples })
    }
}
