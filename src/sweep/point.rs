//! Number of a point → its recorded quantities.
//!
//! Shapes are read out less accurately than `accuracy.relative` (see [`Purpose::ManyShapes`]), and only if recorded.

use std::cell::OnceCell;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use super::grid::Grid;
use super::output::Output;
use crate::error::InputError;
use crate::io::table::Cell;
use crate::mission::{Galaxy, Mission};
use crate::model::{Device, Model};
use crate::physics::accuracy::Purpose;
use crate::physics::shape::ShapeChange;
use crate::plan::date_distribution::Confidence;
use crate::plan::evaluate::{unmeasurable, warnings};
use crate::plan::judgement::{Budget, Judgement, Limited};
use crate::plan::verdict::{crossings, mean_rate_per_yr, rate_at_launch_per_yr};

/// Models whose images are kept for others with the same galaxies.
const KEPT: usize = 32;

/// Probability and number of draws for quantities estimated from draws, for each point.
const CONFIDENCE: Confidence = Confidence { probability: 0.9, samples: 400 };

/// Computes the points of one sweep; shared by threads.
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
        mission = Purpose::ManyShapes.of(&mission);
        if !self.grid.records.iter().any(|output| output.of_galaxies()) {
            mission.galaxies = vec![mission.judged_galaxy().clone()];
        }
        let model = self.model(&mission);
        if let Some(galaxy) = (0..mission.galaxies.len()).find(|galaxy| model.scene(*galaxy).is_none()) {
            return Err(unmeasurable(&mission, &mission.galaxies[galaxy]));
        }
        let end = EndOfLife::of(&model)?;
        let end = EndOfLife { judgement: self.judgement(&end)?, ..end };
        let outputs = self.grid.outputs();
        let values = outputs.iter().map(|(output, galaxy)| end.value(*output, *galaxy)).collect::<Result<_, _>>()?;
        let warnings: Vec<String> = warnings(&model)?.iter().map(ToString::to_string).collect();
        Ok((values, warnings.join("; ")))
    }

    /// Judgement of all budgets, if needed for a recorded quantity: it is drawn, or shear biases are limited.
    fn judgement(&self, end: &EndOfLife) -> Result<Option<Judgement>, InputError> {
        let mission = &end.model.mission;
        let drawn = self.grid.records.iter().any(|output| output.is_drawn());
        let limits_biases = Limited::by(mission).iter().any(|limited| *limited != Limited::DeltaE);
        let judged = limits_biases && self.grid.records.iter().any(|output| output.is_judged());
        if !(drawn || judged) {
            return Ok(None);
        }
        let of_galaxy = crossings(end.model, mission.requirement.limits(), &[(end.duration_yr, end.delta_e()?)])?;
        Judgement::of(end.model, of_galaxy, drawn.then_some(CONFIDENCE)).map(Some)
    }

    /// A model with its images drawn, or with those of an earlier one if they are the same.
    fn model(&self, mission: &Mission) -> Model {
        let known = self.lock().iter().find(|known| known.shares_scenes(mission)).cloned();
        if let Some(known) = known {
            return known.like(mission);
        }
        // No other thread has this model while its images are drawn: a thread waiting for another's drawing might be given work
        // that needs the same images, and wait for itself.
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

/// A mission at its end, and before as needed.
struct EndOfLife<'a> {
    model: &'a Model,
    duration_yr: f64,
    device: Device,
    /// Changes of the galaxies' shapes, computed when first needed.
    galaxies: OnceCell<Vec<Option<ShapeChange>>>,
    /// Judgement of all budgets, if a recorded quantity needs it.
    judgement: Option<Judgement>,
}

impl EndOfLife<'_> {
    fn of(model: &Model) -> Result<EndOfLife<'_>, InputError> {
        let duration_yr = model.mission.mission.duration_yr;
        Ok(EndOfLife {
            model,
            duration_yr,
            device: model.device_at(duration_yr)?,
            galaxies: OnceCell::new(),
            judgement: None,
        })
    }

    fn value(&self, output: Output, galaxy: Option<&str>) -> Result<Option<f64>, InputError> {
        let requirement = &self.model.mission.requirement;
        let corrected = requirement.delta_e * requirement.correction_factor;
        let margin = |limit: f64| Ok(self.delta_e()?.map(|delta_e| limit - delta_e));
        let change = |value: fn(&ShapeChange) -> f64| Ok(self.change(galaxy)?.as_ref().map(value));
        let judgement = self.judgement.as_ref();
        let drawn = || judgement.and_then(|judgement| judgement.distribution.as_ref()).map(|found| found.requirement());
        let met = |limit: usize| Ok(drawn().map(|dates| dates[limit].probability_met()));
        let kept = |limit: usize| Ok(drawn().and_then(|dates| dates[limit].kept_yr(CONFIDENCE.probability)));
        let budget = |limited: Limited| {
            judgement.and_then(|judgement| judgement.budgets.iter().find(|budget| budget.limited == limited))
        };
        let exceeded = |limited: Limited| Ok(budget(limited).and_then(|budget| budget.crossings[0].t_yr));
        let first = |corrected: usize, limit: f64| match judgement {
            Some(judgement) => Ok(judgement.kept_yr(None)[corrected]),
            None => self.exceeded_yr(limit),
        };
        match output {
            Output::Dose => self.device.dose_mev_g().map(Some),
            Output::ActiveYears => Ok(Some(self.model.history().active_years(self.duration_yr))),
            Output::DeltaE => self.delta_e(),
            Output::ExceededUncorrected => first(0, requirement.delta_e),
            Output::ExceededCorrected => first(1, corrected),
            Output::AdditiveBias => Ok(budget(Limited::C).and_then(Budget::at_end)),
            Output::MultiplicativeBias => Ok(budget(Limited::M).and_then(Budget::at_end)),
            Output::ExceededDeltaE | Output::MarginUncorrected | Output::MarginCorrected
                if !requirement.limits_a_galaxy() =>
            {
                Ok(None)
            }
            Output::ExceededDeltaE => self.exceeded_yr(requirement.delta_e),
            Output::ExceededAdditive => exceeded(Limited::C),
            Output::ExceededMultiplicative => exceeded(Limited::M),
            Output::MarginUncorrected => margin(requirement.delta_e),
            Output::MarginCorrected => margin(corrected),
            Output::RateAtLaunch => rate_at_launch_per_yr(self.model),
            Output::MeanRate => mean_rate_per_yr(self.model, self.delta_e()?),
            Output::ProbabilityMetUncorrected => met(0),
            Output::ProbabilityMetCorrected => met(1),
            Output::KeptUncorrected => kept(0),
            Output::KeptCorrected => kept(1),
            Output::DeltaE1 => change(|change| change.delta_e1),
            Output::DeltaY => change(|change| change.delta_y_px),
            Output::DeltaSize => change(|change| change.delta_size),
            Output::DeltaFlux => change(|change| change.delta_flux),
        }
    }

    fn galaxies(&self) -> Result<&[Option<ShapeChange>], InputError> {
        if let Some(known) = self.galaxies.get() {
            return Ok(known);
        }
        let galaxies = 0..self.model.mission.galaxies.len();
        let found = galaxies.map(|galaxy| self.model.change_by(galaxy, &self.device)).collect::<Result<_, _>>()?;
        Ok(self.galaxies.get_or_init(|| found))
    }

    /// Change of a galaxy's shape, by its name; None if the mission has no such galaxy, or it has no shape left.
    fn change(&self, galaxy: Option<&str>) -> Result<Option<ShapeChange>, InputError> {
        let of_that_name = |known: &Galaxy| Some(known.name.as_str()) == galaxy;
        let place = self.model.mission.galaxies.iter().position(of_that_name);
        place.map_or(Ok(None), |place| Ok(self.galaxies()?[place]))
    }

    fn delta_e(&self) -> Result<Option<f64>, InputError> {
        Ok(self.galaxies()?[self.model.judged()].map(|change| change.magnitude()))
    }

    fn exceeded_yr(&self, limit: f64) -> Result<Option<f64>, InputError> {
        let [crossing] = crossings(self.model, [limit], &[(self.duration_yr, self.delta_e()?)])?;
        Ok(crossing.t_yr)
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
