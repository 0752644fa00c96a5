//! How well a correction must know the traps, and how often they must be measured.

use ctiplan::mission::{Mission, Orbit};
use ctiplan::plan::evaluate::evaluate;
use ctiplan::study::Study;
use ctiplan::study::calibration::{Calibration, Continued, Outcome, Results, TOLERANCE};

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

/// Even growth that is not continued is missed in proportion to the interval: the limit is reached where the share of the mission is
/// the error with which the density must be known.
#[test]
fn the_longest_interval_is_solved_for_or_said_to_be_any_or_none() {
    let asked =
        Calibration { intervals_months: vec![6.0], density_error: 0.0, release_error: 0.0, ..Calibration::default() };
    let with = |delta_e: f64| {
        let found = ask(&asked, &even().with(&[("requirement.delta_e".into(), delta_e.into())]).unwrap());
        (found.longest[0].clone(), found.known[0].needed_percent.unwrap())
    };
    let (solved, needed_percent) = with(1e-4);
    assert_eq!((solved.continued, solved.outcome), (Continued::Constant, Outcome::Solved));
    let expected = 60.0 * needed_percent / 100.0;
    let months = solved.interval_months.unwrap();
    assert!((months / expected - 1.0).abs() < 2.0 * TOLERANCE, "{months} {expected}");
    // Nothing is drawn.
    assert_eq!(solved.error_months, None);
    let (any, _) = with(1e-1);
    assert_eq!((any.outcome, any.interval_months.map(f64::round)), (Outcome::AlwaysMet, Some(60.0)));
    let (none, _) = with(1e-8);
    assert_eq!((none.outcome, none.interval_months), (Outcome::NotReachable, None));
    assert!(none.used_at_shortest_percent > 100.0);
}

/// Under a Sun that is drawn: of the intervals that grow by 1.3, all below the longest keep the limits, and the next one does not.
#[test]
fn the_longest_interval_parts_those_that_keep_the_limits_from_those_that_do_not() {
    let asked = Calibration { samples: 100, probability: 0.8, intervals_months: vec![6.0], ..Calibration::default() };
    let used = ask(&asked, &one_species()).intervals[0].used_percent;
    // A limit that calibrations every half year just use up.
    let limit = 0.00999 * used * one_species().requirement.delta_e;
    let mission = one_species().with(&[("requirement.delta_e".into(), limit.into())]).unwrap();
    let grid: Vec<f64> = (0..=25).map(|step| 0.1 * (60.0_f64 / 0.1).powf(f64::from(step) / 25.0)).collect();
    let found = ask(&Calibration { intervals_months: grid[..25].to_vec(), ..asked }, &mission);
    for longest in &found.longest {
        let months = longest.interval_months.unwrap_or_else(|| panic!("{longest:?}"));
        assert_eq!(longest.outcome, Outcome::Solved, "{longest:?}");
        let of = found.intervals.iter().filter(|one| one.continued == longest.continued);
        let (shorter, longer): (Vec<_>, Vec<_>) = of.partition(|one| one.interval_months < months);
        assert!(shorter.len() > 5 && shorter.iter().all(|one| one.used_percent <= 100.0), "{longest:?} {shorter:?}");
        assert!(longer.first().is_none_or(|next| next.used_percent > 100.0), "{longest:?} {longer:?}");
    }
}

/// The seed of the draws is the mission's unless another is asked for.
#[test]
fn another_seed_draws_another_sun() {
    let run = |words: &[&str]| {
        let out = std::process::Command::new(env!("CARGO_BIN_EXE_ctiplan"))
            .args(["study", "calibration", "missions/snap_l2_trades.toml", "--samples", "50", "--interval-months", "6"])
            .args(words)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).unwrap()
    };
    let [own, other] = [run(&[]), run(&["--seed", "4711"])];
    assert_eq!(own, run(&["--seed", "1"]));
    assert_ne!(own, other);
}
