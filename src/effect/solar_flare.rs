//! One solar event: a step of dose.

use serde::Deserialize;

use super::{Card, Catalogued, EVENT_EPOCHS, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Key, Need::Required, key};
use crate::physics::DoseHistory;

/// `[effects.solar-flare]`
#[derive(Debug, Deserialize)]
pub struct SolarFlare {
    t_yr: f64,
    dose_mev_g: f64,
}

impl Catalogued for SolarFlare {
    const CARD: Card = Card {
        kind: "solar-flare",
        adds: "a step of dose on one day, seen by the dose monitor",
        physics: "D(t) increases by dose_mev_g at t_yr. Its traps are those of any other dose.",
        source: "Feynman et al. 2002 (JGR 107, 1303): most of a cycle's fluence comes in a few events",
        holds: "An event of several days counts as one time. Several events are several [[effects.solar-flare]].",
        residuals: "The model's dose, trails and changes of shape are correct before one day and too small by a constant \
                    after it.",
        keys: &[
            key("t_yr", "time of the event since launch", "yr", Number(0.0, 100.0), Required),
            Key {
                help: |value| (value < 0.0).then(|| "an event adds dose; for the loss of traps see `bakeout`".into()),
                ..key("dose_mev_g", "dose of the event", "MeV/g", Number(0.0, 1e12), Required)
            },
        ],
    };

    fn nothing(mission: &Mission) -> toml::Table {
        numbers(&[("t_yr", 0.5 * mission.mission.duration_yr), ("dose_mev_g", 0.0)])
    }

    fn example(mission: &Mission) -> toml::Table {
        numbers(&[("t_yr", 0.5 * mission.mission.duration_yr), ("dose_mev_g", 2e6)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // A third of a mean year's dose, on a day between any two epochs.
        let dose_mev_g = (reach.dose_mev_g / reach.last_yr().max(1.0) / 3.0).max(1e4);
        let on = |t_yr: f64| vec![numbers(&[("t_yr", t_yr), ("dose_mev_g", dose_mev_g)])];
        reach.between_epochs(EVENT_EPOCHS).into_iter().map(on).collect()
    }
}

impl Effect for SolarFlare {
    fn dose(&self, dose: &mut DoseHistory) {
        dose.steps.push((self.t_yr, self.dose_mev_g));
    }
}
