//! All budgets of a requirement judged together: by `compare`, sweeps and studies.

use std::fs;
use std::process::Command;

use ctiplan::evaluate;
use ctiplan::mission::Mission;
use ctiplan::plan::date_distribution::Confidence;
use ctiplan::plan::evaluate::Evaluation;
use ctiplan::plan::judgement::Limited;
use ctiplan::plan::scenario::{Axis, Candidate, Cause, Comparison, Criterion, compare};
use ctiplan::study::Study;
use ctiplan::study::clock::Clock;
use ctiplan::study::launch::Launch;
use ctiplan::study::shielding::Shielding;
use ctiplan::warning::Warning;
use serde_json::Value;
use tempfile::TempDir;

const SHIELDED: &str = include_str!("../../missions/snap_l2_shielded.toml");

/// SNAP behind a shield with three galaxies and these requirements, quickly evaluated; the folder holds its table.
fn mission(requirement: &str) -> (TempDir, Mission) {
    let folder = TempDir::new().unwrap();
    fs::write(
        folder.path().join("galaxies.csv"),
        "flux_e,half_light_px,e1\n3000,1.0,0.3\n5000,1.5,-0.2\n2000,0.8,0.1\n",
    )
    .unwrap();
    let text = SHIELDED
        .replace("delta_e = 1.0e-3", requirement)
        .replace("[requirement]", "[population]\ntable = \"galaxies.csv\"\n\n[requirement]");
    let path = folder.path().join("mission.toml");
    fs::write(&path, text).unwrap();
    let settings = [
        ("accuracy.subpixel_grid".to_string(), 1.into()),
        ("accuracy.noise_realisations".to_string(), 0.into()),
        ("mission.launch".to_string(), toml::Value::Datetime("2011-01-01".parse().unwrap())),
    ];
    let mission = Mission::read(&path).unwrap().with(&settings).unwrap();
    (folder, mission)
}

/// |c| and |m| at the end of the mission.
fn biases(mission: &Mission) -> [f64; 2] {
    let found = evaluated(mission).population.unwrap();
    let end = found.years.last().unwrap().1;
    [end.c, end.m].map(|members| members[0].value.abs().max(members[1].value.abs()))
}

fn evaluated(mission: &Mission) -> Evaluation {
    evaluate(mission).unwrap().with_population(mission.accuracy.seed).unwrap()
}

fn compared(mission: &Mission, axis: &str, values: &str, confidence: Option<Confidence>) -> Comparison {
    let candidates = [Candidate { file: "mission.toml".into(), mission: mission.clone() }];
    compare(&candidates, &[Axis::parse(axis, values).unwrap()], confidence, || {}).unwrap()
}

/// A requirement that m breaks first, halfway.
fn broken_by_m() -> (TempDir, Mission) {
    let [c, m] = biases(&mission("delta_e = 1.0e-1\nc = 1.0e-1").1);
    mission(&format!("delta_e = 1.0e-1\nc = {}\nm = {}", 2.0 * c, 0.5 * m))
}

#[test]
fn the_verdict_is_that_of_the_first_budget_and_says_which_one_that_is() {
    let (_folder, mission) = broken_by_m();
    let expected = evaluated(&mission).population.unwrap().m.unwrap().uncorrected.t_yr.unwrap();
    let found = compared(&mission, "readout.transfers", "1650,300", None);
    let judgement = &found.scenarios[0].judgement;
    let [first, corrected] = judgement.first();
    assert_eq!((first, corrected), (Some((Limited::M, expected)), None));
    assert!((judgement.used().unwrap() - 2.0).abs() < 0.01, "{:?}", judgement.used());
    assert_eq!((found.ranking.best.clone(), found.ranking.by), (vec![1], Some(Criterion::Uncorrected)));
    let json = serde_json::to_value(&found).unwrap();
    let one = &json["scenarios"][0];
    assert_eq!((&one["first"]["exceeded_by"], one["first"]["exceeded_t_yr"].as_f64()), (&"m".into(), Some(expected)));
    assert!(one["first"]["c_at_end"].as_f64().unwrap() > 0.0 && one["uncorrected"]["exceeded"] == false);
    // Studies say the same.
    let launch = Launch { launches: Some(vec![mission.mission.launch.0]), ..Launch::default() };
    let launched = launch.study(&mission, &|| {}).unwrap();
    let clock = Clock { line_times_ms: Some(vec![mission.readout.line_time_ms]), confidence: None };
    let clocked = clock.study(&mission, &|| {}).unwrap();
    for judged in [&launched.launches[0].judged, clocked.line_times[0].judged.as_ref().unwrap()] {
        assert_eq!((judged.exceeded_by, judged.corrected_by), (Some(Limited::M), None));
        // Studies read out more coarsely.
        assert!((judged.exceeded_t_yr.unwrap() - expected).abs() < 0.02, "{judged:?} {expected}");
    }
}

#[test]
fn probabilities_are_those_of_all_budgets_with_or_without_one_on_the_galaxy() {
    let (_folder, mission) = broken_by_m();
    let confidence = Confidence { probability: 0.7, samples: 400 };
    let met = |mission: &Mission| {
        let found = compared(mission, "readout.transfers", "1650", Some(confidence));
        found.scenarios[0].judgement.distribution.clone().unwrap()
    };
    let all = met(&mission);
    let mut alone = mission.clone();
    (alone.requirement.delta_e, alone.requirement.c) = (0.999, None);
    let alone = met(&alone);
    // The galaxy and c are far from their limits.
    assert_eq!(all.requirement()[0].probability_exceeded, alone.requirement()[0].probability_exceeded);
    assert!(alone.m.is_some() && alone.c.is_none() && alone.requirement()[0].probability_exceeded > 0.05, "{alone:?}");
    // Studies tell the same, with errors, and rank by it.
    let clock = Clock { line_times_ms: Some(vec![25.0, 10.0]), confidence: Some(confidence) };
    let found = clock.study(&mission, &|| {}).unwrap();
    let judged = found.line_times[0].judged.as_ref().unwrap();
    let expected = 100.0 * (1.0 - all.requirement()[0].probability_exceeded);
    // A draw or two lie between the dates of two accuracies.
    assert!((judged.met_percent.unwrap() - expected).abs() < 1.0, "{judged:?} {expected}");
    assert!(judged.met_error_percent.unwrap() > 0.0 && found.ranking.is_some());
    let shields = Shielding { thicknesses_mm: vec![5.0, 20.0], confidences: vec![0.9], probability: Some(confidence) };
    let found = shields.study(&mission, &|| {}).unwrap();
    let met = |place: usize| found.drawn[place].judged.met_percent.unwrap();
    assert!(met(0) < met(1) && met(2) < met(3), "thicker shields are surer: {:?}", found.drawn);
}

#[test]
fn a_sweep_records_biases_and_the_first_budget() {
    let (folder, mission) = broken_by_m();
    let grid = r#"
mission = "mission.toml"
outputs = ["c", "m", "exceeded_yr", "exceeded_m_yr", "exceeded_c_yr"]

[axes]
readout.transfers = [1650]
accuracy.subpixel_grid = [1]
mission.launch = [2011-01-01]
"#;
    fs::write(folder.path().join("grid.toml"), grid).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
        .args(["sweep", "grid.toml", "--output", "swept.csv"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = fs::read_to_string(folder.path().join("swept.csv")).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let (header, row) = (lines.next().unwrap(), lines.next().unwrap());
    let value = |name: &str| {
        let place = header.split(',').position(|column| column.trim_matches('"') == name).unwrap();
        row.split(',').nth(place).unwrap().trim_matches('"').parse::<f64>().ok()
    };
    let [c, m] = biases(&mission);
    for (name, expected) in [("c", c), ("m", m)] {
        // Sweeps read out more coarsely.
        assert!((value(name).unwrap() / expected - 1.0).abs() < 0.01, "{name}: {text}");
    }
    assert_eq!((value("exceeded_yr"), value("exceeded_c_yr")), (value("exceeded_m_yr"), None));
    assert!(value("exceeded_m_yr").is_some());
}

#[test]
fn what_cannot_be_told_of_draws_is_refused() {
    let (folder, _) = mission("c = 1.0e-3");
    let path = folder.path().join("mission.toml");
    let output = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
        .args([
            "study",
            "launch",
            path.to_str().unwrap(),
            "--launch",
            "2011-01-01",
            "--probability",
            "0.99",
            "--samples",
            "20",
        ])
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).to_string();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("too few"), "{message}");
    let json: Value = serde_json::json!(Limited::DeltaE);
    assert_eq!(json, "delta_e");
}

/// A change that no trap of the image makes is not shared out among its species.
#[test]
fn what_registers_and_amplifiers_do_is_named_as_the_cause() {
    let plain = Mission::parse(include_str!("../../missions/snap_l2.toml")).unwrap();
    let settings = [("accuracy.subpixel_grid".to_string(), 1.into())];
    let plain = plain.with(&settings).unwrap();
    let bounce = toml::Table::from_iter([("fraction".to_string(), 0.05.into()), ("length_px".to_string(), 2.0.into())]);
    let mut trailed = plain.clone();
    trailed.effects.insert("signal-bounce".into(), bounce.into());
    let candidates = [plain, trailed].map(|mission| Candidate { file: "snap.toml".into(), mission });
    let found = compare(&candidates, &[], None, || {}).unwrap();
    let only = Cause::Effects { only_better: Vec::new(), only_worse: vec!["signal-bounce".into()] };
    assert!(found.why.contains(&only), "{:?}", found.why);
    let beside =
        found.why.iter().find_map(|cause| if let Cause::Beside { share } = cause { Some(*share) } else { None });
    let [best, worst] = beside.unwrap();
    assert!(best < 1e-9 && worst > 0.9, "{best} {worst}");
    assert!(!found.why.iter().any(|cause| matches!(cause, Cause::Species { .. })), "{:?}", found.why);
}

#[test]
fn traps_that_stay_filled_are_warned_of_unless_the_exposures_before_are_described() {
    let warned = |more: &str| {
        let text = include_str!("../../missions/snap_l2.toml").replace("release_ms = 5000.0", "release_ms = 1.0e5");
        assert!(text.contains("1.0e5"));
        let mission = Mission::parse(&format!("{text}{more}\n[accuracy]\nsubpixel_grid = 1\n")).unwrap();
        evaluate(&mission).unwrap().warnings.iter().any(|warning| matches!(warning, Warning::NeverReleases { .. }))
    };
    assert!(warned(""));
    assert!(!warned(
        "\n[survey]\nexposure_s = 300.0\nslew_s = 30.0\n[survey.persistence]\nscene = \"same\"\nexposures = 1\nrows = 2000\n"
    ));
}

/// A rate is that of the growth: traps that are there at launch do not grow.
#[test]
fn the_mean_rate_does_not_count_what_is_there_at_launch() {
    let rate = |more: &str| {
        let text = include_str!("../../missions/snap_l2.toml");
        let mission = Mission::parse(&format!("{text}\n{more}[accuracy]\nsubpixel_grid = 1\n")).unwrap();
        evaluate(&mission).unwrap().verdict.mean_rate_per_yr.unwrap()
    };
    let plain = rate("");
    let with_traps = rate("[effects.prelaunch-traps]\nCi = 0.02\nVV = 0.02\nCO = 0.02\n\n");
    // Nearly as many traps at launch as at the end: |Δe| bends by a few per cent. With what they do themselves it would be nearly twice
    // as much.
    assert!((with_traps / plain - 1.0).abs() < 0.05, "{with_traps} {plain}");
}

/// What is not limited has no verdict, no margin, and no say in a ranking.
#[test]
fn a_mission_that_limits_shear_biases_alone_has_no_budget_of_one_galaxy() {
    let (folder, _) = mission("delta_e = 1.0e-1\nc = 1.0e-1");
    let path = folder.path().join("mission.toml");
    let text = fs::read_to_string(&path).unwrap().replace("delta_e = 1.0e-1\n", "");
    fs::write(&path, text).unwrap();
    let alone = Mission::read(&path).unwrap().with(&[("accuracy.subpixel_grid".into(), 1.into())]).unwrap();
    let json = serde_json::to_value(evaluated(&alone)).unwrap();
    assert_eq!(json["budget"]["delta_e"], Value::Null);
    assert_eq!(json["budget"]["uncorrected"], Value::Null);
    assert_eq!(json["budget"]["c"]["uncorrected"]["exceeded"], Value::Bool(false));
    // Detectors that differ in |Δe| and not in what is limited: the galaxies of the population make transfers of their own.
    fs::write(
        folder.path().join("galaxies.csv"),
        "flux_e,half_light_px,e1,transfers\n3000,1.0,0.3,700\n5000,1.5,-0.2,700\n2000,0.8,0.1,700\n",
    )
    .unwrap();
    let alone = Mission::read(&path).unwrap().with(&[("accuracy.subpixel_grid".into(), 1.into())]).unwrap();
    let found = compared(&alone, "readout.transfers", "800,1650", None);
    assert_eq!(found.scenarios[0].judgement.budgets.len(), 1);
    let [few, many] = [0, 1].map(|place| found.scenarios[place].delta_e.unwrap());
    assert!(many > 1.5 * few, "{few} {many}");
    assert_eq!(found.ranking.by, None, "{:?}", found.ranking);
}
