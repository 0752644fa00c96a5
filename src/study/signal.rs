//! Signal-to-noise ratio of a galaxy in an aperture, and the exposure needed to restore it.
//!
//! ```text
//! S/N = s F t / √(s F t + π r² (B t + P + R²))
//! ```
//!
//! for a share s of the flux F within r, sky B, exposures t times as long, charge P added by the camera with its shot noise, and
//! read noise R. A survey covers an area per time of
//!
//! ```text
//! area ∝ 1/(t exposure + max(readout, slew))
//! ```
//!
//! with readout and slew in parallel.

use std::f64::consts::PI;

use crate::mission::{Galaxy, Mission, Survey};
use crate::numeric::root_finding;
use crate::physics::galaxy::{Profile, snr};

/// Exposures of the judged galaxy with one clock. Every study uses read noise, S/N and area from here.
#[derive(Clone, Debug)]
pub struct Exposure {
    /// The galaxy.
    pub aperture: Aperture,
    /// Read noise, e- per pixel.
    pub read_noise_e: f64,
    /// Readout time, s.
    pub readout_s: f64,
    survey: Option<Survey>,
}

impl Exposure {
    /// With the mission's own clock. If `[readout.noise]` has no read noise for it, that of the judged galaxy is used.
    pub fn of(mission: &Mission) -> Exposure {
        let line_time_ms = mission.readout.line_time_ms;
        let read_noise_e = read_noise_e(mission, line_time_ms).unwrap_or(mission.judged_galaxy().read_noise_e);
        Exposure::with(mission, line_time_ms, read_noise_e)
    }

    /// With another time between two parallel transfers (ms). None if `[readout.noise]` has no read noise for it.
    pub fn with_line_time(mission: &Mission, line_time_ms: f64) -> Option<Exposure> {
        Some(Exposure::with(mission, line_time_ms, read_noise_e(mission, line_time_ms)?))
    }

    fn with(mission: &Mission, line_time_ms: f64, read_noise_e: f64) -> Exposure {
        // At least as many rows as transfers, if the mission does not state the number of rows.
        let rows = mission.readout.noise.as_ref().map_or(mission.readout.transfers, |noise| noise.rows);
        Exposure {
            aperture: Aperture::of(mission, mission.judged_galaxy()),
            read_noise_e,
            readout_s: f64::from(rows) * line_time_ms / 1000.0,
            survey: mission.survey.clone(),
        }
    }

    /// Signal-to-noise ratio with charge (e- per pixel) on top of the sky.
    pub fn snr(&self, extra_e: f64) -> f64 {
        self.aperture.snr(extra_e, self.read_noise_e)
    }

    /// Area per time relative to other exposures, each as long as the mission's.
    pub fn area(&self, reference: &Exposure) -> f64 {
        reference.cycle(1.0) / self.cycle(1.0)
    }

    /// Area per time relative to other exposures, if these are lengthened or shortened to the others' signal-to-noise ratio in
    /// spite of charge (e- per pixel) on top of the sky.
    pub fn area_equal_depth(&self, extra_e: f64, reference: &Exposure) -> f64 {
        let times = self.aperture.times_for(reference.snr(0.0), extra_e, self.read_noise_e);
        reference.cycle(1.0) / self.cycle(times)
    }

    /// Time from one exposure to the next, s, if `times` times as long; without a survey, `times`.
    fn cycle(&self, times: f64) -> f64 {
        self.survey.as_ref().map_or(times, |survey| survey.cycle_s(times * survey.exposure_s, self.readout_s))
    }
}

/// Read noise (e-) of a clock with this time between two parallel transfers, by `[readout.noise]`.
fn read_noise_e(mission: &Mission, line_time_ms: f64) -> Option<f64> {
    let noise = mission.readout.noise.as_ref()?;
    noise.read_noise_e(noise.pixel_rate_khz(line_time_ms)?)
}

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
    /// The galaxy's own aperture, or the one with the best signal-to-noise ratio for the sky and the galaxy's read noise.
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

    /// The same for an exposure `times` times as long.
    fn after(&self, times: f64, extra_e: f64, read_noise_e: f64) -> f64 {
        let pixels = PI * self.radius_px * self.radius_px;
        let signal_e = self.signal_e * times;
        signal_e / (signal_e + pixels * (self.background_e * times + extra_e + read_noise_e * read_noise_e)).sqrt()
    }

    /// Factor on the exposure needed for a signal-to-noise ratio.
    pub fn times_for(&self, snr: f64, extra_e: f64, read_noise_e: f64) -> f64 {
        // The ratio increases at least as the square root of the exposure.
        let now = self.after(1.0, extra_e, read_noise_e);
        let far = 2.0 * (snr / now).powi(2).max((now / snr).powi(2)).ln().max(1.0);
        root_finding::between(-far, far, 1e-12, |log| (self.after(log.exp(), extra_e, read_noise_e) / snr).ln()).exp()
    }
}
