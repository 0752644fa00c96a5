//! The Lagrange point: Gaia.

use ctiplan::mission::Mission;

use super::flown::{self, *};

/// Dose (1e6 MeV/g) of the damage that was seen: a tenth of 2.5e7 to 3.4e7 MeV/g, which were expected before launch (from memory).
pub const SEEN: (f64, f64) = (2.5, 3.4);

/// Shares of cosmic rays in the dose with which both statements hold: a calculation outside this project, of the same events, behind
/// 15 mm.
pub const SHARE: (f64, f64) = (0.77, 0.84);

/// Times up to which the dose is compared, decimal years: the first 30 months, and the end of 2019.
pub const UNTIL: [f64; 2] = [2016.47, 2020.0];

pub fn mission() -> Mission {
    flown::mission("gaia")
}

/// Share of cosmic rays in the dose since launch, and the dose (1e6 MeV/g), up to a decimal year.
pub fn share_and_dose(flown: &Flown, until: f64) -> (f64, f64) {
    let dose = flown.dose(until);
    (flown.rate_of(&COSMIC_RAYS, flown.launch, until) * (until - flown.launch) / dose, 1e-6 * dose)
}

pub fn report() -> Vec<String> {
    let mission = mission();
    let mut lines = vec![
        "Dose since launch; published: most by cosmic rays; 2.5 to 3.4 at the end of 2019 (from memory)".to_string(),
        format!(" {:<28} {:<28} to the end of 2019", "", "first 30 months"),
        format!(" mm Al  nuclei/protons  {0} {0}", format!("{:>10} {:>17}", "cosmic [%]", "dose [1e6 MeV/g]")),
    ];
    for (thickness_mm, nuclei) in [(10.0, 0.5), (15.0, 0.2), (15.0, 0.5), (15.0, 0.75), (20.0, 0.5)] {
        let set = with(&mission, &[("environment.nuclei_over_protons", nuclei.into())]);
        let flown = Flown::behind(&set, thickness_mm);
        let cells = UNTIL.map(|until| {
            let (share, dose) = share_and_dose(&flown, until);
            format!("{:>10.1} {dose:>17.2}", 100.0 * share)
        });
        lines.push(format!(" {thickness_mm:<6} {nuclei:>14.2}  {}", cells.join(" ")));
    }
    let (median, seen) = (Flown::new(&drawn(&mission)), Flown::new(&mission));
    lines.push(String::new());
    lines.push(
        "Dose rate behind 15 mm, 1e5 MeV/g/yr: solar protons, cosmic rays; before launch (median) and as observed"
            .into(),
    );
    for year in 2014..2020 {
        let from = f64::from(year);
        let rates = |flown: &Flown| {
            let rate = |names: &[&str]| 1e-5 * flown.rate_of(names, from, from + 1.0);
            format!("{:>7.2} {:>6.2}", rate(&[SOLAR_PROTONS]), rate(&COSMIC_RAYS))
        };
        lines.push(format!(" {year}  {}   {}", rates(&median), rates(&seen)));
    }
    lines
}
