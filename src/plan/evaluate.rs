//! The chain: mission → dose → traps → readout → shapes → verdict.

pub(crate) mod json;
mod time_scales;

use chrono::NaiveDate;

use crate::error::InputError;
use crate::mission::{Galaxy, Mission, ReadoutMethod, TrapsAtStart};
use crate::model::noise::Realisations;
use crate::model::{Model, Scene};
use crate::numeric::calendar::date_after;
use crate::numeric::parallel;
use crate::physics::SpeciesState;
use crate::physics::accuracy::SHOWS_IN_SHAPES;
use crate::physics::shape::ShapeChange;
use crate::plan::noise::NoisyEvaluation;
use crate::plan::population::PopulationBias;
use crate::plan::requirement::{Crossing, Point, resolved};
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

/// State at one time.
#[derive(Clone, Debug)]
pub struct Year {
    /// Years since launch.
    pub t_yr: f64,
    /// The day; None past the end of the calendar.
    pub date: Option<NaiveDate>,
    /// Dose since launch as measured by its monitor, MeV/g.
    pub dose_mev_g: f64,
    /// Traps.
    pub traps: Vec<SpeciesState>,
    /// Mean change of each galaxy's shape, in the mission's order. None if no shape is left to measure.
    pub galaxies: Vec<Option<ShapeChange>>,
}

/// When the budget is exceeded, and the rate of the change.
#[derive(Clone, Debug, PartialEq)]
pub struct BudgetVerdict {
    /// Without software correction.
    pub uncorrected: Crossing,
    /// With it.
    pub corrected: Crossing,
    /// d|Δe|/dt just after launch, per year.
    pub rate_at_launch_per_yr: Option<f64>,
    /// |Δe| at the end of the mission over its duration, per year.
    pub mean_rate_per_yr: Option<f64>,
}

impl Evaluation {
    /// The same with the noise of one exposure.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn with_noise(self, realisations: Realisations) -> Result<Evaluation, InputError> {
        let noise = NoisyEvaluation::of(&self, realisations)?;
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

/// State at a time (years since launch).
fn year(model: &Model, t_yr: f64) -> Result<Year, InputError> {
    let device = model.device_at(t_yr)?;
    let galaxies = parallel::try_map(0..model.mission.galaxies.len(), |galaxy| model.change_by(galaxy, &device))?;
    Ok(Year {
        t_yr,
        date: date_after(model.mission.mission.launch.0, t_yr),
        dose_mev_g: device.dose_mev_g()?,
        galaxies,
        traps: device.traps,
    })
}

/// |Δe| of the judged galaxy at a time (years since launch); None if the shape is lost.
fn magnitude(model: &Model, t_yr: f64) -> Result<Option<f64>, InputError> {
    Ok(model.change(model.judged(), t_yr)?.map(|change| change.magnitude()))
}

/// When |Δe| of the judged galaxy crosses limits, each located with as few readouts as possible; `known` points are reused.
pub(crate) fn crossings<const N: usize>(
    model: &Model,
    limits: [f64; N],
    known: &[Point],
) -> Result<[Crossing; N], InputError> {
    crossings_of(model, limits, known, |t_yr| magnitude(model, t_yr))
}

/// When a quantity of a model crosses limits, as in [`crossings`]: it must be smooth between the model's times.
pub(crate) fn crossings_of<const N: usize>(
    model: &Model,
    limits: [f64; N],
    known: &[Point],
    magnitude: impl Fn(f64) -> Result<Option<f64>, InputError> + Sync,
) -> Result<[Crossing; N], InputError> {
    let mut times = model.times_yr(model.mission.mission.duration_yr);
    times.retain(|t_yr| known.iter().all(|known| known.0 != *t_yr));
    let mut points: Vec<Point> = parallel::try_map(times, |t_yr| Ok((t_yr, magnitude(t_yr)?)))?;
    points.extend(known);
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let resolved = resolved(&points, &limits, &magnitude)?;
    let found = limits.map(|limit| resolved.crossing(limit, &magnitude));
    let found: Vec<Crossing> = found.into_iter().collect::<Result<_, _>>()?;
    Ok(found.try_into().expect("as many crossings as limits"))
}

/// d|Δe|/dt just after launch, per year; None if no shape is left.
pub(crate) fn rate_at_launch_per_yr(model: &Model) -> Result<Option<f64>, InputError> {
    let just_after_yr = JUST_AFTER * model.mission.mission.duration_yr;
    let (launch, later) = (magnitude(model, 0.0)?, magnitude(model, just_after_yr)?);
    Ok(later.zip(launch).map(|(later, launch)| (later - launch) / just_after_yr))
}

/// Mean of d|Δe|/dt over the mission, per year, from |Δe| at its end; None if no shape is left at launch or then. Changes by traps
/// present at launch and by the amplifier are not part of the rate.
pub(crate) fn mean_rate_per_yr(model: &Model, at_end: Option<f64>) -> Result<Option<f64>, InputError> {
    let at_launch = magnitude(model, 0.0)?;
    Ok(at_end.zip(at_launch).map(|(end, launch)| (end - launch) / model.mission.mission.duration_yr))
}

/// Judges the requirement; `years` (ascending) are reused.
fn verdict(model: &Model, years: &[Year]) -> Result<BudgetVerdict, InputError> {
    let magnitude = |year: &Year| year.galaxies[model.judged()].map(|change| change.magnitude());
    let known: Vec<Point> = years.iter().map(|year| (year.t_yr, magnitude(year))).collect();
    let limits = model.mission.requirement.limits();
    let [uncorrected, corrected] = crossings(model, limits, &known)?;
    Ok(BudgetVerdict {
        uncorrected,
        corrected,
        rate_at_launch_per_yr: rate_at_launch_per_yr(model)?,
        mean_rate_per_yr: mean_rate_per_yr(model, known.last().and_then(|end| end.1))?,
    })
}

/// Share of the mission over which the rate at launch is measured: long enough for the accuracy of shapes, too short for the curve
/// to bend.
const JUST_AFTER: f64 = 1e-3;

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

/// Ends of the years of a mission, and its end.
pub(crate) fn year_ends(duration_yr: f64) -> Vec<f64> {
    let mut ends: Vec<f64> = (1..=duration_yr.floor() as usize).map(|year| year as f64).collect();
    if duration_yr.fract() > 0.0 {
        ends.push(duration_yr);
    }
    ends
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
