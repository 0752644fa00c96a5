//! Uncertain inputs of a mission, and how to change a mission by one of them.

use crate::environment::Niel;
use crate::environment::esp::Spectrum;
use crate::environment::shielding::{Geometry, dose_behind};
use crate::environment::solar_cycle::{CYCLE_SCATTER_YR, Maximum};
use crate::mission::{Mission, Orbit};
use crate::plan::dose;

/// Changes a mission by a deviation of an input.
type Apply = dyn Fn(&mut Mission, f64) + Send + Sync;

/// An uncertain input.
pub struct Input {
    /// Name.
    pub name: String,
    /// How uncertain it is.
    pub sigma: Sigma,
    apply: Box<Apply>,
}

/// How uncertain an input is.
#[derive(Clone, Copy, PartialEq)]
pub enum Sigma {
    /// Standard deviation of its logarithm.
    Relative(f64),
    /// Standard deviation, yr.
    Years(f64),
}

impl Input {
    /// Changes a mission by so many standard deviations of the input.
    pub fn deviate(&self, mission: &mut Mission, z: f64) {
        let (Sigma::Relative(sigma) | Sigma::Years(sigma)) = self.sigma;
        (self.apply)(mission, sigma * z);
    }
}

/// An input that is multiplied by a factor.
fn input(name: impl Into<String>, sigma: f64, apply: impl Fn(&mut Mission, f64) + Send + Sync + 'static) -> Input {
    let apply = Box::new(move |mission: &mut Mission, deviation: f64| apply(mission, deviation.exp()));
    Input { name: name.into(), sigma: Sigma::Relative(sigma), apply }
}

/// The lengths of cycles to maxima that are not known yet, in a mission that lists them. Each shifts all maxima after it.
pub fn cycles(maxima: &[Maximum]) -> Vec<Input> {
    let ahead = maxima.iter().enumerate().filter(|(_, maximum)| maximum.cycles_ahead > 0);
    let shift = |(index, maximum): (usize, &Maximum)| Input {
        name: format!("solar maximum {:.1}", maximum.year),
        sigma: Sigma::Years(CYCLE_SCATTER_YR),
        apply: Box::new(move |mission: &mut Mission, shift_yr: f64| {
            mission.environment.solar_maximum[index..].iter_mut().for_each(|year| *year += shift_yr);
        }),
    };
    ahead.map(shift).collect()
}

/// The inputs of a mission whose dose rate is given as a number, those known exactly left out. `shield` says by how much the
/// dose changes with the shield's thickness.
pub fn inputs(mission: &Mission, shield: Option<Shield>) -> Vec<Input> {
    let known = &mission.uncertainty;
    let scale_dose = |mission: &mut Mission, factor: f64| {
        if let Some(rate) = &mut mission.environment.active_dose_rate_mev_g_yr {
            *rate *= factor;
        }
    };
    let mut inputs = vec![input("dose model", known.dose_model, move |mission, factor| {
        scale_dose(mission, factor);
        mission.environment.cosmic_ray_floor_mev_g_yr *= factor;
    })];
    if let Some(shield) = shield {
        inputs
            .push(input("shielding", known.shielding, move |mission, factor| scale_dose(mission, shield.dose(factor))));
    }
    for (index, species) in mission.detector.traps.iter().enumerate() {
        inputs.push(input(format!("density {}", species.name), known.density, move |mission, factor| {
            mission.detector.traps[index].density_per_px *= factor;
        }));
        inputs.push(input(format!("release {}", species.name), known.release, move |mission, factor| {
            mission.detector.traps[index].release_ms *= factor;
        }));
    }
    inputs.push(input("full well", known.full_well, |mission, factor| {
        let detector = &mut mission.detector;
        detector.full_well_e = detector.notch_e + factor * (detector.full_well_e - detector.notch_e);
    }));
    inputs.push(input("well fill power", known.well_fill_power, |mission, factor| {
        mission.detector.well_fill_power *= factor;
    }));
    inputs.push(input("background", known.background, |mission, factor| mission.sky.background_e *= factor));
    inputs.push(input("galaxy flux", known.galaxy_flux, |mission, factor| {
        let galaxy = &mut mission.galaxies[0];
        galaxy.flux_e = galaxy.flux_e.map(|flux_e| flux_e * factor);
    }));
    inputs.push(input("galaxy size", known.galaxy_size, |mission, factor| mission.galaxies[0].half_light_px *= factor));
    inputs.retain(|input| input.sigma != Sigma::Relative(0.0));
    inputs
}

/// Dose of an active year behind a shield whose thickness is not quite known.
#[derive(Clone)]
pub struct Shield {
    spectrum: Spectrum,
    geometry: Geometry,
    thickness_mm: f64,
    niel: Niel,
}

impl Shield {
    /// The mission's shield, or the sphere that makes the dose rate it gives. None where there is none: in a low Earth orbit,
    /// or where no thickness makes that rate.
    pub fn of(mission: &Mission) -> Option<Shield> {
        let environment = &mission.environment;
        let spectrum = Spectrum::esp(environment.confidence, 1.0);
        let of = |geometry, thickness_mm| Shield {
            spectrum: spectrum.clone(),
            geometry,
            thickness_mm,
            niel: environment.niel,
        };
        match &mission.shielding {
            _ if mission.mission.orbit == Orbit::Leo => None,
            Some(shield) => Some(of(shield.geometry, shield.thickness_mm)),
            None => {
                dose::equivalent_mm(mission, Geometry::Sphere).map(|thickness_mm| of(Geometry::Sphere, thickness_mm))
            }
        }
    }

    /// Dose behind so many times the thickness, over the dose behind it.
    fn dose(&self, factor: f64) -> f64 {
        let dose = |thickness_mm: f64| dose_behind(&self.spectrum, self.geometry, thickness_mm, self.niel.curve());
        dose(factor * self.thickness_mm) / dose(self.thickness_mm)
    }
}
