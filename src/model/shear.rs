//! How a galaxy's measured ellipticity responds to shear, before and after the readout.
//!
//! A galaxy is drawn with a shear of ± g before the PSF. Its response to shear is
//!
//! ```text
//! R = (e(+g) − e(−g)) / 2g
//! ```
//!
//! of the estimator itself, independent of its definition: no assumption on the profile or the PSF enters. Its response to the
//! shape of the PSF is determined in the same way, with the PSF sheared by ± g, relative to that of a star measured with the same
//! weight:
//!
//! ```text
//! S = (e(PSF +g) − e(PSF −g)) / (e*(PSF +g) − e*(PSF −g))
//! ```
//!
//! A survey corrects galaxies for the ellipticity of its PSF model, which is derived from stars. If these are trailed by Δe*, the
//! correction removes S Δe* from the galaxy's Δe.

use crate::error::InputError;
use crate::mission::{Dither, Mission};
use crate::model::noise::Realisations;
use crate::model::{Device, Model, Scene};
use crate::physics::accuracy::Purpose;
use crate::physics::conditions::Conditions;
use crate::physics::galaxy::LensedGalaxy;

/// Shear of a galaxy, and of the PSF: second-order terms are a few 1e-4 of the response.
const SHEAR: f64 = 0.01;

/// Half-light radius of a star, px.
const STAR_PX: f64 = 0.001;

/// A galaxy somewhere on the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurveyGalaxy {
    /// Flux, e-.
    pub flux_e: f64,
    /// Circularised half-light radius before the PSF, px.
    pub half_light_px: f64,
    /// Sersic index.
    pub sersic_index: f64,
    /// Intrinsic ellipticity (e1, e2).
    pub ellipticity: [f64; 2],
    /// σ of the weight, px.
    pub weight_px: f64,
    /// Parallel transfers.
    pub transfers: u32,
    /// Read noise, e- per pixel.
    pub read_noise_e: f64,
}

/// Effects of shear, the PSF and trailing on a galaxy's ellipticity; members 1 and 2 of each.
#[derive(Clone, Debug, PartialEq)]
pub struct ShearResponse {
    /// R before the readout.
    pub before: [f64; 2],
    /// S; 0 without stars.
    pub leakage: [f64; 2],
    /// At each of the devices.
    pub trailed: Vec<TrailedResponse>,
}

/// Changes by trailing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrailedResponse {
    /// Δe1 and Δe2 of the galaxy.
    pub change: [f64; 2],
    /// R after the readout less R before.
    pub response: [f64; 2],
    /// Δe1 and Δe2 of a star of the PSF model, at the same place.
    pub star: [f64; 2],
}

/// How a galaxy of a survey is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveyMeasurement {
    /// Its positions in the exposures over which changes of shape are averaged; at least one.
    pub dithers: Vec<Dither>,
    /// Flux of the stars from which the PSF model is derived, e-.
    pub psf_stars_e: Option<f64>,
    /// Noise, if it is included.
    pub noise: Option<Realisations>,
}

/// Mean ellipticity before the readout, and its changes by several devices.
struct Measured {
    before: [f64; 2],
    changes: Vec<[f64; 2]>,
}

impl Model {
    /// Response of a galaxy to shear and trailing at some times (years since launch), averaged over the exposures that have it on
    /// the detector. None if it, or a star, has no measurable shape before or after, or if no exposure has it.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn shear_response(
        &self,
        galaxy: &SurveyGalaxy,
        times_yr: &[f64],
        how: &SurveyMeasurement,
    ) -> Result<Option<ShearResponse>, InputError> {
        let device = |t_yr: &f64, dither: Dither| -> Result<Option<Device>, InputError> {
            let Some(transfers) = farther(galaxy.transfers, dither.rows) else { return Ok(None) };
            let at = Conditions { transfers, ..self.conditions(*t_yr) };
            Ok(self.device(&at)?.fit_for(Purpose::ManyShapes).columns_farther(dither.columns))
        };
        let mut devices = Vec::with_capacity(how.dithers.len() * times_yr.len());
        for dither in &how.dithers {
            let exposure: Option<Vec<Device>> =
                times_yr.iter().map(|t_yr| device(t_yr, *dither)).collect::<Result<_, _>>()?;
            devices.extend(exposure.into_iter().flatten());
        }
        if devices.is_empty() {
            return Ok(None);
        }
        let survey = Survey { model: self, galaxy, how };
        let found = survey.response(&devices)?;
        Ok(found.map(|found| ShearResponse { trailed: mean_of_exposures(&found.trailed, times_yr.len()), ..found }))
    }
}

/// `transfers` plus `more`; None if the object is not on the detector.
pub(super) fn farther(transfers: u32, more: i64) -> Option<u32> {
    u32::try_from(i64::from(transfers) + more).ok().filter(|transfers| *transfers > 0)
}

/// Changes at each of `times` times, averaged over consecutive exposures.
fn mean_of_exposures(trailed: &[TrailedResponse], times: usize) -> Vec<TrailedResponse> {
    let exposures = trailed.len() / times;
    if exposures == 1 {
        return trailed.to_vec();
    }
    let mean = |of: fn(&TrailedResponse) -> [f64; 2], time: usize| {
        let sum = |member: usize| trailed[time..].iter().step_by(times).map(|one| of(one)[member]).sum::<f64>();
        [0, 1].map(|member| sum(member) / exposures as f64)
    };
    let at = |time: usize| TrailedResponse {
        change: mean(|one| one.change, time),
        response: mean(|one| one.response, time),
        star: mean(|one| one.star, time),
    };
    (0..times).map(at).collect()
}

/// A galaxy to be measured.
struct Survey<'a> {
    model: &'a Model,
    galaxy: &'a SurveyGalaxy,
    how: &'a SurveyMeasurement,
}

impl Survey<'_> {
    fn response(&self, devices: &[Device]) -> Result<Option<ShearResponse>, InputError> {
        let mut found = ShearResponse {
            before: [0.0; 2],
            leakage: [0.0; 2],
            trailed: vec![TrailedResponse::default(); devices.len()],
        };
        for member in [0, 1] {
            let sheared = |sign: f64| LensedGalaxy { shear: along(member, sign * SHEAR), ..self.lensed() };
            let [plus, minus] = [1.0, -1.0].map(|sign| self.measured(&sheared(sign), self.galaxy.flux_e, devices));
            let (Some(plus), Some(minus)) = (plus?, minus?) else { return Ok(None) };
            let slope = |plus: [f64; 2], minus: [f64; 2]| (plus[member] - minus[member]) / (2.0 * SHEAR);
            found.before[member] = slope(plus.before, minus.before);
            for ((trailed, plus), minus) in found.trailed.iter_mut().zip(&plus.changes).zip(&minus.changes) {
                trailed.response[member] = slope(*plus, *minus);
                // The mean over both members' pairs: terms even in the shear cancel equally in both.
                for (change, (plus, minus)) in trailed.change.iter_mut().zip(plus.iter().zip(minus)) {
                    *change += 0.25 * (plus + minus);
                }
            }
        }
        match self.how.psf_stars_e {
            None => Ok(Some(found)),
            Some(flux_e) => Ok(self.with_stars(found, flux_e, devices)?),
        }
    }

    /// The same with stars of the PSF model.
    fn with_stars(
        &self,
        mut found: ShearResponse,
        flux_e: f64,
        devices: &[Device],
    ) -> Result<Option<ShearResponse>, InputError> {
        let star = LensedGalaxy { half_light_px: STAR_PX, sersic_index: 0.5, ellipticity: [0.0; 2], ..self.lensed() };
        let Some(measured) = self.measured(&star, flux_e, devices)? else { return Ok(None) };
        for (trailed, change) in found.trailed.iter_mut().zip(measured.changes) {
            trailed.star = change;
        }
        for member in [0, 1] {
            let difference = |object: &LensedGalaxy| {
                let before = |sign: f64| {
                    let object = LensedGalaxy { psf_shear: along(member, sign * SHEAR), ..*object };
                    Some(self.scene(&object, flux_e)?.ellipticity_before()[member])
                };
                Some(before(1.0)? - before(-1.0)?)
            };
            let Some((of_galaxy, of_star)) = difference(&self.lensed()).zip(difference(&star)) else { return Ok(None) };
            found.leakage[member] = of_galaxy / of_star;
        }
        Ok(Some(found))
    }

    fn lensed(&self) -> LensedGalaxy {
        LensedGalaxy {
            sersic_index: self.galaxy.sersic_index,
            half_light_px: self.galaxy.half_light_px,
            ellipticity: self.galaxy.ellipticity,
            shear: [0.0; 2],
            psf_shear: [0.0; 2],
        }
    }

    fn scene(&self, object: &LensedGalaxy, flux_e: f64) -> Option<Scene> {
        Scene::lensed(object, flux_e, self.galaxy.weight_px, &self.model.mission, self.model.positions())
    }

    fn measured(&self, object: &LensedGalaxy, flux_e: f64, devices: &[Device]) -> Result<Option<Measured>, InputError> {
        let Some(scene) = self.scene(object, flux_e) else { return Ok(None) };
        let mut measured = Measured { before: scene.ellipticity_before(), changes: Vec::with_capacity(devices.len()) };
        for device in devices {
            let Some(change) = scene.change_by(device)? else { return Ok(None) };
            let change = device.observed_change(change)?;
            let mut change = [change.delta_e1, change.delta_e2];
            if let Some(realisations) = self.how.noise {
                let Some(term) = scene.noise_term(device, self.galaxy.read_noise_e, realisations)? else {
                    return Ok(None);
                };
                change = [0, 1].map(|member| change[member] + term.added[member]);
                measured.before = term.before;
            }
            measured.changes.push(change);
        }
        Ok(Some(measured))
    }
}

/// A shear along one member.
fn along(member: usize, shear: f64) -> [f64; 2] {
    let mut along = [0.0; 2];
    along[member] = shear;
    along
}

/// Number of galaxies up to which each is averaged over the mission's own grid of sub-pixel positions.
const FEW: usize = 8;

/// The mission with the grid of sub-pixel positions for a number of galaxies: the error of each is negligible compared with their
/// scatter.
pub fn of_many(mission: &Mission, galaxies: usize) -> Mission {
    let mut mission = mission.clone();
    if galaxies > FEW {
        mission.accuracy.subpixel_grid = Purpose::Draws.grid(mission.accuracy.subpixel_grid);
    }
    mission
}
