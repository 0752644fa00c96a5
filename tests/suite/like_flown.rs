//! Measurements like those that fly, with what makes them difficult: few rows, damage at launch, a detector cooled on a date, events
//! (tests/like_flown/README.md).

use ctiplan::analysis::diagnose::{Diagnosis, Note, Options, Progress, Reason, Verdict, diagnose};
use ctiplan::analysis::measurement::DataSet;
use ctiplan::mission::Mission;

const SILENT: Progress = Progress { stage: &|_, _| (), advance: &|| () };

fn diagnosed(mission: &str, data: &str) -> Diagnosis {
    diagnosed_with(mission, data, false)
}

fn diagnosed_with(mission: &str, data: &str, stability: bool) -> Diagnosis {
    let mission = Mission::read(format!("tests/like_flown/{mission}.toml")).unwrap();
    let data = DataSet::read(format!("tests/like_flown/{data}.ecsv"), &mission).unwrap();
    let options = Options { free: mission.fit.free.clone(), stability, ..Options::default() };
    diagnose(&mission, &[data], &options, &SILENT).unwrap()
}

/// A detector before any irradiation loses charge: one row of four, 9 sigma off. With so few rows either the errors are too small or
/// traps of launch are missing, and the model alone is not at its noise.
#[test]
fn few_rows_far_from_the_model_are_not_noise() {
    let found = diagnosed("irradiated", "irradiated_few");
    let Reason::Undecided { effects, fall, chi2, n: 4 } = &found.reason else { panic!("{}", found.reason) };
    assert_eq!((found.verdict, &effects[..]), (Verdict::Unfit, &["prelaunch-traps".to_string()][..]));
    assert!(*fall > 50.0 && *chi2 > 50.0, "{}", found.reason);
}

/// Damage at launch is a constant, and so is an offset of the measurement: one of most of the values, hundreds of times their
/// errors, is not passed over.
#[test]
fn a_pedestal_that_is_most_of_the_values_is_not_passed_over() {
    let found = diagnosed("launch_damage", "launch_damage");
    assert!(matches!(found.reason, Reason::LackingOrPedestals { are_most: true, .. }), "{}", found.reason);
    let named = found.alternatives.iter().flatten().any(|effect| effect == "prelaunch-traps");
    assert!(found.verdict == Verdict::Ambiguous && named, "{:?}", found.alternatives);
}

/// What follows a condition is not called larger errors that follow none: a cooling and events, or a law of charge and background that the
/// catalogue does not have.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn what_follows_conditions_is_not_called_noise() {
    for (mission, data) in [("irradiated", "irradiated_background"), ("cooled", "cooled_three_events")] {
        let found = diagnosed(mission, data);
        assert_eq!(found.verdict, Verdict::Unexplained, "{data}: {}", found.reason);
        assert!(!found.covariates.is_empty() && found.suggestion.is_some(), "{data}");
    }
}

/// A step when a word of the user's own changes is named with that word.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn a_step_is_named_with_what_changes_then() {
    let found = diagnosed("injected", "injected");
    assert!(matches!(found.reason, Reason::BetterLaw { .. }), "{}", found.reason);
    let named = |note: &Note| matches!(note, Note::CoincidesWith { condition, .. } if condition == "sci");
    assert!(found.notes.iter().any(named), "{:?}", found.notes);
}

/// A law of a temperature is written about the temperatures of the data.
#[test]
fn laws_are_counted_from_the_middle_of_a_narrow_range() {
    let found = diagnosed("warmer", "warmer");
    let Reason::BetterLaw { expression, .. } = &found.reason else { panic!("{}", found.reason) };
    assert!(expression.contains("(temperature_k - 155)"), "{expression}");
}

/// An event and a cooling, which the file records: not three effects, but the event beside a law of temperature.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn a_recorded_cooling_is_not_made_of_effects() {
    let found = diagnosed("cooled", "cooled_one_event");
    let Reason::BetterLaw { expression, beside, .. } = &found.reason else { panic!("{}", found.reason) };
    assert!(expression.contains("temperature_k") && beside[..] == ["solar-flare".to_string()], "{}", found.reason);
}

/// Two events look like scatter from row to row. With larger errors than quoted they are not needed; what the quoted errors tell is
/// said beside it.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn where_errors_were_enlarged_the_quoted_ones_are_tried() {
    let found = diagnosed_with("cooled", "two_events", true);
    assert!(found.noise[0].scale > 1.3, "{:?}", found.noise);
    let as_quoted = found.stability.done.iter().find(|changed| changed.change == "errors as quoted").unwrap();
    assert!(!as_quoted.holds && as_quoted.effects.iter().any(|effect| effect == "solar-flare"), "{as_quoted:?}");
}

/// A flare and a cycle of the dose rate leave hardly more than noise of three events; another two flares are further off, and the
/// third makes all the difference.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn three_events_are_not_taken_for_one_and_a_cycle() {
    let found = diagnosed("three_steps", "three_steps");
    let added: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
    assert_eq!((found.verdict, &added[..]), (Verdict::Missing, &["solar-flare"; 3][..]), "{}", found.reason);
    let mut epochs: Vec<f64> =
        found.parameters.iter().filter(|fitted| fitted.key.ends_with(".t_yr")).map(|fitted| fitted.value).collect();
    epochs.sort_by(f64::total_cmp);
    // As drawn, to less than a sampling interval.
    for (found, drawn) in epochs.iter().zip([0.72, 1.51, 3.73]) {
        assert!((found - drawn).abs() < 0.2, "{found} for {drawn} yr");
    }
    // The same effect in place of each of three equal ones is mentioned once.
    let mut notes: Vec<String> = found.notes.iter().map(|note| note.to_string()).collect();
    let all = notes.len();
    notes.sort();
    notes.dedup();
    assert_eq!(notes.len(), all, "{notes:?}");
}

/// The zero levels of five exposures are off by several of the rows' own errors, which `sigma_common` says: that is no scatter from row to row.
/// Nothing is missing in one table, and a preflash in the other.
#[test]
fn errors_in_common_are_no_larger_errors_of_rows() {
    let mission = Mission::read("tests/like_flown/exposures.toml").unwrap();
    for (name, verdict, missing) in
        [("exposures", Verdict::Complete, None), ("exposures_preflash", Verdict::Missing, Some("preflash"))]
    {
        let data = DataSet::read(format!("tests/like_flown/{name}.csv"), &mission).unwrap();
        let options = Options { free: mission.fit.free.clone(), stability: false, ..Options::default() };
        let found = diagnose(&mission, &[data], &options, &SILENT).unwrap();
        let steps: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
        assert_eq!((found.verdict, steps), (verdict, Vec::from_iter(missing)), "{name}: {}", found.reason);
        assert_eq!((found.noise[0].scale, found.noise[0].correlation), (1.0, 0.0), "{name}");
    }
}
