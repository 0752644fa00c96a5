//! A mission's derived dose at calendar years, and numbers beside published ones.

use chrono::NaiveDate;
use ctiplan::environment::shielding::Geometry;
use ctiplan::mission::{Mission, Shielding};
use ctiplan::model::Model;
use ctiplan::numeric::calendar::decimal_year;

/// A dose against the calendar.
pub trait Dose {
    /// Dose since launch (MeV/g) at a decimal year.
    fn dose(&self, year: f64) -> f64;

    /// Mean dose rate (MeV/g/yr) between two decimal years.
    fn rate(&self, from: f64, to: f64) -> f64 {
        (self.dose(to) - self.dose(from)) / (to - from)
    }

    /// Slope (MeV/g/yr) of a straight line through the dose at evenly spaced times between two decimal years.
    fn slope(&self, from: f64, to: f64) -> f64 {
        const POINTS: u32 = 200;
        let points: Vec<(f64, f64)> = (0..POINTS)
            .map(|point| from + (to - from) * (f64::from(point) + 0.5) / f64::from(POINTS))
            .map(|year| (year - 0.5 * (from + to), self.dose(year)))
            .collect();
        points.iter().map(|(x, y)| x * y).sum::<f64>() / points.iter().map(|(x, _)| x * x).sum::<f64>()
    }
}

/// The dose of a mission.
pub struct Flown {
    /// Decimal year.
    pub launch: f64,
    model: Model,
}

impl Flown {
    pub fn new(mission: &Mission) -> Flown {
        Flown { launch: decimal_year(mission.mission.launch.0), model: Model::new(mission) }
    }

    /// The same mission behind a sphere of aluminium.
    pub fn behind(mission: &Mission, thickness_mm: f64) -> Flown {
        Flown::new(&behind(mission, thickness_mm))
    }

    /// Mean dose rate (MeV/g/yr) of some sources between two decimal years.
    pub fn rate_of(&self, names: &[&str], from: f64, to: f64) -> f64 {
        let history = self.model.history();
        let (start, end) = (from - self.launch, to - self.launch);
        let named = history.sources.iter().filter(|source| names.contains(&source.name.as_str()));
        let sum: f64 = named.map(|source| history.of_source_mev_g(source, start, end)).sum();
        sum / (to - from)
    }
}

impl Dose for Flown {
    fn dose(&self, year: f64) -> f64 {
        self.model.dose_mev_g(year - self.launch).expect("a mission without a formula")
    }
}

/// The mission of a file in `missions/flown/`.
pub fn mission(name: &str) -> Mission {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/missions/flown/");
    Mission::read(format!("{path}{name}.toml")).expect("a valid mission")
}

/// The same mission with some keys set.
pub fn with(mission: &Mission, settings: &[(&str, toml::Value)]) -> Mission {
    let settings: Vec<_> = settings.iter().map(|(key, value)| (key.to_string(), value.clone())).collect();
    mission.with(&settings).expect("valid settings")
}

/// The same mission with the median Sun in place of the one that was observed.
pub fn drawn(mission: &Mission) -> Mission {
    with(mission, &[("environment.sun", "drawn".into())])
}

/// The same mission behind a sphere of aluminium.
pub fn behind(mission: &Mission, thickness_mm: f64) -> Mission {
    Mission { shielding: Some(Shielding::aluminium(Geometry::Sphere, thickness_mm)), ..mission.clone() }
}

/// Protons of solar events.
pub const SOLAR_PROTONS: &str = "solar-protons";

/// Protons and nuclei of cosmic rays.
pub const COSMIC_RAYS: [&str; 2] = ["cosmic-rays", "cosmic-ray-nuclei"];

/// A number of the model beside a published one, both over the same mean.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    pub published: f64,
    /// 1 sigma of the published number.
    pub error: f64,
    pub model: f64,
}

impl Compared {
    /// Model less published, in published errors.
    pub fn sigma(&self) -> f64 {
        (self.model - self.published) / self.error
    }

    /// `published ± error, model, difference`.
    pub fn words(&self) -> String {
        format!("{:>7.2} +- {:.2} {:>8.2} {:>+9.1}", self.published, self.error, self.model, self.sigma())
    }
}

/// Values and errors of a measurement file with columns time, value, sigma; the time as it stands there.
pub fn rows(file: &str) -> Vec<(&str, f64, f64)> {
    file.lines()
        .filter(|line| line.starts_with(|first: char| first.is_ascii_digit()))
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            (cells[0], number(cells[1]), number(cells[2]))
        })
        .collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().expect("a number")
}

/// Decimal year of an ISO date.
pub fn year_of(date: &str) -> f64 {
    decimal_year(NaiveDate::parse_from_str(date, "%Y-%m-%d").expect("a date"))
}
