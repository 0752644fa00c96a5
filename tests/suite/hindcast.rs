//! Cameras that flew: what `cargo run --release --example hindcast` prints and docs/hindcast.md shows, and which goals are met.

#[path = "../../examples/hindcast/chandra.rs"]
mod chandra;
#[path = "../../examples/hindcast/events.rs"]
mod events;
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

/// To renew the blocks: `RENEW=1 cargo test --test suite hindcast::`.
#[test]
fn the_document_shows_what_is_computed() {
    for name in report::REPORTS {
        let page = fs::read_to_string(PAGE).unwrap();
        let command = format!("```sh\ncargo run --release --example hindcast -- {name}\n```\n\n```text\n");
        let (before, rest) = page.split_once(&command).unwrap_or_else(|| panic!("no block of {name}"));
        let (shown, after) = rest.split_once("```\n").unwrap();
        let printed = report::of(name).unwrap();
        if std::env::var_os("RENEW").is_some() {
            fs::write(PAGE, format!("{before}{command}{printed}```\n{after}")).unwrap();
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
    assert_eq!(met, [false, true, false, true, false, false, false]);
}

#[test]
fn the_phase_in_low_orbit_is_the_lag_that_was_put_in() {
    let lag_yr = hst::lag_yr(&Flown::new(&hst::mission()));
    assert!((lag_yr - hst::LAG_YR).abs() < 0.05, "{lag_yr} yr");
}

#[test]
fn the_modulation_falls_with_thickness_and_rises_towards_the_atmosphere() {
    let of = |altitude_km| hst::THICKNESSES_MM.map(|mm| hst::modulation(hst::extremes(mm, altitude_km)));
    let (high, low) = (of(590.0), of(540.0));
    assert!(high.windows(2).all(|pair| pair[1] < pair[0]), "{high:?}");
    assert!(high.iter().zip(&low).all(|(high, low)| low > high), "{high:?}, {low:?}");
}

/// The direction is right: less growth around maximum, by less than was published.
#[test]
fn in_low_orbit_growth_is_least_around_maximum() {
    let growth = hst::stretches(&Flown::new(&hst::mission())).into_iter().map(|stretch| stretch.growth);
    let growth: Vec<Compared> = growth.collect();
    assert!(growth.windows(2).all(|pair| pair[0].published < pair[1].published && pair[0].model < pair[1].model));
    assert!(growth[0].model > growth[0].published);
}

/// The median Sun is too weak in 2000 to 2002 and too strong in 2003 to 2006, whatever the shield and the belt.
#[test]
fn on_the_ellipse_the_first_years_are_too_weak_and_the_next_too_strong() {
    let mission = xmm::mission();
    for flown in [Flown::new(&mission), Flown::behind(&mission, 20.0), Flown::new(&xmm::without_belt())] {
        let sums = xmm::sums(&flown);
        assert!(sums[0].sigma() < -WITHIN_SIGMA && sums[1].sigma() > WITHIN_SIGMA);
        assert!((0.5..0.65).contains(&(sums[0].model / sums[0].published)));
    }
    let (published, cosmic_rays) = xmm::quiet_years(&Flown::new(&mission));
    assert!(published < 0.6 * cosmic_rays, "{published}, {cosmic_rays}");
}

#[test]
fn on_the_long_ellipse_growth_does_not_slow_as_published() {
    let mission = chandra::mission();
    assert!(chandra::late_over_early(&Flown::new(&mission)) > 0.9);
    // Events of the years as they came explain half of it.
    assert!((0.5..0.8).contains(&chandra::late_over_early(&Flown::new(&mission).with_events())));
}

#[test]
fn at_l2_cosmic_rays_are_most_of_the_dose_only_below_the_median_sun() {
    for thickness_mm in [10.0, 15.0, 20.0] {
        let confidence = gaia::cosmic_ray_confidence(thickness_mm).unwrap();
        assert!((0.1..0.5).contains(&confidence), "{thickness_mm} mm: {confidence}");
    }
}

/// The files that the program reads hold the published numbers in other units.
#[test]
fn measurements_are_the_published_numbers() {
    let pair = |published, used| rows(published).into_iter().zip(rows(used)).collect::<Vec<_>>();
    let low = pair(
        include_str!("../../missions/flown/hst_acs_trap_density.ecsv"),
        include_str!("../../missions/flown/hst_acs_dose.ecsv"),
    );
    for ((t_yr, traps, traps_sigma), (same_t_yr, dose, dose_sigma)) in low {
        assert_eq!(t_yr, same_t_yr);
        assert!((1e-7 * dose - traps).abs() < 1e-9 && (1e-7 * dose_sigma - traps_sigma).abs() < 1e-9, "{t_yr} yr");
    }
    let ellipse = pair(
        include_str!("../../missions/flown/xmm_pn_al_k.ecsv"),
        include_str!("../../missions/flown/xmm_pn_charge.ecsv"),
    );
    for ((date, cti, cti_sigma), (same_date, charge, charge_sigma)) in ellipse {
        assert_eq!(date, same_date);
        let left = 407.0 * (1.0 - cti).powi(200);
        assert!((charge - left).abs() < 6e-4 && (charge_sigma - 200.0 * left * cti_sigma).abs() < 6e-4, "{date}");
    }
}

/// The list holds no year twice and leaves none out.
#[test]
fn events_are_of_every_year() {
    let years: Vec<i32> = events::PEAKS.iter().map(|(year, _)| *year).collect();
    assert_eq!(years, (1999..=2020).collect::<Vec<_>>());
    let whole: f64 = events::PEAKS.iter().map(|(_, peaks)| peaks).sum();
    assert!((events::sum(1999.0, 2021.0) / whole - 1.0).abs() < 1e-12);
}
