//! Traps that charge of cosmic rays has filled before an exposure is read.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{FRACTION, Key, Need::Required, key, percentage};
use crate::physics::Damage;

/// `[effects.sacrificial-charge]`
#[derive(Debug, Deserialize)]
pub struct SacrificialCharge {
    filled: f64,
}

impl Catalogued for SacrificialCharge {
    const CARD: Card = Card {
        kind: "sacrificial-charge",
        adds: "traps that charge of cosmic rays keeps full, so that packets do not meet them",
        physics: "rho -> rho (1 − filled)^(rate/mean rate), with the rate of protons of cosmic rays above 1 GeV: that of the month with \
                  environment.sun = \"observed\", that of the phase of the solar cycle otherwise. A hit fills the traps that its charge \
                  passes; a packet meets them full if it comes within their release time. With n hits per column and second, \
                  each passing on average half of the rows, 1 − exp(−n tau/2) of the traps of release time tau are full. n \
                  is the flux, 2 per cm2 and s in space, times the area of a column times the 2 to 3 columns of a track: 0.2 for a \
                  column of 0.015 x 3 cm2. tau = 0.1, 0.4 and 1 s then give 1, 4 and 10 %.",
        source: "an hypothesis of this project for the CTI of XMM's EPIC pn, which falls near solar minimum; its team corrects the gain by \
                 the rate of discarded lines, those with a cosmic ray (calibration notes of EPIC pn). Flux: see the source \
                 cosmic-rays",
        holds: "The same fraction of all species, of launch and of radiation, in image and register. Not for doses given in a \
                laboratory. Traps that release within a few lines are empty again, and are not filled in fact.",
        residuals: "The model's losses are too large near solar minimum, when cosmic rays are most frequent, and too small near \
                    maximum, at every signal_e. The dose is correct.",
        keys: &[Key {
            help: percentage,
            ..key(
                "filled",
                "fraction of the traps that are full, at the mean rate of cosmic rays",
                "",
                FRACTION,
                Required,
            )
        }],
    };

    const REPLACES: bool = true;

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("filled", 0.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("filled", 0.05)])
    }

    fn trials(_: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        [0.01, 0.2].map(|filled| vec![numbers(&[("filled", filled)])]).into()
    }
}

impl Effect for SacrificialCharge {
    fn damage(&self, damage: &mut Damage) {
        damage.filled = self.filled;
    }
}
