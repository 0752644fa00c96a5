//! Number of a point → what is recorded of it.
//!
//! Shapes are read out coarser than `accuracy.relative` asks (see [`crate::mission::Accuracy::of_many_shapes`]). The budget is judged with as few readouts as that takes: while a mission has no
//! effects its traps only ever increase, and |Δe| with them, so that its end tells whether a limit is reached.

use std::cell::OnceCell;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use super::grid::Grid;
use super::output::Output;
use crate::device::Device;
use crate::error::InputError;
use crate::evaluate::{JUST_AFTER, unmeasurable, warnings, year_ends};
use crate::mission::{Galaxy, Mission};
use crate::model::Model;
use crate::observable::Observable;
use crate::requirement::{Crossing, first_crossing};
use crate::shape::ShapeChange;
use crate::table::Cell;

/// Models whose images are kept for others with the same galaxies.
const KEPT: usize = 32;

/// Computes points of one sweep; shared by threads.
pub(super) struct Points<'a> {
    grid: &'a Grid,
    /// The latest models with different images, newest first.
    models: Mutex<VecDeque<Arc<Model>>>,
}

impl<'a> Points<'a> {
    pub fn of(grid: &'a Grid) -> Points<'a> {
        Points { grid, models: Mutex::default() }
    }

    /// The row of a point, in the order of [`Grid::columns`].
    pub fn row(&self, point: u64) -> Vec<Cell> {
        let (mission, settings) = self.grid.point(point);
        let (name, mission) = &self.grid.missions[mission];
        let mut row =
            vec![Cell::Text(self.grid.fingerprint.clone()), Cell::Integer(point as i64), Cell::Text(name.clone())];
        row.extend(settings.iter().map(|(_, value)| cell(value)));
        match self.outputs(mission, &settings) {
            Ok((values, warnings)) => {
                row.extend(values.into_iter().map(|value| value.map_or(Cell::Missing, Cell::Number)));
                row.extend([words(warnings), Cell::Missing]);
            }
            Err(error) => {
                row.extend((0..self.grid.outputs().len()).map(|_| Cell::Missing));
                row.extend([Cell::Missing, words(one_line(&error))]);
            }
        }
        row
    }

    fn outputs(
        &self,
        mission: &Mission,
        settings: &[(String, toml::Value)],
    ) -> Result<(Vec<Option<f64>>, String), InputError> {
        let mut mission = if settings.is_empty() { mission.clone() } else { mission.with(settings)? };
        mission.accuracy.relative = mission.accuracy.of_many_shapes();
        if !self.grid.records.iter().any(|output| output.of_galaxies()) {
            mission.galaxies = vec![mission.judged_galaxy().clone()];
        }
        let model = self.model(&mission);
        if let Some(galaxy) = (0..mission.galaxies.len()).find(|galaxy| model.scene(*galaxy).is_none()) {
            return Err(unmeasurable(&mission, &mission.galaxies[galaxy]));
        }
        let end = EndOfLife::of(&model);
        let values = self.grid.outputs().iter().map(|(output, galaxy)| end.value(*output, *galaxy)).collect();
        model.check()?;
        let warnings: Vec<String> = warnings(&model).iter().map(ToString::to_string).collect();
        Ok((values, warnings.join("; ")))
    }

    /// A model with its images drawn, or with those of an earlier one where they are the same.
    fn model(&self, mission: &Mission) -> Model {
        let same = |known: &&Arc<Model>| {
            let known = &known.mission;
            known.galaxies == mission.galaxies
                && known.psf == mission.psf
                && known.sky == mission.sky
                && known.accuracy == mission.accuracy
        };
        let known = self.lock().iter().find(same).cloned();
        if let Some(known) = known {
            return known.like(mission);
        }
        // Nobody else has this model while its images are drawn: a thread that waits for another's drawing might be given
        // work that needs the same images, and wait for itself.
        let model = Model::new(mission);
        for galaxy in 0..mission.galaxies.len() {
            model.scene(galaxy);
        }
        let mut models = self.lock();
        models.push_front(Arc::new(model.clone()));
        models.truncate(KEPT);
        model
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, VecDeque<Arc<Model>>> {
        self.models.lock().expect("nothing fails while models are looked through")
    }
}

/// A mission at its end, and on the way there as far as that is asked for.
struct EndOfLife<'a> {
    model: &'a Model,
    duration_yr: f64,
    dose_mev_g: f64,
    device: Device,
    /// Changes of the galaxies' shapes, once they are asked for.
    galaxies: OnceCell<Vec<Option<ShapeChange>>>,
}

impl EndOfLife<'_> {
    fn of(model: &Model) -> EndOfLife<'_> {
        let duration_yr = model.mission.mission.duration_yr;
        let device = model.device_at(duration_yr);
        let dose_mev_g = device.observed(model.dose.dose_mev_g(duration_yr), Observable::Dose, &device.at);
        EndOfLife { model, duration_yr, dose_mev_g, device, galaxies: OnceCell::new() }
    }

    fn value(&self, output: Output, galaxy: Option<&str>) -> Option<f64> {
        let requirement = &self.model.mission.requirement;
        let corrected = requirement.delta_e * requirement.correction_factor;
        match output {
            Output::Dose => Some(self.dose_mev_g),
            Output::ActiveYears => Some(self.model.dose.active_years(self.duration_yr)),
            Output::DeltaE => self.delta_e(),
            Output::ExceededUncorrected => self.crossing(requirement.delta_e).t_yr,
            Output::ExceededCorrected => self.crossing(corrected).t_yr,
            Output::MarginUncorrected => Some(requirement.delta_e - self.delta_e()?),
            Output::MarginCorrected => Some(corrected - self.delta_e()?),
            Output::RateAtLaunch => {
                let just_after_yr = JUST_AFTER * self.duration_yr;
                Some((self.delta_e_at(just_after_yr)? - self.delta_e_at(0.0)?) / just_after_yr)
            }
            Output::MeanRate => Some(self.delta_e()? / self.duration_yr),
            Output::DeltaE1 => Some(self.change(galaxy)?.delta_e1),
            Output::DeltaY => Some(self.change(galaxy)?.delta_y_px),
            Output::DeltaSize => Some(self.change(galaxy)?.delta_size),
            Output::DeltaFlux => Some(self.change(galaxy)?.delta_flux),
        }
    }

    fn galaxies(&self) -> &[Option<ShapeChange>] {
        let galaxies = 0..self.model.mission.galaxies.len();
        self.galaxies.get_or_init(|| galaxies.map(|galaxy| self.model.change_by(galaxy, &self.device)).collect())
    }

    /// Change of a galaxy's shape, by its name; None where the mission has no such galaxy.
    fn change(&self, galaxy: Option<&str>) -> Option<ShapeChange> {
        let of_that_name = |known: &Galaxy| Some(known.name.as_str()) == galaxy;
        self.galaxies()[self.model.mission.galaxies.iter().position(of_that_name)?]
    }

    fn delta_e(&self) -> Option<f64> {
        self.galaxies()[self.model.judged()].map(|change| change.magnitude())
    }

    fn delta_e_at(&self, t_yr: f64) -> Option<f64> {
        self.model.change(self.model.judged(), t_yr).map(|change| change.magnitude())
    }

    fn crossing(&self, limit: f64) -> Crossing {
        let end = (self.duration_yr, self.delta_e());
        let monotone = self.model.mission.effects.is_empty();
        if monotone && end.1.is_some_and(|delta_e| delta_e < limit) {
            return first_crossing(limit, &[end], |t_yr| self.delta_e_at(t_yr));
        }
        let mut times = self.model.dose.changes_yr(self.duration_yr);
        times.push(0.0);
        if !monotone {
            times.extend(year_ends(self.duration_yr));
        }
        times.retain(|t_yr| *t_yr < self.duration_yr);
        times.sort_by(f64::total_cmp);
        times.dedup();
        let mut known: Vec<_> = times.into_iter().map(|t_yr| (t_yr, self.delta_e_at(t_yr))).collect();
        known.push(end);
        first_crossing(limit, &known, |t_yr| self.delta_e_at(t_yr))
    }
}

fn cell(value: &toml::Value) -> Cell {
    match value {
        toml::Value::Float(number) => Cell::Number(*number),
        toml::Value::Integer(integer) => Cell::Integer(*integer),
        toml::Value::String(text) => Cell::Text(text.clone()),
        other => Cell::Text(other.to_string()),
    }
}

fn words(text: String) -> Cell {
    if text.is_empty() { Cell::Missing } else { Cell::Text(text) }
}

fn one_line(error: &InputError) -> String {
    let said = [error.place.as_deref(), Some(error.problem.as_str()), error.help.as_deref()];
    said.into_iter().flatten().map(|line| line.replace('\n', " ")).collect::<Vec<_>>().join("; ")
}
