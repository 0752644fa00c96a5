//! Cameras that flew: what `cargo run --release --example hindcast` prints and docs/hindcast.md shows, and which goals are met.

#[path = "../../examples/hindcast/chandra.rs"]
mod chandra;
#[path = "../../examples/hindcast/drawn.rs"]
mod drawn;
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

/// `tests/suite/tutorial.rs` says how to renew the blocks.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn the_page_of_the_hindcast_shows_what_the_program_prints() {
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
    let (low_orbit, rest) = met.split_at(4);
    let (median, drawn_suns) = rest.split_at(4);
    assert_eq!(low_orbit, [false, true, false, true]);
    assert_eq!(median, [false, false, false, false]);
    assert_eq!(drawn_suns, [false, true, true, true, true]);
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

/// The median Sun is too weak in 2000 to 2002 and too strong in 2003 to 2006, behind any shield and with or without the belt.
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

/// What the bands test, and what they do not: they are so wide that a constant rate lies in them too.
#[test]
fn bands_of_drawn_suns_are_wide_and_have_a_constant_rate_within() {
    for bands in [xmm::bands(&xmm::mission()), chandra::bands(&chandra::mission())] {
        assert_eq!((drawn::within(&bands), drawn::constant_within(&bands)), (bands.len(), bands.len()));
        assert!(bands.iter().any(|band| band.width() > 3.0) && bands.iter().all(|band| band.width() > 0.5));
        assert!(drawn::as_extreme(&bands) > 0.05);
    }
}

/// Neutrons add to cosmic rays more than to solar protons, so bands are narrower: the last year of the ellipse is outside then.
#[test]
fn with_neutrons_the_ellipse_is_not_within_its_bands() {
    let neglected = xmm::bands(&xmm::mission());
    let counted = xmm::bands(&with_neutrons(&xmm::mission()));
    assert!(neglected.iter().zip(&counted).all(|(without, with)| with.width() < without.width()));
    assert!(!counted[4].within() && drawn::within(&counted) == 4);
    assert_eq!(drawn::within(&chandra::bands(&with_neutrons(&chandra::mission()))), 4);
}

/// Growth over the mean growth is 1 in the mean over all years, under each Sun.
#[test]
fn windows_of_a_drawn_sun_add_up_to_its_growth() {
    let bands = xmm::bands(&xmm::mission());
    for sun in 0..drawn::DRAWS as usize {
        let sum: f64 =
            xmm::SUMS.iter().zip(&bands).map(|((from, to), band)| (to - from) as f64 * band.draws[sun]).sum();
        assert!((sum / 16.0 - 1.0).abs() < 1e-3, "{sun}: {sum}");
    }
}

/// Solar protons do not reach the low orbit: all Suns are the same there, and the same as the median.
#[test]
fn in_low_orbit_the_sun_makes_no_difference() {
    let median = hst::stretches(&Flown::new(&hst::mission()));
    for (band, stretch) in hst::bands().iter().zip(median) {
        assert!(band.width() < 1e-3, "{}", band.width());
        assert!((band.quantiles()[1] - stretch.growth.model).abs() < 1e-3);
    }
}

/// The median of the Suns is near the median Sun, whose dose follows from the same model of fluences without a draw.
#[test]
fn at_l2_drawn_suns_have_the_dose_of_the_median_sun_in_their_middle() {
    let suns = gaia::Suns::of(&gaia::mission());
    assert!((suns.dose.quantiles()[1] / gaia::dose() - 1.0).abs() < 0.1);
    assert!((suns.cosmic_rays_most() - gaia::cosmic_ray_confidence(15.0).unwrap()).abs() < 0.05);
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
