//! Intensity of the dipole from a single trap in a flat field after trap pumping: electrons moved from a pixel into its neighbour.
//!
//! ```text
//! I = N P (exp(−t/τ) − exp(−2t/τ))        largest at t = τ ln 2, where it is N P/4
//! ```
//!
//! after N cycles with the phase time t, for a trap with release time τ and capture probability P, here 1. A row names the species
//! of the trap, if the mission has several.
//!
//! Source: Mostek et al. 2010, Proc. SPIE 7742; Murray et al. 2012, Proc. SPIE 8453; Hall et al. 2014, IEEE Trans. Nucl. Sci. 61, 1826.

use super::{Card, Probe};

pub(super) const CARD: Card = Card {
    name: "pumping_dipole",
    unit: "e-",
    label: "dipole of a trap [e⁻]",
    requires: &["phase_time_ms", "pumping_cycles"],
    conditions: &["phase_time_ms", "pumping_cycles", "t_yr", "dose_mev_g", "temperature_k"],
    probe: Probe::Pumping(|release_ms, at| {
        let cycles = at.pumping_cycles.expect("a dipole has cycles");
        dipole_e(cycles, 1.0, at.phase_time_ms.expect("a dipole has a phase time"), release_ms)
    }),
    least_sigma: 5.0,
    most: None,
    more: "model's dipole too faint",
    less: "model's dipole too bright",
};

/// Intensity of a dipole (e-) after a number of cycles with a phase time, for a trap with a release time (both ms) and a capture
/// probability.
pub fn dipole_e(cycles: f64, probability: f64, phase_ms: f64, release_ms: f64) -> f64 {
    let left = (-phase_ms / release_ms).exp();
    // exp(−t/τ) − exp(−2t/τ)
    cycles * probability * left * (1.0 - left)
}
