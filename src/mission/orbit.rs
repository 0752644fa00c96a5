//! `[mission]` and `[orbit]`: orbit and duration of a mission.

use std::fmt;

use chrono::NaiveDate;
use ctiplan_magnetosphere::Elements;
use ctiplan_magnetosphere::orbit::GEOSTATIONARY;
use serde::{Deserialize, Serialize};

use super::{Date, Mission, SunOfThePast};
use crate::environment::observed_sun::{Observed, Record};
use crate::environment::source::Place;
use crate::numeric::calendar::decimal_year;

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
    /// File of the elements at dates, in place of those above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub history: Option<String>,
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
    ///
    /// Of an orbit that changes, the elements nearest to the middle of the mission.
    pub fn place(&self) -> Option<Place> {
        let distance = |t_yr: f64| (t_yr - 0.5 * self.mission.duration_yr).abs();
        let orbits = self.imported.orbits.iter();
        if let Some((_, elements)) = orbits.min_by(|a, b| distance(a.0).total_cmp(&distance(b.0))) {
            return Some(Place::Earth(*elements));
        }
        if let Some(orbit) = &self.orbit {
            return Some(orbit.elements().map_or(Place::Interplanetary, Place::Earth));
        }
        match self.mission.orbit.unwrap_or(Orbit::L2) {
            Orbit::L1 | Orbit::L2 | Orbit::Interplanetary => Some(Place::Interplanetary),
            Orbit::Geo => Some(Place::Earth(GEOSTATIONARY)),
            Orbit::Leo => None,
        }
    }

    /// Elements of an orbit that changes, each at its decimal year, from launch on; empty if it does not.
    pub fn orbits(&self) -> Vec<(f64, Elements)> {
        let launch = decimal_year(self.mission.launch.0);
        let mut orbits: Vec<(f64, Elements)> =
            self.imported.orbits.iter().map(|(t_yr, elements)| (launch + t_yr, *elements)).collect();
        if let Some((_, elements)) = orbits.first().copied().filter(|first| first.0 > launch) {
            orbits.insert(0, (launch, elements));
        }
        orbits
    }

    /// The Sun as it was, seen from its launch; None if it is not wanted.
    pub fn observed_sun(&self) -> Option<Observed> {
        let record = || self.imported.solar_events.clone().unwrap_or_else(Record::built_in);
        (self.environment.sun == SunOfThePast::Observed).then(|| Observed::new(self.mission.launch.0, record()))
    }

    /// Last day on which the Sun was observed; None if it is drawn at all times of the mission.
    pub fn observed_to(&self) -> Option<NaiveDate> {
        let to = self.observed_sun()?.record().to.date();
        (to > self.mission.launch.0).then_some(to)
    }

    /// Its orbit, in words.
    pub fn orbit_name(&self) -> String {
        if let [(_, first), .., (_, last)] = &self.imported.orbits[..] {
            let [first, last] = [first, last].map(|at| format!("{:.0} x {:.0} km", at.perigee_km, at.apogee_km));
            return format!("{first} to {last}, elements at {} dates", self.imported.orbits.len());
        }
        match &self.orbit {
            Some(orbit) => orbit.to_string(),
            None if self.mission.orbit == Some(Orbit::Interplanetary) => INTERPLANETARY.into(),
            None => format!("{:?}", self.mission.orbit.unwrap_or(Orbit::L2)).to_uppercase(),
        }
    }
}
