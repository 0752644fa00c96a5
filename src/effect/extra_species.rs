//! One more trap species.

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, Refusal, new_name, numbers, tables};
use crate::mission::keys::{self, Allowed::Number, Need::Default, Need::Optional, Need::Required, key};
use crate::mission::{Detector, Mission, Species};

/// `[effects.extra-species]`
#[derive(Debug, Deserialize)]
pub struct ExtraSpecies {
    name: String,
    density_per_px: f64,
    release_ms: f64,
    energy_ev: f64,
    well_fill_power: Option<f64>,
}

impl Catalogued for ExtraSpecies {
    const CARD: Card = Card {
        kind: "extra-species",
        adds: "one additional trap species",
        physics: "A species with the parameters of [[detector.traps]]: density at the reference dose, release time at the \
                  reference temperature, energy level.",
        source: "Rhodes et al. 2010, section 3: two species left a residual in the trails that a third, slow one explained",
        holds: "The energy level has no influence if all data are taken at the reference temperature. The species may have a \
                name. Several species are several [[effects.extra-species]] with different names.",
        residuals: "The model's trail is too faint where trail_px is near the release time in transfers. If that is longer \
                    than any measured trail, the model lacks a loss that increases with transfers and is absent from the \
                    trail.",
        keys: &[
            key("name", "name of the species", "", keys::Allowed::Text, Default("\"extra\"")),
            key("density_per_px", "trap density at the reference dose", "per pixel", Number(0.0, 1e4), Required),
            key("release_ms", "release time", "ms", keys::Allowed::Positive(0.0, 1e12), Required),
            key("energy_ev", "energy level below the band", "eV", Number(0.0, 1.2), Default("0.4")),
            key(
                "well_fill_power",
                "well fill power of this species, in place of the detector's",
                "",
                keys::Allowed::Positive(0.0, 5.0),
                Optional,
            ),
        ],
    };

    fn nothing(mission: &Mission) -> toml::Table {
        numbers(&[("density_per_px", 0.0), ("release_ms", 3.0 * mission.readout.line_time_ms), ("energy_ev", 0.4)])
    }

    fn example(mission: &Mission) -> toml::Table {
        numbers(&[("density_per_px", 0.7), ("release_ms", 40.0 * mission.readout.line_time_ms), ("energy_ev", 0.4)])
    }

    fn trials(mission: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // From release within a fraction of a transfer to release long after the last pixel of any trail.
        let [shortest_ms, longest_ms] = reach.line_time_ms;
        let last_ms = 30.0 * longest_ms * f64::from(reach.trail_px.max(10));
        let density_per_px = (0.03 * mission.reference_dose_mev_g() / reach.dose_mev_g.max(1.0)).clamp(0.01, 10.0);
        let energies: &[f64] = if reach.varies_in_temperature() { &[0.21, 0.34, 0.45] } else { &[0.4] };
        let taken: Vec<String> =
            mission.detector.traps.iter().map(|species| species.name.clone()).chain(names(mission)).collect();
        let name = new_name("extra", &taken);
        let releases = ratios(0.3 * shortest_ms, last_ms, 12);
        let trial = |(release_ms, energy_ev): (f64, f64)| {
            let mut table =
                numbers(&[("density_per_px", density_per_px), ("release_ms", release_ms), ("energy_ev", energy_ev)]);
            table.insert("name".into(), name.clone().into());
            vec![table]
        };
        releases
            .flat_map(|release_ms| energies.iter().map(move |energy_ev| (release_ms, *energy_ev)))
            .map(trial)
            .collect()
    }

    fn held(reach: &Reach) -> &'static [&'static str] {
        if reach.varies_in_temperature() { &[] } else { &["energy_ev"] }
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        let species = mission.detector.traps.iter().map(|species| species.name.clone()).chain(names(mission));
        if species.filter(|name| *name == self.name).count() > 1 {
            return Err(Refusal {
                key: "name".into(),
                problem: format!("duplicate name \"{}\": another species has it", self.name),
                help: Some("give each species a `name` of its own".into()),
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
            well_fill_power: self.well_fill_power,
            surface_level_e: None,
        });
    }
}
