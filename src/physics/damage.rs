//! Dose and temperature → traps.
//!
//! ```text
//! ρ(t) = ρ_ref D(t)/D_ref          τ(T) = τ_ref (T_ref/T)² exp(E/k (1/T − 1/T_ref))
//! ```
//!
//! Traps are linear in displacement damage dose (Rhodes et al. 2010, section 4.1); emission times follow Shockley-Read-Hall
//! statistics with the T² of the thermal velocity and the density of states. Effects may change the content of [`Damage`]: traps
//! per dose, traps at launch, and traps that anneal.

use std::fmt;
use std::sync::Arc;

use serde::Serialize;

use crate::error::InputError;
use crate::mission::{Detector, Species};
use crate::physics::dose_history::DoseHistory;
use crate::readout::{CaptureDensity, Phase, Trap};

/// Boltzmann's constant, eV/K (CODATA 2018).
pub const BOLTZMANN_EV_K: f64 = 8.617_333_262e-5;

/// One species at one time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpeciesState {
    /// Name.
    pub name: String,
    /// Traps per pixel.
    pub density_per_px: f64,
    /// Release time at the operating temperature, ms; the median if it is spread.
    pub release_ms: f64,
    /// Standard deviation of the logarithm of the release time.
    #[serde(skip)]
    pub release_sigma: f64,
    /// Capture time inside the charge cloud, ms; 0 if capture is instantaneous.
    #[serde(skip)]
    pub capture_ms: f64,
    /// Exponent of the cloud's density in the capture rate; 0 if the rate is the same in every cloud.
    #[serde(skip)]
    pub capture_density_power: f64,
    /// Charge of the packets to which the capture time applies, if it depends on the density, e-.
    #[serde(skip)]
    pub capture_at_e: f64,
    /// Exponent of its cloud's height, if it differs from the detector's.
    #[serde(skip)]
    pub well_fill_power: Option<f64>,
    /// Charge above which a packet reaches the trap at the surface, e-; none in the bulk.
    #[serde(skip)]
    pub surface_level_e: Option<f64>,
}

impl SpeciesState {
    /// As seen by a readout with transfers of this duration (ms), in one step.
    pub fn trap(&self, transfer_ms: f64) -> Trap {
        Trap {
            density_per_px: self.density_per_px,
            release_transfers: self.release_ms / transfer_ms,
            release_sigma: self.release_sigma,
            capture_transfers: self.capture_ms / transfer_ms,
            capture_density: (self.capture_density_power > 0.0)
                .then_some(CaptureDensity { power: self.capture_density_power, at_e: self.capture_at_e }),
            well_fill_power: self.well_fill_power,
            surface_level_e: self.surface_level_e,
            phase: Phase::SINGLE,
        }
    }
}

/// How dose is converted to traps.
#[derive(Clone, Debug)]
pub struct Damage {
    /// Traps per unit of dose, relative to the mission's.
    pub traps_per_dose: f64,
    /// Traps per pixel at launch, by the name of their species.
    pub at_launch_per_px: Vec<(String, f64)>,
    /// Processes by which traps disappear or increase.
    pub losses: Vec<Loss>,
    /// Fraction of the traps that are full of charge of cosmic rays when a packet comes, at their mean rate.
    pub filled: f64,
}

/// A process by which traps disappear or increase.
#[derive(Clone)]
pub struct Loss {
    /// Whether traps present at launch are unaffected: those of fabrication, not of radiation.
    pub spares_launch: bool,
    /// When it happens, in years since launch, if it is instantaneous.
    pub on_yr: Option<f64>,
    /// Fraction at a time (second argument) of the traps created at an earlier one (first); years since launch.
    pub survives: Arc<dyn Fn(f64, f64) -> f64 + Send + Sync>,
}

impl fmt::Debug for Loss {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "Loss {{ on_yr: {:?} }}", self.on_yr)
    }
}

impl Default for Damage {
    fn default() -> Damage {
        Damage { traps_per_dose: 1.0, at_launch_per_px: Vec::new(), losses: Vec::new(), filled: 0.0 }
    }
}

/// Dose and its traps at one time, common to all detectors and temperatures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Irradiation {
    /// Dose since launch, or laboratory dose, MeV/g.
    pub dose_mev_g: f64,
    /// Dose that, given at once at this time, would create the traps that remain of those created since launch, MeV/g.
    effective_dose_mev_g: f64,
    /// Fraction of the traps at launch that remain.
    kept: f64,
    /// Fraction of the traps that charge of cosmic rays has not filled.
    empty: f64,
}

impl Damage {
    /// The effect of the dose up to a time (years since launch): of a mission's own dose, or of a laboratory dose (MeV/g).
    ///
    /// # Errors
    /// If a law of the dose has no value.
    pub(crate) fn irradiation(
        &self,
        history: &DoseHistory,
        t_yr: f64,
        given_mev_g: Option<f64>,
    ) -> Result<Irradiation, InputError> {
        let dose_mev_g = given_mev_g.map_or_else(|| history.dose_mev_g(t_yr), Ok)?;
        let left_mev_g = match given_mev_g {
            Some(given_mev_g) => given_mev_g * self.survives(0.0, t_yr),
            None if self.losses.is_empty() => dose_mev_g,
            None => {
                let breaks: Vec<f64> = self.losses_yr().collect();
                history.weighted_dose_mev_g(t_yr, &breaks, |made_yr| self.survives(made_yr, t_yr))?
            }
        };
        let losses = self.losses.iter().filter(|loss| !loss.spares_launch);
        let kept = losses.map(|loss| (loss.survives)(0.0, t_yr)).product();
        let empty = match given_mev_g {
            // Hits are independent: each leaves the same fraction of what others left empty. There are none in a laboratory.
            None if self.filled > 0.0 => (1.0 - self.filled).powf(history.cosmic_ray_rate(t_yr)),
            _ => 1.0,
        };
        Ok(Irradiation { dose_mev_g, effective_dose_mev_g: self.traps_per_dose * left_mev_g, kept, empty })
    }

    /// Traps of a detector at a temperature (K), with densities per dose quoted at a reference dose (MeV/g).
    pub(crate) fn traps(
        &self,
        detector: &Detector,
        reference_dose_mev_g: f64,
        irradiation: &Irradiation,
        temperature_k: f64,
    ) -> Vec<SpeciesState> {
        let mut traps = after(detector, reference_dose_mev_g, irradiation.effective_dose_mev_g, temperature_k);
        for species in &mut traps {
            for (_, at_launch) in self.at_launch_per_px.iter().filter(|(name, _)| *name == species.name) {
                species.density_per_px += at_launch * irradiation.kept;
            }
            species.density_per_px *= irradiation.empty;
        }
        traps
    }

    /// Times (years since launch) at which traps disappear instantaneously.
    pub(crate) fn losses_yr(&self) -> impl Iterator<Item = f64> {
        self.losses.iter().filter_map(|loss| loss.on_yr)
    }

    fn survives(&self, made_yr: f64, now_yr: f64) -> f64 {
        self.losses.iter().map(|loss| (loss.survives)(made_yr, now_yr)).product()
    }
}

/// Traps of a detector after a dose (MeV/g), with densities quoted at a reference dose (MeV/g), at a temperature (K).
fn after(detector: &Detector, reference_dose_mev_g: f64, dose_mev_g: f64, temperature_k: f64) -> Vec<SpeciesState> {
    let state = |species: &Species| SpeciesState {
        name: species.name.clone(),
        density_per_px: species.density_per_px * dose_mev_g / reference_dose_mev_g,
        release_ms: species.release_ms
            * release_factor(species.energy_ev, temperature_k, detector.reference_temperature_k),
        release_sigma: 0.0,
        capture_ms: 0.0,
        capture_density_power: 0.0,
        capture_at_e: detector.full_well_e,
        well_fill_power: species.well_fill_power,
        surface_level_e: species.surface_level_e,
    };
    detector.traps.iter().map(state).collect()
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
