//! Nuclear reactions of protons in a shield.
//!
//! ```text
//! primaries left   exp(−t/λ)              λ = 107 g/cm², the interaction length of aluminium
//! neutrons made    ν (1 − exp(−t/λ)) of the protons that get through; ν = 2 for protons of the belts and the Sun, 5.5 for cosmic rays
//! their damage     NIEL of neutrons of some MeV, 2.5e-3 MeV cm²/g
//! ```
//!
//! An estimate, accurate to a factor of 2: multiplicities are for aluminium and one reaction each. The mass of the spacecraft
//! behind the detector adds to them, and heavy metals produce several times as many. λ: Particle Data Group, Atomic and Nuclear
//! Properties (2020).

use super::proton::RANGE_ALUMINIUM;
use super::shielding::{Direction, Shield};
use super::spectrum::Spectrum;

/// Nuclear interaction length in aluminium, g/cm².
pub const INTERACTION_G_CM2: f64 = 107.0;

/// Damage of the neutrons, MeV cm²/g.
const NIEL_NEUTRONS: f64 = 2.5e-3;

/// Energy (MeV) behind the shield above which protons are counted.
const COUNTED_MEV: f64 = 0.1;

/// Share of the dose above which a warning is given.
pub const MATTERS: f64 = 0.05;

/// Effects of reactions, as doses in silicon (MeV/g).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Secondaries {
    /// Dose lost with the protons that react.
    pub lost_mev_g: f64,
    /// Dose from neutrons.
    pub neutrons_mev_g: f64,
}

impl Secondaries {
    /// Behind a shield, for a spectrum with a dose (MeV/g) behind each direction, and neutrons per reaction.
    pub fn of(shield: &Shield, spectrum: &Spectrum, dose_mev_g: f64, neutrons: f64) -> Secondaries {
        let range = RANGE_ALUMINIUM.at(COUNTED_MEV);
        let behind = |direction: &Direction| spectrum.above(RANGE_ALUMINIUM.inverse(range + direction.aluminium_g_cm2));
        let all = shield.mean(behind);
        let react = |direction: &Direction| -(-direction.areal_g_cm2 / INTERACTION_G_CM2).exp_m1();
        let reacting = shield.mean(|direction| behind(direction) * react(direction));
        Secondaries {
            lost_mev_g: if all > 0.0 { dose_mev_g * reacting / all } else { 0.0 },
            neutrons_mev_g: neutrons * NIEL_NEUTRONS * reacting,
        }
    }
}
