//! Signal-to-noise ratio ↔ flux.

use std::f64::consts::PI;

use super::Profile;
use crate::mission::{Galaxy, Mission};

/// Flux (e-) of a mission's galaxy: as given, or from its signal-to-noise ratio.
pub fn flux_e(mission: &Mission, galaxy: &Galaxy) -> f64 {
    match (galaxy.flux_e, galaxy.snr, galaxy.aperture_px) {
        (None, Some(snr), Some(aperture_px)) => {
            let share = Profile::of(galaxy, &mission.psf).within(aperture_px);
            flux_of(snr, share, aperture_px, mission.sky.background_e, galaxy.read_noise_e)
        }
        (flux_e, ..) => flux_e.expect("a galaxy that was read has a flux or a signal-to-noise ratio"),
    }
}

/// Flux (e-) for which the part `share` within an aperture has the signal-to-noise ratio `snr`, with its own photon noise,
/// background (e- per pixel) and read noise (e- per pixel).
///
/// ```text
/// S/N = s F / √(s F + π r² (B + R²))
/// ```
pub fn flux_of(snr: f64, share: f64, aperture_px: f64, background_e: f64, read_noise_e: f64) -> f64 {
    let noise2 = PI * aperture_px * aperture_px * (background_e + read_noise_e * read_noise_e);
    // (sF)² − (S/N)² sF − (S/N)² noise² = 0
    let signal = 0.5 * snr * (snr + (snr * snr + 4.0 * noise2).sqrt());
    signal / share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flux_has_the_signal_to_noise_ratio() {
        let flux_e = flux_of(13.0, 0.8, 4.0, 120.0, 4.0);
        let signal = 0.8 * flux_e;
        let noise2 = signal + PI * 16.0 * (120.0 + 16.0);
        assert!((signal / noise2.sqrt() - 13.0).abs() < 1e-9);
    }
}
