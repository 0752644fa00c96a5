//! More or fewer traps per unit of dose.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{self, Key, Need::Required, key};
use crate::physics::Damage;

/// `[effects.dose-scale]`
#[derive(Debug, Deserialize)]
pub struct DoseScale {
    factor: f64,
}

impl Catalogued for DoseScale {
    const CARD: Card = Card {
        kind: "dose-scale",
        adds: "a factor on the traps per unit of dose, not seen by the dose monitor",
        physics: "ρ = factor ρ_ref D/D_ref, for all species. Possible causes: secondaries from the shield, shielding that \
                  differs from the model's, damage by another particle than that of the reference irradiation.",
        source: "Dale et al. 1994 (IEEE TNS 41, 1974) on secondaries; Rhodes et al. 2010, section 4.1",
        holds: "Traps at launch are not scaled. With one epoch alone it is degenerate with other effects that add traps.",
        residuals: "All effects of traps in the model are too small (or too large) by the same factor at every time, \
                    distance and signal. The dose is correct.",
        keys: &[Key {
            help: |value| (value == 0.0).then(|| "this means no traps: remove the species instead".into()),
            ..key(
                "factor",
                "traps per unit of dose over the model's",
                "",
                keys::Allowed::Positive(0.0, 1000.0),
                Required,
            )
        }],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("factor", 1.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("factor", 1.4)])
    }

    fn trials(_: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        [0.97, 1.03].map(|factor| vec![numbers(&[("factor", factor)])]).into()
    }
}

impl Effect for DoseScale {
    fn damage(&self, damage: &mut Damage) {
        damage.traps_per_dose *= self.factor;
    }
}
