//! A mission's derived dose at calendar years, and numbers beside published ones.

use chrono::NaiveDate;
use ctiplan::environment::shielding::Geometry;
use ctiplan::mission::{Mission, SecondariesCounted, Shielding};
use ctiplan::model::Model;
use ctiplan::numeric::calendar::decimal_year;
use ctiplan::physics::DoseHistory;

use super::events;

/// Errors (1 sigma) by which a model may differ from each published number.
pub const WITHIN_SIGMA: f64 = 2.0;

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

/// The dose of a mission under the median Sun.
pub struct Flown {
    /// Decimal year.
    pub launch: f64,
    duration_yr: f64,
    model: Model,
    /// Whether solar protons come in proportion to the events of each year, known afterwards, and not evenly in active years.
    events: bool,
}

impl Flown {
    pub fn new(mission: &Mission) -> Flown {
        let header = &mission.mission;
        Flown {
            launch: decimal_year(header.launch.0),
            duration_yr: header.duration_yr,
            model: Model::new(mission),
            events: false,
        }
    }

    /// The same dose of solar protons in all, in proportion to the events of each year.
    pub fn with_events(self) -> Flown {
        Flown { events: true, ..self }
    }

    /// The same mission behind a sphere of aluminium.
    pub fn behind(mission: &Mission, thickness_mm: f64) -> Flown {
        Flown::new(&behind(mission, thickness_mm))
    }

    /// Mean dose rate (MeV/g/yr) of some sources between two decimal years, events left alone.
    pub fn rate_of(&self, names: &[&str], from: f64, to: f64) -> f64 {
        let history = self.history();
        let (start, end) = (from - self.launch, to - self.launch);
        let named = history.sources.iter().filter(|source| names.contains(&source.name.as_str()));
        let sum: f64 = named.map(|source| history.of_source_mev_g(source, start, end)).sum();
        sum / (to - from)
    }

    /// Dose (MeV/g) of everything but solar protons up to a time in years since launch.
    pub fn without_sun(&self, t_yr: f64) -> f64 {
        let history = self.history();
        let others = history.sources.iter().filter(|source| source.name != SOLAR_PROTONS);
        others.map(|source| history.of_source_mev_g(source, 0.0, t_yr)).sum()
    }

    pub fn history(&self) -> &DoseHistory {
        self.model.history()
    }
}

impl Dose for Flown {
    fn dose(&self, year: f64) -> f64 {
        let dose = self.model.dose_mev_g(year - self.launch).expect("a mission without a formula");
        if !self.events {
            return dose;
        }
        let end = self.launch + self.duration_yr;
        let solar = |to: f64| (to - self.launch) * self.rate_of(&[SOLAR_PROTONS], self.launch, to);
        dose - solar(year) + solar(end) * events::sum(self.launch, year) / events::sum(self.launch, end)
    }
}

/// The same mission behind a sphere of aluminium.
pub fn behind(mission: &Mission, thickness_mm: f64) -> Mission {
    Mission { shielding: Some(Shielding::aluminium(Geometry::Sphere, thickness_mm)), ..mission.clone() }
}

/// The same mission with nuclear reactions in the shield counted: protons lost, damage by neutrons added.
pub fn with_neutrons(mission: &Mission) -> Mission {
    let mut mission = mission.clone();
    mission.shielding.as_mut().expect("a shield").secondaries = SecondariesCounted::Estimated;
    mission
}

/// The source that is drawn as events.
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

/// Whether all numbers are within the published errors, in words.
pub fn verdict(compared: &[Compared]) -> String {
    let worst = compared.iter().map(|one| one.sigma().abs()).fold(0.0, f64::max);
    let within = compared.iter().filter(|one| one.sigma().abs() <= WITHIN_SIGMA).count();
    let met = if met(compared) { "met" } else { "not met" };
    format!("within {WITHIN_SIGMA} sigma: {within} of {}, largest {worst:.1} sigma: {met}", compared.len())
}

/// Whether all numbers are within the published errors.
pub fn met(compared: &[Compared]) -> bool {
    compared.iter().all(|one| one.sigma().abs() <= WITHIN_SIGMA)
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
