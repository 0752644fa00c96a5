//! Dose in the active years of the solar cycle, and none in the others.

use serde::Deserialize;

use super::{Card, Catalogued, Effect};
use crate::mission::Mission;
use crate::physics::DoseHistory;

/// `[effects.solar-cycle]`
#[derive(Debug, Deserialize)]
pub struct SolarCycle {}

impl Catalogued for SolarCycle {
    const CARD: Card = Card {
        kind: "solar-cycle",
        adds: "dose in 7 of 11 years instead of a constant average, for missions with the `constant` model",
        physics: "The dose rate is the active one from 2.5 years before to 4.5 years after each solar maximum, and 0 \
                  otherwise.",
        source: "ECSS-E-ST-10-04C (2008), annex B.1; solar maxima from environment.solar_maximum",
        holds: "No effect in a mission whose model is `solar-cycle`. Single events are a separate effect, solar-flare.",
        residuals: "The model's dose, and all damage, is too large in quiet years and too small in active ones. Residuals \
                    against t_yr are a staircase, with steps where active years begin and end.",
        keys: &[],
    };

    fn nothing(_: &Mission) -> toml::Table {
        // At zero strength only if the mission already follows the cycle: it has no adjustable strength.
        toml::Table::new()
    }

    fn example(_: &Mission) -> toml::Table {
        toml::Table::new()
    }
}

impl Effect for SolarCycle {
    fn dose(&self, dose: &mut DoseHistory) {
        dose.follow_solar_cycle();
    }
}
