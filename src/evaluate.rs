//! The chain: mission → dose → traps → readout → shapes → verdict.

use chrono::NaiveDate;
use rayon::prelude::*;

use crate::calendar::date_after;
use crate::damage::SpeciesState;
use crate::environment::DoseHistory;
use crate::error::InputError;
use crate::mission::{Galaxy, Mission, ReadoutMethod};
use crate::model::Model;
use crate::observable::Observable;
use crate::requirement::{Crossing, first_crossing};
use crate::scene::Scene;
use crate::shape::ShapeChange;
use crate::warning::Warning;

/// Everything along the way from a mission to its verdict.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// The mission, as resolved.
    pub mission: Mission,
    /// Dose over time.
    pub dose: DoseHistory,
    /// State at the end of each year of the mission, and at its end.
    pub years: Vec<Year>,
    /// When the budget is exceeded.
    pub verdict: Verdict,
    /// Things seen that are not errors.
    pub warnings: Vec<Warning>,
}

/// State at one time.
#[derive(Clone, Debug)]
pub struct Year {
    /// Years since launch.
    pub t_yr: f64,
    /// The day; None past the end of the calendar.
    pub date: Option<NaiveDate>,
    /// Dose since launch, MeV/g.
    pub dose_mev_g: f64,
    /// Traps.
    pub traps: Vec<SpeciesState>,
    /// Mean change of each galaxy's shape, in the mission's order. None where no shape is left to measure.
    pub galaxies: Vec<Option<ShapeChange>>,
}

/// What becomes of the requirement.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Without software correction.
    pub uncorrected: Crossing,
    /// With it.
    pub corrected: Crossing,
    /// d|Δe|/dt just after launch, per year.
    pub rate_at_launch_per_yr: Option<f64>,
    /// |Δe| at the end of the mission over its duration, per year.
    pub mean_rate_per_yr: Option<f64>,
}

impl Verdict {
    /// Whether the requirement is met, with correction, to the end of the mission.
    pub fn met(&self) -> bool {
        self.corrected.t_yr.is_none()
    }
}

/// State at a time (years since launch).
fn year(model: &Model, t_yr: f64) -> Year {
    let device = model.device_at(t_yr);
    let galaxies = 0..model.mission.galaxies.len();
    Year {
        t_yr,
        date: date_after(model.mission.mission.launch.0, t_yr),
        dose_mev_g: device.observed(model.dose.dose_mev_g(t_yr), Observable::Dose, &device.at),
        galaxies: galaxies.into_par_iter().map(|galaxy| model.change_by(galaxy, &device)).collect(),
        traps: device.traps,
    }
}

/// Judges the requirement; `years` (rising) are reused.
fn verdict(model: &Model, years: &[Year]) -> Verdict {
    let judged = model.judged();
    let magnitude = |t_yr: f64| model.change(judged, t_yr).map(|change| change.magnitude());
    let duration_yr = model.mission.mission.duration_yr;
    let mut extra: Vec<f64> = model.dose.changes_yr(duration_yr);
    extra.insert(0, 0.0);
    extra.retain(|t_yr| years.iter().all(|year| year.t_yr != *t_yr));
    let mut known: Vec<(f64, Option<f64>)> = extra.into_par_iter().map(|t_yr| (t_yr, magnitude(t_yr))).collect();
    known.extend(years.iter().map(|year| (year.t_yr, year.galaxies[judged].map(|change| change.magnitude()))));
    known.sort_by(|a, b| a.0.total_cmp(&b.0));

    let requirement = &model.mission.requirement;
    let just_after_yr = JUST_AFTER * duration_yr;
    let rate_at_launch_per_yr =
        magnitude(just_after_yr).zip(known[0].1).map(|(later, launch)| (later - launch) / just_after_yr);
    Verdict {
        uncorrected: first_crossing(requirement.delta_e, &known, magnitude),
        corrected: first_crossing(requirement.delta_e * requirement.correction_factor, &known, magnitude),
        rate_at_launch_per_yr,
        mean_rate_per_yr: known.last().and_then(|end| end.1).map(|end| end / duration_yr),
    }
}

/// Share of the mission over which the rate at launch is taken: long enough for the accuracy of shapes, too short for
/// the curve to bend.
const JUST_AFTER: f64 = 1e-3;

/// Evaluates a mission.
///
/// # Errors
/// Where a galaxy of the mission has no measurable shape even before the readout, or a formula has no value.
pub fn evaluate(mission: &Mission) -> Result<Evaluation, InputError> {
    let model = Model::new(mission);
    let measurable: Vec<bool> =
        (0..mission.galaxies.len()).into_par_iter().map(|galaxy| model.scene(galaxy).is_some()).collect();
    if let Some(galaxy) = measurable.iter().position(|measurable| !measurable) {
        return Err(unmeasurable(mission, &mission.galaxies[galaxy]));
    }
    let years: Vec<Year> =
        year_ends(mission.mission.duration_yr).into_par_iter().map(|t_yr| year(&model, t_yr)).collect();
    let verdict = verdict(&model, &years);
    model.check()?;
    let warnings = warnings(&model);
    Ok(Evaluation { mission: mission.clone(), dose: model.dose, years, verdict, warnings })
}

/// Ends of the years of a mission, and its end.
fn year_ends(duration_yr: f64) -> Vec<f64> {
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

fn warnings(model: &Model) -> Vec<Warning> {
    let mission = &model.mission;
    let mut warnings = model.dose.warnings.clone();
    for (index, galaxy) in mission.galaxies.iter().enumerate() {
        let peak_e = model.scene(index).map_or(0.0, Scene::peak_e);
        if peak_e > mission.detector.full_well_e {
            warnings.push(Warning::Saturated { name: format!("galaxy \"{}\"", galaxy.name), peak_e });
        }
    }
    if mission.accuracy.readout == ReadoutMethod::MonteCarlo {
        warnings.push(Warning::OneSetOfTraps);
    }
    for species in model.traps(mission.mission.duration_yr) {
        let over_readout = species.release_ms / (mission.readout.line_time_ms * f64::from(mission.readout.transfers));
        if over_readout > 1.0 && species.density_per_px > 0.0 {
            warnings.push(Warning::NeverReleases { species: species.name, over_readout });
        }
    }
    if mission.accuracy.readout == ReadoutMethod::Fast && mission.accuracy.relative > 1e-3 {
        warnings.push(Warning::CoarseAccuracy { relative: mission.accuracy.relative });
    }
    warnings
}
