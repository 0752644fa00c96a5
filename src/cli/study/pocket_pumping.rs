use clap::Args;

use super::{Options, numbers};
use crate::cli::number_argument::{number, positive, whole};
use crate::error::InputError;
use crate::study::pocket_pumping;

#[derive(Debug, Args)]
pub(super) struct PocketPumping {
    /// Temperatures of the pumping, K [default: the operating one, 20 K below, and up to 80 K above]
    #[arg(long, value_name = "KELVIN")]
    temperature_k: Option<String>,
    /// Phase times, ms [default: 0.001..10000:log:29]
    #[arg(long, value_name = "MS")]
    phase_ms: Option<String>,
    /// Largest number of cycles of one image
    #[arg(long, value_name = "N", default_value_t = default().cycles, value_parser = whole(1_u32..))]
    cycles: u32,
    /// Longest pumping of one image, s
    #[arg(long, value_name = "SECONDS", default_value_t = default().image_s, value_parser = positive)]
    image_s: f64,
    /// Images at each phase time
    #[arg(long, value_name = "N", default_value_t = default().images, value_parser = whole(1_u32..=100_000))]
    images: u32,
    /// Charge of the flat field, e- per pixel [default: 5 % of the full well]
    #[arg(long, value_name = "ELECTRONS", value_parser = positive)]
    flat_e: Option<f64>,
    /// Probability that a trap in the cloud catches an electron in a cycle
    #[arg(long, value_name = "SHARE", default_value_t = default().capture_probability, value_parser = share)]
    capture_probability: f64,
    /// Dipoles of each species that are simulated and fitted at each temperature
    #[arg(long, value_name = "N", default_value_t = default().dipoles, value_parser = whole(2_u32..=100_000))]
    dipoles: u32,
    /// Dipoles count as found from this number of sigma of the flat's noise
    #[arg(long, value_name = "SIGMA", default_value_t = default().threshold_sigma, value_parser = positive)]
    threshold_sigma: f64,
    /// Error of the thermometer, K
    #[arg(long, value_name = "KELVIN", default_value_t = default().temperature_error_k, value_parser = positive)]
    temperature_error_k: f64,
    /// Relative error (1 sigma) of densities and release times where pumping does not find the species
    #[arg(long, value_name = "SHARE", default_value_t = default().known_to, value_parser = share)]
    known_to: f64,
    /// Seed of the dipoles, in place of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
}

fn default() -> pocket_pumping::PocketPumping {
    pocket_pumping::PocketPumping::default()
}

fn share(text: &str) -> Result<f64, String> {
    number(text, |share| share > 0.0 && share <= 1.0, "a share above 0 and up to 1 is needed, such as 0.5")
}

impl Options for PocketPumping {
    type Study = pocket_pumping::PocketPumping;

    fn study(&self, _: &[&str]) -> Result<pocket_pumping::PocketPumping, InputError> {
        let read = |key: &str, text: &Option<String>| text.as_ref().map(|text| numbers(key, text)).transpose();
        Ok(pocket_pumping::PocketPumping {
            temperatures_k: read("detector.temperature_k", &self.temperature_k)?,
            phases_ms: read("readout.line_time_ms", &self.phase_ms)?,
            cycles: self.cycles,
            image_s: self.image_s,
            images: self.images,
            flat_e: self.flat_e,
            capture_probability: self.capture_probability,
            dipoles: self.dipoles,
            threshold_sigma: self.threshold_sigma,
            temperature_error_k: self.temperature_error_k,
            known_to: self.known_to,
            seed: self.seed,
        })
    }
}
