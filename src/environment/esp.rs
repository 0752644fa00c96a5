//! Confidence level and years → fluence of solar protons at 1 AU: the ESP total fluence model.
//!
//! ```text
//! σ² = ln(1 + RV/T)     μ = ln(T · mean) − σ²/2     F(>E) = exp(μ + z_q σ)
//! ```
//!
//! for T solar-active years and a probability q that the fluence is not exceeded. Above 100 MeV: a factor times F(>100 MeV).
//! Log-log interpolation between energies; beyond the ends the power law of the end pair.
//!
//! Source: Xapsos et al. 1999, 2000 (IEEE Trans. Nucl. Sci. 46, 1481; 47, 486), with the parameters of
//! ECSS-E-ST-10-04C (2008), tables B-7 and B-8. Holds at 1 AU outside the magnetosphere (L1, L2, interplanetary).

use statrs::distribution::{ContinuousCDF, Normal};

use super::spectrum::{Law, Spectrum};

/// Threshold energy (MeV), mean fluence of an active year (cm⁻²), relative variance of a year. ECSS table B-7.
const YEARLY: [(f64, f64, f64); 19] = [
    (1.0, 8.877e10, 0.940),
    (3.0, 3.297e10, 3.038),
    (5.0, 1.973e10, 5.250),
    (7.0, 1.371e10, 7.575),
    (10.0, 9.089e9, 11.239),
    (15.0, 5.476e9, 17.675),
    (20.0, 3.707e9, 24.351),
    (25.0, 2.687e9, 31.126),
    (30.0, 2.034e9, 37.889),
    (35.0, 1.589e9, 44.572),
    (40.0, 1.273e9, 51.130),
    (45.0, 1.038e9, 57.504),
    (50.0, 8.602e8, 63.674),
    (55.0, 7.215e8, 69.642),
    (60.0, 6.117e8, 75.368),
    (70.0, 4.518e8, 86.122),
    (80.0, 3.431e8, 95.852),
    (90.0, 2.665e8, 104.635),
    (100.0, 2.109e8, 112.465),
];

/// Threshold energy (MeV), fluence over that above 100 MeV. ECSS table B-8.
const ABOVE_100_MEV: [(f64, f64); 8] = [
    (125.0, 0.603),
    (150.0, 0.39),
    (175.0, 0.267),
    (200.0, 0.191),
    (225.0, 0.141),
    (250.0, 0.107),
    (275.0, 0.0823),
    (300.0, 0.0647),
];

/// Fluence over `active_years` of solar activity that is not exceeded with probability `confidence`, over all
/// directions (4π), at 1 AU.
///
/// The model's shortest time is one year: less counts as one. `confidence` lies between 0 and 1, both excluded.
pub fn fluence(confidence: f64, active_years: f64) -> Spectrum {
    fluence_at(Normal::standard().inverse_cdf(confidence), active_years)
}

/// The same, with the confidence given as the quantile z of the standard normal distribution.
pub fn fluence_at(z: f64, active_years: f64) -> Spectrum {
    let years = active_years.max(1.0);
    spectrum(|yearly| {
        // σ² = ln(1 + RV/T)   μ = ln(T mean) − σ²/2   F = exp(μ + z σ)
        let variance = (yearly.relative_variance / years).ln_1p();
        ((years * yearly.mean_cm2).ln() - variance / 2.0 + z * variance.sqrt()).exp()
    })
}

/// Mean fluence of an active year, cm⁻².
pub fn mean() -> Spectrum {
    spectrum(|yearly| yearly.mean_cm2)
}

/// Fluence of an active year above an energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yearly {
    /// Mean, cm⁻².
    pub mean_cm2: f64,
    /// Variance over the square of the mean, RV.
    pub relative_variance: f64,
}

impl Yearly {
    /// Above an energy (MeV) in the table; None at other energies.
    pub fn above(energy_mev: f64) -> Option<Yearly> {
        let row = YEARLY.iter().find(|row| row.0 == energy_mev)?;
        Some(Yearly { mean_cm2: row.1, relative_variance: row.2 })
    }
}

/// The spectrum of a fluence (cm⁻²) given at the energies of the table. It never rises with energy.
pub(super) fn spectrum(fluence: impl Fn(Yearly) -> f64) -> Spectrum {
    let mut least = f64::INFINITY;
    let mut nodes: Vec<(f64, f64)> = Vec::with_capacity(YEARLY.len() + ABOVE_100_MEV.len());
    for (energy_mev, mean_cm2, relative_variance) in YEARLY {
        least = least.min(fluence(Yearly { mean_cm2, relative_variance }));
        nodes.push((energy_mev, least));
    }
    nodes.extend(ABOVE_100_MEV.iter().map(|&(energy_mev, factor)| (energy_mev, least * factor)));
    Spectrum::of(nodes, Law::Power)
}
