//! Trade studies: a mission → numbers for design decisions.
//!
//! Each study answers one question of the section on future missions of Rhodes et al. 2010 (PASP 122, 439), with numbers, for the
//! judged galaxy of the mission's requirement. A study has a file of the same name in three folders: its options and numbers here,
//! its tables, figures and sentences in `report/study/`, its arguments in `cli/study/`.

pub mod calibration;
pub mod charge_injection;
pub mod clock;
pub mod correction;
pub mod distance;
pub mod error_budget;
pub mod launch;
pub mod pocket_pumping;
pub mod preflash;
pub mod requirement;
pub mod shielding;
mod signal;
mod slopes;
mod tolerance;

use crate::error::InputError;
use crate::mission::{FitSettings, Mission};
use crate::mission_file::lookup;
use crate::model::Model;
use crate::physics::accuracy::Purpose;
use crate::plan::evaluate::unmeasurable;
use crate::warning::Warning;

pub use crate::numeric::estimate::Estimate;
pub use signal::{Aperture, Exposure};

/// A question about a mission. The fields of the type are its options.
pub trait Study {
    /// The results: numbers whose names end in their units. Rows and summaries serialise to the study's JSON.
    type Results;

    /// Computes the results; `advance` is called after each part.
    ///
    /// # Errors
    /// If an option is invalid for the mission, or its judged galaxy has no measurable shape.
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Self::Results, InputError>;
}

/// The uncorrected and the corrected budget of the mission's requirement, |Δe|.
pub fn budgets(mission: &Mission) -> [f64; 2] {
    mission.requirement.limits()
}

/// Warnings about the mission's dose.
fn warnings(mission: &Mission) -> Vec<Warning> {
    Model::new(mission).history().warnings(mission.mission.duration_yr)
}

/// The mission as used in studies: only its judged galaxy, read out accurately enough for differences between options.
fn judged(mission: &Mission) -> Mission {
    let mission = Purpose::ManyShapes.of(mission);
    Mission { galaxies: vec![mission.judged_galaxy().clone()], fit: FitSettings::default(), ..mission }
}

/// A model of the mission as used in studies.
///
/// # Errors
/// If its galaxy has no measurable shape before the readout.
fn ready(mission: &Mission) -> Result<Model, InputError> {
    let model = Model::new(&judged(mission));
    if model.scene(0).is_none() {
        return Err(unmeasurable(mission, mission.judged_galaxy()));
    }
    Ok(model)
}

/// Rejects numbers that a key of the mission does not allow, and an empty list.
fn check(key: &str, numbers: &[f64]) -> Result<(), InputError> {
    let key = lookup::find(key).expect("a key of the mission");
    if numbers.is_empty() {
        return Err(InputError::new("cannot study no values", format!("no value of the {} is given", key.what)));
    }
    let Some(number) = numbers.iter().find(|number| key.kind.refuses(**number)) else { return Ok(()) };
    let problem = format!("the {} is {number}; allowed: {}", key.what, key.kind.allowed(key.unit));
    let error = InputError::new(format!("cannot use the value {number}"), problem);
    Err(match (key.help)(*number) {
        Some(help) => error.with_help(help),
        None => error,
    })
}

/// `count` values from `first` to `last` in equal ratios.
fn ratios(first: f64, last: f64, count: usize) -> Vec<f64> {
    (0..count).map(|index| first * (last / first).powf(index as f64 / (count - 1) as f64)).collect()
}
