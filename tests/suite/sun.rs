//! The Sun after the last maximum that is known: it goes on, every output says so, and the error budget has its uncertainty.

use std::fs;
use std::process::Command;

use ctiplan::evaluate;
use ctiplan::mission::Mission;
use ctiplan::study::Study;
use ctiplan::study::error_budget::ErrorBudget;
use serde_json::Value;

/// SNAP launched on a day, under the cycle, with one galaxy, coarsely.
fn launched(day: &str) -> Mission {
    let text = include_str!("../../missions/snap_l2.toml")
        .replace("launch = 2009-01-01", &format!("launch = {day}"))
        .replace("model = \"constant\"", "model = \"solar-cycle\"")
        .replace("[requirement]", "[accuracy]\nsubpixel_grid = 1\n[requirement]");
    let mut mission = Mission::parse(&text).unwrap();
    mission.galaxies.truncate(1);
    mission
}

fn run(arguments: &[&str]) -> String {
    let done = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap();
    assert!(done.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8(done.stdout).unwrap()
}

#[test]
fn no_mission_is_without_a_sun_for_long() {
    // Five years are longer than the four quiet ones: some dose comes, whenever it is launched.
    for year in 2026..2120 {
        let evaluation = evaluate(&launched(&format!("{year}-01-01"))).unwrap();
        assert!(evaluation.end().dose_mev_g > 0.0, "{year}");
        let known = year < 2029;
        assert_eq!(evaluation.warnings.is_empty(), known, "{year}: {:?}", evaluation.warnings);
    }
    // A cycle later everything is the same.
    let dose = |year: i32| evaluate(&launched(&format!("{year}-01-01"))).unwrap().end().dose_mev_g;
    assert!((dose(2050) / dose(2061) - 1.0).abs() < 1e-2);
}

#[test]
fn every_output_says_which_maxima_it_assumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mission.toml");
    fs::write(&path, launched("2040-01-01").to_toml()).unwrap();
    let mission = path.to_str().unwrap();
    let said = "2046.8 +- 1.4";
    for arguments in [
        &["evaluate", mission][..],
        &["compare", mission, "--launch", "2040-01-01,2042-01-01"],
        &["dose", mission],
        &["study", "clock", mission],
        &["study", "distance", mission],
        &["study", "launch", mission, "--launch", "2040-01-01,2042-01-01"],
    ] {
        let text = run(arguments).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(said), "{arguments:?}: {text}");
        let json: Value = serde_json::from_str(&run(&[arguments, &["--json"]].concat())).unwrap();
        let warnings = json["warnings"].as_array().unwrap();
        assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains(said)), "{arguments:?}: {warnings:?}");
    }
    let grid = folder.path().join("grid.toml");
    fs::write(&grid, "mission = \"mission.toml\"\noutputs = [\"dose_mev_g\"]\n[axes]\nreadout.transfers = [1650]\n")
        .unwrap();
    let table = folder.path().join("points.csv");
    run(&["sweep", grid.to_str().unwrap(), "--output", table.to_str().unwrap()]);
    assert!(fs::read_to_string(&table).unwrap().contains(said));
}

#[test]
fn an_error_budget_draws_the_maxima_that_are_not_known() {
    let mission = launched("2042-01-01");
    let asked = ErrorBudget { draws: 100, horizon_yr: Some(5.0), ..Default::default() };
    let inputs = asked.study(&mission, &|| {}).unwrap().own.inputs;
    // The maxima of 2035.8 and 2046.8 are drawn with the Sun: they are no inputs besides.
    let sun = inputs.iter().find(|input| input.name == "solar-protons").expect("a Sun that is drawn");
    assert!(sun.share_percent.unwrap() > 50.0, "{sun:?}");
    assert!(inputs.iter().all(|input| !input.name.starts_with("solar maximum")));
}
