//! Loss of a fraction of the traps on one day.

use std::sync::Arc;

use serde::Deserialize;

use super::{Card, Catalogued, EVENT_EPOCHS, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Key, Need::Required, key};
use crate::physics::{Damage, Loss};

/// `[effects.bakeout]`
#[derive(Debug, Deserialize)]
pub struct Bakeout {
    t_yr: f64,
    fraction: f64,
}

impl Catalogued for Bakeout {
    const CARD: Card = Card {
        kind: "bakeout",
        adds: "loss of a fraction of the traps on one day",
        physics: "Of the traps made before t_yr (including those at launch), 1 − fraction remain from that day on.",
        source: "Holland 1990 (IEEE TNS 37, 2042); warm-ups of ACS and of Chandra's CCDs",
        holds: "The same fraction for all species. Real species anneal at different temperatures, which a formula for \
                density_per_px.NAME can describe. Several bakeouts are several [[effects.bakeout]].",
        residuals: "The model's trails and losses are correct before one day. After it they are too large, by a fraction \
                    that decreases as new traps are made. The dose is correct.",
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
        reach.between_epochs(EVENT_EPOCHS).into_iter().map(on).collect()
    }
}

impl Effect for Bakeout {
    fn damage(&self, damage: &mut Damage) {
        let Bakeout { t_yr, fraction } = *self;
        if fraction > 0.0 {
            let survives = move |made_yr, now_yr| if made_yr < t_yr && now_yr >= t_yr { 1.0 - fraction } else { 1.0 };
            damage.losses.push(Loss { spares_launch: false, on_yr: Some(t_yr), survives: Arc::new(survives) });
        }
    }
}
