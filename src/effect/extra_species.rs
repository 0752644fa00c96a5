//! One more trap species.

use serde::Deserialize;

use super::{Card, Effect, Kind, Refusal, numbers, tables};
use crate::mission::keys::{self, Kind::Number, Need::Default, Need::Required, key};
use crate::mission::{Detector, Mission, Species};

/// `[effects.extra-species]`
#[derive(Debug, Deserialize)]
pub struct ExtraSpecies {
    name: String,
    density_per_px: f64,
    release_ms: f64,
    energy_ev: f64,
}

impl Kind for ExtraSpecies {
    const CARD: Card = Card {
        kind: "extra-species",
        adds: "one more trap species",
        physics: "A species like those of [[detector.traps]]: density at the reference dose, release time at the reference \
                  temperature, energy level.",
        source: "Rhodes et al. 2010, section 3: two species left a residual in the trails that a third, slow one explained",
        holds: "The energy level is of no consequence where all data are taken at the reference temperature. It may be named; \
                several are several [[effects.extra-species]], with names of their own.",
        residuals: "A trail that is too faint around trail_px of the release time in transfers; where that is longer than \
                    any trail measured, a loss that grows with transfers and is not found in the trail.",
        keys: &[
            key("name", "name of the species", "", keys::Kind::Text, Default("\"extra\"")),
            key("density_per_px", "trap density at the reference dose", "per pixel", Number(0.0, 1e4), Required),
            key("release_ms", "release time", "ms", keys::Kind::Positive(0.0, 1e12), Required),
            key("energy_ev", "energy level below the band", "eV", Number(0.0, 1.2), Default("0.4")),
        ],
    };

    fn nothing(mission: &Mission) -> toml::Table {
        numbers(&[("density_per_px", 0.0), ("release_ms", 3.0 * mission.readout.line_time_ms), ("energy_ev", 0.4)])
    }

    fn example(mission: &Mission) -> toml::Table {
        numbers(&[("density_per_px", 0.7), ("release_ms", 40.0 * mission.readout.line_time_ms), ("energy_ev", 0.4)])
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        let species = mission.detector.traps.iter().map(|species| species.name.clone()).chain(names(mission));
        if species.filter(|name| *name == self.name).count() > 1 {
            return Err(Refusal {
                key: "name".into(),
                problem: format!("there is another species called \"{}\"; names must differ", self.name),
                help: None,
            });
        }
        Ok(())
    }
}

/// Names of a mission's extra species.
pub(super) fn names(mission: &Mission) -> Vec<String> {
    let name = |table: &toml::Table| table.get("name")?.as_str().map(str::to_string);
    tables(mission, ExtraSpecies::CARD.kind).into_iter().filter_map(name).collect()
}

impl Effect for ExtraSpecies {
    fn detector(&self, detector: &mut Detector) {
        detector.traps.push(Species {
            name: self.name.clone(),
            density_per_px: self.density_per_px,
            release_ms: self.release_ms,
            energy_ev: self.energy_ev,
        });
    }
}
