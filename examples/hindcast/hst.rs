//! The low orbit: HST ACS/WFC.

use ctiplan::mission::Mission;

use super::flown::{self, Dose, Flown, drawn, with};

/// Intervals in which growth is compared, decimal years.
pub const INTERVALS: [(f64, f64); 3] = [(2002.16, 2006.0), (2006.0, 2017.0), (2017.0, 2020.0)];

/// Difference of relative growth that counts as met.
pub const WITHIN: f64 = 0.04;

/// Modulation in the published fit, as half the difference of the greatest and the least yearly growth over their mean.
pub const MODULATION: (f64, f64) = (0.11, 0.14);

pub fn mission() -> Mission {
    flown::mission("hst_acs")
}

/// The same on a circle of the mean altitude of 2002 to 2020.
pub fn on_a_circle() -> Mission {
    let mut mission = mission();
    mission.imported.orbits.clear();
    let orbit = mission.orbit.as_mut().expect("an orbit");
    orbit.history = None;
    (orbit.perigee_km, orbit.apogee_km, orbit.inclination_deg) = (Some(560.0), Some(560.0), Some(28.5));
    mission
}

/// Published growth in the intervals over that in all: the fit to 176 dates, with a lag of 0, 100, 200, 300 and 400 d.
pub fn published() -> Vec<[f64; 3]> {
    let text = include_str!("../../missions/flown/hst_acs_density_fitted_176_dates.csv");
    let rows: Vec<Vec<&str>> =
        text.lines().filter(|line| line.starts_with("20")).map(|line| line.split(',').collect()).collect();
    let years: Vec<f64> = rows.iter().map(|row| flown::year_of(row[0])).collect();
    let of_lag = |column: usize| {
        let at = |year: f64| {
            let row = (0..years.len()).min_by(|a, b| (years[*a] - year).abs().total_cmp(&(years[*b] - year).abs()));
            rows[row.expect("rows")][column].parse::<f64>().expect("a number")
        };
        growth(&|from, to| (at(to) - at(from)) / (to - from))
    };
    (1..6).map(of_lag).collect()
}

/// Growth in the intervals over that in all, by a mean rate between two years.
fn growth(rate: &dyn Fn(f64, f64) -> f64) -> [f64; 3] {
    let mean = rate(INTERVALS[0].0, INTERVALS[2].1);
    INTERVALS.map(|(from, to)| rate(from, to) / mean)
}

/// The same in the model.
pub fn of_model(mission: &Mission) -> [f64; 3] {
    let flown = Flown::new(mission);
    growth(&|from, to| flown.rate(from, to))
}

/// Half the difference of the greatest and the least yearly growth of 2003 to 2019 over their mean.
pub fn modulation(mission: &Mission) -> f64 {
    let flown = Flown::new(mission);
    let rates = || (2003..2020).map(|year| flown.rate(f64::from(year), f64::from(year) + 1.0));
    let (least, greatest) = (rates().fold(f64::INFINITY, f64::min), rates().fold(0.0, f64::max));
    (greatest - least) / (greatest + least)
}

/// Largest difference of the model from the published fit with a lag of 300 d.
pub fn farthest(mission: &Mission) -> f64 {
    let pairs = of_model(mission).into_iter().zip(published()[3]);
    pairs.map(|(model, published)| (model - published).abs()).fold(0.0, f64::max)
}

pub fn report() -> Vec<String> {
    let words = |growth: &[f64; 3]| growth.map(|one| format!("{one:>9.2}")).join(" ");
    let mut lines = vec![
        "Growth over the mean growth, behind 15 mm".to_string(),
        format!(" {:<44} {}", "", INTERVALS.map(|(from, to)| format!("{from:.0}-{to:.0}")).join(" ")),
    ];
    for (lag, growth) in [0, 100, 200, 300, 400].iter().zip(published()) {
        lines.push(format!(" {:<44} {}", format!("published fit to 176 dates, lag {lag} d"), words(&growth)));
    }
    let sunk = mission();
    let circle = on_a_circle();
    let cases = [
        ("altitude as flown, Sun as observed", sunk.clone()),
        ("560 km, Sun as observed", circle.clone()),
        ("560 km, mean cycle", drawn(&circle)),
        ("altitude as flown, mean cycle", drawn(&sunk)),
    ];
    for (name, mission) in &cases {
        let modulation = 100.0 * modulation(mission);
        lines.push(format!(" {name:<44} {}   modulation {modulation:.1} %", words(&of_model(mission))));
    }
    lines.push(String::new());
    lines.push("Dose rate on circles under the Sun as observed, 1e6 MeV/g/yr".into());
    lines.push(" km         2003    2009    2014    2019".into());
    for altitude_km in [590.0, 560.0, 540.0] {
        let settings = [("orbit.perigee_km", altitude_km.into()), ("orbit.apogee_km", altitude_km.into())];
        let flown = Flown::new(&with(&circle, &settings));
        let rates =
            [2003.0, 2009.0, 2014.0, 2019.0].map(|year| format!("{:>7.2}", 1e-6 * flown.rate(year, year + 1.0)));
        lines.push(format!(" {altitude_km:<7} {}", rates.join(" ")));
    }
    lines
}
