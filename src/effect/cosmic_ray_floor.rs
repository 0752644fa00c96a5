//! Dose of cosmic rays, in every year.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Need::Required, key};
use crate::physics::DoseHistory;

/// `[effects.cosmic-ray-floor]`
#[derive(Debug, Deserialize)]
pub struct CosmicRayFloor {
    rate_mev_g_yr: f64,
}

impl Catalogued for CosmicRayFloor {
    const CARD: Card = Card {
        kind: "cosmic-ray-floor",
        adds: "a constant dose rate in all years, also quiet ones, seen by the dose monitor",
        physics: "D(t) increases by rate_mev_g_yr t.",
        source: "galactic cosmic rays: ISO 15390 (2004); their slow modulation by the solar cycle is neglected",
        holds: "Added to environment.cosmic_ray_floor_mev_g_yr, if the mission has one.",
        residuals: "The model's dose and trap densities are too small by an amount that increases with t_yr, in quiet and \
                    active years.",
        keys: &[key("rate_mev_g_yr", "dose rate of cosmic rays", "MeV/g/yr", Number(0.0, 1e12), Required)],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("rate_mev_g_yr", 0.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("rate_mev_g_yr", 3e5)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        let last_yr = reach.last_yr().max(1.0);
        let rate_mev_g_yr = (0.1 * reach.dose_mev_g / last_yr).max(1e4);
        vec![vec![numbers(&[("rate_mev_g_yr", rate_mev_g_yr)])]]
    }
}

impl Effect for CosmicRayFloor {
    fn dose(&self, dose: &mut DoseHistory) {
        dose.floor_mev_g_yr += self.rate_mev_g_yr;
    }
}
