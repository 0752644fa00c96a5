//! Signal-to-noise ratio of a galaxy in an aperture, and what it takes to have it back.
//!
//! ```text
//! S/N = s F t / √(s F t + π r² (B t + P + R²))
//! ```
//!
//! for a share s of the flux F within r, sky B, exposures t times as long, charge P that is put in by the camera with its shot
//! noise, and read noise R.

use std::f64::consts::PI;

use crate::galaxy::{Profile, snr};
use crate::mission::{Galaxy, Mission};
use crate::root;

/// A galaxy in an aperture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aperture {
    /// Radius, px.
    pub radius_px: f64,
    /// Flux within, e-.
    pub signal_e: f64,
    /// Sky, e- per pixel.
    pub background_e: f64,
}

impl Aperture {
    /// The galaxy's own aperture, or the one of the best signal-to-noise ratio against the sky and the galaxy's read noise.
    pub fn of(mission: &Mission, galaxy: &Galaxy) -> Aperture {
        let profile = Profile::of(galaxy, &mission.psf);
        let flux_e = snr::flux_e(mission, galaxy);
        let background_e = mission.sky.background_e;
        let within =
            |radius_px: f64| Aperture { radius_px, signal_e: flux_e * profile.within(radius_px), background_e };
        let ratio = |radius_px: &f64| within(*radius_px).snr(0.0, galaxy.read_noise_e);
        let best = || {
            let radii = (1..=200).map(|step| galaxy.weight_px * 3.0 * f64::from(step) / 200.0);
            radii.max_by(|a, b| ratio(a).total_cmp(&ratio(b))).expect("many radii")
        };
        within(galaxy.aperture_px.unwrap_or_else(best))
    }

    /// Signal-to-noise ratio with charge (e- per pixel) on top of the sky, and read noise (e-).
    pub fn snr(&self, extra_e: f64, read_noise_e: f64) -> f64 {
        self.after(1.0, extra_e, read_noise_e)
    }

    /// The same after an exposure so many times as long.
    fn after(&self, times: f64, extra_e: f64, read_noise_e: f64) -> f64 {
        let pixels = PI * self.radius_px * self.radius_px;
        let signal_e = self.signal_e * times;
        signal_e / (signal_e + pixels * (self.background_e * times + extra_e + read_noise_e * read_noise_e)).sqrt()
    }

    /// How many times as long an exposure must be to have a signal-to-noise ratio.
    pub fn times_for(&self, snr: f64, extra_e: f64, read_noise_e: f64) -> f64 {
        // The ratio rises with the exposure at least as its root.
        let now = self.after(1.0, extra_e, read_noise_e);
        let far = 2.0 * (snr / now).powi(2).max((now / snr).powi(2)).ln().max(1.0);
        root::between(-far, far, 1e-12, |log| (self.after(log.exp(), extra_e, read_noise_e) / snr).ln()).exp()
    }
}
