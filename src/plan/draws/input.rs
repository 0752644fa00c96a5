//! Uncertain inputs of a mission, and how to vary a mission by one of them.

use std::sync::Arc;

use crate::environment::esp;
use crate::environment::shielding::{self, Geometry};
use crate::environment::solar_cycle::{CYCLE_SCATTER_YR, Maximum};
use crate::mission::{DoseModel, Mission};
use crate::model::Model;
use crate::numeric::parallel;
use crate::physics::SourceDose;
use crate::physics::source_dose::cosmic_ray_dose_mev_g;
use crate::plan::dose;
use crate::plan::draws::damage_curve;

/// Varies a mission by a deviation of an input.
type Apply = dyn Fn(&mut Mission, f64) + Send + Sync;

/// An uncertain input.
pub struct Input {
    /// Name.
    pub name: String,
    /// Its uncertainty.
    pub sigma: Sigma,
    /// Keys of the mission that it represents: if these are drawn themselves, it is not.
    pub keys: Vec<String>,
    apply: Box<Apply>,
}

/// The uncertainty of an input.
#[derive(Clone, Copy, PartialEq)]
pub enum Sigma {
    /// Standard deviation of its logarithm.
    Relative(f64),
    /// Standard deviation, yr.
    Years(f64),
}

impl Input {
    /// Varies a mission by `z` standard deviations of the input.
    pub fn deviate(&self, mission: &mut Mission, z: f64) {
        let (Sigma::Relative(sigma) | Sigma::Years(sigma)) = self.sigma;
        (self.apply)(mission, sigma * z);
    }
}

/// An input that is multiplied by a factor.
fn input<const N: usize>(
    name: impl Into<String>,
    keys: [&str; N],
    sigma: f64,
    apply: impl Fn(&mut Mission, f64) + Send + Sync + 'static,
) -> Input {
    let apply = Box::new(move |mission: &mut Mission, deviation: f64| apply(mission, deviation.exp()));
    Input { name: name.into(), sigma: Sigma::Relative(sigma), keys: keys.map(String::from).to_vec(), apply }
}

/// The lengths of cycles up to unknown future maxima, for a mission that lists them. Each shifts all maxima after it.
pub fn cycles(maxima: &[Maximum]) -> Vec<Input> {
    let ahead = maxima.iter().enumerate().filter(|(_, maximum)| maximum.cycles_ahead > 0);
    let shift = |(index, maximum): (usize, &Maximum)| Input {
        name: format!("solar maximum {:.1}", maximum.year),
        sigma: Sigma::Years(CYCLE_SCATTER_YR),
        keys: vec!["environment.solar_maximum".into()],
        apply: Box::new(move |mission: &mut Mission, shift_yr: f64| {
            mission.environment.solar_maximum[index..].iter_mut().for_each(|year| *year += shift_yr);
        }),
    };
    ahead.map(shift).collect()
}

/// What the dose of a mission is derived from, where it is uncertain.
#[derive(Clone, Default)]
pub struct Derived {
    /// Dependence of the dose on the shield's thickness.
    pub shield: Option<Shield>,
    /// Dependence of the dose of cosmic rays on their modulation; None if they are not a source.
    pub modulation: Option<CosmicRayModulation>,
    /// Dependence of the number of traps on the damage curve's deviation in σ; None if the dose does not depend on the curve.
    pub niel: Option<f64>,
}

impl Derived {
    /// For a mission as read.
    pub fn of(mission: &Mission) -> Derived {
        Derived {
            shield: Shield::of(mission),
            modulation: CosmicRayModulation::of(mission),
            niel: damage_curve::sensitivity(mission),
        }
    }
}

/// The inputs of a mission, without those known exactly.
pub fn inputs(mission: &Mission, derived: Derived) -> Vec<Input> {
    let Derived { shield, modulation, niel } = derived;
    let known = &mission.uncertainty;
    let mut inputs = vec![input("dose model", DOSE_KEYS, known.dose_model, |mission, factor| {
        mission.environment.dose_factor *= factor;
    })];
    if let Some(shield) = shield {
        inputs.push(input("shielding", DOSE_KEYS, known.shielding, move |mission, factor| {
            mission.environment.dose_factor *= shield.dose(factor);
        }));
    }
    for (index, species) in mission.detector.traps.iter().enumerate() {
        let of = |key: &str| format!("detector.traps.{}.{key}", species.name);
        let (density, release) = (of("density_per_px"), of("release_ms"));
        inputs.push(input(format!("density {}", species.name), [&density], known.density, move |mission, factor| {
            mission.detector.traps[index].density_per_px *= factor;
        }));
        inputs.push(input(format!("release {}", species.name), [&release], known.release, move |mission, factor| {
            mission.detector.traps[index].release_ms *= factor;
        }));
    }
    inputs.push(input("full well", ["detector.full_well_e"], known.full_well, |mission, factor| {
        let detector = &mut mission.detector;
        detector.full_well_e = detector.notch_e + factor * (detector.full_well_e - detector.notch_e);
    }));
    inputs.push(input("well fill power", ["detector.well_fill_power"], known.well_fill_power, |mission, factor| {
        mission.detector.well_fill_power *= factor;
    }));
    inputs.push(input("background", ["sky.background_e"], known.background, |mission, factor| {
        mission.sky.background_e *= factor
    }));
    let galaxy = |key: &str| format!("galaxies.{}.{key}", mission.galaxies[0].name);
    let (flux, size) = (galaxy("flux_e"), galaxy("half_light_px"));
    inputs.push(input("galaxy flux", [&flux], known.galaxy_flux, |mission, factor| {
        let galaxy = &mut mission.galaxies[0];
        galaxy.flux_e = galaxy.flux_e.map(|flux_e| flux_e * factor);
    }));
    inputs.push(input("galaxy size", [&size], known.galaxy_size, |mission, factor| {
        mission.galaxies[0].half_light_px *= factor
    }));
    // At the end, so that the order of the others is unchanged.
    if let Some(sensitivity) = niel {
        inputs.push(input("NIEL", DOSE_KEYS, known.niel, move |mission, factor| {
            mission.environment.dose_factor *= factor.powf(sensitivity);
        }));
    }
    if let Some(modulation) = modulation {
        let name = "cosmic-ray modulation";
        inputs.push(input(name, [], known.cosmic_ray_modulation, move |mission, factor| {
            mission.imported.cosmic_rays = Some(modulation.dose(factor));
        }));
    }
    inputs.retain(|input| input.sigma != Sigma::Relative(0.0));
    inputs
}

/// Keys to which the dose is proportional.
const DOSE_KEYS: [&str; 2] = ["environment.active_dose_rate_mev_g_yr", "environment.dose_factor"];

/// Dose of a mission behind a shield of uncertain thickness, over that behind the nominal shield: its logarithm, at logarithms of
/// the factor on the thickness.
#[derive(Clone)]
pub struct Shield {
    curve: Vec<(f64, f64)>,
    /// Areal density, g/cm²: along the normal of a slab, otherwise the mean over the directions from which protons come.
    pub areal_g_cm2: f64,
}

/// Logarithms of the factors on a thickness for which its dose is computed; beyond them it is extrapolated linearly.
const FACTORS: (f64, f64, usize) = (-2.0, 2.0, 33);

impl Shield {
    /// The mission's shield, or the sphere that gives its dose rate. None if no thickness gives that rate, or if the dose is
    /// imported.
    pub fn of(mission: &Mission) -> Option<Shield> {
        mission.place()?;
        let environment = &mission.environment;
        let shield = match mission.shield() {
            Some(shield) => shield,
            None => {
                let thickness_mm = dose::equivalent_mm(mission, Geometry::Sphere)?;
                shielding::Shield::aluminium(Geometry::Sphere, thickness_mm)
            }
        };
        if environment.model == DoseModel::History || environment.dose_depth.is_some() {
            return None;
        }
        let year = esp::fluence(environment.confidence, 1.0);
        let model = Model::new(mission);
        let (history, duration_yr) = (model.history(), mission.mission.duration_yr);
        let niel = environment.niel.curve();
        let dose = |log: f64| -> f64 {
            let shield = shield.scaled(log.exp());
            if history.sources.is_empty() {
                return shield.dose(&year, niel);
            }
            let of = |source: &Arc<SourceDose>| {
                history.of_spectrum(source, duration_yr, |spectrum| shield.dose(spectrum, niel))
            };
            history.sources.iter().map(of).sum()
        };
        let (from, to, count) = FACTORS;
        let logs: Vec<f64> = (0..count).map(|index| from + (to - from) * index as f64 / (count - 1) as f64).collect();
        let itself = dose(0.0).ln();
        itself.is_finite().then(|| Shield {
            curve: parallel::map(logs, |log| (log, dose(log).ln() - itself)),
            areal_g_cm2: shield.typical_g_cm2()[0],
        })
    }

    /// Factor on the thickness for a factor on the mission's dose.
    /// None outside the computed range, a factor e² either way.
    pub fn factor_for(&self, dose: f64) -> Option<f64> {
        let log = dose.ln();
        let after = self.curve.iter().position(|point| point.1 <= log).filter(|after| *after > 0)?;
        let ((from, high), (to, low)) = (self.curve[after - 1], self.curve[after]);
        Some((from + (to - from) * (high - log) / (high - low)).exp())
    }

    /// Ratio of the doses behind a multiple of the thickness and behind the thickness itself.
    fn dose(&self, factor: f64) -> f64 {
        interpolated(&self.curve, factor)
    }
}

/// Log-log linear interpolation between points, at a factor; beyond the ends, extrapolation from the end pair.
fn interpolated(curve: &[(f64, f64)], factor: f64) -> f64 {
    let log = factor.ln();
    let after = curve.partition_point(|point| point.0 <= log).clamp(1, curve.len() - 1);
    let ((from, low), (to, high)) = (curve[after - 1], curve[after]);
    (low + (high - low) * (log - from) / (to - from)).exp()
}

/// Dose of cosmic rays over the mission with another modulation, over that of a mean cycle: its logarithm, at logarithms of the
/// factor on the modulation, which is the same at all phases of the cycle.
#[derive(Clone)]
pub struct CosmicRayModulation {
    curve: Vec<(f64, f64)>,
}

/// Logarithms of the factors on the modulation for which the dose is computed.
const MODULATIONS: (f64, f64, usize) = (-1.0, 1.0, 17);

impl CosmicRayModulation {
    /// For a mission; None if cosmic rays are not among its sources.
    pub fn of(mission: &Mission) -> Option<CosmicRayModulation> {
        let model = Model::new(mission);
        let itself = cosmic_ray_dose_mev_g(mission, model.history(), 1.0)?.ln();
        let (from, to, count) = MODULATIONS;
        let dose = |index: usize| {
            let log = from + (to - from) * index as f64 / (count - 1) as f64;
            Some((log, cosmic_ray_dose_mev_g(mission, model.history(), log.exp())?.ln() - itself))
        };
        let curve: Option<Vec<(f64, f64)>> = parallel::map(0..count, dose).into_iter().collect();
        curve.filter(|curve| curve.iter().all(|point| point.1.is_finite())).map(|curve| CosmicRayModulation { curve })
    }

    /// Ratio of the doses for a multiple of the modulation and for that of a mean cycle.
    pub fn dose(&self, factor: f64) -> f64 {
        interpolated(&self.curve, factor)
    }
}
