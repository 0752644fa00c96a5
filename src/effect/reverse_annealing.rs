//! Traps that increase with time.

use std::sync::Arc;

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{self, Allowed::Number, Need::Required, key};
use crate::physics::{Damage, Loss};

/// `[effects.reverse-annealing]`
#[derive(Debug, Deserialize)]
pub struct ReverseAnnealing {
    growth: f64,
    time_yr: f64,
}

impl Catalogued for ReverseAnnealing {
    const CARD: Card = Card {
        kind: "reverse-annealing",
        adds: "reverse annealing: the number of traps grows with a time constant, counted from their creation",
        physics: "ρ(t) = (ρ_ref/D_ref) ∫ D'(s) (1 + growth (1 − exp(−(t − s)/time_yr))) ds. Traps at launch are no defects of radiation and do \
                  not grow; those of a laboratory dose do, from the irradiation (t_yr = 0). Fractions of annealing and bakeout are multiplied \
                  with it.",
        source: "Grant et al. 2008 (arXiv:0807.1721): transfer losses of Chandra's irradiated CCDs grew after they were warmed. \
                 First-order law: that of the effective doping of silicon detectors, Moll 1999 (thesis, \
                 DESY-THESIS-1999-040; from memory, not checked for traps in CCDs)",
        holds: "At one temperature, the same for all species. Defects become traps as others that move reach them, faster in \
                warm detectors than in cold ones. With a time_yr much shorter than the mission it is \
                dose-scale with factor = 1 + growth.",
        residuals: "The model's trails and losses become too small as the mission goes on, and go on growing in quiet years. \
                    The dose is correct.",
        keys: &[
            key("growth", "number of traps that are added, over those made at first", "", Number(0.0, 1e4), Required),
            key("time_yr", "time constant", "yr", keys::Allowed::Positive(0.0, f64::INFINITY), Required),
        ],
    };

    const GENERALISES: &'static [&'static str] = &["dose-scale"];

    fn nothing(_: &Mission) -> toml::Table {
        table(0.0, 4.0)
    }

    fn example(_: &Mission) -> toml::Table {
        table(0.5, 4.0)
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // Like annealing: from much faster than the mission to hardly visible within it.
        let span_yr = reach.last_yr().max(0.1);
        ratios(0.1 * span_yr, 5.0 * span_yr, 6).map(|time_yr| vec![table(0.1, time_yr)]).collect()
    }
}

fn table(growth: f64, time_yr: f64) -> toml::Table {
    numbers(&[("growth", growth), ("time_yr", time_yr)])
}

impl Effect for ReverseAnnealing {
    fn damage(&self, damage: &mut Damage) {
        let ReverseAnnealing { growth, time_yr } = *self;
        if growth > 0.0 {
            // 1 + g (1 − exp(−age/time)), exact also at small ages.
            let survives = move |made_yr: f64, now_yr: f64| 1.0 - growth * (-(now_yr - made_yr) / time_yr).exp_m1();
            damage.losses.push(Loss { spares_launch: true, on_yr: None, survives: Arc::new(survives) });
        }
    }
}
