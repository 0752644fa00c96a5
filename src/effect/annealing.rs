//! Traps that disappear with time.

use std::sync::Arc;

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{self, FRACTION, Key, Need::Optional, Need::Required, key, percentage};
use crate::physics::{Damage, Loss};

/// `[effects.annealing]`
#[derive(Debug, Deserialize)]
pub struct Annealing {
    time_yr: f64,
    /// Fraction of the traps that never disappears.
    #[serde(default)]
    remaining: f64,
}

/// Remaining fraction from which a search starts.
const REMAINING: f64 = 0.3;

impl Catalogued for Annealing {
    const CARD: Card = Card {
        kind: "annealing",
        adds: "first-order annealing: each trap disappears with a time constant, counted from its creation",
        physics: "ρ(t) = (ρ_ref/D_ref) ∫ D'(s) (r + (1 − r) exp(−(t − s)/time_yr)) ds with r = remaining. Traps at launch count \
                  from launch, those of a laboratory dose from the irradiation (t_yr = 0).",
        source: "first-order kinetics: Srour et al. 2003 (IEEE TNS 50, 653), section II",
        holds: "At the operating temperature, the same for all species. time_yr = inf means no annealing. \
                Annealing that saturates leaves the fraction remaining; a search tries it with and without.",
        residuals: "The model's trails and losses become too large as the mission goes on, most of all in quiet years. The \
                    dose is correct.",
        keys: &[
            key("time_yr", "time constant", "yr", keys::Allowed::Positive(0.0, f64::INFINITY), Required),
            Key {
                help: percentage,
                ..key("remaining", "fraction of the traps that never disappears (0 if absent)", "", FRACTION, Optional)
            },
        ],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("time_yr", f64::INFINITY)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("time_yr", 4.0), ("remaining", 0.2)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // From much faster than the mission to hardly visible within it.
        let span_yr = reach.last_yr().max(0.1);
        let times = || ratios(0.1 * span_yr, 5.0 * span_yr, 6);
        let whole = times().map(|time_yr| vec![numbers(&[("time_yr", time_yr)])]);
        // What saturates within the mission may leave a part.
        let in_part = times().take(4).map(|time_yr| vec![numbers(&[("time_yr", time_yr), ("remaining", REMAINING)])]);
        whole.chain(in_part).collect()
    }
}

impl Effect for Annealing {
    fn damage(&self, damage: &mut Damage) {
        if self.time_yr.is_finite() {
            let rate_per_yr = 1.0 / self.time_yr;
            let remaining = self.remaining;
            let survives = move |made_yr: f64, now_yr: f64| {
                remaining + (1.0 - remaining) * (-(now_yr - made_yr) * rate_per_yr).exp()
            };
            damage.losses.push(Loss { spares_launch: false, on_yr: None, survives: Arc::new(survives) });
        }
    }
}
