//! What protons do in a shield besides slowing down: nuclear reactions.
//!
//! ```text
//! primaries left   exp(−t/λ)              λ = 107 g/cm², the interaction length of aluminium
//! neutrons made    ν t/λ of the protons   ν = 2 for protons of the belts and the Sun, 5.5 for cosmic rays
//! their damage     NIEL of neutrons of some MeV, 2.5e-3 MeV cm²/g
//! ```
//!
//! An estimate, good to a factor of 2: multiplicities are those of aluminium and of one reaction each, the mass of the spacecraft
//! behind the detector adds to them, and heavy metals make several times as many. λ: Particle Data Group, Atomic and Nuclear
//! Properties (2020).

use super::shielding::Shield;
use super::spectrum::Spectrum;

/// Nuclear interaction length in aluminium, g/cm².
pub const INTERACTION_G_CM2: f64 = 107.0;

/// Damage of the neutrons, MeV cm²/g.
const NIEL_NEUTRONS: f64 = 2.5e-3;

/// Energy (MeV) above which a proton makes neutrons.
const THRESHOLD_MEV: f64 = 30.0;

/// Share of the dose that matters: a warning is given beyond it.
pub const MATTERS: f64 = 0.05;

/// What reactions take and add, as doses in silicon (MeV/g).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Secondaries {
    /// Lost with the protons that react.
    pub lost_mev_g: f64,
    /// Made by neutrons.
    pub neutrons_mev_g: f64,
}

impl Secondaries {
    /// Behind a shield, of a spectrum with a dose (MeV/g) behind each direction, and neutrons per reaction.
    pub fn of(shield: &Shield, spectrum: &Spectrum, dose_mev_g: f64, neutrons: f64) -> Secondaries {
        let reacting = spectrum.above(THRESHOLD_MEV);
        let depth = shield.mean_areal_g_cm2() / INTERACTION_G_CM2;
        let open = shield.mean(|_| 1.0);
        Secondaries {
            lost_mev_g: dose_mev_g * -(-depth).exp_m1(),
            neutrons_mev_g: open * neutrons * depth.min(1.0) * reacting * NIEL_NEUTRONS,
        }
    }

    /// Net effect over a dose.
    pub fn share(&self, dose_mev_g: f64) -> f64 {
        if dose_mev_g > 0.0 { (self.neutrons_mev_g - self.lost_mev_g) / dose_mev_g } else { 0.0 }
    }
}
