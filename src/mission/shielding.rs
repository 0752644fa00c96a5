//! `[shielding]`: matter around the detector.

use serde::{Deserialize, Serialize};

use super::Mission;
use crate::environment::material::Material;
use crate::environment::shielding::{Direction, Geometry, Shield};

/// `[shielding]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shielding {
    /// Sphere or slab; None with sectors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geometry: Option<Geometry>,
    /// Its material.
    pub material: Material,
    /// Thickness, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness_mm: Option<f64>,
    /// Areal density, g/cm², in place of the thickness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub areal_density_g_cm2: Option<f64>,
    /// File of thicknesses against solid angle, in place of geometry and thickness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sectors: Option<String>,
    /// Layers, in place of a thickness.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<Layer>,
    /// Whether nuclear reactions in the shield are counted.
    pub secondaries: SecondariesCounted,
}

/// Whether nuclear reactions in the shield are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SecondariesCounted {
    /// Protons only slow down.
    Neglected,
    /// Loss of protons and damage by neutrons, accurate to a factor of 2.
    Estimated,
}

/// `[[shielding.layers]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layer {
    /// Its material.
    pub material: Material,
    /// Thickness, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness_mm: Option<f64>,
    /// Areal density, g/cm², in place of the thickness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub areal_density_g_cm2: Option<f64>,
}

impl Layer {
    fn areal_g_cm2(&self) -> f64 {
        let of_thickness = self.thickness_mm.map(|mm| mm / 10.0 * self.material.density_g_cm3());
        self.areal_density_g_cm2.or(of_thickness).unwrap_or(0.0)
    }
}

impl Shielding {
    /// Aluminium of this shape and thickness (mm).
    pub fn aluminium(geometry: Geometry, thickness_mm: f64) -> Shielding {
        Shielding {
            geometry: Some(geometry),
            material: Material::Aluminium,
            thickness_mm: Some(thickness_mm),
            areal_density_g_cm2: None,
            sectors: None,
            layers: Vec::new(),
            secondaries: SecondariesCounted::Neglected,
        }
    }

    /// The layers; that of the section itself if there are no others.
    fn all_layers(&self) -> Vec<Layer> {
        let own = Layer {
            material: self.material,
            thickness_mm: self.thickness_mm,
            areal_density_g_cm2: self.areal_density_g_cm2,
        };
        if self.layers.is_empty() { vec![own] } else { self.layers.clone() }
    }

    /// In words, such as `sphere of 10 mm aluminium`.
    pub fn words(&self) -> String {
        let layer = |layer: &Layer| match (layer.thickness_mm, layer.areal_density_g_cm2) {
            (Some(mm), _) => format!("{mm} mm {}", layer.material),
            (_, Some(areal)) => format!("{areal} g/cm2 {}", layer.material),
            _ => layer.material.to_string(),
        };
        let layers = self.all_layers().iter().map(layer).collect::<Vec<_>>().join(" + ");
        match (self.geometry, &self.sectors) {
            (Some(geometry), _) => format!("{geometry} of {layers}"),
            (None, Some(file)) => format!("sectors of {file} ({})", self.material),
            (None, None) => layers,
        }
    }
}

impl Mission {
    /// Matter around the detector, by direction. None without `[shielding]`.
    pub fn shield(&self) -> Option<Shield> {
        let shielding = self.shielding.as_ref()?;
        let Some(geometry) = shielding.geometry else {
            let equivalence = shielding.material.equivalence();
            let direction = |&(share, areal_g_cm2): &(f64, f64)| Direction {
                share,
                areal_g_cm2,
                aluminium_g_cm2: equivalence * areal_g_cm2,
            };
            return Some(Shield {
                directions: self.imported.sectors.iter().map(direction).collect(),
                along_normal_g_cm2: None,
            });
        };
        let layers = shielding.all_layers();
        let areal: f64 = layers.iter().map(Layer::areal_g_cm2).sum();
        let aluminium: f64 = layers.iter().map(|layer| layer.material.equivalence() * layer.areal_g_cm2()).sum();
        Some(Shield::of(geometry, areal, aluminium))
    }
}
