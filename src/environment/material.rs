//! Shield materials: density, and the equivalent areal density of aluminium.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::proton::ALUMINIUM_G_CM3;

/// Material of a shield.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Material {
    /// Aluminium.
    Aluminium,
    /// Graphite.
    Graphite,
    /// Carbon fibre reinforced plastic, 60 % fibre.
    Cfrp,
    /// Fused silica, SiO₂.
    Silica,
    /// Silicon.
    Silicon,
    /// Silicon carbide.
    SiliconCarbide,
    /// Titanium.
    Titanium,
    /// Iron, steel.
    Iron,
    /// Copper.
    Copper,
    /// Molybdenum.
    Molybdenum,
    /// Tantalum.
    Tantalum,
    /// Tungsten.
    Tungsten,
    /// Lead.
    Lead,
    /// Polyimide.
    Polyimide,
    /// Polyethylene.
    Polyethylene,
}

impl Material {
    /// Names in mission files.
    pub const NAMES: &'static [&'static str] = &[
        "aluminium",
        "graphite",
        "cfrp",
        "silica",
        "silicon",
        "silicon-carbide",
        "titanium",
        "iron",
        "copper",
        "molybdenum",
        "tantalum",
        "tungsten",
        "lead",
        "polyimide",
        "polyethylene",
    ];

    /// Density (g/cm³), and the areal density of aluminium equivalent to 1 g/cm².
    ///
    /// Densities of the Particle Data Group (Atomic and Nuclear Properties, 2020); graphite is that of machined blocks, carbon
    /// fibre plastic and silicon carbide are typical values. Equivalences: this project's Bethe formula without shell correction,
    /// mean over 30 to 200 MeV, ±3 % there; for heavy metals they are 10 % lower at 10 MeV.
    pub fn density_and_equivalence(self) -> (f64, f64) {
        match self {
            Material::Aluminium => (ALUMINIUM_G_CM3, 1.0),
            Material::Graphite => (1.8, 1.15),
            Material::Cfrp => (1.6, 1.19),
            Material::Silica => (2.20, 1.06),
            Material::Silicon => (2.329, 1.03),
            Material::SiliconCarbide => (3.15, 1.07),
            Material::Titanium => (4.54, 0.91),
            Material::Iron => (7.874, 0.89),
            Material::Copper => (8.96, 0.86),
            Material::Molybdenum => (10.22, 0.79),
            Material::Tantalum => (16.65, 0.66),
            Material::Tungsten => (19.30, 0.65),
            Material::Lead => (11.35, 0.63),
            Material::Polyimide => (1.42, 1.18),
            Material::Polyethylene => (0.94, 1.37),
        }
    }

    /// Density, g/cm³.
    pub fn density_g_cm3(self) -> f64 {
        self.density_and_equivalence().0
    }

    /// Areal density of aluminium (g/cm²) equivalent to 1 g/cm².
    pub fn equivalence(self) -> f64 {
        self.density_and_equivalence().1
    }
}

impl fmt::Display for Material {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_a_material() {
        for name in Material::NAMES {
            let material =
                Material::deserialize(serde::de::value::StrDeserializer::<serde::de::value::Error>::new(name));
            assert_eq!(material.expect(name).to_string(), *name);
        }
    }
}
