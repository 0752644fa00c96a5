//! A mission ready for evaluation: dose, traps, detector and galaxies with all effects, at any time and under any conditions.
//!
//! ```text
//! mission + effects → [`DoseHistory`] → [`Damage`] → [`Device`] → change of shape
//! ```
//!
//! This is the only way from a mission to a dose, a trap density or a change of shape. Its components are private to this module:
//! commands, studies and fits use a [`Model`], so that none of them can omit an effect.

mod device;
mod effects;
pub mod noise;
pub mod predict;
pub mod realise;
mod scene;
#[cfg(test)]
mod scene_golden;
pub mod shear;
pub mod survey;

use std::sync::{Arc, OnceLock};

use crate::error::InputError;
use crate::mission::keys::plain;
use crate::mission::{Accuracy, Detector, Mission, ReadoutMethod, TrapsAtStart};
use crate::physics::accuracy::Purpose;
use crate::physics::conditions::Conditions;
use crate::physics::damage::Irradiation;
use crate::physics::shape::ShapeChange;
use crate::physics::{Damage, DoseHistory, SpeciesState};
use crate::readout::{Clock, Cloud, Method, interrupt};
pub use device::{Beside, Device};
use effects::Effects;
use noise::{NoiseTerm, Realisations};
pub use scene::Scene;
pub(crate) use scene::{Above, downstream, half_px};

/// Number of times in a mission at which a formula of time is sampled.
const FORMULA_TIMES: u32 = 240;

/// A mission with its effects, ready for evaluation.
#[derive(Clone, Debug)]
pub struct Model {
    /// The mission.
    pub mission: Mission,
    history: DoseHistory,
    effects: Effects,
    detector: Detector,
    damage: Damage,
    /// Images of the galaxies, drawn when needed; None if a galaxy has no measurable shape.
    scenes: Arc<Vec<OnceLock<Option<Scene>>>>,
}

impl Model {
    /// Prepares a mission.
    pub fn new(mission: &Mission) -> Model {
        interrupt::check();
        let effects = Effects::of(mission);
        let mut history = DoseHistory::of(mission);
        let mut detector = mission.detector.clone();
        let mut damage = Damage::default();
        for effect in effects.iter() {
            effect.dose(&mut history);
            effect.detector(&mut detector);
            effect.damage(&mut damage);
        }
        let scenes = Arc::new(mission.galaxies.iter().map(|_| OnceLock::new()).collect());
        Model { mission: mission.clone(), history, effects, detector, damage, scenes }
    }

    /// Prepares a similar mission: if its galaxies are the same, their images are reused.
    pub fn like(&self, mission: &Mission) -> Model {
        let model = Model::new(mission);
        let shares = self.shares_scenes(mission) && self.positions() == model.positions();
        if shares { Model { scenes: Arc::clone(&self.scenes), ..model } } else { model }
    }

    /// Whether a mission's galaxies have the same images as those of this one.
    pub(crate) fn shares_scenes(&self, mission: &Mission) -> bool {
        let known = &self.mission;
        known.galaxies == mission.galaxies
            && known.psf == mission.psf
            && known.sky == mission.sky
            && known.accuracy == mission.accuracy
    }

    /// Sub-pixel positions in x and in y at which galaxies are read out. If columns differ or interact, as many are needed in x as
    /// in y.
    pub fn positions(&self) -> [u32; 2] {
        let Accuracy { subpixel_grid, readout, .. } = self.mission.accuracy;
        let serial = self.effects.iter().any(|effect| effect.serial().is_some());
        let differ = serial || readout == ReadoutMethod::MonteCarlo;
        [if differ { subpixel_grid } else { scene::positions_across(subpixel_grid) }, subpixel_grid]
    }

    /// The dose history: active years, steps, the source of the rate, and what is uncertain about it.
    pub fn history(&self) -> &DoseHistory {
        &self.history
    }

    /// Times (years since launch, ascending) between which every quantity of the model is smooth: launch, the end, each time at
    /// which the dose rate changes, and both sides of each jump.
    pub fn times_yr(&self, duration_yr: f64) -> Vec<f64> {
        let within = |t_yr: &f64| *t_yr > 0.0 && *t_yr <= duration_yr;
        let jumps = self.history.steps.iter().map(|(t_yr, _)| *t_yr).chain(self.damage.losses_yr());
        let mut times = vec![0.0, duration_yr];
        times.extend(self.history.bends_yr(duration_yr));
        times.extend(self.history.turns_yr(duration_yr));
        let warmings = self.mission.imported.temperatures.iter().map(|(t_yr, _)| *t_yr);
        let jumps = jumps.chain(warmings);
        times.extend(jumps.filter(within).flat_map(|t_yr| [t_yr.next_down(), t_yr]));
        // A formula of time may be any function.
        if self.depends_on().iter().any(|name| name == "t_yr") {
            times.extend((1..FORMULA_TIMES).map(|index| duration_yr * f64::from(index) / f64::from(FORMULA_TIMES)));
        }
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Conditions of the mission's own exposures at a time (years since launch).
    pub fn conditions(&self, t_yr: f64) -> Conditions {
        Conditions::of(&self.mission, t_yr)
    }

    /// Dose since launch as its monitor sees it, MeV/g, at a time (years since launch).
    ///
    /// # Errors
    /// If a formula has no value, here and below.
    pub fn dose_mev_g(&self, t_yr: f64) -> Result<f64, InputError> {
        self.device_at(t_yr)?.dose_mev_g()
    }

    /// Traps at a time (years since launch).
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn traps(&self, t_yr: f64) -> Result<Vec<SpeciesState>, InputError> {
        Ok(self.device_at(t_yr)?.traps)
    }

    /// The detector at a time (years since launch).
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn device_at(&self, t_yr: f64) -> Result<Device, InputError> {
        self.device(&self.conditions(t_yr))
    }

    /// The detector under given conditions.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn device(&self, given: &Conditions) -> Result<Device, InputError> {
        let at = self.true_conditions(given)?;
        let irradiation = self.irradiation(at.t_yr, at.dose_mev_g)?;
        self.irradiated(at, &irradiation)
    }

    /// The true conditions, modified by effects, if the given ones are assumed.
    fn true_conditions(&self, given: &Conditions) -> Result<Conditions, InputError> {
        let mut at = given.clone();
        self.effects.apply(|effect| effect.conditions(&mut at))?;
        Ok(at)
    }

    /// The irradiation by the mission's dose, or by a dose given in a laboratory (MeV/g), up to a time (years since launch).
    fn irradiation(&self, t_yr: f64, given_mev_g: Option<f64>) -> Result<Irradiation, InputError> {
        let irradiation = self.damage.irradiation(&self.history, t_yr, given_mev_g);
        irradiation.map_err(|error| self.effects.of_mission(error))
    }

    /// The detector under true conditions, after their dose.
    fn irradiated(&self, at: Conditions, irradiation: &Irradiation) -> Result<Device, InputError> {
        let reference_dose_mev_g = self.history.reference_dose_mev_g;
        let damaged =
            |detector: &Detector| self.damage.traps(detector, reference_dose_mev_g, irradiation, at.temperature_k);
        let mut traps = damaged(&self.detector);
        let registers = self.effects.iter().filter_map(|effect| effect.serial()).map(|register| device::Register {
            traps: damaged(&Detector { traps: register.traps, ..self.detector.clone() }),
            pixel_time_ms: register.pixel_time_ms,
            transfers: register.transfers,
        });
        let registers = registers.collect();
        let at = Conditions { dose_mev_g: Some(irradiation.dose_mev_g), ..at };
        let detector = &self.detector;
        let mut cloud = Cloud::new(detector.full_well_e, detector.notch_e, detector.well_fill_power)
            .with_volume_at_zero(detector.volume_at_zero);
        self.effects.apply(|effect| effect.cloud(&mut cloud, &at))?;
        let phases = self.mission.readout.clock.as_ref();
        let mut clock = phases
            .map_or(Clock::single(), |phases| phases.clock().expect("a mission's clock was checked when it was read"));
        self.effects.apply(|effect| effect.clock(&mut clock, &at))?;
        self.effects.apply(|effect| effect.traps(&mut traps, &at))?;
        let without_density = |species: &&SpeciesState| {
            species.capture_density_power > 0.0 && cloud.density_e(species.capture_at_e) == 0.0
        };
        if let Some(species) = traps.iter().find(without_density) {
            let problem = format!(
                "packets of {} e- have no cloud, and their density gives no capture time",
                plain(species.capture_at_e)
            );
            let error = InputError::new("cannot model capture by density", problem).with_help(
                "set effects.finite-capture.capture_at_e to the charge of packets that fill a part of the well",
            );
            return Err(self.effects.of_mission(error));
        }
        let (store, effects) = (self.mission.readout.store, self.effects.clone());
        let persistence = self.mission.survey.clone().filter(|survey| survey.persistence.is_some());
        Ok(Device { at, traps, cloud, clock, store, persistence, method: self.method(), registers, effects })
    }

    /// Mean change of a galaxy's shape (by its index in the mission) at a time (years since launch). None if the shape is not
    /// measurable before or after the readout.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn change(&self, galaxy: usize, t_yr: f64) -> Result<Option<ShapeChange>, InputError> {
        self.change_by(galaxy, &self.device_at(t_yr)?)
    }

    /// The same with a given device.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn change_by(&self, galaxy: usize, device: &Device) -> Result<Option<ShapeChange>, InputError> {
        match self.trailed(galaxy, &device.fit_for(Purpose::Shape))? {
            Some(change) => device.observed_change(change).map(Some),
            None => Ok(None),
        }
    }

    /// Mean change of a galaxy's shape by a device, before effects modify the measured value.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub(crate) fn trailed(&self, galaxy: usize, device: &Device) -> Result<Option<ShapeChange>, InputError> {
        self.scene(galaxy).map_or(Ok(None), |scene| scene.change_by(device))
    }

    /// The contribution of the noise of one exposure to the mean change of a galaxy's shape by a device; see [`noise`]. None if the
    /// shape is lost.
    ///
    /// # Errors
    /// As [`Model::dose_mev_g`].
    pub fn noise_term(
        &self,
        galaxy: usize,
        device: &Device,
        realisations: Realisations,
    ) -> Result<Option<NoiseTerm>, InputError> {
        let mission = &self.mission;
        let galaxy = &mission.galaxies[galaxy];
        let scene = Scene::of(mission, galaxy, self.positions().map(|positions| positions.min(noise::GRID)));
        let read_noise_e = mission.read_noise_e(galaxy);
        scene.map_or(Ok(None), |scene| scene.noise_term(device, read_noise_e, realisations))
    }

    /// A galaxy's image, ready to be trailed, by its index in the mission. None if it has no measurable shape.
    pub fn scene(&self, galaxy: usize) -> Option<&Scene> {
        let drawn = || Scene::of(&self.mission, &self.mission.galaxies[galaxy], self.positions());
        self.scenes[galaxy].get_or_init(drawn).as_ref()
    }

    /// Index of the judged galaxy in the mission.
    pub fn judged(&self) -> usize {
        self.mission.judged()
    }

    /// Names of conditions that effects depend on in addition to those of the chain itself.
    pub fn depends_on(&self) -> Vec<String> {
        self.effects.iter().flat_map(|effect| effect.depends_on()).collect()
    }

    fn method(&self) -> Method {
        let accuracy = &self.mission.accuracy;
        if self.mission.readout.traps_at_start == TrapsAtStart::Carried {
            return Method::CarriedTraps;
        }
        match accuracy.readout {
            ReadoutMethod::Fast => Method::Fast { relative: accuracy.relative },
            ReadoutMethod::Exact => Method::Exact,
            ReadoutMethod::Fractional => Method::Fractional { levels: accuracy.levels as usize },
            ReadoutMethod::MonteCarlo => Method::MonteCarlo { seed: accuracy.seed },
        }
    }
}
