//! The confidence by which missions are ranked.

use clap::Args;

use crate::plan::date_distribution::Confidence;

/// Options of commands that rank missions.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Confident {
    /// Rank by how long budgets are kept with this probability, such as 0.9, instead of in the design case: the Sun and [uncertainty] are drawn
    #[arg(long, value_name = "P", value_parser = probability)]
    confidence: Option<f64>,
    /// Draws of each mission, with --confidence
    #[arg(long, value_name = "N", requires = "confidence", default_value_t = 400)]
    #[arg(value_parser = clap::value_parser!(u32).range(20..=65_536))]
    samples: u32,
}

impl Confident {
    /// The requested confidence, if any.
    pub fn confidence(self) -> Option<Confidence> {
        self.confidence.map(|probability| Confidence { probability, samples: self.samples })
    }
}

/// Parses a probability.
pub(super) fn probability(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value < 1.0 => Ok(value),
        Ok(value) if (1.0..=100.0).contains(&value) => {
            Err(format!("allowed: above 0 and below 1; {value} % is {}", value / 100.0))
        }
        _ => Err("allowed: a number above 0 and below 1".into()),
    }
}
