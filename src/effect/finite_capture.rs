//! Finite capture times.

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, Refusal, numbers, tables};
use crate::error::InputError;
use crate::mission::keys::{
    Allowed::{self, Number},
    Key,
    Need::{Default, Optional, Required},
    key, plain,
};
use crate::mission::{Mission, Species};
use crate::physics::SpeciesState;
use crate::physics::conditions::Conditions;

/// `[effects.finite-capture]`
#[derive(Debug, Deserialize)]
pub struct FiniteCapture {
    capture_ms: f64,
    #[serde(default)]
    density_power: f64,
    capture_at_e: Option<f64>,
}

/// What is believed of density_power: capture of one electron gives 1, and a cloud that fills slowly less (half of it as a standard deviation).
const SCATTER_OF_POWERS: f64 = 0.5;

impl Catalogued for FiniteCapture {
    const CARD: Card = Card {
        kind: "finite-capture",
        adds: "a finite capture time of the traps inside the cloud",
        physics: "Inside the cloud, d(fill)/dt = (1 − fill)/τc − fill/τ during one line time; above it, traps only \
                  release. The height of the cloud is that of the charge on arrival. The capture time of a packet of n electrons is \
                  τc(n) = capture_ms [(n₀/h(n₀))/(n/h(n))]^density_power: n/h(n) is the density of electrons in the cloud, and n₀ = capture_at_e. \
                  density_power = 0 is one capture time for all packets. density_power = 1 is Shockley-Read-Hall capture, 1/τc = σ v_th n_e: \
                  a full well has n_e = full_well_e/V and capture_ms = V/(σ v_th full_well_e), V being the volume of the cloud of a full well.",
        source: "Massey et al. 2014 (MNRAS 439, 887), appendix A, for one capture time; Short et al. 2013 (MNRAS 430, 3078) for a rate that \
                 depends on the density of electrons",
        holds: "The same capture time for all species and at any depth of the cloud, and the same well fill power. capture_ms = 0 is instantaneous \
                capture. With traps slower than the line time, a readout takes about ten times longer. The density is that on arrival, the same \
                throughout the cloud. The whole charge of a packet counts, also that in a notch: with a notch and volume_at_zero = 0, the density \
                has no limit towards the notch, where packets meet no traps any more. With volume_at_zero it is n/volume_at_zero at and below \
                the notch.",
        residuals: "The model's losses are too large if clocks are fast or release times short, and its trails are too \
                    bright next to the packet. Both residuals increase at a shorter line_time_ms. With density_power, they increase towards \
                    faint packets and low background_e as well.",
        keys: &[
            key("capture_ms", "capture time", "ms", Number(0.0, 1e7), Required),
            Key {
                scatter: Some(SCATTER_OF_POWERS),
                ..key(
                    "density_power",
                    "power of the density of electrons to which the capture rate is proportional; 1 for Shockley-Read-Hall",
                    "",
                    Number(0.0, 3.0),
                    Default("0.0"),
                )
            },
            key(
                "capture_at_e",
                "charge of the packets in which the capture time is capture_ms; a full well if it is not given",
                "e-",
                Allowed::Positive(0.0, 1e9),
                Optional,
            ),
        ],
    };

    const REPLACES: bool = true;

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("capture_ms", 0.0)])
    }

    fn example(mission: &Mission) -> toml::Table {
        let capture_ms = 0.3 * mission.readout.line_time_ms;
        numbers(&[("capture_ms", capture_ms), ("density_power", 0.0), ("capture_at_e", mission.detector.full_well_e)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        let [shortest_ms, longest_ms] = reach.line_time_ms;
        let times = ratios(0.03 * shortest_ms, 2.0 * longest_ms, 4);
        let tables = |capture_ms: f64| {
            // One capture time for all packets, or Shockley-Read-Hall's.
            let constant = numbers(&[("capture_ms", capture_ms)]);
            let by_density = numbers(&[("capture_ms", capture_ms), ("density_power", 1.0)]);
            [vec![constant], vec![by_density]]
        };
        times.flat_map(tables).collect()
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        self.check_reference(mission)?;
        if self.capture_ms > 0.0 && mission.persistence().is_some() {
            return Err(Refusal {
                key: "capture_ms".into(),
                problem: "traps that keep charge into the next exposure are modelled with capture at once".into(),
                help: Some("remove [survey.persistence], or set capture_ms = 0".into()),
            });
        }
        let own_power = |table: &toml::Table| table.contains_key("well_fill_power");
        let of_register = |table: &toml::Table| {
            let species = table.get("traps").and_then(toml::Value::as_array);
            species.is_some_and(|species| species.iter().filter_map(toml::Value::as_table).any(own_power))
        };
        let own_cloud = |species: &Species| species.well_fill_power.is_some() || species.surface_level_e.is_some();
        let differ = mission.detector.traps.iter().any(own_cloud)
            || tables(mission, "extra-species").into_iter().any(own_power)
            || tables(mission, "serial-traps").into_iter().any(of_register);
        if self.capture_ms == 0.0 || !differ {
            return Ok(());
        }
        Err(Refusal {
            key: "capture_ms".into(),
            problem: "a capture time needs one well fill power for all species, and none at the surface".into(),
            help: Some("remove well_fill_power and surface_level_e from the species, or set capture_ms = 0".into()),
        })
    }
}

impl FiniteCapture {
    /// Checks that packets of the reference have a density.
    fn check_reference(&self, mission: &Mission) -> Result<(), Refusal> {
        let Some(capture_at_e) = self.capture_at_e.filter(|_| self.density_power > 0.0) else { return Ok(()) };
        let given = |kind: &str, key: &str| tables(mission, kind).last().and_then(|table| table.get(key)?.as_float());
        let notch_e = given("notch", "notch_e").unwrap_or(mission.detector.notch_e);
        let volume_at_zero = given("volume-at-zero", "fraction").unwrap_or(mission.detector.volume_at_zero);
        if volume_at_zero > 0.0 || capture_at_e > notch_e {
            return Ok(());
        }
        Err(Refusal {
            key: "capture_at_e".into(),
            problem: format!(
                "packets of {} e- stay within the notch of {} e-, where no trap captures",
                plain(capture_at_e),
                plain(notch_e)
            ),
            help: Some(
                "give the charge of a packet whose capture time is known, or remove capture_at_e for a full well"
                    .into(),
            ),
        })
    }
}

impl Effect for FiniteCapture {
    fn traps(&self, traps: &mut [SpeciesState], _: &Conditions) -> Result<(), InputError> {
        for species in traps {
            species.capture_ms = self.capture_ms;
            species.capture_density_power = self.density_power;
            species.capture_at_e = self.capture_at_e.unwrap_or(species.capture_at_e);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;

    /// Change of e1 of SNAP's galaxy after five years.
    fn change(keys: &str) -> f64 {
        let plain = include_str!("../../missions/snap_l2.toml");
        let mission = Mission::parse(&format!("{plain}\n[effects.finite-capture]\n{keys}")).unwrap();
        Model::new(&mission).change(0, 5.0).unwrap().unwrap().delta_e1
    }

    #[test]
    fn a_power_of_zero_changes_no_bit() {
        assert_eq!(change("capture_ms = 3.0"), change("capture_ms = 3.0\ndensity_power = 0.0\ncapture_at_e = 1000.0"));
    }

    #[test]
    fn faint_packets_are_captured_less_than_a_full_well() {
        // Sky and galaxy are far below a full well: their clouds have lower densities.
        let changes = ["0.0", "0.25", "0.5", "1.0"]
            .map(|power| change(&format!("capture_ms = 3.0\ndensity_power = {power}")).abs());
        assert!(changes.windows(2).all(|pair| pair[1] < 0.995 * pair[0]), "{changes:?}");
        let full_well = change("capture_ms = 3.0\ndensity_power = 1.0\ncapture_at_e = 161000.0");
        assert_eq!(full_well.abs(), changes[3]);
    }
}
