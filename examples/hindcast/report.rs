//! The reports of all cameras, by name, and what was aimed at.

use super::flown::Flown;
use super::{chandra, euclid, gaia, hst, xmm};

/// Reports that there are.
pub const REPORTS: [&str; 6] = ["hst", "xmm", "chandra", "gaia", "goals", "euclid"];

/// What docs/hindcast.md, and docs/euclid.md of the last, show under a name.
pub fn of(name: &str) -> Option<String> {
    let lines = match name {
        "hst" => hst::report(),
        "xmm" => xmm::report(),
        "chandra" => chandra::report(),
        "gaia" => gaia::report(),
        "euclid" => euclid::report(),
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

/// All that can be tested.
pub fn goals() -> Vec<Goal> {
    let charged = xmm::with_charge(&xmm::mission());
    let chi2 = xmm::fitted(&charged, xmm::YEARS).chi2;
    let (rms, largest) = xmm::predicted(&charged);
    let at_l2 = Flown::new(&gaia::mission());
    let [first, all] = gaia::UNTIL.map(|until| gaia::share_and_dose(&at_l2, until));
    let (least, greatest) = (all.1 / gaia::SEEN.1, all.1 / gaia::SEEN.0);
    let (sunk, circle) = (hst::farthest(&hst::mission()), hst::farthest(&hst::on_a_circle()));
    let modulation = hst::modulation(&hst::on_a_circle());
    let worst = chandra::THICKNESSES_MM.map(|mm| chandra::chi2(&Flown::behind(&chandra::mission(), mm)));
    let best = worst.into_iter().fold(f64::INFINITY, f64::min);
    vec![
        Goal { what: "XMM: chi2 of 17 yearly values, at most 20", result: format!("{chi2:.1}"), met: chi2 <= 20.0 },
        Goal {
            what: "XMM: the last nine from the first eight, rms within 2 sigma",
            result: format!("{rms:.1}, largest {largest:.1}"),
            met: rms <= 2.0,
        },
        Goal {
            what: "Gaia: 77 to 84 % of the dose by cosmic rays, behind 15 mm",
            result: format!("{:.1} and {:.1} %", 100.0 * first.0, 100.0 * all.0),
            met: [first.0, all.0].iter().all(|share| (gaia::SHARE.0..=gaia::SHARE.1).contains(share)),
        },
        Goal {
            what: "Gaia: dose within a factor of 1.5 of what was seen (from memory)",
            result: format!("{least:.2} to {greatest:.2} times"),
            met: least > 1.0 / 1.5 && greatest < 1.5,
        },
        Goal {
            what: "HST: growth in three intervals within 0.04, altitude as flown",
            result: format!("{sunk:.2}"),
            met: sunk <= hst::WITHIN,
        },
        Goal { what: "HST: the same at 560 km", result: format!("{circle:.2}"), met: circle <= hst::WITHIN },
        Goal {
            what: "HST: modulation at 560 km, 11 to 14 %",
            result: format!("{:.1} %", 100.0 * modulation),
            met: (hst::MODULATION.0..=hst::MODULATION.1).contains(&modulation),
        },
        Goal {
            what: "Chandra: chi2 of four slopes, behind 10 to 80 mm",
            result: format!("{best:.0} at least"),
            met: best < 9.5,
        },
    ]
}
