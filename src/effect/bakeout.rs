//! A fraction of the traps gone on one day.

use std::sync::Arc;

use serde::Deserialize;

use super::{Card, Effect, Kind, MOMENTS, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{Key, Kind::Number, Need::Required, key};
use crate::physics::{Damage, Loss};

/// `[effects.bakeout]`
#[derive(Debug, Deserialize)]
pub struct Bakeout {
    t_yr: f64,
    fraction: f64,
}

impl Kind for Bakeout {
    const CARD: Card = Card {
        kind: "bakeout",
        adds: "a fraction of the traps present disappears on one day",
        physics: "Of the traps made before t_yr (at launch too), 1 − fraction remain from that day on.",
        source: "Holland 1990 (IEEE TNS 37, 2042); warm-ups of ACS and of Chandra's CCDs",
        holds: "All species alike: real ones anneal at temperatures of their own, which a formula on density_per_px.NAME can \
                say. Several are several [[effects.bakeout]].",
        residuals: "Trails and losses right before one day, and too large after it by a fraction that shrinks as new traps \
                    are made; the dose itself right.",
        keys: &[
            key("t_yr", "time of the bakeout since launch", "yr", Number(0.0, 100.0), Required),
            Key {
                help: |value| {
                    (value > 1.0).then(|| format!("a fraction, not a percentage: {value} % is {}", value / 100.0))
                },
                ..key("fraction", "fraction of the traps that disappears", "", Number(0.0, 1.0), Required)
            },
        ],
    };

    fn nothing(mission: &Mission) -> toml::Table {
        numbers(&[("t_yr", 0.5 * mission.mission.duration_yr), ("fraction", 0.0)])
    }

    fn example(mission: &Mission) -> toml::Table {
        numbers(&[("t_yr", 0.5 * mission.mission.duration_yr), ("fraction", 0.4)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        let on = |t_yr: f64| vec![numbers(&[("t_yr", t_yr), ("fraction", 0.3)])];
        reach.between_epochs(MOMENTS).into_iter().map(on).collect()
    }
}

impl Effect for Bakeout {
    fn damage(&self, damage: &mut Damage) {
        let Bakeout { t_yr, fraction } = *self;
        if fraction > 0.0 {
            let survives = move |made_yr, now_yr| if made_yr < t_yr && now_yr >= t_yr { 1.0 - fraction } else { 1.0 };
            damage.losses.push(Loss { on_yr: Some(t_yr), survives: Arc::new(survives) });
        }
    }
}
