//! The ellipse through the belts: XMM-Newton EPIC pn.

use ctiplan::mission::Mission;

use super::drawn::{self, Band, Drawn};
use super::flown::*;

pub fn mission() -> Mission {
    Mission::parse(include_str!("../../missions/flown/xmm_pn.toml")).expect("a valid mission")
}

/// The mission without trapped protons: its perigee moved away from the belt in 2003.
pub fn without_belt() -> Mission {
    let mut mission = mission();
    let others = ["solar-protons", "cosmic-rays", "cosmic-ray-nuclei"];
    mission.environment.sources = Some(others.map(String::from).to_vec());
    mission
}

/// New years (decimal), published CTI and errors.
fn cti() -> Vec<(f64, f64, f64)> {
    let rows = rows(include_str!("../../missions/flown/xmm_pn_al_k.ecsv"));
    rows.iter().map(|(date, value, sigma)| (year_of(date), *value, *sigma)).collect()
}

/// Mean growth of CTI per year over all published years.
fn mean_growth(rows: &[(f64, f64, f64)]) -> f64 {
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    (last.1 - first.1) / (last.0 - first.0)
}

/// Growth from the start of one published year to that of another, per year over the mean.
pub fn growth(flown: &impl Dose, from: usize, to: usize) -> Compared {
    let rows = cti();
    let [(start, low, low_error), (end, high, high_error)] = [rows[from], rows[to]];
    let scale = 1.0 / ((end - start) * mean_growth(&rows));
    Compared {
        published: (high - low) * scale,
        error: low_error.hypot(high_error) * scale,
        model: flown.rate(start, end) / flown.rate(rows[0].0, rows[rows.len() - 1].0),
    }
}

/// All single years from 2000 to 2015.
pub fn years(flown: &Flown) -> Vec<Compared> {
    (0..cti().len() - 1).map(|index| growth(flown, index, index + 1)).collect()
}

/// Years that are summed: first, and first after.
pub const SUMS: [(usize, usize); 5] = [(2000, 2003), (2003, 2007), (2007, 2011), (2011, 2015), (2015, 2016)];

pub fn sums(flown: &impl Dose) -> Vec<Compared> {
    SUMS.iter().map(|(from, to)| growth(flown, from - 2000, to - 2000)).collect()
}

/// The same of a mission under drawn Suns.
pub fn bands(mission: &Mission) -> Vec<Band> {
    Drawn::of(mission).bands(|course| sums(course))
}

/// Growth of 2004-2006 over that of 2007-2010: published, and of cosmic rays alone in the model.
pub fn quiet_years(flown: &Flown) -> (f64, f64) {
    let published = growth(flown, 4, 7).published / growth(flown, 7, 11).published;
    let rate = |from, to| flown.rate_of(&COSMIC_RAYS, from, to);
    (published, rate(2004.0, 2007.0) / rate(2007.0, 2011.0))
}

pub fn report() -> Vec<String> {
    let flown = Flown::new(&mission());
    let mut lines = vec![
        "Growth in a year over the mean, behind 30 mm; dose rates in 1e5 MeV/g/yr".into(),
        " year       published    model  diff [sigma]  solar  trapped  cosmic rays".into(),
    ];
    let years = years(&flown);
    for (index, growth) in years.iter().enumerate() {
        let from = 2000.0 + index as f64;
        let rate = |names: &[&str]| 1e-5 * flown.rate_of(names, from, from + 1.0);
        lines.push(format!(
            " {from:.0}  {} {:>10.2} {:>8.2} {:>12.2}",
            growth.words(),
            rate(&[SOLAR_PROTONS]),
            rate(&["trapped-protons"]),
            rate(&COSMIC_RAYS)
        ));
    }
    lines.push(format!(" {}", verdict(&years)));
    let cases = [
        ("behind 30 mm", flown),
        ("behind 20 mm", Flown::behind(&mission(), 20.0)),
        ("behind 30 mm, without trapped protons", Flown::new(&without_belt())),
        ("the same, solar protons in proportion to the events of each year", Flown::new(&without_belt()).with_events()),
    ];
    for (words, case) in &cases {
        lines.extend([String::new(), format!("Growth over several years over the mean, {words}")]);
        lines.push(" years           published    model  diff [sigma]".into());
        for ((from, to), sum) in SUMS.iter().zip(sums(case)) {
            lines.push(format!(" {from}-{}  {}", to - 1, sum.words()));
        }
        lines.push(format!(" {}", verdict(&sums(case))));
    }
    let (published, cosmic_rays) = quiet_years(&cases[2].1);
    lines.push(String::new());
    lines.push(format!(
        "Growth of 2004-2006 over that of 2007-2010: published {published:.2}, cosmic rays alone {cosmic_rays:.2}"
    ));
    let mission = mission();
    for (words, mission) in [
        ("behind 30 mm", &mission),
        ("behind 20 mm", &behind(&mission, 20.0)),
        ("behind 30 mm, neutrons counted", &with_neutrons(&mission)),
    ] {
        let what = format!("Growth over several years over the mean, {words}");
        let names = SUMS.map(|(from, to)| format!("{from}-{}", to - 1));
        lines.push(String::new());
        lines.extend(drawn::table(&what, "years    ", &names, &bands(mission)));
    }
    lines
}
