//! One chain, and nothing goes round it: whatever asks for the dose, the traps or the change of shape of a mission is told the
//! same, for every effect of the catalogue and every pair of them.

use std::fs;
use std::path::Path;
use std::process::Command;

use ctiplan::effect::CATALOGUE;
use ctiplan::evaluate;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::predict::{Question, predict};
use ctiplan::physics::observable::Observable;
use ctiplan::plan::dose;
use ctiplan::study::Study;
use ctiplan::study::error_budget::ErrorBudget;
use ctiplan::study::launch::Launch;
use ctiplan::study::shielding::{self, Shielding};
use serde_json::Value;

/// SNAP behind its shield; one galaxy, coarsely.
fn base(model: &str) -> Mission {
    let text = include_str!("../../missions/snap_l2_shielded.toml")
        .replace("model = \"solar-cycle\"", &format!("model = \"{model}\""))
        .replace("geometry = \"slab\"", "geometry = \"sphere\"")
        .replace("thickness_mm = 13.6", "thickness_mm = 39.5")
        .replace("[requirement]", "[accuracy]\nsubpixel_grid = 1\n[requirement]");
    let mut mission = Mission::parse(&text).unwrap();
    mission.galaxies.truncate(1);
    mission.requirement.galaxy = mission.galaxies[0].name.clone();
    mission
}

/// The mission with these effects, each as in its example.
fn with(model: &str, kinds: &[usize]) -> Mission {
    let base = base(model);
    let mut mission = base.clone();
    for kind in kinds {
        let entry = &CATALOGUE[*kind];
        let mut table = (entry.example)(&base);
        if entry.card.kind == "formula" {
            // Without the time, at which a formula would be looked at 240 times.
            table = toml::from_str("target = \"value\"\nexpression = \"value * 1.02\"").unwrap();
        }
        mission.effects.insert(entry.card.kind.into(), toml::Value::Table(table));
    }
    Mission::parse(&mission.to_toml()).unwrap()
}

fn alone_and_in_pairs() -> Vec<Vec<usize>> {
    let all = 0..CATALOGUE.len();
    let pairs = all.clone().flat_map(|one| (one + 1..CATALOGUE.len()).map(move |other| vec![one, other]));
    [vec![]].into_iter().chain(all.map(|one| vec![one])).chain(pairs).collect()
}

fn name(kinds: &[usize]) -> String {
    kinds.iter().map(|kind| CATALOGUE[*kind].card.kind).collect::<Vec<_>>().join(" and ")
}

/// What was told, and by whom.
type Evidence = Vec<(&'static str, f64)>;

/// Everything that tells a dose (MeV/g) and |Δe| of the judged galaxy at the end of a mission.
fn doses_and_shapes(mission: &Mission) -> (Evidence, Evidence) {
    let survey = dose::survey(mission, &[]).unwrap();
    let evaluation = evaluate(mission).unwrap();
    let end = evaluation.model.conditions(mission.mission.duration_yr);
    let predicted = |observable: Observable, galaxy: Option<usize>| {
        predict(&Model::new(mission), &[Question { observable, at: &end, galaxy, species: None }]).unwrap()[0]
    };
    let launch = Launch { launches: Some(vec![mission.mission.launch.0]), ..Default::default() };
    let (launch, shielded) = (ask(&launch, mission), shielded(mission));
    let (launch, shielded) = (&launch.launches[0], &shielded.cases[0]);
    let change = evaluation.end().galaxies[0].unwrap();
    let doses = vec![
        ("evaluate", evaluation.end().dose_mev_g),
        ("dose", survey.total_mev_g),
        ("dose, sum of years", survey.years.iter().map(|year| year.dose_mev_g).sum()),
        ("dose, last of the curve", survey.over_time.last().unwrap().1),
        ("predict", predicted(Observable::Dose, None)),
        ("study launch", launch.dose_mev_g),
        ("study shielding", shielded.dose_mev_g),
    ];
    let shapes = vec![
        ("evaluate", change.magnitude()),
        ("predict", predicted(Observable::DeltaE1, Some(0)).hypot(change.delta_e2)),
        ("study launch", launch.delta_e.unwrap()),
        ("study shielding", shielded.delta_e.unwrap()),
    ];
    (doses, shapes)
}

fn ask<S: Study>(study: &S, mission: &Mission) -> S::Results {
    study.study(mission, &|| {}).unwrap_or_else(|error| panic!("{error}"))
}

/// Behind the mission's own shield, at its own confidence.
fn shielded(mission: &Mission) -> shielding::Results {
    let own = mission.shielding.as_ref().unwrap();
    let confidences = vec![mission.environment.confidence];
    ask(&Shielding { thicknesses_mm: vec![own.thickness_mm.unwrap()], confidences, probability: None }, mission)
}

/// Trade studies are read out to 3e-3 of the packets (`accuracy.rs`: 30 and 100 times coarser than 1e-6). Shapes are ten times as
/// accurate, in each of up to two registers.
const OF_SHAPES: f64 = 6e-4;

fn agree(of: &str, told: &[(&str, f64)], tolerance: f64) {
    let (who, expected) = told[0];
    for (other, value) in &told[1..] {
        assert!(
            (value - expected).abs() <= tolerance * expected.abs(),
            "{of}: {value} by {other}, {expected} by {who}"
        );
    }
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn all_tell_the_same_dose_and_change_of_shape() {
    for kinds in alone_and_in_pairs() {
        let (doses, shapes) = doses_and_shapes(&with("solar-cycle", &kinds));
        agree(&name(&kinds), &doses, 1e-9);
        agree(&name(&kinds), &shapes, OF_SHAPES);
    }
}

/// The effect and the model of one name are one thing, however quantiles add up.
#[test]
fn the_solar_cycle_is_the_same_as_an_effect_and_as_a_model() {
    let cycle = CATALOGUE.iter().position(|entry| entry.card.kind == "solar-cycle").unwrap();
    for accumulate in ["yearly", "mission"] {
        let set = |mission: Mission| mission.with(&[("environment.accumulate".into(), accumulate.into())]).unwrap();
        let [model, effect] =
            [set(with("solar-cycle", &[])), set(with("constant", &[cycle]))].map(|mission| Model::new(&mission));
        for t_yr in [0.3, 2.0, 3.7, 5.0] {
            assert_eq!(model.dose_mev_g(t_yr), effect.dose_mev_g(t_yr), "{accumulate}, {t_yr} yr");
        }
    }
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn an_error_budget_starts_from_the_mission() {
    for kind in 0..CATALOGUE.len() {
        let mission = with("solar-cycle", &[kind]);
        let study = ask(&ErrorBudget { draws: 40, horizon_yr: Some(5.0), ..Default::default() }, &mission);
        let nominal = study.own.nominal.delta_e.unwrap();
        let expected = evaluate(&mission).unwrap().end().galaxies[0].unwrap().magnitude();
        // Draws of uncertainties of per cents are read out to 1e-3.
        assert!((nominal / expected - 1.0).abs() < 2e-3, "{}: {nominal}, {expected}", name(&[kind]));
    }
}

/// The commands, as users meet them.
#[test]
fn commands_tell_the_same_dose_traps_and_change_of_shape() {
    let folder = tempfile::tempdir().unwrap();
    let frame = frame(folder.path());
    let cases: Vec<Vec<usize>> = (0..CATALOGUE.len()).map(|kind| vec![kind]).collect();
    let mut paths = Vec::new();
    for kinds in &cases {
        let path = folder.path().join(format!("{}.toml", name(kinds)));
        // At a constant rate, so that the solar cycle is an effect.
        fs::write(&path, with("constant", kinds).to_toml()).unwrap();
        paths.push(path.to_str().unwrap().to_string());
    }
    let grid = folder.path().join("grid.toml");
    let missions: Vec<String> = cases.iter().map(|kinds| format!("\"{}.toml\"", name(kinds))).collect();
    let line = format!("mission = [{}]\noutputs = [\"dose_mev_g\", \"delta_e\"]\n", missions.join(", "));
    fs::write(&grid, format!("{line}[axes]\nreadout.transfers = [1650]\n")).unwrap();
    let table = folder.path().join("points.csv");
    run(&["sweep", grid.to_str().unwrap(), "--output", table.to_str().unwrap()]);
    let text = fs::read_to_string(&table).unwrap();
    let points = csv(&text);

    for ((kinds, path), point) in cases.iter().zip(&paths).zip(&points) {
        let of = name(kinds);
        let evaluation = json(&["evaluate", path]);
        let end = evaluation["years"].as_array().unwrap().last().unwrap();
        let (e1, e2) = (&end["galaxies"][0]["delta_e1"], &end["galaxies"][0]["delta_e2"]);
        let delta_e = number(e1).hypot(number(e2));
        let compared = &json(&["compare", path, &paths[0]])["scenarios"][0];
        let dose = json(&["dose", path]);
        let trailed = folder.path().join(format!("{of}.fits"));
        let at = number(&evaluation["duration_yr"]).to_string();
        let read = json(&["readout", &frame, trailed.to_str().unwrap(), "--mission", path, "--at", &at]);
        agree(
            &of,
            &[
                ("evaluate", number(&end["dose_mev_g"])),
                ("dose", number(&dose["total_mev_g"])),
                ("compare", number(&compared["dose_mev_g"])),
                ("sweep", point("dose_mev_g")),
                ("readout", number(&read["dose_mev_g"])),
            ],
            1e-9,
        );
        agree(
            &of,
            &[("evaluate", delta_e), ("compare", number(&compared["delta_e"])), ("sweep", point("delta_e"))],
            OF_SHAPES,
        );
        assert_eq!(end["traps"], read["traps"], "{of}");
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn run(arguments: &[&str]) -> String {
    let done = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap();
    assert!(done.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8(done.stdout).unwrap()
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&run(&[arguments, &["--json"]].concat())).unwrap()
}

/// The rows of a table, each as the number in a column.
fn csv(text: &str) -> Vec<impl Fn(&str) -> f64 + use<>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let of = |row: csv::StringRecord| {
        let header = header.clone();
        move |key: &str| row[header.iter().position(|column| column == key).unwrap()].parse().unwrap()
    };
    rows.into_iter().map(of).collect()
}

/// A small frame in electrons.
fn frame(folder: &Path) -> String {
    let card = |text: &str| format!("{text:<80}");
    let cards = [
        "SIMPLE  =                    T",
        "BITPIX  =                  -64",
        "NAXIS   =                    2",
        "NAXIS1  =                    1",
        "NAXIS2  =                    4",
        "BUNIT   = 'electron'",
        "END",
    ];
    let mut bytes = cards.map(card).concat().into_bytes();
    bytes.resize(2880, b' ');
    bytes.extend([500.0_f64, 20.0, 20.0, 20.0].iter().flat_map(|charge_e| charge_e.to_be_bytes()));
    bytes.resize(2 * 2880, 0);
    let path = folder.join("frame.fits");
    fs::write(&path, bytes).unwrap();
    path.to_str().unwrap().to_string()
}
