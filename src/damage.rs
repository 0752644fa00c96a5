//! Dose and temperature → traps.
//!
//! ```text
//! ρ(t) = ρ_ref D(t)/D_ref          τ(T) = τ_ref (T_ref/T)² exp(E/k (1/T − 1/T_ref))
//! ```
//!
//! Traps are linear in displacement damage dose (Rhodes et al. 2010, section 4.1); emission times follow Shockley-Read-Hall
//! statistics with the T² of the thermal velocity and the density of states.

use crate::mission::{Clocking, Detector};
use crate::readout::Trap;

/// Boltzmann's constant, eV/K (CODATA 2018).
pub const BOLTZMANN_EV_K: f64 = 8.617_333_262e-5;

/// One species at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeciesState {
    /// Name.
    pub name: String,
    /// Traps per pixel.
    pub density_per_px: f64,
    /// Release time at the operating temperature, ms.
    pub release_ms: f64,
}

impl SpeciesState {
    /// As the readout meets it.
    pub fn trap(&self, clocking: &Clocking) -> Trap {
        Trap::new(self.density_per_px, self.release_ms / clocking.line_time_ms)
    }
}

/// Traps of a detector after a dose (MeV/g), at its operating temperature.
pub fn after(detector: &Detector, dose_mev_g: f64) -> Vec<SpeciesState> {
    detector
        .traps
        .iter()
        .map(|species| SpeciesState {
            name: species.name.clone(),
            density_per_px: species.density_per_px * dose_mev_g / detector.reference_dose_mev_g,
            release_ms: species.release_ms
                * release_factor(species.energy_ev, detector.temperature_k, detector.reference_temperature_k),
        })
        .collect()
}

/// Release time at a temperature over that at the reference temperature (K), for an energy level (eV).
pub fn release_factor(energy_ev: f64, temperature_k: f64, reference_k: f64) -> f64 {
    let ratio = reference_k / temperature_k;
    // τ/τ_ref = (T_ref/T)² exp(E/k (1/T − 1/T_ref))
    ratio * ratio * (energy_ev / BOLTZMANN_EV_K * (1.0 / temperature_k - 1.0 / reference_k)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn release_times_follow_the_temperatures_of_two_published_tables() {
        // HST ACS: release times (transfers) at −77 and −81 °C and energy levels as coded by Massey et al. 2014 and 2010:
        // A 0.48, 0.74 (0.31 eV); B 4.86, 7.7 (0.34 eV); C 20.6, 37.0 (0.44 eV). They round to 2 or 3 digits.
        for (warm, cold, energy_ev) in [(0.48, 0.74, 0.31), (4.86, 7.7, 0.34), (20.6, 37.0, 0.44)] {
            let factor = release_factor(energy_ev, 273.15 - 81.0, 273.15 - 77.0);
            assert!((factor / (cold / warm) - 1.0).abs() < 0.02, "{energy_ev} eV: {factor}, {}", cold / warm);
        }
        assert_eq!(release_factor(0.3, 150.0, 150.0), 1.0);
    }
}
