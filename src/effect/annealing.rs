//! Traps that disappear with time.

use std::sync::Arc;

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{self, Need::Required, key};
use crate::physics::{Damage, Loss};

/// `[effects.annealing]`
#[derive(Debug, Deserialize)]
pub struct Annealing {
    time_yr: f64,
}

impl Catalogued for Annealing {
    const CARD: Card = Card {
        kind: "annealing",
        adds: "first-order annealing: each trap disappears with a time constant, counted from its creation",
        physics: "ρ(t) = (ρ_ref/D_ref) ∫ D'(s) exp(−(t − s)/time_yr) ds. Traps at launch count from launch, those of a \
                  laboratory dose from the irradiation (t_yr = 0).",
        source: "first-order kinetics: Srour et al. 2003 (IEEE TNS 50, 653), section II",
        holds: "At the operating temperature, the same for all species. time_yr = inf means no annealing.",
        residuals: "The model's trails and losses become too large as the mission goes on, most of all in quiet years. The \
                    dose is correct.",
        keys: &[key("time_yr", "time constant", "yr", keys::Allowed::Positive(0.0, f64::INFINITY), Required)],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("time_yr", f64::INFINITY)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("time_yr", 4.0)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // From much faster than the mission to hardly within it.
        let span_yr = reach.last_yr().max(0.1);
        ratios(0.1 * span_yr, 5.0 * span_yr, 6).map(|time_yr| vec![numbers(&[("time_yr", time_yr)])]).collect()
    }
}

impl Effect for Annealing {
    fn damage(&self, damage: &mut Damage) {
        if self.time_yr.is_finite() {
            let rate_per_yr = 1.0 / self.time_yr;
            let survives = move |made_yr: f64, now_yr: f64| (-(now_yr - made_yr) * rate_per_yr).exp();
            damage.losses.push(Loss { on_yr: None, survives: Arc::new(survives) });
        }
    }
}
