use clap::Args;

use super::Options;
use crate::cli::file_argument::InputFile;
use crate::cli::number_argument::{number, whole};
use crate::error::InputError;
use crate::study::correction;

#[derive(Debug, Args)]
pub(super) struct Correction {
    /// Relative error (1 sigma) of each species' density
    #[arg(long, value_name = "SHARE", default_value_t = default().density_error, value_parser = share)]
    density_error: f64,
    /// Relative error (1 sigma) of each release time
    #[arg(long, value_name = "SHARE", default_value_t = default().release_error, value_parser = share)]
    release_error: f64,
    /// Relative error (1 sigma) of the well fill power
    #[arg(long, value_name = "SHARE", default_value_t = default().well_fill_error, value_parser = share)]
    well_fill_error: f64,
    /// Take parameters, their errors and correlations from what `ctiplan fit --json` printed, instead of the three above
    #[arg(long, value_name = "FIT.json", conflicts_with_all = ["density_error", "release_error", "well_fill_error"])]
    fit: Option<InputFile>,
    /// Iterations of the forward model
    #[arg(long, value_name = "N", default_value_t = default().iterations, value_parser = whole(1_u32..=50))]
    iterations: u32,
    /// Sets of believed parameters that are drawn
    #[arg(long, alias = "draws", value_name = "N", default_value_t = default().draws, value_parser = whole(2_u32..=10_000))]
    samples: u32,
    /// Read noise, e- per pixel [default: that of the mission's clock, or of its galaxy]
    #[arg(long, value_name = "ELECTRONS", value_parser = electrons)]
    read_noise_e: Option<f64>,
    /// Galaxies with noise that are corrected with the true model; 0 for none
    #[arg(long, value_name = "N", default_value_t = default().realisations, value_parser = whole(0_u32..=1_000_000))]
    realisations: u32,
    /// Seed of the draws and of the noise, in place of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
}

fn default() -> correction::Correction {
    correction::Correction::default()
}

fn share(text: &str) -> Result<f64, String> {
    number(text, |share| (0.0..=1.0).contains(&share), "a share between 0 and 1 is needed, such as 0.05 for 5 %")
}

fn electrons(text: &str) -> Result<f64, String> {
    number(text, |electrons| (0.0..=1e4).contains(&electrons), "a read noise between 0 and 10000 e- is needed")
}

impl Options for Correction {
    type Study = correction::Correction;

    fn study(&self, _: &[&str]) -> Result<correction::Correction, InputError> {
        Ok(correction::Correction {
            density_error: self.density_error,
            release_error: self.release_error,
            well_fill_error: self.well_fill_error,
            fit: self.fit.as_ref().map(|path| path.to_path_buf()),
            iterations: self.iterations,
            draws: self.samples,
            read_noise_e: self.read_noise_e,
            realisations: self.realisations,
            seed: self.seed,
        })
    }
}
