use clap::Args;

use super::{Options, list};
use crate::cli::number_argument::{number, probability, whole};
use crate::error::InputError;
use crate::study::calibration;

#[derive(Debug, Args)]
pub(super) struct Calibration {
    /// Times between two calibrations, months
    #[arg(long, value_name = "MONTHS", default_value_t = list(&default().intervals_months))]
    interval_months: String,
    /// Relative error (1 sigma) of each species' density in one calibration
    #[arg(long, value_name = "SHARE", default_value_t = default().density_error, value_parser = share)]
    density_error: f64,
    /// Relative error (1 sigma) of each release time in one calibration
    #[arg(long, value_name = "SHARE", default_value_t = default().release_error, value_parser = share)]
    release_error: f64,
    /// Probability with which the requirement is to be met, by the draws of the Sun
    #[arg(long, alias = "confidence", value_name = "P", default_value_t = default().probability, value_parser = probability)]
    probability: f64,
    /// Draws of the Sun
    #[arg(long, alias = "draws", value_name = "N", default_value_t = default().samples, value_parser = whole(20_u32..=65_536))]
    samples: u32,
    /// Seed of the draws [default: the mission's]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

fn default() -> calibration::Calibration {
    calibration::Calibration::default()
}

fn share(text: &str) -> Result<f64, String> {
    number(text, |share| (0.0..=1.0).contains(&share), "a share between 0 and 1 is needed, such as 0.01 for 1 %")
}

impl Options for Calibration {
    type Study = calibration::Calibration;

    fn study(&self, _: &[&str]) -> Result<calibration::Calibration, InputError> {
        let months = |text: &str| text.trim().parse::<f64>().ok().filter(|months| months.is_finite());
        let refused = |text: &str| {
            InputError::new("cannot calibrate", format!("`{text}` is not a time between calibrations in months"))
                .with_help("--interval-months 1,3,6")
        };
        let intervals = self.interval_months.split(',').map(|text| months(text).ok_or_else(|| refused(text)));
        Ok(calibration::Calibration {
            intervals_months: intervals.collect::<Result<_, _>>()?,
            density_error: self.density_error,
            release_error: self.release_error,
            probability: self.probability,
            samples: self.samples,
            seed: self.seed,
        })
    }
}
