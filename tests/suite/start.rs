//! What stands at the beginning: a mission to start from, a schema for editors, completions, manual pages.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn ctiplan(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap()
}

fn stdout(arguments: &[&str]) -> String {
    let output = ctiplan(arguments);
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "", "{arguments:?}");
    assert!(output.status.success(), "{arguments:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Whether a program is there.
fn there(program: &str) -> bool {
    let there = Command::new(program).arg("--version").output().is_ok();
    if !there {
        crate::skipped::for_want_of(program);
    }
    there
}

#[test]
fn init_writes_a_mission_that_can_be_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new.toml").display().to_string();
    let said = stdout(&["init", &path]);
    assert_eq!(said, format!("wrote {path}: a mission to start from\nnext: ctiplan evaluate {path}\n"));
    let json: Value = serde_json::from_str(&stdout(&["evaluate", &path, "--json"])).unwrap();
    let year = &json["years"][4];
    assert!(year["dose_mev_g"].as_f64().unwrap() > 0.0 && year["galaxies"][0]["delta_e1"].as_f64().unwrap() < 0.0);
    // It is the user's from now on.
    fs::write(&path, "mine").unwrap();
    let refused = ctiplan(&["init", &path]);
    assert_eq!((refused.status.code(), fs::read_to_string(&path).unwrap()), (Some(2), "mine".into()));
    assert!(String::from_utf8(refused.stderr).unwrap().contains("the file exists already\n  help: give another name"));
    stdout(&["init", &path, "--overwrite"]);
    assert!(fs::read_to_string(&path).unwrap().starts_with("# A mission to start from"));
}

/// TOML as editors show it to a schema: dates are words.
fn as_json(value: &toml::Value) -> Value {
    match value {
        toml::Value::Datetime(date) => date.to_string().into(),
        toml::Value::Array(members) => members.iter().map(as_json).collect(),
        toml::Value::Table(members) => {
            Value::Object(members.iter().map(|(key, value)| (key.clone(), as_json(value))).collect())
        }
        plain => serde_json::to_value(plain).unwrap(),
    }
}

fn files(folder: &str) -> Vec<std::path::PathBuf> {
    let all = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = all.filter(|path| path.extension().is_some_and(|extension| extension == "toml")).collect();
    files.sort();
    assert!(!files.is_empty(), "{folder}");
    files
}

/// What is wrong with these is not the kind or the range of one value; dates are words to a schema, with quotes and without.
const BEYOND_A_SCHEMA: [&str; 55] = [
    "clock_dwell_for_each_step",
    "clock_merges_packets",
    "clock_of_too_few_steps",
    "clock_phase_above_the_last",
    "clock_skips_a_phase",
    "effect_capture_within_the_notch",
    "effect_notch_above_well",
    "effect_same_name",
    "effect_species_unknown",
    "fit_key_of_absent_effect",
    "fit_key_of_which_flare",
    "flux_and_snr",
    "formula_broken",
    "formula_dose_of_temperature",
    "formula_sign_and_power",
    "formula_species_unknown",
    "formula_target_unknown",
    "formula_unused_parameter",
    "history_that_is_not_there",
    "history_without_a_file",
    "launch_before_the_maxima",
    "launch_in_quotes",
    "layer_without_a_thickness",
    "low_orbit_in_the_papers_model",
    "low_orbit_without_elements",
    "more_active_years_than_years",
    "no_dose",
    "no_such_galaxy",
    "notch_above_full_well",
    "orbit_said_twice",
    "orbit_without_inclination",
    "perigee_above_apogee",
    "persistence_of_too_few_rows",
    "persistence_with_a_store",
    "persistence_with_finite_capture",
    "rate_given_and_derived",
    "reference_missing",
    "reference_twice",
    "reference_without_energy",
    "same_name_twice",
    "second_notch",
    "shield_too_thin",
    "shield_twice",
    "shield_without_a_thickness",
    "snr_without_aperture",
    "solar_maxima_overlap",
    "solar_maximum_twice",
    "source_twice",
    "source_unknown",
    "sources_in_the_papers_model",
    "sources_none",
    "store_of_too_few_rows",
    "store_with_carried_traps",
    "surface_above_full_well",
    "unknown_fit_key",
];

#[test]
fn the_schema_knows_good_missions_from_bad_ones() {
    let schema: Value = serde_json::from_str(&stdout(&["schema"])).unwrap();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    assert!(jsonschema::meta::is_valid(&schema));
    let validator = jsonschema::options().should_validate_formats(true).build(&schema).unwrap();
    let faults = |text: &str| {
        let mission = as_json(&toml::Value::Table(text.parse().unwrap()));
        validator.iter_errors(&mission).map(|error| format!("{}: {error}", error.instance_path())).collect::<Vec<_>>()
    };
    let good = ["missions", "docs/tutorial", "docs/sweeps", "tests/images"].map(files).concat();
    let missions = good.iter().map(|path| fs::read_to_string(path).unwrap()).filter(|text| text.contains("[mission]"));
    for text in missions.chain([ctiplan::mission_file::template()]) {
        assert_eq!(faults(&text), Vec::<String>::new(), "{text}");
    }
    let mut passed = Vec::new();
    for path in files("missions/broken") {
        let text = fs::read_to_string(&path).unwrap();
        if text.parse::<toml::Table>().is_ok() && faults(&text).is_empty() {
            passed.push(path.file_stem().unwrap().to_str().unwrap().to_string());
        }
    }
    assert_eq!(passed, BEYOND_A_SCHEMA);
}

#[test]
fn the_schema_says_what_the_definitions_say() {
    let schema = ctiplan::mission_file::schema();
    for key in ctiplan::mission::keys::KEYS {
        let mut place = &schema;
        for part in key.path.split('.') {
            place = &place["properties"][part.trim_end_matches("[]")];
            place = if part.ends_with("[]") { &place["items"] } else { place };
        }
        let description = place["description"].as_str().unwrap_or_else(|| panic!("{} is not in the schema", key.path));
        assert!(description.starts_with(key.what) && description.ends_with(key.unit), "{}: {description}", key.path);
    }
    let effects = schema["properties"]["effects"]["properties"].as_object().unwrap();
    let kinds = ctiplan::effect::CATALOGUE.iter().map(|entry| entry.card.kind);
    assert!(effects.keys().map(String::as_str).eq(kinds));
}

#[test]
fn bash_completes_commands_and_options() {
    if !there("bash") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("ctiplan.bash");
    fs::write(&script, stdout(&["completions", "bash"])).unwrap();
    let bash = |arguments: &[&str]| Command::new("bash").args(arguments).output().unwrap();
    let read = bash(&["-n", script.to_str().unwrap()]);
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let completed = |words: &[&str]| {
        let (last, before) = (words.last().unwrap(), words[words.len() - 2]);
        let asked = format!(
            "source {}; COMP_WORDS=({}); COMP_CWORD={}; _ctiplan ctiplan '{last}' '{before}'; echo \"${{COMPREPLY[*]}}\"",
            script.display(),
            words.join(" "),
            words.len() - 1
        );
        let output = bash(&["-c", &asked]);
        String::from_utf8(output.stdout).unwrap().trim().to_string()
    };
    assert_eq!(completed(&["ctiplan", "eval"]), "evaluate");
    assert_eq!(completed(&["ctiplan", "study", "pocket"]), "pocket-pumping");
    assert_eq!(completed(&["ctiplan", "evaluate", "--mon"]), "--monte-carlo");
    for shell in ["zsh", "fish", "elvish", "powershell"] {
        assert!(stdout(&["completions", shell]).contains("pocket-pumping"), "{shell}");
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let man = folder.path().join("man1");
    stdout(&["man", man.to_str().unwrap()]);
    for page in ["ctiplan", "ctiplan-evaluate", "ctiplan-study", "ctiplan-study-error-budget", "ctiplan-man"] {
        let text = fs::read_to_string(man.join(format!("{page}.1"))).unwrap_or_else(|_| panic!("{page}"));
        assert!(text.contains(".SH NAME") && text.contains(".SH SYNOPSIS"), "{page}");
    }
    if !there("groff") {
        return;
    }
    for page in fs::read_dir(&man).unwrap() {
        let page = page.unwrap().path();
        let output = Command::new("groff").args(["-man", "-ww", "-Tascii", "-P-cbou"]).arg(&page).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && said.is_empty(), "{}: {said}", page.display());
        assert!(String::from_utf8_lossy(&output.stdout).contains("SYNOPSIS"), "{}", page.display());
    }
}

#[test]
fn people_are_told_the_next_command_and_programs_are_not() {
    let case = Path::new("tests/practice/slow-trap");
    let [mission, trails] = ["mission.toml", "trails.ecsv"].map(|name| case.join(name).display().to_string());
    let said = stdout(&["validate", &mission, &trails]);
    let next = format!("\nnext: ctiplan diagnose {mission} {trails}\n");
    assert!(said.ends_with(&next), "{said}");
    for format in ["--json", "--csv"] {
        assert!(!stdout(&["validate", &mission, &trails, format]).contains("next: "));
    }
    let tight = "requirement.correction_factor=1";
    let said = stdout(&["evaluate", "missions/snap_l2.toml", "--set", tight]);
    assert!(
        said.ends_with(&format!("\nnext: ctiplan study error-budget missions/snap_l2.toml --set {tight}\n")),
        "{said}"
    );
    let folder = tempfile::tempdir().unwrap();
    let new = folder.path().join("new mission.toml").display().to_string();
    // Where the truth is, the fit explains the data.
    let case = Path::new("tests/practice/nothing-missing");
    let [mission, changes] = ["mission.toml", "delta_e1.ecsv"].map(|name| case.join(name).display().to_string());
    let key = ctiplan::mission::Mission::read(&mission).unwrap().detector.traps[0].name.clone();
    let free = format!("detector.traps.{key}.density_per_px");
    let said = stdout(&["fit", &mission, &changes, "--free", &free, "--write", &new]);
    assert!(said.ends_with(&format!("\nnext: ctiplan validate '{new}' {changes}\n")), "{said}");
    assert!(!stdout(&["validate", &new, &changes]).contains("next: "));
}
