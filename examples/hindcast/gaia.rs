//! The Lagrange point: Gaia.

use ctiplan::mission::Mission;

use super::drawn::{self, Band, Drawn};
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
    flown.rate_of(&[SOLAR_PROTONS], YEARS.0, YEARS.1) / flown.rate(YEARS.0, YEARS.1)
}

/// Largest confidence (steps of 0.01) at which cosmic rays make most of the dose behind a sphere of aluminium.
pub fn cosmic_ray_confidence(thickness_mm: f64) -> Option<f64> {
    let steps = (1..=99).map(|percent| f64::from(percent) / 100.0);
    steps.take_while(|confidence| solar_share(thickness_mm, *confidence) < 0.5).last()
}

/// Dose (1e6 MeV/g) since launch at the end of 2019 under the median Sun.
pub fn dose() -> f64 {
    1e-6 * Flown::new(&mission()).dose(YEARS.1)
}

/// Dose (1e6 MeV/g) of the damage that was seen: a tenth of 2.5e7 to 3.4e7 MeV/g, which were expected before launch (from memory).
pub const SEEN: (f64, f64) = (2.5, 3.4);

/// Under drawn Suns.
pub struct Suns {
    /// Share (%) of cosmic rays in the dose of 2014 to 2019, beside one half.
    pub share: Band,
    /// Dose (1e6 MeV/g) since launch at the end of 2019, beside the middle of what was seen.
    pub dose: Band,
}

impl Suns {
    pub fn of(mission: &Mission) -> Suns {
        let (from, to) = YEARS;
        let seen = 0.5 * (SEEN.0 + SEEN.1);
        let numbers = |course: &drawn::Course| {
            let share = 100.0 * (course.others(to) - course.others(from)) / (course.dose(to) - course.dose(from));
            vec![
                Compared { published: 50.0, error: 0.0, model: share },
                Compared { published: seen, error: SEEN.1 - seen, model: 1e-6 * course.dose(to) },
            ]
        };
        let mut bands = Drawn::of(mission).bands(numbers).into_iter();
        let mut next = || bands.next().expect("two numbers");
        Suns { share: next(), dose: next() }
    }

    /// Share of the Suns with which cosmic rays are most of the dose.
    pub fn cosmic_rays_most(&self) -> f64 {
        1.0 - self.share.below(50.0)
    }

    /// Ratio of the doses at the ends of the band.
    pub fn spread(&self) -> f64 {
        let [low, _, high] = self.dose.quantiles();
        high / low
    }

    /// Quantiles at which the least and the greatest of what was seen lie.
    pub fn seen(&self) -> (f64, f64) {
        (self.dose.below(SEEN.0), self.dose.below(SEEN.1))
    }
}

/// Least and greatest ratio of a dose (1e6 MeV/g) and the dose that was seen.
pub fn over_seen(dose: f64) -> (f64, f64) {
    (dose / SEEN.1, dose / SEEN.0)
}

/// Whether a dose (1e6 MeV/g) is within a factor of 2 of whatever was seen.
pub fn within_two(dose: f64) -> bool {
    let (least, greatest) = over_seen(dose);
    least >= 0.5 && greatest <= 2.0
}

fn drawn_tables() -> Vec<String> {
    let mission = mission();
    let cases = [
        ("10", behind(&mission, 10.0)),
        ("15", mission.clone()),
        ("20", behind(&mission, 20.0)),
        ("15, neutrons counted", with_neutrons(&mission)),
    ]
    .map(|(words, mission)| (words, Suns::of(&mission)));
    let quantiles = |band: &Band| band.quantiles().map(|at| format!("{at:>6.1}")).join(" ");
    let mut lines = vec![
        format!("Share of cosmic rays in the dose of 2014 to 2019 [%], published: above 50: {}", drawn::suns()),
        " mm Al                   5 %   50 %   95 %  width  Suns with more than 50 [%]".into(),
    ];
    for (words, case) in &cases {
        let above = 100.0 * case.cosmic_rays_most();
        lines.push(format!(" {words:<20} {} {:>6.1} {above:>8.1}", quantiles(&case.share), case.share.width()));
    }
    lines.push(String::new());
    lines.push(format!("Dose at the end of 2019 [1e6 MeV/g], seen: 2.5 to 3.4 (from memory): {}", drawn::suns()));
    lines.push(
        " mm Al                   5 %   50 %   95 %  95 over 5 %  seen at quantile [%]  Suns within a factor of 2 [%]"
            .into(),
    );
    for (words, case) in &cases {
        let (from, to) = case.seen();
        let seen = format!("{:.1} to {:.1}", 100.0 * from, 100.0 * to);
        let within = 100.0 * case.dose.mean(|draw| f64::from(u8::from(within_two(draw))));
        let spread = case.spread();
        lines.push(format!(" {words:<20} {} {spread:>12.1}  {seen:>20} {within:>10.1}", quantiles(&case.dose)));
    }
    lines
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
        lines.push(format!(" {year} {:>6.2} {:>12.2} {growth:>21.2}", rate(&[SOLAR_PROTONS]), rate(&COSMIC_RAYS)));
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
    lines.push(String::new());
    lines.extend(drawn_tables());
    lines
}
