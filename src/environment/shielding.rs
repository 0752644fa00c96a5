//! Spectrum and aluminium → spectrum behind the aluminium and its displacement damage dose.
//!
//! Straight ahead, continuous slowing down, no secondaries: a proton that leaves with E_out entered with
//! E_in = R⁻¹(R(E_out) + t). A sphere has the same thickness t in every direction. A slab is seen under the angle
//! arccos μ, has thickness t/μ, and covers half of the sky; nothing comes from the other half.
//!
//! ```text
//! D = ∫ NIEL(E_out) f(E_in) dE_in        slab: D = ½ ∫₀¹ D_sphere(t/μ) dμ
//! ```

use std::fmt;
use std::num::NonZeroUsize;

use gauss_quad::GaussLegendre;
use serde::{Deserialize, Serialize};

use super::esp::Spectrum;
use super::proton::{ALUMINIUM_G_CM3, Curve, RANGE_ALUMINIUM};

/// Shape of the aluminium around the detector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Geometry {
    /// The detector at the centre of a spherical shell.
    Sphere,
    /// Isotropic protons through one slab, the other side opaque.
    Slab,
}

impl fmt::Display for Geometry {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Geometry::Sphere => "sphere",
            Geometry::Slab => "slab",
        })
    }
}

/// Emerging energies (MeV) over which a dose is integrated. Slower protons, of less than 1 keV, displace next to nothing
/// (SR-NIEL falls to 0 at 0.15 keV); above, the fits end.
const EMERGING_MEV: (f64, f64) = (1e-3, 1000.0);

/// Fluence above an energy (MeV) behind aluminium (mm), cm⁻².
pub fn fluence_behind(spectrum: &Spectrum, geometry: Geometry, thickness_mm: f64, energy_mev: f64) -> f64 {
    let sphere = |thickness_g_cm2: f64| {
        spectrum.above(RANGE_ALUMINIUM.inverse(RANGE_ALUMINIUM.at(energy_mev) + thickness_g_cm2))
    };
    over_directions(geometry, thickness_mm, sphere)
}

/// Displacement damage dose in silicon (MeV/g) behind aluminium (mm).
pub fn dose_behind(spectrum: &Spectrum, geometry: Geometry, thickness_mm: f64, niel: &Curve) -> f64 {
    let legendre = GaussLegendre::new(NonZeroUsize::new(10).expect("ten points"));
    let sphere = |thickness_g_cm2: f64| {
        let entering = |emerging_mev: f64| RANGE_ALUMINIUM.inverse(RANGE_ALUMINIUM.at(emerging_mev) + thickness_g_cm2);
        let emerging = |entering_mev: f64| {
            let left = RANGE_ALUMINIUM.at(entering_mev) - thickness_g_cm2;
            if left > 0.0 { RANGE_ALUMINIUM.inverse(left) } else { 0.0 }
        };
        // Where the spectrum's power law changes, and at least every factor of two, as NIEL bends.
        let (low, high) = EMERGING_MEV;
        let mut cuts: Vec<f64> = spectrum.energies_mev().map(emerging).filter(|e| *e > low && *e < high).collect();
        cuts.extend((0..=20).map(|k| low * 2_f64.powi(k)).filter(|e| *e < high));
        cuts.push(high);
        cuts.sort_by(f64::total_cmp);
        cuts.windows(2)
            .map(|cut| {
                legendre.integrate(cut[0].ln(), cut[1].ln(), |log_energy| {
                    let energy_mev = log_energy.exp();
                    let entering_mev = entering(energy_mev);
                    // dE_in/dE_out = (R/E · slope) at E_out over the same at E_in
                    let stretch = RANGE_ALUMINIUM.at(energy_mev) * RANGE_ALUMINIUM.log_slope(energy_mev) * entering_mev
                        / (RANGE_ALUMINIUM.at(entering_mev) * RANGE_ALUMINIUM.log_slope(entering_mev) * energy_mev);
                    niel.at(energy_mev) * spectrum.differential(entering_mev) * stretch * energy_mev
                })
            })
            .sum()
    };
    over_directions(geometry, thickness_mm, sphere)
}

/// Mean over directions of what arrives behind a thickness (g/cm²).
fn over_directions(geometry: Geometry, thickness_mm: f64, arriving: impl Fn(f64) -> f64) -> f64 {
    let thickness_g_cm2 = thickness_mm / 10.0 * ALUMINIUM_G_CM3;
    match geometry {
        Geometry::Sphere => arriving(thickness_g_cm2),
        Geometry::Slab => {
            let legendre = GaussLegendre::new(NonZeroUsize::new(24).expect("24 points"));
            0.5 * legendre.integrate(0.0, 1.0, |mu| arriving(thickness_g_cm2 / mu))
        }
    }
}
