//! Traps present at launch.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, Refusal};
use crate::error::nearest;
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Need::Optional, key};
use crate::physics::Damage;

/// `[effects.prelaunch-traps]`
#[derive(Debug, Deserialize)]
pub struct PrelaunchTraps {
    #[serde(flatten)]
    per_px: BTreeMap<String, f64>,
}

impl Catalogued for PrelaunchTraps {
    const CARD: Card = Card {
        kind: "prelaunch-traps",
        adds: "traps at launch, a density for each species",
        physics: "ρ(t) = ρ_0 + ρ_ref D(t)/D_ref. The traps come from manufacturing, or from tests before launch. They anneal \
                  and are baked out like any others.",
        source: "Rhodes et al. 2010, section 2.3; Massey et al. 2014 (MNRAS 439, 887), table 1: ACS at launch",
        holds: "Traps measured after a laboratory dose include them. Species that are not named have none. \
                Traps that are there at launch alone, with a release time or well fill power of their own, are a species of \
                density_per_px = 0.",
        residuals: "The model's trails and losses are too small by the same amount at every time, including launch. The dose \
                    is correct.",
        keys: &[key("*", "density at launch of that species", "per pixel", Number(0.0, 1e4), Optional)],
    };

    fn nothing(mission: &Mission) -> toml::Table {
        mission.detector.traps.iter().map(|species| (species.name.clone(), 0.0.into())).collect()
    }

    fn example(mission: &Mission) -> toml::Table {
        mission.detector.traps.iter().map(|species| (species.name.clone(), 0.01.into())).collect()
    }

    fn trials(mission: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // A fifth of those created in the mission, species by species.
        let share = 0.2 * reach.dose_mev_g / mission.reference_dose_mev_g();
        let species = mission.detector.traps.iter();
        let alone = |alone: &str| {
            let density = |per_px: f64, name: &str| if name == alone { (share * per_px).clamp(1e-4, 1e4) } else { 0.0 };
            let all = mission.detector.traps.iter();
            all.map(|trap| (trap.name.clone(), density(trap.density_per_px, &trap.name).into())).collect()
        };
        vec![species.map(|trap| alone(&trap.name)).collect()]
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        let known = || mission.detector.traps.iter().map(|species| species.name.as_str());
        let extra = super::extra_species::names(mission);
        let known = || known().chain(extra.iter().map(String::as_str));
        match self.per_px.keys().find(|name| !known().any(|known| known == *name)) {
            None => Ok(()),
            Some(name) => Err(Refusal {
                key: name.clone(),
                problem: format!(
                    "there is no trap species \"{name}\"; there are: {}",
                    known().collect::<Vec<_>>().join(", ")
                ),
                help: nearest(name, known()).map(|near| format!("did you mean \"{near}\"?")),
            }),
        }
    }
}

impl Effect for PrelaunchTraps {
    fn damage(&self, damage: &mut Damage) {
        damage.at_launch_per_px.extend(self.per_px.iter().map(|(name, density)| (name.clone(), *density)));
    }
}
