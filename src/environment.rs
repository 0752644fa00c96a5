//! Orbit, Sun and shield → dose rate at the detector, for each source of protons.
//!
//! ```text
//! [`source`] spectra over time ([`esp`], AP-8, [`cosmic_rays`]; [`solar_cycle`]) → [`shielding`] → NIEL in silicon ([`proton`])
//! ```
//!
//! "Dose" is displacement damage dose in MeV per gram of silicon, everywhere. A single place, the model, combines these parts into
//! D(t) of a mission.

pub mod cosmic_rays;
pub mod esp;
pub mod material;
pub mod observed_sun;
pub mod proton;
pub mod secondaries;
pub mod shielding;
pub mod solar_cycle;
pub mod solar_events;
pub mod source;
pub mod spectrum;

/// Seconds per year of 365.25 days.
pub const SECONDS_PER_YEAR: f64 = 365.25 * 86_400.0;

use std::fmt;

use serde::{Deserialize, Serialize};

use proton::Curve;

/// Damage curve of protons in silicon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Niel {
    /// SR-NIEL, displacement threshold 21 eV.
    Sr,
    /// RD50 compilation.
    Rd50,
}

impl fmt::Display for Niel {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Niel::Sr => "SR-NIEL",
            Niel::Rd50 => "RD50",
        })
    }
}

impl Niel {
    /// The damage curve.
    pub fn curve(self) -> &'static Curve {
        match self {
            Niel::Sr => &proton::NIEL_SR,
            Niel::Rd50 => &proton::NIEL_RD50,
        }
    }

    /// Reference NIEL of protons at an energy (MeV), MeV cm²/g: the tables' own values at 10 and 12.5 MeV, common energies for
    /// irradiation tests, and between 7 and 20 MeV the curve, corrected by their deviation from it.
    pub fn at(self, energy_mev: f64) -> f64 {
        let known = [(10.0, self.at_10_mev()), (12.5, self.at_12_5_mev())];
        let curve = self.curve();
        let [low, high] = known.map(|(energy_mev, value): (f64, f64)| (energy_mev.ln(), value / curve.at(energy_mev)));
        let corrections = [(7_f64.ln(), 1.0), low, high, (20_f64.ln(), 1.0)];
        let log = energy_mev.ln();
        let between = corrections.windows(2).find(|pair| (pair[0].0..=pair[1].0).contains(&log));
        let correction = between
            .map_or(1.0, |pair| pair[0].1 + (pair[1].1 - pair[0].1) * (log - pair[0].0) / (pair[1].0 - pair[0].0));
        correction * curve.at(energy_mev)
    }

    /// NIEL of 12.5 MeV protons, MeV cm²/g, from the same tables.
    pub fn at_12_5_mev(self) -> f64 {
        match self {
            Niel::Sr => 8.44e-3,
            Niel::Rd50 => 7.31e-3,
        }
    }

    /// NIEL of 10 MeV protons, MeV cm²/g, as printed in the tables: SR-NIEL-7 v11.0 (Boschini et al.), and the RD50 compilation
    /// (Vasilescu & Lindström), 3.871 times 95 MeV mb. The fitted curves have an error of 5 % at single energies.
    pub fn at_10_mev(self) -> f64 {
        match self {
            Niel::Sr => 9.4037e-3,
            Niel::Rd50 => 3.871 * proton::NIEL_NEUTRON_1MEV,
        }
    }
}
