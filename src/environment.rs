//! Orbit, Sun and shield → dose at the detector, day by day.
//!
//! ```text
//! [`esp`] fluence spectrum at a confidence → [`shielding`] → NIEL in silicon ([`proton`]) → active dose rate
//!                                                       [`solar_cycle`] active years → D(t)
//! ```
//!
//! "Dose" is displacement damage dose in MeV per gram of silicon, everywhere. D(t) of a mission is made of these parts in one
//! place, the model.

pub mod esp;
pub mod proton;
pub mod shielding;
pub mod solar_cycle;

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
}
