//! Cameras that flew: what `cargo run --release --example hindcast` prints and docs/hindcast.md shows, and which goals are met.

#[path = "../../examples/hindcast/chandra.rs"]
mod chandra;
#[path = "../../examples/hindcast/euclid.rs"]
mod euclid;
#[path = "../../examples/hindcast/flown.rs"]
mod flown;
#[path = "../../examples/hindcast/gaia.rs"]
mod gaia;
#[path = "../../examples/hindcast/hst.rs"]
mod hst;
#[path = "../../examples/hindcast/report.rs"]
mod report;
#[path = "../../examples/hindcast/xmm.rs"]
mod xmm;

use std::fs;

use flown::*;

use crate::alike::first_difference;
use crate::tutorial::shows_what_is_printed;

const PAGE: &str = "docs/hindcast.md";

/// Pages that show a report.
pub const PAGES: [&str; 2] = [PAGE, "docs/euclid.md"];

/// The page that shows a report.
fn page_of(name: &str) -> &'static str {
    PAGES[usize::from(name == "euclid")]
}

/// `tests/suite/tutorial.rs` says how to renew the blocks.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn the_page_of_the_hindcast_shows_what_the_program_prints() {
    for name in report::REPORTS {
        let path = page_of(name);
        let page = fs::read_to_string(path).unwrap();
        let command = format!("```sh\ncargo run --release --example hindcast -- {name}\n```\n\n```text\n");
        let (before, rest) = page.split_once(&command).unwrap_or_else(|| panic!("no block of {name}"));
        let (shown, after) = rest.split_once("```\n").unwrap();
        let printed = report::of(name).unwrap();
        if std::env::var_os("RENEW").is_some() {
            fs::write(path, format!("{before}{command}{printed}```\n{after}")).unwrap();
        } else {
            assert_eq!(first_difference(shown, &printed), None, "{name}");
        }
    }
    shows_what_is_printed(PAGE);
}

/// What is met and what is not, as the page says it.
#[test]
fn goals_are_met_or_not_as_the_page_says() {
    let met: Vec<bool> = report::goals().iter().map(|goal| goal.met).collect();
    let [xmm, gaia, hst, chandra] = [&met[..2], &met[2..4], &met[4..7], &met[7..]];
    assert_eq!((xmm, gaia), (&[true, true][..], &[true, true][..]));
    assert_eq!((hst, chandra), (&[false, false, false][..], &[false][..]));
}

/// The Sun as it was and the charge are both needed.
#[test]
fn on_the_ellipse_neither_the_sun_nor_the_charge_is_enough() {
    let mission = xmm::mission();
    let charged = xmm::with_charge(&mission);
    let chi2 = |mission| xmm::fitted(&mission, xmm::YEARS).chi2;
    let [constant, observed] = [chi2(xmm::constant(&mission)), chi2(mission.clone())];
    let [charged_constant, both] = [chi2(xmm::constant(&charged)), chi2(charged)];
    assert!(constant > 200.0 && observed > 150.0 && charged_constant > 100.0 && both < 20.0);
}

/// With the weight of nuclei that the camera on the ellipse has.
#[test]
fn at_l2_cosmic_rays_make_most_of_the_dose() {
    let weight = |mission: ctiplan::mission::Mission| mission.number("environment.nuclei_over_protons");
    assert_eq!(weight(gaia::mission()), weight(xmm::mission()));
    let flown = Flown::new(&gaia::mission());
    for until in gaia::UNTIL {
        let (share, _) = gaia::share_and_dose(&flown, until);
        assert!((gaia::SHARE.0..=gaia::SHARE.1).contains(&share), "{until}: {share}");
    }
}

/// Before launch a draw of the Sun had more than what came.
#[test]
fn a_mission_in_its_third_year_has_had_less_than_half_of_what_was_drawn() {
    let (flown, [low, median, high]) = euclid::had();
    let dose = flown.dose_mev_g;
    assert!(low < dose.value && dose.value < 0.5 * median && median < high, "{dose:?} {low:e} {median:e} {high:e}");
}
