//! The reports of all cameras, by name, and what was aimed at.

use super::drawn::{self, Band};
use super::flown::{Compared, Flown, WITHIN_SIGMA, met};
use super::{chandra, gaia, hst, xmm};

/// Reports that there are.
pub const REPORTS: [&str; 5] = ["hst", "xmm", "chandra", "gaia", "goals"];

/// What docs/hindcast.md shows under a name.
pub fn of(name: &str) -> Option<String> {
    let lines = match name {
        "hst" => hst::report(),
        "xmm" => xmm::report(),
        "chandra" => chandra::report(),
        "gaia" => gaia::report(),
        "goals" => goals().iter().map(Goal::words).collect(),
        _ => return None,
    };
    Some(lines.join("\n") + "\n")
}

/// Something aimed at.
pub struct Goal {
    pub what: &'static str,
    pub result: String,
    pub met: bool,
}

impl Goal {
    fn words(&self) -> String {
        format!("{:<66} {:<34} {}", self.what, self.result, if self.met { "met" } else { "not met" })
    }
}

/// All that can be tested: the median Sun first, then drawn Suns.
pub fn goals() -> Vec<Goal> {
    let mut goals = low_orbit();
    goals.extend(median());
    goals.extend(drawn_suns());
    goals
}

fn low_orbit() -> Vec<Goal> {
    let low = Flown::new(&hst::mission());
    let stretches: Vec<Compared> = hst::stretches(&low).iter().map(|stretch| stretch.growth).collect();
    let ratios = hst::ratios(&low);
    let modulation = hst::modulation(hst::extremes(15.0, 590.0));
    let lag_yr = hst::lag_yr(&low);
    vec![
        within("HST: growth between dates, within their errors", &stretches),
        Goal {
            what: "HST: growth to 2006 over growth after, within published analyses",
            result: format!("{:.2}", ratios[0].ratio.model),
            met: hst::among(&ratios),
        },
        Goal {
            what: "HST: modulation behind 15 mm, 18.0 to 23.0 %",
            result: format!("{:.1} %", 100.0 * modulation),
            met: (hst::MODULATION.0..=hst::MODULATION.1).contains(&modulation),
        },
        Goal {
            what: "HST: phase within a year (its lag is put in)",
            result: format!("{:+.2} yr", lag_yr - hst::LAG_YR),
            met: (lag_yr - hst::LAG_YR).abs() < 1.0,
        },
    ]
}

/// High orbits under the median Sun.
fn median() -> Vec<Goal> {
    let ellipse = Flown::new(&xmm::mission());
    let long = chandra::slopes(&Flown::new(&chandra::mission()));
    let long: Vec<Compared> = long.into_iter().map(|(_, slope)| slope).collect();
    let share = gaia::solar_share(15.0, 0.5);
    let dose = gaia::dose();
    let (least, greatest) = gaia::over_seen(dose);
    vec![
        within("XMM: growth over several years, within its errors", &xmm::sums(&ellipse)),
        within("Chandra: slopes over that to 2006, within their scatter", &long),
        Goal {
            what: "Gaia: most of the dose by cosmic rays, behind 15 mm at 50 %",
            result: format!("solar protons {:.1} %", 100.0 * share),
            met: share < 0.5,
        },
        Goal {
            what: "Gaia: absolute within a factor of 2 (from memory)",
            result: format!("{least:.1} to {greatest:.1} times what was seen"),
            met: gaia::within_two(dose),
        },
    ]
}

/// The same with the Sun drawn as events.
fn drawn_suns() -> Vec<Goal> {
    let at_l2 = gaia::Suns::of(&gaia::mission());
    let most = at_l2.cosmic_rays_most();
    let (from, to) = at_l2.seen();
    let [low, _, high] = drawn::QUANTILES;
    vec![
        banded("HST: growth between dates, within 5 to 95 % of drawn Suns", &hst::bands()),
        banded("XMM: growth over several years, within 5 to 95 % of drawn Suns", &xmm::bands(&xmm::mission())),
        banded(
            "Chandra: slopes over that to 2006, within 5 to 95 % of drawn Suns",
            &chandra::bands(&chandra::mission()),
        ),
        Goal {
            what: "Gaia: most by cosmic rays with at least 5 % of drawn Suns",
            result: format!("{:.1} % of the Suns, width {:.1} %", 100.0 * most, at_l2.share.width()),
            met: most >= low,
        },
        Goal {
            what: "Gaia: absolute, within 5 to 95 % of drawn Suns (from memory)",
            result: format!("quantile {:.0} to {:.0} %, width x {:.0}", 100.0 * from, 100.0 * to, at_l2.spread()),
            met: from >= low && to <= high,
        },
    ]
}

fn within(what: &'static str, compared: &[Compared]) -> Goal {
    let within = compared.iter().filter(|one| one.sigma().abs() <= WITHIN_SIGMA).count();
    Goal { what, result: format!("{within} of {} within {WITHIN_SIGMA} sigma", compared.len()), met: met(compared) }
}

fn banded(what: &'static str, bands: &[Band]) -> Goal {
    let (within, all) = (drawn::within(bands), bands.len());
    let widths = bands.iter().map(Band::width);
    let (least, greatest) = (widths.clone().fold(f64::INFINITY, f64::min), widths.fold(0.0, f64::max));
    Goal { what, result: format!("{within} of {all}, width {least:.2} to {greatest:.2}"), met: within == all }
}
