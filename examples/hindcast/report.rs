//! The reports of all cameras, by name, and what was aimed at.

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
        format!("{:<66} {:<32} {}", self.what, self.result, if self.met { "met" } else { "not met" })
    }
}

/// All that can be tested.
pub fn goals() -> Vec<Goal> {
    let low = Flown::new(&hst::mission());
    let stretches: Vec<Compared> = hst::stretches(&low).iter().map(|stretch| stretch.growth).collect();
    let ratios = hst::ratios(&low);
    let ratio = ratios[0].ratio.model;
    let modulation = hst::modulation(hst::extremes(15.0, 590.0));
    let lag_yr = hst::lag_yr(&low);
    let ellipse = Flown::new(&xmm::mission());
    let long = chandra::slopes(&Flown::new(&chandra::mission()));
    let long: Vec<Compared> = long.into_iter().map(|(_, slope)| slope).collect();
    let share = gaia::solar_share(15.0, 0.5);
    vec![
        within("HST: growth between dates, within their errors", &stretches),
        Goal {
            what: "HST: growth to 2006 over growth after, within published analyses",
            result: format!("{ratio:.2}"),
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
        within("XMM: growth over several years, within its errors", &xmm::sums(&ellipse)),
        within("Chandra: slopes over that to 2006, within their scatter", &long),
        Goal {
            what: "Gaia: most of the dose by cosmic rays, behind 15 mm at 50 %",
            result: format!("solar protons {:.1} %", 100.0 * share),
            met: share < 0.5,
        },
    ]
}

fn within(what: &'static str, compared: &[Compared]) -> Goal {
    let within = compared.iter().filter(|one| one.sigma().abs() <= WITHIN_SIGMA).count();
    Goal { what, result: format!("{within} of {} within {WITHIN_SIGMA} sigma", compared.len()), met: met(compared) }
}
