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

/// A detector before any irradiation loses charge: one row of four, 9 sigma off. That is neither noise nor errors that are too small
/// by as much: traps of launch are named.
#[test]
fn few_rows_far_from_the_model_are_not_noise() {
    let found = diagnosed("irradiated", "irradiated_few");
    assert_eq!(found.steps.first().map(|step| step.effect.as_str()), Some("prelaunch-traps"), "{}", found.reason);
    assert!(found.baseline.chi2 > 50.0, "{}", found.reason);
}

/// Damage at launch is a constant, and so is an offset of the measurement: one of most of the values, hundreds of times their errors, is
/// no offset that was overlooked.
#[test]
fn a_pedestal_that_is_most_of_the_values_is_not_passed_over() {
    let found = diagnosed("launch_damage", "launch_damage");
    let named = found.steps.iter().map(|step| &step.effect).chain(found.alternatives.iter().flatten());
    assert!(named.into_iter().any(|effect| effect == "prelaunch-traps"), "{}", found.reason);
    assert!(matches!(found.verdict, Verdict::Missing | Verdict::Ambiguous), "{}", found.reason);
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
    let Reason::BetterLaw { expression, .. } = &found.reason else { panic!("{}", found.reason) };
    let named = |note: &Note| matches!(note, Note::CoincidesWith { condition, .. } if condition == "sci");
    assert!(expression.contains("sci") || found.notes.iter().any(named), "{expression}, {:?}", found.notes);
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

/// Two events look like scatter from row to row, or like a bend: nothing is certain, and the events have a share of the evidence.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn two_events_in_few_rows_are_not_decided_and_not_passed_over() {
    let found = diagnosed("cooled", "two_events");
    assert_eq!(found.verdict, Verdict::Ambiguous, "{}", found.reason);
    let shares = &found.ranking.as_ref().unwrap().shares;
    let of_events = shares.iter().find(|share| share.effect == "solar-flare").unwrap();
    assert!(of_events.share > 0.3, "{shares:?}");
}

/// A flare and a cycle of the dose rate leave hardly more than noise of three events. The best evidence is for three; the third is not decided
/// against errors that are correlated in time.
#[test]
#[ignore = "slow: .ci/run runs it"]
fn three_events_are_not_taken_for_one_and_a_cycle() {
    let found = diagnosed("three_steps", "three_steps");
    let added: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
    assert!(added.len() >= 2 && added.iter().all(|effect| *effect == "solar-flare"), "{}", found.reason);
    let best = &found.ranking.as_ref().unwrap().sets[0].effects;
    assert_eq!(best[..], ["solar-flare"; 3].map(str::to_string));
    // As drawn, to less than a sampling interval.
    let parameters = found.steps.iter().flat_map(|step| &step.parameters);
    for epoch in parameters.filter(|fitted| fitted.key.ends_with(".t_yr")) {
        assert!([0.72, 1.51, 3.73].iter().any(|drawn| (epoch.value - drawn).abs() < 0.2), "{epoch:?}");
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
