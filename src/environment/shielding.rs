//! Spectrum and shield → spectrum behind the shield and its displacement damage dose.
//!
//! Straight ahead, continuous slowing down: a proton that leaves with E_out entered with E_in = R⁻¹(R(E_out) + t). A shield is a
//! list of directions, each with its share of the sky and a thickness t. A sphere has one. A slab at the angle arccos μ has
//! thickness t/μ and covers half of the sky; no protons come from the other half.
//!
//! ```text
//! D = Σ share ∫ NIEL(E_out) f(E_in) dE_in        slab: D = ½ ∫₀¹ D_sphere(t/μ) dμ
//! ```
//!
//! Effects neglected here are in [`super::secondaries`].

use std::fmt;
use std::num::NonZeroUsize;

use gauss_quad::GaussLegendre;
use serde::{Deserialize, Serialize};

use super::proton::{ALUMINIUM_G_CM3, Curve, RANGE_ALUMINIUM};
use super::spectrum::Spectrum;

/// Shape of the shield around the detector.
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

/// A direction, or several equal ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Share of the sky (4π).
    pub share: f64,
    /// Areal density, g/cm².
    pub areal_g_cm2: f64,
    /// Equivalent areal density of aluminium, g/cm².
    pub aluminium_g_cm2: f64,
}

/// Matter around the detector, by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Shield {
    /// Directions from which protons come.
    pub directions: Vec<Direction>,
    /// Of a slab, the areal density along its normal and its equivalent in aluminium, g/cm²: a mean over directions would be infinite.
    pub along_normal_g_cm2: Option<[f64; 2]>,
}

impl Shield {
    /// A shape with a thickness along its normal: areal density, and its equivalent in aluminium, g/cm².
    pub fn of(geometry: Geometry, areal_g_cm2: f64, aluminium_g_cm2: f64) -> Shield {
        let direction = |share: f64, cosine: f64| Direction {
            share,
            areal_g_cm2: areal_g_cm2 / cosine,
            aluminium_g_cm2: aluminium_g_cm2 / cosine,
        };
        let directions = match geometry {
            Geometry::Sphere => vec![direction(1.0, 1.0)],
            Geometry::Slab => {
                let legendre = GaussLegendre::new(NonZeroUsize::new(24).expect("24 points"));
                // Nodes and weights on −1 to 1.
                legendre.iter().map(|(node, weight)| direction(0.25 * weight, 0.5 * (1.0 + node))).collect()
            }
        };
        let is_slab = geometry == Geometry::Slab;
        Shield { directions, along_normal_g_cm2: is_slab.then_some([areal_g_cm2, aluminium_g_cm2]) }
    }

    /// Aluminium of this shape and thickness (mm).
    pub fn aluminium(geometry: Geometry, thickness_mm: f64) -> Shield {
        let areal_g_cm2 = thickness_mm / 10.0 * ALUMINIUM_G_CM3;
        Shield::of(geometry, areal_g_cm2, areal_g_cm2)
    }

    /// The same with all thicknesses multiplied.
    pub fn scaled(&self, factor: f64) -> Shield {
        let scaled = |direction: &Direction| Direction {
            areal_g_cm2: factor * direction.areal_g_cm2,
            aluminium_g_cm2: factor * direction.aluminium_g_cm2,
            ..*direction
        };
        Shield {
            directions: self.directions.iter().map(scaled).collect(),
            along_normal_g_cm2: self.along_normal_g_cm2.map(|both| both.map(|one| factor * one)),
        }
    }

    /// Mean over the sky of a quantity behind each direction; zero where there is no direction.
    pub fn mean(&self, arriving: impl Fn(&Direction) -> f64) -> f64 {
        self.directions.iter().map(|direction| direction.share * arriving(direction)).sum()
    }

    /// Fluence above an energy (MeV) behind the shield, cm⁻².
    pub fn fluence(&self, spectrum: &Spectrum, energy_mev: f64) -> f64 {
        let range = RANGE_ALUMINIUM.at(energy_mev);
        self.mean(|direction| spectrum.above(RANGE_ALUMINIUM.inverse(range + direction.aluminium_g_cm2)))
    }

    /// Displacement damage dose in silicon (MeV/g) behind the shield. For the many directions of ray tracing it is interpolated
    /// between thicknesses.
    pub fn dose(&self, spectrum: &Spectrum, niel: &Curve) -> f64 {
        if self.directions.len() <= DIRECTIONS {
            return self.mean(|direction| dose_behind(spectrum, direction.aluminium_g_cm2, niel));
        }
        let thicknesses = || self.directions.iter().map(|direction| direction.aluminium_g_cm2);
        let (least, most) = (thicknesses().fold(f64::INFINITY, f64::min), thicknesses().fold(0.0, f64::max));
        let curve = DepthCurve::of(spectrum, niel, least, most);
        self.mean(|direction| curve.at(direction.aluminium_g_cm2))
    }

    /// Areal density and its equivalent in aluminium, g/cm²: of a slab along its normal, of other shields the mean over the directions
    /// from which protons come.
    pub fn typical_g_cm2(&self) -> [f64; 2] {
        let seen: f64 = self.mean(|_| 1.0);
        let mean = |of: fn(&Direction) -> f64| if seen > 0.0 { self.mean(of) / seen } else { 0.0 };
        let means = || [mean(|direction| direction.areal_g_cm2), mean(|direction| direction.aluminium_g_cm2)];
        self.along_normal_g_cm2.unwrap_or_else(means)
    }
}

/// Maximum number of directions for which each is computed separately.
const DIRECTIONS: usize = 48;

/// Dose against thickness of aluminium, tabulated.
pub struct DepthCurve {
    /// ln g/cm², evenly spaced, and MeV/g.
    points: Vec<(f64, f64)>,
}

impl DepthCurve {
    /// For a range of thicknesses, g/cm².
    pub fn of(spectrum: &Spectrum, niel: &Curve, least: f64, most: f64) -> DepthCurve {
        let (from, to) = (least.max(THINNEST).ln(), most.max(1.5 * least).max(1.5 * THINNEST).ln());
        let point = |index: usize| {
            let log = from + (to - from) * index as f64 / DIRECTIONS as f64;
            (log, dose_behind(spectrum, log.exp(), niel))
        };
        DepthCurve { points: (0..=DIRECTIONS).map(point).collect() }
    }

    /// Dose (MeV/g) behind a thickness (g/cm²): a cubic in the logarithms through the four nearest points, limited to the range of
    /// the two adjacent ones. (At the end of a spectrum a cubic overshoots.) Beside a point without dose there is no logarithm:
    /// linear.
    pub fn at(&self, thickness_g_cm2: f64) -> f64 {
        let log = thickness_g_cm2.max(THINNEST).ln();
        let first = self.points.partition_point(|point| point.0 <= log).saturating_sub(2).min(self.points.len() - 4);
        let near = &self.points[first..first + 4];
        let after = self.points.partition_point(|point| point.0 <= log).clamp(1, self.points.len() - 1);
        let (thinner, thicker) = (self.points[after - 1], self.points[after]);
        if near.iter().any(|point| point.1 <= 0.0) {
            let share = ((log - thinner.0) / (thicker.0 - thinner.0)).clamp(0.0, 1.0);
            return thinner.1 + share * (thicker.1 - thinner.1);
        }
        let weight = |index: usize| {
            let others = near.iter().enumerate().filter(|(other, _)| *other != index);
            others.map(|(_, point)| (log - point.0) / (near[index].0 - point.0)).product::<f64>()
        };
        let cubic: f64 = (0..4).map(|index| weight(index) * near[index].1.ln()).sum();
        let (from, to) = (thinner.1.ln(), thicker.1.ln());
        cubic.clamp(to.min(from), to.max(from)).exp()
    }
}

/// Thickness (g/cm²) below which all are equivalent: protons stopped by 0.4 µm cause no damage that is counted.
const THINNEST: f64 = 1e-4;

/// Emerging energies (MeV) over which a dose is integrated. Slower protons, of less than 1 keV, displace almost nothing (SR-NIEL
/// falls to 0 at 0.15 keV).
const EMERGING_MEV: (f64, f64) = (1e-3, 1e5);

/// Displacement damage dose in silicon (MeV/g) behind aluminium (g/cm²) in all directions.
fn dose_behind(spectrum: &Spectrum, thickness_g_cm2: f64, niel: &Curve) -> f64 {
    let legendre = GaussLegendre::new(NonZeroUsize::new(10).expect("ten points"));
    let emerging = |entering_mev: f64| {
        let left = RANGE_ALUMINIUM.at(entering_mev) - thickness_g_cm2;
        if left > 0.0 { RANGE_ALUMINIUM.inverse(left) } else { 0.0 }
    };
    // At kinks of the spectrum, and at least every factor of two, as NIEL is curved.
    let (low, high) = EMERGING_MEV;
    let mut cuts: Vec<f64> = spectrum.kinks_mev().map(emerging).filter(|e| *e > low && *e < high).collect();
    cuts.extend((0..=26).map(|k| low * 2_f64.powi(k)).filter(|e| *e < high));
    cuts.push(high);
    cuts.sort_by(f64::total_cmp);
    cuts.windows(2)
        .map(|cut| {
            legendre.integrate(cut[0].ln(), cut[1].ln(), |log_energy| {
                let energy_mev = log_energy.exp();
                let (range, slope) = RANGE_ALUMINIUM.value_and_slope(energy_mev);
                let entering_mev = RANGE_ALUMINIUM.inverse(range + thickness_g_cm2);
                let (range_in, slope_in) = RANGE_ALUMINIUM.value_and_slope(entering_mev);
                // dE_in/dE_out = (R/E · slope) at E_out over the same at E_in
                let stretch = range * slope * entering_mev / (range_in * slope_in * energy_mev);
                niel.at(energy_mev) * spectrum.differential(entering_mev) * stretch * energy_mev
            })
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean over the directions of a slab grows with the number of directions that are computed.
    #[test]
    fn the_thickness_of_a_slab_is_that_along_its_normal() {
        let slab = Shield::aluminium(Geometry::Slab, 5.0);
        let normal_g_cm2 = 0.5 * ALUMINIUM_G_CM3;
        assert_eq!(slab.typical_g_cm2(), [normal_g_cm2; 2]);
        assert_eq!(slab.scaled(2.0).typical_g_cm2(), [2.0 * normal_g_cm2; 2]);
        assert_eq!(Shield::aluminium(Geometry::Sphere, 5.0).typical_g_cm2(), [normal_g_cm2; 2]);
        // Half of the sky behind 1 g/cm2 of tantalum, a tenth behind 4: protons see 1.5 on average.
        let direction =
            |share: f64, areal_g_cm2: f64| Direction { share, areal_g_cm2, aluminium_g_cm2: 0.7 * areal_g_cm2 };
        let sectors = Shield { directions: vec![direction(0.5, 1.0), direction(0.1, 4.0)], along_normal_g_cm2: None };
        let [areal, aluminium] = sectors.typical_g_cm2();
        assert!((areal - 1.5).abs() < 1e-12 && (aluminium - 1.05).abs() < 1e-12, "{areal} {aluminium}");
    }
}
