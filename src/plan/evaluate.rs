//! The chain: mission → dose → traps → readout → shapes → verdict, with noise and population if requested.

pub(crate) mod json;
mod time_scales;

use crate::error::InputError;
use crate::mission::{Galaxy, Mission, ReadoutMethod, TrapsAtStart};
use crate::model::noise::Realisations;
use crate::model::{Model, Scene};
use crate::numeric::parallel;
use crate::physics::accuracy::SHOWS_IN_SHAPES;
use crate::plan::curve::year_ends;
use crate::plan::noise::NoisyEvaluation;
use crate::plan::population::PopulationBias;
pub use crate::plan::verdict::{BudgetVerdict, Year};
use crate::plan::verdict::{verdict, year};
use crate::warning::Warning;

/// All results from a mission to its verdict.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// The mission, as resolved, with its dose, traps and galaxies.
    pub model: Model,
    /// State at the end of each year of the mission, and at its end.
    pub years: Vec<Year>,
    /// When the budget is exceeded.
    pub verdict: BudgetVerdict,
    /// Changes of shape with noise, if requested.
    pub noise: Option<NoisyEvaluation>,
    /// Shear biases of the population, if requested and there is one.
    pub population: Option<PopulationBias>,
    /// Warnings.
    pub warnings: Vec<Warning>,
}

impl Evaluation {
    /// The same with the noise of one exposure.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn with_noise(self, realisations: Realisations) -> Result<Evaluation, InputError> {
        let noise = NoisyEvaluation::of(&self.model, &self.years, &self.verdict, realisations)?;
        Ok(Evaluation { noise, ..self })
    }

    /// The same with the shear biases of the population, if there is one; `seed` is that of its law and its noise.
    ///
    /// # Errors
    /// If a formula has no value, or no galaxy of the population can be measured.
    pub fn with_population(self, seed: u64) -> Result<Evaluation, InputError> {
        let population = PopulationBias::of(&self.model, seed)?;
        Ok(Evaluation { population, ..self })
    }

    /// The mission, as resolved.
    pub fn mission(&self) -> &Mission {
        &self.model.mission
    }

    /// State at the end of the mission.
    pub fn end(&self) -> &Year {
        self.years.last().expect("a mission has an end")
    }
}

/// Evaluates a mission.
///
/// # Errors
/// If a galaxy of the mission has no measurable shape even before the readout, or a formula has no value.
pub fn evaluate(mission: &Mission) -> Result<Evaluation, InputError> {
    evaluated(Model::new(mission))
}

/// Evaluates a mission with an existing model.
///
/// # Errors
/// As [`evaluate`].
pub(crate) fn evaluated(model: Model) -> Result<Evaluation, InputError> {
    let mission = &model.mission;
    let measurable = parallel::map(0..mission.galaxies.len(), |galaxy| model.scene(galaxy).is_some());
    if let Some(galaxy) = measurable.iter().position(|measurable| !measurable) {
        return Err(unmeasurable(mission, &mission.galaxies[galaxy]));
    }
    let years = parallel::try_map(year_ends(mission.mission.duration_yr), |t_yr| year(&model, t_yr))?;
    let verdict = verdict(&model, &years)?;
    let rough = verdict.corrected.rough_yr.map(|interval_yr| Warning::RoughShape { interval_yr });
    let warnings = warnings(&model)?.into_iter().chain(rough).collect();
    Ok(Evaluation { model, years, verdict, noise: None, population: None, warnings })
}

pub(crate) fn unmeasurable(mission: &Mission, galaxy: &Galaxy) -> InputError {
    InputError::new(
        format!("cannot evaluate mission \"{}\"", mission.mission.name),
        format!("galaxy \"{}\" has no weighted moments: its weight finds no centroid", galaxy.name),
    )
    .with_help("choose weight_px closer to the size of the galaxy")
}

pub(crate) fn warnings(model: &Model) -> Result<Vec<Warning>, InputError> {
    let mission = &model.mission;
    let mut warnings = model.history().warnings(mission.mission.duration_yr);
    warnings.extend(model.history().idle_phase(mission));
    for (index, galaxy) in mission.galaxies.iter().enumerate() {
        let peak_e = model.scene(index).map_or(0.0, Scene::peak_e);
        if peak_e > mission.detector.full_well_e {
            warnings.push(Warning::Saturated { name: format!("galaxy \"{}\"", galaxy.name), peak_e });
        }
    }
    if mission.accuracy.readout == ReadoutMethod::MonteCarlo {
        warnings.push(Warning::OneSetOfTraps);
    }
    if mission.readout.traps_at_start == TrapsAtStart::Carried {
        warnings.push(Warning::CarriedTraps);
    }
    warnings.extend(time_scales::warnings(model)?);
    if mission.accuracy.readout == ReadoutMethod::Fast && mission.accuracy.relative > SHOWS_IN_SHAPES {
        warnings.push(Warning::CoarseAccuracy { relative: mission.accuracy.relative });
    }
    Ok(warnings)
}
