//! How well a correction must know the traps, and how often they must be measured.

use ctiplan::mission::{Mission, Orbit};
use ctiplan::plan::evaluate::evaluate;
use ctiplan::study::Study;
use ctiplan::study::calibration::{Calibration, Continued, Results};

/// SNAP with its first species alone, quickly evaluated.
fn one_species() -> Mission {
    let mission = Mission::read("missions/snap_l2.toml").unwrap();
    let mut mission = mission.with(&[("accuracy.subpixel_grid".into(), 1.into())]).unwrap();
    mission.detector.traps.truncate(1);
    mission
}

/// The same in a low orbit of given dose, where there is no Sun to draw: traps grow evenly.
fn even() -> Mission {
    let mut mission = one_species();
    mission.mission.orbit = Some(Orbit::Leo);
    mission
}

fn ask(asked: &Calibration, mission: &Mission) -> Results {
    asked.study(mission, &|| {}).unwrap()
}

#[test]
fn a_density_must_be_known_to_the_limit_over_what_it_does() {
    let mission = one_species();
    let end = evaluate(&mission).unwrap().end().galaxies[0].unwrap();
    let found = ask(&Calibration { samples: 100, ..Calibration::default() }, &mission);
    let needed = found.known[0].needed_percent.unwrap();
    // Δe is nearly proportional to the density; the rest is its curvature.
    let expected = 100.0 * mission.requirement.delta_e / end.delta_e1.abs();
    assert!((needed / expected - 1.0).abs() < 0.05, "{needed} {expected}");
}

#[test]
fn even_growth_is_foreseen_on_a_line_and_missed_in_proportion_to_the_interval() {
    let asked = Calibration {
        intervals_months: vec![3.0, 6.0, 12.0],
        density_error: 0.0,
        release_error: 0.0,
        ..Calibration::default()
    };
    let found = ask(&asked, &even());
    assert!(found.sun_not_drawn.is_some());
    let error = |continued: Continued| -> Vec<f64> {
        let of = found.intervals.iter().filter(|one| one.continued == continued);
        of.map(|one| one.density_error_percent).collect()
    };
    // Of 60 months.
    for (error, months) in error(Continued::Constant).into_iter().zip([3.0, 6.0, 12.0]) {
        assert!((error - 100.0 * months / 60.0).abs() < 0.01, "{error} {months}");
    }
    // Until the second calibration there is no line: equal but for rounding, as the line is no better in the first interval.
    for (linear, constant) in error(Continued::Linear).into_iter().zip(error(Continued::Constant)) {
        assert!((linear / constant - 1.0).abs() < 1e-9, "{linear} {constant}");
    }
    // Errors of two calibrations: ρ̂ₖ (1 + x) − ρ̂ₖ₋₁ x with x = 1 at the end of four of five years.
    let measured = Calibration { intervals_months: vec![12.0], density_error: 0.3, ..asked };
    let found = ask(&measured, &even());
    let expected = 100.0 * 0.3 * (2.0_f64 * 0.8).hypot(0.6);
    assert!((found.intervals[1].density_error_percent - expected).abs() < 0.01, "{:?}", found.intervals);
}

#[test]
fn rarer_calibrations_leave_more_under_a_sun_that_is_drawn() {
    let found = ask(&Calibration { samples: 100, ..Calibration::default() }, &one_species());
    assert!(found.sun_not_drawn.is_none());
    for continued in [Continued::Constant, Continued::Linear] {
        let of: Vec<_> = found.intervals.iter().filter(|one| one.continued == continued).collect();
        assert!(of[0].used_percent < of[of.len() - 1].used_percent, "{of:?}");
        assert!(of.iter().all(|one| one.met_error_percent > 0.0));
    }
}

#[test]
fn intervals_that_make_no_sense_are_refused() {
    for months in [0.0, -1.0, 61.0, f64::NAN] {
        let asked = Calibration { intervals_months: vec![months], ..Calibration::default() };
        let message = asked.study(&one_species(), &|| {}).unwrap_err().to_string();
        assert!(message.contains("allowed: 0.1 to 60"), "{message}");
    }
}
