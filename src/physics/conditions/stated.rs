//! Conditions as a row of measurements states them: what it leaves to the mission is that of the mission evaluated.

use std::borrow::Cow;
use std::ops::Deref;

use chrono::NaiveDate;

use super::{Conditions, MIRRORED};
use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::calendar::DAYS_PER_YEAR;

/// Conditions of which some are left to the mission. It reads as those under the mission with which the row was read; predictions
/// take those under the mission that is evaluated. A condition can only be changed by stating it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    at: Conditions,
    /// Which of [`MIRRORED`] are the mission's.
    left: [bool; MIRRORED.len()],
    /// The launch from which `t_yr` was counted, if the row states a date.
    launch: Option<NaiveDate>,
}

/// Conditions as they are under a mission.
pub trait UnderMission {
    /// The conditions of a prediction by a mission's model.
    ///
    /// # Errors
    /// If the mission contradicts them: it was launched after the row's date.
    fn under(&self, mission: &Mission) -> Result<Cow<'_, Conditions>, InputError>;
}

impl UnderMission for Conditions {
    fn under(&self, _: &Mission) -> Result<Cow<'_, Conditions>, InputError> {
        Ok(Cow::Borrowed(self))
    }
}

impl UnderMission for Stated {
    fn under(&self, mission: &Mission) -> Result<Cow<'_, Conditions>, InputError> {
        let mut at = Cow::Borrowed(&self.at);
        let launch = mission.mission.launch.0;
        if let Some(known) = self.launch.filter(|known| *known != launch) {
            let t_yr = at.t_yr - (launch - known).num_days() as f64 / DAYS_PER_YEAR;
            if t_yr < 0.0 {
                let problem = format!("a date of the measurements is {:.3} yr before launch, {launch}", -t_yr);
                return Err(InputError::new("cannot use the measurements", problem));
            }
            at.to_mut().t_yr = t_yr;
        }
        if self.left.contains(&true) {
            let believed = believed(mission, at.t_yr, at.dose_mev_g);
            for (name, _) in MIRRORED.iter().zip(self.left).filter_map(|(mirrored, left)| left.then_some(mirrored)) {
                at.to_mut().set(name, believed.get(name).expect("a mission has it"));
            }
        }
        Ok(at)
    }
}

/// The mission's own conditions. A laboratory measurement, of a given dose, does not follow the mission's history.
fn believed(mission: &Mission, t_yr: f64, dose_mev_g: Option<f64>) -> Conditions {
    let own = Conditions::of(mission, t_yr);
    let temperature_k = if dose_mev_g.is_some() { mission.detector.temperature_k } else { own.temperature_k };
    Conditions { dose_mev_g, temperature_k, ..own }
}

impl Stated {
    /// Time (years since launch) and dose (MeV/g, if given at once) alone: the rest is left to the mission.
    pub fn left_to(mission: &Mission, t_yr: f64, dose_mev_g: Option<f64>) -> Stated {
        Stated { at: believed(mission, t_yr, dose_mev_g), left: [true; MIRRORED.len()], launch: None }
    }

    /// The same, if the time was given by a date.
    pub fn dated(self, mission: &Mission) -> Stated {
        Stated { launch: Some(mission.mission.launch.0), ..self }
    }

    /// The same with one condition stated; None if there is no such condition.
    pub fn with(&self, name: &str, value: f64) -> Option<Stated> {
        let mut other = self.clone();
        other.state(name, value).then_some(other)
    }

    /// States one condition; false if there is no such condition.
    pub fn state(&mut self, name: &str, value: f64) -> bool {
        if let Some(place) = MIRRORED.iter().position(|(mirrored, _)| *mirrored == name) {
            self.left[place] = false;
        }
        if name == "t_yr" {
            self.launch = None;
        }
        self.at.set(name, value)
    }

    /// Numeric columns unknown to the model, by name.
    pub(crate) fn set_covariates(&mut self, covariates: Vec<(String, f64)>) {
        self.at.covariates = covariates;
    }

    /// Whether its time follows from a date and the mission's launch.
    pub fn is_dated(&self) -> bool {
        self.launch.is_some()
    }

    /// Whether a condition is the mission's.
    pub fn is_left(&self, name: &str) -> bool {
        MIRRORED.iter().zip(self.left).any(|((mirrored, _), left)| left && *mirrored == name)
    }
}

impl Deref for Stated {
    type Target = Conditions;

    fn deref(&self) -> &Conditions {
        &self.at
    }
}

impl From<Conditions> for Stated {
    /// All of them stated.
    fn from(at: Conditions) -> Stated {
        Stated { at, left: [false; MIRRORED.len()], launch: None }
    }
}
