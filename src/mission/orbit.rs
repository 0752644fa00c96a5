//! `[mission]` and `[orbit]`: orbit and duration of a mission.

use std::fmt;

use ctiplan_magnetosphere::Elements;
use ctiplan_magnetosphere::orbit::GEOSTATIONARY;
use serde::{Deserialize, Serialize};

use super::{Date, Mission};
use crate::environment::source::Place;

/// `[mission]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Name in reports.
    pub name: String,
    /// Day of launch.
    pub launch: Date,
    /// Length of the mission, years of 365.25 days.
    pub duration_yr: f64,
    /// The orbit, unless given by `[orbit]`; L2 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orbit: Option<Orbit>,
}

/// The orbit of a mission, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Orbit {
    /// Sun-Earth Lagrange point 1.
    L1,
    /// Sun-Earth Lagrange point 2.
    L2,
    /// Around the Sun at 1 AU.
    Interplanetary,
    /// Geostationary.
    Geo,
    /// Any low Earth orbit: without its elements no dose can be derived.
    Leo,
}

/// `[orbit]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrbitElements {
    /// The kind of orbit.
    pub kind: OrbitKind,
    /// Lowest altitude above a sphere of 6371 km, km.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub perigee_km: Option<f64>,
    /// Highest altitude, km.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub apogee_km: Option<f64>,
    /// Inclination, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inclination_deg: Option<f64>,
    /// Argument of perigee, degrees; None: uniformly distributed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub argument_of_perigee_deg: Option<f64>,
}

/// The kind of orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrbitKind {
    /// Sun-Earth Lagrange point 1.
    L1,
    /// Sun-Earth Lagrange point 2.
    L2,
    /// Around the Sun at 1 AU.
    Interplanetary,
    /// Geostationary.
    Geo,
    /// Around the Earth, by its elements.
    Elements,
}

/// The orbit around the Sun, in words.
const INTERPLANETARY: &str = "interplanetary at 1 AU";

impl fmt::Display for OrbitElements {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.elements() {
            None if self.kind == OrbitKind::Interplanetary => out.write_str(INTERPLANETARY),
            None => write!(out, "{}", format!("{:?}", self.kind).to_uppercase()),
            Some(_) if self.kind == OrbitKind::Geo => out.write_str("GEO"),
            Some(Elements { perigee_km, apogee_km, inclination_deg, argument_of_perigee_deg }) => {
                write!(out, "{perigee_km} x {apogee_km} km, {inclination_deg} deg")?;
                argument_of_perigee_deg.map_or(Ok(()), |argument| write!(out, ", perigee at {argument} deg"))
            }
        }
    }
}

impl OrbitElements {
    /// Elements of an orbit around the Earth.
    pub fn elements(&self) -> Option<Elements> {
        match self.kind {
            OrbitKind::L1 | OrbitKind::L2 | OrbitKind::Interplanetary => None,
            OrbitKind::Geo => Some(GEOSTATIONARY),
            OrbitKind::Elements => Some(Elements {
                perigee_km: self.perigee_km?,
                apogee_km: self.apogee_km?,
                inclination_deg: self.inclination_deg?,
                argument_of_perigee_deg: self.argument_of_perigee_deg,
            }),
        }
    }
}

impl Mission {
    /// Its location, for protons. None in a low Earth orbit of unknown elements.
    pub fn place(&self) -> Option<Place> {
        if let Some(orbit) = &self.orbit {
            return Some(orbit.elements().map_or(Place::Interplanetary, Place::Earth));
        }
        match self.mission.orbit.unwrap_or(Orbit::L2) {
            Orbit::L1 | Orbit::L2 | Orbit::Interplanetary => Some(Place::Interplanetary),
            Orbit::Geo => Some(Place::Earth(GEOSTATIONARY)),
            Orbit::Leo => None,
        }
    }

    /// Its orbit, in words.
    pub fn orbit_name(&self) -> String {
        match &self.orbit {
            Some(orbit) => orbit.to_string(),
            None if self.mission.orbit == Some(Orbit::Interplanetary) => INTERPLANETARY.into(),
            None => format!("{:?}", self.mission.orbit.unwrap_or(Orbit::L2)).to_uppercase(),
        }
    }
}
