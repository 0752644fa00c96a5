//! The long ellipse above the belts: Chandra ACIS.

use ctiplan::mission::Mission;

use super::drawn::{self, Band, Drawn};
use super::events;
use super::flown::*;

/// Start of what is compared, decimal year: the damage before it is that of soft protons through the mirrors.
const START: f64 = 1999.67;

/// Slope of parallel CTI (1e-6 per year, Mn K) of the imaging array, of a line from the start to a date: O'Dell et al. 2005, and the
/// monitoring pages of the Chandra X-ray Center (MTA). The last but one sets the scale.
pub const SLOPES: [(f64, f64); 5] = [(2000.7, 5.0), (2003.4, 3.19), (2004.65, 2.50), (2006.0, 2.93), (2015.67, 1.63)];

/// The date that sets the scale: the slope of 2006.
const SCALE: usize = 3;

/// Scatter of slopes that different pages print for the same array in 2006: 2.75 to 2.93, 1e-6 per year.
const SCATTER: f64 = 0.1;

pub fn mission() -> Mission {
    Mission::parse(include_str!("../../missions/flown/chandra_acis.toml")).expect("a valid mission")
}

/// Slopes up to the dates, over that of 2006; that of 2006 itself left out.
pub fn slopes(flown: &impl Dose) -> Vec<(f64, Compared)> {
    let (scale_year, scale) = SLOPES[SCALE];
    let model_scale = flown.slope(START, scale_year);
    let of = |(year, slope): (f64, f64)| {
        let published = slope / scale;
        let error = published * (SCATTER / slope).hypot(SCATTER / scale);
        (year, Compared { published, error, model: flown.slope(START, year) / model_scale })
    };
    SLOPES.into_iter().enumerate().filter(|(index, _)| *index != SCALE).map(|(_, slope)| of(slope)).collect()
}

/// The same of a mission under drawn Suns.
pub fn bands(mission: &Mission) -> Vec<Band> {
    let slopes = |course: &drawn::Course| slopes(course).into_iter().map(|(_, slope)| slope).collect();
    Drawn::of(mission).bands(slopes)
}

/// Mean growth per year from 2006 to 2015.7 over that from the start to 2006.
pub fn late_over_early(flown: &Flown) -> f64 {
    flown.rate(2006.0, 2015.67) / flown.rate(START, 2006.0)
}

/// Step at the event of 2003-10-28 if it brought its part of the solar protons, by its peak flux, in years of mean growth up to 2006.
pub fn step_yr() -> f64 {
    let flown = Flown::new(&mission()).with_events();
    let (start, end) = (START, 2015.67);
    let solar = (end - start) * flown.rate_of(&[SOLAR_PROTONS], start, end);
    solar * events::OCTOBER_2003 / events::sum(start, end) / flown.rate(start, 2006.0)
}

pub fn report() -> Vec<String> {
    let mut lines = Vec::new();
    let cases = [
        ("behind 40 mm", Flown::new(&mission())),
        ("behind 80 mm", Flown::behind(&mission(), 80.0)),
        ("behind 40 mm, solar protons in proportion to the events of each year", Flown::new(&mission()).with_events()),
    ];
    for (words, flown) in &cases {
        lines.push(format!("Slope of a line from 1999-09 to a date over that to 2006.0, {words}"));
        lines.push(" date          published    model  diff [sigma]".into());
        let slopes = slopes(flown);
        for (year, slope) in &slopes {
            lines.push(format!(" {year:.1}  {}", slope.words()));
        }
        let compared: Vec<Compared> = slopes.iter().map(|(_, slope)| *slope).collect();
        lines.push(format!(" {}", verdict(&compared)));
        lines.push(format!(" growth after 2006 over growth before: {:.2}", late_over_early(flown)));
        lines.push(String::new());
    }
    let flown = Flown::new(&mission());
    lines.push("Growth in a year over the mean of 2000 to 2014, behind 40 mm".into());
    lines.push(" year  model  solar [1e5 MeV/g/yr]  cosmic rays [1e5 MeV/g/yr]".into());
    let mean = flown.rate(2000.0, 2015.0);
    for year in 2000..2015 {
        let from = f64::from(year);
        let rate = |names: &[&str]| 1e-5 * flown.rate_of(names, from, from + 1.0);
        let growth = flown.rate(from, from + 1.0) / mean;
        let (solar, cosmic_rays) = (rate(&[SOLAR_PROTONS]), rate(&COSMIC_RAYS));
        lines.push(format!(" {year} {growth:>6.2} {solar:>21.2} {cosmic_rays:>27.2}"));
    }
    lines.push(String::new());
    lines.push(format!(
        "Step in October 2003 in years of growth: published below 1; model 0; by the peak flux of the event {:.1}",
        step_yr()
    ));
    let mission = mission();
    for (words, mission) in [
        ("behind 40 mm", &mission),
        ("behind 80 mm", &behind(&mission, 80.0)),
        ("behind 40 mm, neutrons counted", &with_neutrons(&mission)),
    ] {
        let what = format!("Slope of a line from 1999-09 to a date over that to 2006.0, {words}");
        let dates = SLOPES.into_iter().enumerate().filter(|(index, _)| *index != SCALE);
        let names: Vec<String> = dates.map(|(_, (year, _))| format!("{year:.1}")).collect();
        lines.push(String::new());
        lines.extend(drawn::table(&what, "date  ", &names, &bands(mission)));
    }
    lines
}
