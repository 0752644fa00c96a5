//! Capture that takes time.

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, Refusal, numbers, tables};
use crate::error::InputError;
use crate::mission::keys::{Allowed::Number, Need::Required, key};
use crate::mission::{Mission, Species};
use crate::physics::SpeciesState;
use crate::physics::conditions::Conditions;

/// `[effects.finite-capture]`
#[derive(Debug, Deserialize)]
pub struct FiniteCapture {
    capture_ms: f64,
}

impl Catalogued for FiniteCapture {
    const CARD: Card = Card {
        kind: "finite-capture",
        adds: "a finite capture time of the traps inside the cloud",
        physics: "Inside the cloud, d(fill)/dt = (1 − fill)/capture_ms − fill/τ during one line time; above it, traps only \
                  release. The height of the cloud is that of the charge on arrival.",
        source: "Massey et al. 2014 (MNRAS 439, 887), appendix A; Short et al. 2013 (MNRAS 430, 3078)",
        holds: "The same capture time for all species and at any depth of the cloud, and the same well fill power. capture_ms = 0 is instantaneous \
                capture. With traps slower than the line time, a readout takes about ten times longer.",
        residuals: "The model's losses are too large if clocks are fast or release times short, and its trails are too \
                    bright next to the packet. Both residuals increase at a shorter line_time_ms.",
        keys: &[key("capture_ms", "capture time", "ms", Number(0.0, 1e7), Required)],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("capture_ms", 0.0)])
    }

    fn example(mission: &Mission) -> toml::Table {
        numbers(&[("capture_ms", 0.3 * mission.readout.line_time_ms)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        let [shortest_ms, longest_ms] = reach.line_time_ms;
        let times = ratios(0.03 * shortest_ms, 2.0 * longest_ms, 4);
        times.map(|capture_ms| vec![numbers(&[("capture_ms", capture_ms)])]).collect()
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
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

impl Effect for FiniteCapture {
    fn traps(&self, traps: &mut [SpeciesState], _: &Conditions) -> Result<(), InputError> {
        for species in traps {
            species.capture_ms = self.capture_ms;
        }
        Ok(())
    }
}
