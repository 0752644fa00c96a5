//! One more trap species.

use serde::Deserialize;

use super::reach::ratios;
use super::{AfterFit, Card, Catalogued, Effect, Reach, Refusal, new_name, numbers, tables};
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

/// Parameters that distinguish one species from another.
const NAMES: [&str; 2] = ["density_per_px", "release_ms"];

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

    /// If a fit has moved a species with free density and release time away from its release time, and the extra species is now
    /// nearer to it, both exchange their values.
    fn plainer(after: &AfterFit, key: &str) -> Vec<(String, f64)> {
        let AfterFit { fitted, given, free, .. } = *after;
        let own = |name: &str| format!("{key}.{name}");
        let of = |species: &Species, name: &str| format!("detector.traps.{}.{name}", species.name);
        let extra_ms = fitted.number(&own("release_ms")).expect("a required number");
        let is_nearer = |species: &&Species| {
            let before = &given.detector.traps.iter().find(|known| known.name == species.name);
            let away = |release_ms: f64| before.map_or(0.0, |before| (release_ms / before.release_ms).ln().abs());
            NAMES.iter().all(|name| free.contains(&of(species, name))) && away(extra_ms) < away(species.release_ms)
        };
        let Some(species) = fitted.detector.traps.iter().find(is_nearer) else { return Vec::new() };
        let swapped = |name: &&str| {
            let keys = [own(name), of(species, name)];
            let [a, b] = [0, 1].map(|place| fitted.number(&keys[place]).expect("a number"));
            keys.into_iter().zip([b, a])
        };
        NAMES.iter().flat_map(swapped).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mission_file::add_effect;

    #[test]
    fn a_species_keeps_its_name() {
        let given = Mission::read("missions/snap_l2.toml").unwrap();
        let species = &given.detector.traps[0];
        let keys = NAMES.map(|name| format!("detector.traps.{}.{name}", species.name));
        let (density_per_px, release_ms) = (species.density_per_px, species.release_ms);
        let fitted = |own_ms: f64, extra_ms: f64| {
            let at = given.with(&[(keys[0].clone(), 0.5.into()), (keys[1].clone(), own_ms.into())]).unwrap();
            let table = numbers(&[("density_per_px", density_per_px), ("release_ms", extra_ms), ("energy_ev", 0.4)]);
            add_effect(&at, ExtraSpecies::CARD.kind, table).unwrap()
        };
        let (away, key) = fitted(0.01 * release_ms, 1.1 * release_ms);
        let mut swapped = plainer(&away, &given, &keys, &key);
        swapped.sort_by(|a, b| a.0.cmp(&b.0));
        let values: Vec<f64> = swapped.iter().map(|(_, value)| *value).collect();
        assert_eq!(values, [density_per_px, 1.1 * release_ms, 0.5, 0.01 * release_ms], "{swapped:?}");
        // Fixed parameters cannot be exchanged, and a species at its original release time need not be.
        assert!(plainer(&away, &given, &keys[..1], &key).is_empty());
        let (here, key) = fitted(1.1 * release_ms, 0.01 * release_ms);
        assert!(plainer(&here, &given, &keys, &key).is_empty());
    }

    fn plainer(fitted: &Mission, given: &Mission, free: &[String], key: &str) -> Vec<(String, f64)> {
        ExtraSpecies::plainer(&AfterFit { fitted, given, free, epochs_yr: &[] }, key)
    }
}
