//! A mission made ready: dose, damage and detector with all effects, at any time and under any conditions.

use std::sync::{Arc, OnceLock};

use crate::conditions::Conditions;
use crate::damage::{Damage, SpeciesState};
use crate::device::Device;
use crate::effect::{self, Effect};
use crate::environment::DoseHistory;
use crate::error::{InputError, shortened};
use crate::mission::{Detector, Mission, ReadoutMethod};
use crate::readout::{Cloud, Method, Readout};
use crate::scene::Scene;
use crate::shape::ShapeChange;

/// Accuracy of the readout from which shapes are measured, over that of the shapes: errors of single packets average out
/// (`tests/readout.rs` holds shapes against every transfer done).
const READOUT_OF_SHAPES: f64 = 3.0;

/// A mission with its effects, ready to be asked.
#[derive(Clone, Debug)]
pub struct Model {
    /// The mission.
    pub mission: Mission,
    /// Dose over time.
    pub dose: DoseHistory,
    effects: Vec<Arc<dyn Effect>>,
    detector: Detector,
    damage: Damage,
    /// Images of the galaxies, drawn when they are needed; None where a galaxy has no measurable shape.
    scenes: Arc<Vec<OnceLock<Option<Scene>>>>,
}

impl Model {
    /// Prepares a mission.
    pub fn new(mission: &Mission) -> Model {
        let effects = effect::of(mission);
        let mut dose = DoseHistory::of(mission);
        let mut detector = mission.detector.clone();
        let mut damage = Damage::default();
        for effect in &effects {
            effect.dose(&mut dose);
            effect.detector(&mut detector);
            effect.damage(&mut damage);
        }
        let scenes = Arc::new(mission.galaxies.iter().map(|_| OnceLock::new()).collect());
        Model { mission: mission.clone(), dose, effects, detector, damage, scenes }
    }

    /// Prepares a mission that is like this one in much: images of galaxies that are the same are not drawn again.
    pub fn like(&self, mission: &Mission) -> Model {
        let known = &self.mission;
        let same = known.galaxies == mission.galaxies
            && known.psf == mission.psf
            && known.sky == mission.sky
            && known.accuracy == mission.accuracy;
        let model = Model::new(mission);
        if same { Model { scenes: Arc::clone(&self.scenes), ..model } } else { model }
    }

    /// Conditions of the mission's own exposures at a time (years since launch).
    pub fn conditions(&self, t_yr: f64) -> Conditions {
        Conditions::of(&self.mission, t_yr)
    }

    /// Traps at a time (years since launch).
    pub fn traps(&self, t_yr: f64) -> Vec<SpeciesState> {
        self.device(&self.conditions(t_yr)).traps
    }

    /// The detector at a time (years since launch).
    pub fn device_at(&self, t_yr: f64) -> Device {
        self.device(&self.conditions(t_yr))
    }

    /// The detector under given conditions.
    pub fn device(&self, given: &Conditions) -> Device {
        let mut at = given.clone();
        for effect in &self.effects {
            effect.conditions(&mut at);
        }
        let damaged = |detector: &Detector| self.damage.traps(detector, &self.dose, &at);
        let mut traps = damaged(&self.detector);
        let registers = self.effects.iter().filter_map(|effect| effect.serial());
        let registers: Vec<_> = registers
            .map(|register| {
                let traps = damaged(&Detector { traps: register.traps, ..self.detector.clone() });
                (traps, register.pixel_time_ms, register.transfers)
            })
            .collect();
        at.dose_mev_g = Some(at.dose_mev_g.unwrap_or_else(|| self.dose.dose_mev_g(at.t_yr)));
        let cloud = self.cloud(&at);
        let serial = registers
            .into_iter()
            .map(|(traps, pixel_time_ms, transfers)| (self.readout(&traps, pixel_time_ms, cloud.clone()), transfers))
            .collect();
        for effect in &self.effects {
            effect.traps(&mut traps, &at);
        }
        let readout = self.readout(&traps, at.line_time_ms, cloud);
        Device { at, traps, readout, serial, effects: self.effects.clone() }
    }

    /// Mean change of a galaxy's shape (by its place in the mission) at a time (years since launch). None where no shape
    /// is left, or there was none.
    pub fn change(&self, galaxy: usize, t_yr: f64) -> Option<ShapeChange> {
        self.change_by(galaxy, &self.device_at(t_yr))
    }

    /// The same with a device that is at hand.
    pub fn change_by(&self, galaxy: usize, device: &Device) -> Option<ShapeChange> {
        Some(device.observed_change(self.scene(galaxy)?.change_by(&device.coarser(READOUT_OF_SHAPES))?))
    }

    /// A galaxy's image, ready to be trailed, by its place in the mission. None where it has no measurable shape.
    pub fn scene(&self, galaxy: usize) -> Option<&Scene> {
        self.scenes[galaxy].get_or_init(|| Scene::of(&self.mission, &self.mission.galaxies[galaxy])).as_ref()
    }

    /// Place of the judged galaxy in the mission.
    pub fn judged(&self) -> usize {
        let judged = &self.mission.requirement.galaxy;
        self.mission.galaxies.iter().position(|galaxy| galaxy.name == *judged).expect("a mission has its judged galaxy")
    }

    /// A readout with other traps, all else the same.
    pub fn readout_with(&self, traps: &[SpeciesState]) -> Readout {
        let at = self.conditions(0.0);
        self.readout(traps, at.line_time_ms, self.cloud(&at))
    }

    /// Conditions, by name, that effects depend on beyond those that the chain itself depends on.
    pub fn depends_on(&self) -> Vec<String> {
        self.effects.iter().flat_map(|effect| effect.depends_on()).collect()
    }

    /// What went wrong while effects were applied, where something did.
    ///
    /// # Errors
    /// The first fault of the first effect.
    pub fn check(&self) -> Result<(), InputError> {
        match self.effects.iter().find_map(|effect| effect.fault()) {
            None => Ok(()),
            Some(fault) => Err(InputError {
                refused: format!("cannot apply a formula of mission \"{}\"", self.mission.mission.name),
                place: Some(format!("effects.formula.expression = \"{}\"", shortened(&fault.text))),
                problem: match fault.place {
                    Some(place) => format!("at letter {}: {}", place + 1, fault.problem),
                    None => fault.problem,
                },
                help: fault.help,
            }),
        }
    }

    fn cloud(&self, at: &Conditions) -> Cloud {
        let detector = &self.detector;
        let mut cloud = Cloud::new(detector.full_well_e, detector.notch_e, detector.well_fill_power);
        for effect in &self.effects {
            effect.cloud(&mut cloud, at);
        }
        cloud
    }

    fn readout(&self, traps: &[SpeciesState], transfer_ms: f64, cloud: Cloud) -> Readout {
        let accuracy = &self.mission.accuracy;
        Readout {
            traps: traps.iter().map(|species| species.trap(transfer_ms)).collect(),
            cloud,
            method: match accuracy.readout {
                ReadoutMethod::Fast => Method::Fast { relative: accuracy.relative },
                ReadoutMethod::Exact => Method::Exact,
                ReadoutMethod::Fractional => Method::Fractional { levels: accuracy.levels as usize },
                ReadoutMethod::MonteCarlo => Method::MonteCarlo { seed: accuracy.seed },
            },
        }
    }
}
