//! The effects of a mission, applied to one quantity of the chain at a time.

use std::sync::Arc;

use crate::effect::{self, Effect};
use crate::error::InputError;
use crate::mission::Mission;

/// A mission's effects in the order of the catalogue.
#[derive(Clone, Debug)]
pub(super) struct Effects {
    mission: Arc<str>,
    all: Arc<[Arc<dyn Effect>]>,
}

impl Effects {
    pub fn of(mission: &Mission) -> Effects {
        Effects { mission: mission.mission.name.as_str().into(), all: effect::of(mission).into() }
    }

    pub fn iter(&self) -> impl Iterator<Item = &dyn Effect> {
        self.all.iter().map(AsRef::as_ref)
    }

    /// Lets each effect change something in turn.
    ///
    /// # Errors
    /// If an effect has no value; names the mission.
    pub fn apply(&self, mut change: impl FnMut(&dyn Effect) -> Result<(), InputError>) -> Result<(), InputError> {
        self.iter().try_for_each(&mut change).map_err(|error| self.of_mission(error))
    }

    /// An error of an effect, with the name of the mission.
    pub fn of_mission(&self, error: InputError) -> InputError {
        InputError { refused: format!("{} of mission \"{}\"", error.refused, self.mission), ..error }
    }
}
