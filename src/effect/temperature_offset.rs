//! A thermometer offset.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, Refusal, numbers};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Key, Need::Required, key};
use crate::physics::conditions::Conditions;

/// `[effects.temperature-offset]`
#[derive(Debug, Deserialize)]
pub struct TemperatureOffset {
    kelvin: f64,
}

impl Catalogued for TemperatureOffset {
    const CARD: Card = Card {
        kind: "temperature-offset",
        adds: "an offset of the detector temperature from the thermometer (positive if warmer)",
        physics: "Release times are those at temperature_k + kelvin. The reference temperature is not changed.",
        source: "release times: Shockley & Read 1952 (Phys. Rev. 87, 835) and Hall 1952 (Phys. Rev. 87, 387)",
        holds: "The same offset at every time and temperature.",
        residuals: "Measured trails of all species are steeper than the model's (flatter if the offset is negative), as with \
                    a slower (faster) clock; deep levels more than shallow ones. If the temperature does not vary, the \
                    effect looks like other release times.",
        keys: &[Key {
            help: |value| (value > 100.0).then(|| "a difference in kelvin, not a temperature".into()),
            ..key("kelvin", "offset of the temperature from the thermometer", "K", Number(-100.0, 100.0), Required)
        }],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("kelvin", 0.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("kelvin", 4.0)])
    }

    fn trials(_: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        [-0.5, 0.5].map(|kelvin| vec![numbers(&[("kelvin", kelvin)])]).into()
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        let real_k = mission.detector.temperature_k + self.kelvin;
        if real_k > 0.0 {
            return Ok(());
        }
        let problem = format!("the detector would be at {real_k} K");
        Err(Refusal { key: "kelvin".into(), problem, help: None })
    }
}

impl Effect for TemperatureOffset {
    fn conditions(&self, at: &mut Conditions) -> Result<(), InputError> {
        at.temperature_k += self.kelvin;
        Ok(())
    }
}
