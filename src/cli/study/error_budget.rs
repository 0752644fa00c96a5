use clap::Args;

use super::Options;
use crate::cli::file_argument::InputFile;
use crate::cli::number_argument::whole;
use crate::error::InputError;
use crate::mission::Mission;
use crate::study::error_budget;

#[derive(Debug, Args)]
pub(super) struct ErrorBudget {
    /// Missions that are drawn
    #[arg(long, alias = "draws", value_name = "N", default_value_t = error_budget::ErrorBudget::default().draws, value_parser = whole(2_u32..=65_536))]
    samples: u32,
    /// Years since launch up to which dates are followed, at most 100 [default: the mission]
    #[arg(long, value_name = "YEARS")]
    horizon_yr: Option<f64>,
    /// Also evaluate with the detector of this mission, such as an n-channel one beside a p-channel one, all else the same
    #[arg(long, value_name = "MISSION")]
    detector_of: Option<InputFile>,
    /// Seed of the draws, in place of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
}

impl Options for ErrorBudget {
    type Study = error_budget::ErrorBudget;

    fn study(&self, _: &[&str]) -> Result<error_budget::ErrorBudget, InputError> {
        Ok(error_budget::ErrorBudget {
            draws: self.samples,
            horizon_yr: self.horizon_yr,
            detector_of: self.detector_of.as_ref().map(Mission::read).transpose()?,
            seed: self.seed,
        })
    }
}
