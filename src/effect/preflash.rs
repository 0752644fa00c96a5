//! Background that is missing in the mission file.

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Need::Required, key};
use crate::physics::conditions::Conditions;

/// `[effects.preflash]`
#[derive(Debug, Deserialize)]
pub struct Preflash {
    electrons: f64,
}

impl Catalogued for Preflash {
    const CARD: Card = Card {
        kind: "preflash",
        adds: "background that is not in the mission file: a preflash, stray light, dark current",
        physics: "Every pixel holds this additional charge before transfer. It keeps the lowest traps full.",
        source: "Rhodes et al. 2010, section 6; Massey et al. 2010 on the background's effect",
        holds: "Added to background_e, in every row of every file.",
        residuals: "The model's losses and trails are too large at small background_e, most of all for faint packets and far \
                    behind them. They are correct at large background_e.",
        keys: &[key("electrons", "additional charge in every pixel", "e-", Number(0.0, 1e7), Required)],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("electrons", 0.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("electrons", 40.0)])
    }

    fn trials(mission: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        // It is unknown: from almost zero to much more than the sky.
        let largest_e = (10.0 * mission.sky.background_e).clamp(100.0, 0.1 * mission.detector.full_well_e);
        ratios(1.0, largest_e, 4).map(|electrons| vec![numbers(&[("electrons", electrons)])]).collect()
    }
}

impl Effect for Preflash {
    fn conditions(&self, at: &mut Conditions) -> Result<(), InputError> {
        at.background_e += self.electrons;
        Ok(())
    }
}
