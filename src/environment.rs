//! Orbit, Sun and shield → dose at the detector, day by day.
//!
//! ```text
//! [`esp`] fluence spectrum at a confidence → [`shielding`] → NIEL in silicon ([`proton`]) → active dose rate
//!                                                       [`solar_cycle`] active years → D(t)
//! ```
//!
//! "Dose" is displacement damage dose in MeV per gram of silicon, everywhere. D(t) of a mission is made of these parts in one
//! place, [`crate::model`].

pub mod esp;
pub mod proton;
pub mod shielding;
pub mod solar_cycle;

use crate::mission::Niel;
use proton::Curve;

impl Niel {
    /// The damage curve.
    pub fn curve(self) -> &'static Curve {
        match self {
            Niel::Sr => &proton::NIEL_SR,
            Niel::Rd50 => &proton::NIEL_RD50,
        }
    }
}
