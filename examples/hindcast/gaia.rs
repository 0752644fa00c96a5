//! The Lagrange point: Gaia.

use ctiplan::mission::Mission;

use super::flown::*;

/// What is compared: 2014 to 2019.
const YEARS: (f64, f64) = (2014.0, 2020.0);

pub fn mission() -> Mission {
    Mission::parse(include_str!("../../missions/flown/gaia.toml")).expect("a valid mission")
}

/// Share of solar protons in the dose behind a sphere of aluminium at a confidence.
pub fn solar_share(thickness_mm: f64, confidence: f64) -> f64 {
    let mut mission = mission();
    mission.environment.confidence = confidence;
    let flown = Flown::behind(&mission, thickness_mm);
    flown.rate_of(&["solar-protons"], YEARS.0, YEARS.1) / flown.rate(YEARS.0, YEARS.1)
}

/// Largest confidence (steps of 0.01) at which cosmic rays make most of the dose behind a sphere of aluminium.
pub fn cosmic_ray_confidence(thickness_mm: f64) -> Option<f64> {
    let steps = (1..=99).map(|percent| f64::from(percent) / 100.0);
    steps.take_while(|confidence| solar_share(thickness_mm, *confidence) < 0.5).last()
}

pub fn report() -> Vec<String> {
    let mission = mission();
    let flown = Flown::new(&mission);
    let mut lines = vec![
        "Dose rate, behind 15 mm, 1e5 MeV/g/yr".to_string(),
        " year  solar  cosmic rays  growth over the mean".into(),
    ];
    for year in 2014..2020 {
        let from = f64::from(year);
        let rate = |names: &[&str]| 1e-5 * flown.rate_of(names, from, from + 1.0);
        let growth = flown.rate(from, from + 1.0) / flown.rate(YEARS.0, YEARS.1);
        lines.push(format!(" {year} {:>6.2} {:>12.2} {growth:>21.2}", rate(&["solar-protons"]), rate(&COSMIC_RAYS)));
    }
    lines.push(String::new());
    lines.push("Share of solar protons in the dose of 2014 to 2019; published: below 50 %".into());
    lines.push(" mm Al  at 5 % [%]  at 10 %  at 50 %  at 95 %  cosmic rays are most up to a confidence of".into());
    for thickness_mm in [10.0, 15.0, 20.0] {
        let [least, low, median, high] =
            [0.05, 0.1, 0.5, 0.95].map(|confidence| 100.0 * solar_share(thickness_mm, confidence));
        let most = cosmic_ray_confidence(thickness_mm).map_or("none".into(), |most| format!("{:.0} %", 100.0 * most));
        lines.push(format!(" {thickness_mm:<5} {least:>11.1} {low:>8.1} {median:>8.1} {high:>8.1}  {most}"));
    }
    lines
}
