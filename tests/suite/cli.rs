//! The program as a user meets it.

use std::process::{Command, Output, Stdio};

use serde_json::Value;

const SNAP: &str = "missions/snap_l2.toml";

fn ctiplan(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap()
}

fn stdout(arguments: &[&str]) -> String {
    let output = ctiplan(arguments);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}: {stderr}");
    assert_eq!(stderr, "", "{arguments:?}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&stdout(arguments)).unwrap()
}

#[test]
fn evaluate_prints_the_json_of_the_contract() {
    let json = json(&["evaluate", SNAP, "--json"]);
    assert_eq!(json["mission"], "SNAP at L2");
    let years = json["years"].as_array().unwrap();
    assert_eq!(years.len(), 5);
    assert_eq!((&years[0]["t_yr"], &years[0]["date"]), (&1.0.into(), &"2010-01-01".into()));
    assert!((years[0]["dose_mev_g"].as_f64().unwrap() / 1.616e6 - 1.0).abs() < 1e-3);
    assert_eq!(years[0]["traps"][1]["name"], "VV");
    let density = years[4]["traps"][1]["density_per_px"].as_f64().unwrap();
    assert!((density / (0.49 * 5.0 * 7.0 / 11.0 * 2.54e6 / 1.78e8) - 1.0).abs() < 1e-12);
    for key in ["delta_e1", "delta_e2", "delta_y", "delta_size", "delta_flux"] {
        assert!(years[4]["galaxies"][0][key].is_number(), "{key}");
    }
    let budget = &json["budget"];
    assert_eq!((&budget["delta_e"], &budget["galaxy"]), (&0.001.into(), &"faint".into()));
    assert_eq!(budget["uncorrected"]["exceeded"], true);
    assert!(budget["uncorrected"]["t_yr"].as_f64().unwrap() < 4.0);
    assert!(budget["uncorrected"]["date"].as_str().unwrap().starts_with("2012-"));
    let corrected = &budget["corrected"];
    assert_eq!((&corrected["factor"], &corrected["exceeded"]), (&10.0.into(), &false.into()));
    assert_eq!((&corrected["t_yr"], &corrected["date"]), (&Value::Null, &Value::Null));
}

#[test]
fn tables_fit_80_columns_and_have_no_lines_when_piped() {
    for arguments in [
        &["evaluate", SNAP, "--monte-carlo", "2"][..],
        &["evaluate", "missions/survey_nchannel_l2.toml"],
        &["evaluate", "missions/rhodes2010_galaxies.toml"],
        &["dose", "missions/snap_l2_shielded.toml"],
        &["dose", "missions/hst_leo.toml", "--explain"],
        &["compare", SNAP, "--transfers", "825,1650", "--line-time-ms", "10,25"],
        &["compare", SNAP, "missions/hst_leo.toml"],
        &["diagnose", &practice("one-epoch/mission.toml"), &practice("one-epoch/trails.ecsv")],
        &["diagnose", &practice("slow-trap/mission.toml"), &practice("slow-trap/trails.ecsv"), "--no-stability"],
    ] {
        for line in stdout(arguments).lines() {
            assert!(line.chars().count() <= 80, "{arguments:?}: {line}");
            assert!(line.is_ascii() && !line.contains('|') || line.contains("|delta e|"), "{arguments:?}: {line}");
        }
    }
}

#[test]
fn csv_has_one_header_and_rows_of_its_length() {
    for (arguments, rows) in [
        (&["evaluate", SNAP, "--csv"][..], 5 * 4),
        // One species more than the file lists.
        (&["evaluate", "docs/tutorial/three_species.toml", "--csv"], 8 * 4),
        (&["dose", SNAP, "--csv"], 6),
        (&["compare", SNAP, "--transfers", "100..1700:400", "--csv"], 5),
    ] {
        let text = stdout(arguments);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(reader.records().map(Result::unwrap).count(), rows, "{arguments:?}");
    }
}

#[test]
fn compare_keeps_the_order_and_names_the_best() {
    let json = json(&["compare", SNAP, "--transfers", "1650,825,400", "--launch", "2009-01-01,2011-01-01", "--json"]);
    let scenarios = json["scenarios"].as_array().unwrap();
    let settings: Vec<(&str, i64)> = scenarios
        .iter()
        .map(|scenario| {
            let settings = &scenario["settings"];
            (settings["mission.launch"].as_str().unwrap(), settings["readout.transfers"].as_i64().unwrap())
        })
        .collect();
    let expected = [1650, 825, 400].map(|transfers| ("2009-01-01", transfers));
    assert_eq!(settings[..3], expected);
    assert_eq!(settings.len(), 6);
    // More of the years after a launch in 2011 are active.
    assert_eq!((&json["best"], &json["worst"]), (&2.into(), &3.into()));
    assert!(!json["why"].as_array().unwrap().is_empty());
    let change = |index: usize| scenarios[index]["delta_e"].as_f64().unwrap();
    assert!(change(2) < change(1) && change(1) < change(0));
}

#[test]
fn compare_tells_missions_apart_whatever_is_set() {
    // Three missions of two names, one of them in two folders.
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    std::fs::create_dir(path("other")).unwrap();
    let text = std::fs::read_to_string(SNAP).unwrap();
    let files = [path("warm.toml"), path("other/warm.toml"), path("cold.toml")];
    for (file, kelvin) in files.iter().zip(["153.0", "143.0", "133.0"]) {
        let warm = text.replace("\ntemperature_k = 133.0", &format!("\ntemperature_k = {kelvin}"));
        std::fs::write(file, warm).unwrap();
    }
    let page = path("page.html");
    for set in [&[][..], &["--set", "sky.background_e=60,120"], &["--launch", "2009-01-01,2012-01-01"]] {
        let missions = [&files[0], &files[1], &files[2], "missions/snap_l2_trades.toml"];
        let run = |more: &[&str]| stdout(&[&["compare"], &missions[..], set, more].concat());
        let shown = run(&["--html", &page, "--overwrite"]).split_whitespace().collect::<String>();
        let html = std::fs::read_to_string(&page).unwrap();
        for name in
            ["SNAP at L2 (cold.toml)", &format!("SNAP at L2 ({})", files[0]), &format!("SNAP at L2 ({})", files[1])]
        {
            assert!(html.contains(name), "{set:?}: {name}\n{html}");
        }
        assert!(shown.contains("cold.toml") && !shown.contains("snap_l2_trades.toml"), "{shown}");
        let json: Value = serde_json::from_str(&run(&["--json"])).unwrap();
        let rows: Vec<(String, String)> = json["scenarios"]
            .as_array()
            .unwrap()
            .iter()
            .map(|row| (row["file"].as_str().unwrap().to_string(), row["settings"].to_string()))
            .collect();
        assert!(rows.iter().enumerate().all(|(place, row)| !rows[..place].contains(row)), "{rows:?}");
        let csv = run(&["--csv"]);
        assert!(
            csv.lines().enumerate().all(|(place, row)| csv.lines().skip(place + 1).all(|other| other != row)),
            "{csv}"
        );
    }
}

#[test]
fn compare_says_how_long_each_launch_lasts() {
    let arguments = ["compare", SNAP, "--launch", "2010-01-01,2012-01-01,2014-01-01"];
    let text = stdout(&arguments);
    let json = json(&[&arguments[..], &["--json"]].concat());
    for scenario in json["scenarios"].as_array().unwrap() {
        let launch = scenario["settings"]["mission.launch"].as_str().unwrap();
        let row = text.lines().find(|line| line.trim().starts_with(launch)).unwrap();
        let words: Vec<&str> = row.split_whitespace().collect();
        if let Some(t_yr) = scenario["uncorrected"]["t_yr"].as_f64() {
            let date = scenario["uncorrected"]["date"].as_str().unwrap();
            let place = words.iter().position(|word| *word == date).unwrap();
            assert_eq!(words[place + 1], format!("{t_yr:.2}"), "{row}");
        }
    }
}

#[test]
fn compare_takes_any_key() {
    for setting in [
        "detector.temperature_k=130,133,136",
        "detector.traps.VV.density_per_px=0.1..0.5:lin:3",
        "environment.model=constant,solar-cycle",
        "galaxies.faint.flux_e=500..5000:log:3",
    ] {
        let json = json(&["compare", SNAP, "--set", setting, "--json"]);
        assert!(json["scenarios"].as_array().unwrap().len() >= 2, "{setting}");
    }
}

#[test]
fn a_shielded_mission_is_dosed_less_behind_more() {
    let dose = |thickness: &str| {
        let set = format!("shielding.thickness_mm={thickness}");
        json(&["dose", "missions/snap_l2_shielded.toml", "--set", &set, "--json"])["total_mev_g"].as_f64().unwrap()
    };
    assert!(dose("10") > dose("20") && dose("20") > dose("40"));
}

/// The rate of active years, and what the words say of them, make the dose of the table.
#[test]
fn given_active_years_are_said_and_counted() {
    let set = ["missions/snap_l2_shielded.toml", "--set", "environment.active_years=2"];
    let said = stdout(&[&["evaluate"], &set[..], &["--samples", "0"]].concat());
    let line = said.lines().find(|line| line.starts_with("Dose: ")).unwrap();
    assert!(line.contains("in active years, of which 2.00 are spread over 5 yr"), "{line}");
    let rate: f64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    let total = json(&[&["dose"], &set[..], &["--json"]].concat())["total_mev_g"].as_f64().unwrap();
    assert!((2.0 * rate / total - 1.0).abs() < 1e-3, "{rate} {total}");
    // Two years around the minimum of 2019.
    let quiet = ["environment.model=solar-cycle", "mission.launch=2019-06-01", "mission.duration_yr=2"];
    let quiet = quiet.map(|setting| ["--set", setting]).concat();
    let said = stdout(&[&["evaluate", set[0], "--samples", "0"], &quiet[..]].concat());
    assert!(said.contains("no active year of") && !said.contains("confidence for"), "{said}");
}

#[test]
fn spectra_are_printed_at_the_energies_asked_for() {
    let json = json(&["dose", "missions/snap_l2_shielded.toml", "--energies-mev", "10,30,100", "--json"]);
    let spectrum = json["spectrum"].as_array().unwrap();
    assert_eq!(spectrum.len(), 3);
    // ECSS table I-3: 95 %, one year.
    for (row, expected) in spectrum.iter().zip([3.51e10, 7.59e9, 7.09e8]) {
        let year = row["integral_cm2"]["year"].as_f64().unwrap();
        assert!((year / expected - 1.0).abs() < 2e-3);
        assert!(row["shielded_integral_cm2"]["year"].as_f64().unwrap() < year);
    }
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let run = |seed: &str, threads: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
            .args(["evaluate", SNAP, "--monte-carlo", "40", "--seed", seed, "--json"])
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert_eq!(run("5", "1"), run("5", "3"));
    assert_ne!(run("5", "1"), run("6", "1"));
}

#[test]
fn bright_galaxies_with_noise_change_as_the_noise_free_mean_does() {
    // Noise is not harmless: it decides which row is the brightest, and the sky's fills traps that a faint galaxy would
    // meet. So bright a galaxy keeps its change of position and flux to 2 %, and of ellipticity to 10 %.
    let json = json(&[
        "evaluate",
        SNAP,
        "--monte-carlo",
        "200",
        "--set",
        "galaxies.bright.flux_e=300000",
        "--set",
        "galaxies.bright.read_noise_e=4",
        "--json",
    ]);
    let number = |value: &Value| value.as_f64().unwrap();
    let (noisy, expected) = (&json["monte_carlo"][1], &json["years"][4]["galaxies"][1]);
    assert_eq!((&noisy["name"], &expected["name"]), (&"bright".into(), &"bright".into()));
    assert_eq!((&noisy["measured"], &noisy["lost"]), (&200.into(), &0.into()));
    for (what, tolerance) in [("delta_e1", 0.1), ("delta_y", 0.02), ("delta_flux", 0.02)] {
        let (mean, error) = (number(&noisy["mean"][what]), number(&noisy["standard_error"][what]));
        let expected = number(&expected[what]);
        assert!(error > 0.0 && error < 0.05 * expected.abs(), "{what}: {mean} +- {error}");
        assert!(
            (mean - expected).abs() < 5.0 * error + tolerance * expected.abs(),
            "{what}: {mean} +- {error}, {expected}"
        );
    }
}

#[test]
fn bad_input_has_status_2_and_one_message() {
    for arguments in [
        &["evaluate", "missions/none.toml"][..],
        &["evaluate", "missions"],
        &["evaluate", SNAP, "--set", "detector.temperature_k=-120"],
        &["evaluate", SNAP, "--set", "detector.temperatur_k=120"],
        &["evaluate", SNAP, "--set", "detector.temperature_k=120,130"],
        &["evaluate", SNAP, "--set", "nonsense"],
        &["evaluate", SNAP, "--monte-carlo", "1"],
        &["evaluate", SNAP, "--json", "--csv"],
        &["evaluate"],
        &["compare", SNAP],
        &["compare", SNAP, "--transfers", "1..2"],
        &["compare", SNAP, "--transfers", "0,5"],
        &["compare", SNAP, "--launch", "2009-02-30"],
        &["dose", SNAP, "--energies-mev", "0"],
        &["dose", SNAP, "--energies-mev", "ten"],
        &["nothing"],
    ] {
        let output = ctiplan(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(stderr.starts_with("error: ") || stderr.contains("Usage"), "{arguments:?}: {stderr}");
        assert!(!stderr.contains("panicked"), "{arguments:?}: {stderr}");
    }
}

#[test]
fn a_key_is_set_once() {
    for arguments in [
        "evaluate @ --set detector.temperature_k=130 --set detector.temperature_k=140",
        "evaluate @ --set detector.temperature_k=130 --set detector.temperature_k=130",
        "dose @ --set detector.traps.VV.release_ms=1 --set readout.transfers=9 --set detector.traps.VV.release_ms=2",
        "compare @ --set readout.transfers=100,200 --set readout.transfers=300",
        "compare @ --transfers 100,200 --set readout.transfers=300",
        "compare @ --launch 2009-01-01 --set mission.launch=2010-01-01,2011-01-01",
        "study clock @ --set readout.transfers=100 --set readout.transfers=300",
        "readout tests/golden/camera.fits target/x.fits --at 1 --mission @ --set sky.background_e=1 --set sky.background_e=2",
    ] {
        let words: Vec<&str> = arguments.split(' ').map(|word| if word == "@" { SNAP } else { word }).collect();
        let output = ctiplan(&words);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {stderr}");
        assert!(stderr.contains("cannot set") && stderr.contains("the key is set twice"), "{arguments}: {stderr}");
    }
}

#[test]
fn a_launch_has_no_time_of_day() {
    for arguments in [
        ["evaluate", SNAP, "--set", "mission.launch=2009-01-01T12:00:00"],
        ["compare", SNAP, "--launch", "2009-01-01T12:00:00,2010-01-01"],
        ["compare", SNAP, "--set", "mission.launch=2009-01-01 12:00,2010-01-01"],
    ] {
        assert_eq!(ctiplan(&arguments).status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn species_that_release_in_place_are_warned_of() {
    // The divacancies of SNAP are released after 12.15 ms: below a tenth of a line time they are warned of, and only they.
    let warned = |line_time_ms: &str| {
        let set = format!("readout.line_time_ms={line_time_ms}");
        let warnings = json(&["evaluate", SNAP, "--json", "--set", &set])["warnings"].clone();
        let of = |warning: &&Value| warning.as_str().unwrap().contains("the release time is");
        warnings.as_array().unwrap().iter().filter(of).cloned().collect::<Vec<_>>()
    };
    assert!(warned("121").is_empty());
    let warnings = warned("122");
    assert!(
        warnings.len() == 1 && warnings[0].as_str().unwrap().starts_with("VV: the release time is 0.100 line times"),
        "{warnings:?}"
    );
    let survey = stdout(&["evaluate", "missions/survey_nchannel_l2.toml"]);
    assert_eq!(survey.split_whitespace().collect::<Vec<_>>().join(" ").matches("the release time is").count(), 2);
}

#[test]
fn check_tells_whether_the_corrected_requirement_is_met() {
    assert_eq!(ctiplan(&["evaluate", SNAP, "--check"]).status.code(), Some(0));
    let tight = ["evaluate", SNAP, "--check", "--set", "requirement.correction_factor=1"];
    assert_eq!(ctiplan(&tight).status.code(), Some(1));
}

#[test]
fn a_reader_who_has_seen_enough_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
        .args(["compare", SNAP, "--transfers", "1..40:1", "--csv"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty());
}

#[test]
fn the_readme_shows_what_the_program_prints() {
    let readme = std::fs::read_to_string("README.md").unwrap();
    let output = stdout(&["evaluate", SNAP]);
    let first = output.lines().next().unwrap();
    let shown = readme.find(first).map_or("", |start| readme[start..].split("```").next().unwrap());
    assert_eq!(crate::alike::first_difference(shown, &output), None, "README.md is to show:\n{output}");
}

#[test]
fn the_page_of_effects_is_up_to_date() {
    // To renew it: cargo run -- effects --markdown > docs/effects.md
    assert_eq!(stdout(&["effects", "--markdown"]), include_str!("../../docs/effects.md"));
}

#[test]
fn effects_lists_the_catalogue_and_tells_of_one() {
    let listed = stdout(&["effects"]);
    let catalogue = json(&["effects", "--json"]);
    let catalogue = catalogue.as_array().unwrap();
    assert!(catalogue.len() >= 17);
    for effect in catalogue {
        let kind = effect["effect"].as_str().unwrap();
        assert!(listed.contains(kind), "{kind}");
        let one = stdout(&["effects", kind]);
        assert!(one.contains("Physics") && one.contains(&format!("effects.{kind}")), "{kind}");
        for line in one.lines().chain(listed.lines()) {
            assert!(line.chars().count() <= 80, "{kind}: {line}");
        }
    }
    let unknown = ctiplan(&["effects", "anealing"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8(unknown.stderr).unwrap().contains("did you mean `annealing`?"));
}

#[test]
fn validate_prints_the_json_of_the_contract() {
    let folder = "tests/practice/slow-trap";
    let mission = format!("{folder}/mission.toml");
    let (trails, packets) = (format!("{folder}/trails.ecsv"), format!("{folder}/packets.ecsv"));
    let json = json(&["validate", &mission, &trails, &packets, "--json"]);
    assert_eq!(json["n"], 35);
    assert!(json["chi2"].as_f64().unwrap() > 1e5 && json["rms"].as_f64().unwrap() > 50.0);
    let sets = json["datasets"].as_array().unwrap();
    assert_eq!(
        (&sets[0]["file"], &sets[0]["observable"], &sets[0]["n"]),
        (&trails.into(), &"trail".into(), &18.into())
    );
    let rows = sets[1]["rows"].as_array().unwrap();
    assert_eq!((rows.len(), &rows[0]["value"], &rows[0]["sigma"]), (17, &1564.6274.into(), &0.6.into()));
    let chi2: f64 = sets.iter().map(|set| set["chi2"].as_f64().unwrap()).sum();
    assert!((chi2 / json["chi2"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    let off = |row: &Value| {
        let number = |key: &str| row[key].as_f64().unwrap();
        ((number("value") - number("model")) / number("sigma")).powi(2)
    };
    let by_hand: f64 = rows.iter().map(off).sum();
    assert!((by_hand / sets[1]["chi2"].as_f64().unwrap() - 1.0).abs() < 1e-12);
}

#[test]
fn validate_draws_and_writes_what_it_found() {
    let folder = tempfile::tempdir().unwrap();
    let [plots, tables] = ["plots", "tables"].map(|name| folder.path().join(name).display().to_string());
    let case = "tests/practice/notch";
    stdout(&[
        "validate",
        &format!("{case}/mission.toml"),
        &format!("{case}/trails.ecsv"),
        "--plots",
        &plots,
        "--plots-as",
        "svg,pdf,png",
        "--residuals",
        &tables,
    ]);
    let drawn: Vec<_> = std::fs::read_dir(&plots).unwrap().map(|entry| entry.unwrap().path()).collect();
    // The data, and residuals against each of three conditions, each as three files.
    assert_eq!(drawn.len(), 3 * 4);
    for figure in drawn {
        let bytes = std::fs::read(&figure).unwrap();
        let (start, end): (&[u8], &[u8]) = match figure.extension().unwrap().to_str().unwrap() {
            "svg" => (b"<svg ", b"</svg>\n"),
            "pdf" => (b"%PDF-", b"%%EOF"),
            _ => (b"\x89PNG", b"IEND\xaeB`\x82"),
        };
        assert!(bytes.starts_with(start) && bytes.ends_with(end), "{}", figure.display());
    }
    let svg = std::fs::read_to_string(format!("{plots}/1-trails.svg")).unwrap();
    for label in ["distance behind the packet [px]", "(data − model)/σ", ">model<"] {
        assert!(svg.contains(label), "{label}");
    }
    let refused = ctiplan(&["evaluate", SNAP, "--plots", &plots, "--plots-as", "eps"]);
    let stderr = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr.contains("'eps'") && stderr.contains("figures can be svg, pdf and png"), "{stderr}");
    let table = ctiplan::io::table::Table::read(format!("{tables}/1-trails.ecsv")).unwrap();
    let column =
        |name: &str| table.column(name).unwrap().cells.iter().map(|cell| cell.number().unwrap()).collect::<Vec<_>>();
    let (value, sigma, model, residual) = (column("value"), column("sigma"), column("model"), column("residual_sigma"));
    for row in 0..value.len() {
        assert!(((value[row] - model[row]) / sigma[row] - residual[row]).abs() < 1e-9);
    }
}

#[test]
fn fit_writes_a_mission_that_validate_confirms() {
    let folder = tempfile::tempdir().unwrap();
    let new = folder.path().join("new.toml").display().to_string();
    let case = "tests/practice/prelaunch";
    let (mission, trails) = (format!("{case}/mission.toml"), format!("{case}/trails.ecsv"));
    let text = format!(
        "{}\n[effects.prelaunch-traps]  # added\nfast = 0.01\nmid = 0.01 # also\nslow = 0.01\n",
        std::fs::read_to_string(mission).unwrap()
    );
    let start = folder.path().join("start.toml").display().to_string();
    std::fs::write(&start, &text).unwrap();
    let free = ["fast", "mid", "slow"].map(|name| format!("effects.prelaunch-traps.{name}"));
    let fit = json(&[
        "fit", &start, &trails, "--json", "--write", &new, "--only", "--free", &free[0], "--free", &free[1], "--free",
        &free[2],
    ]);
    assert_eq!(fit["parameters"][1]["key"], "effects.prelaunch-traps.mid");
    let chi2 = fit["chi2"].as_f64().unwrap();
    assert!(chi2 < fit["chi2_before"].as_f64().unwrap() / 20.0);
    let confirmed = json(&["validate", &new, &trails, "--json"]);
    assert!((confirmed["chi2"].as_f64().unwrap() / chi2 - 1.0).abs() < 1e-9);
    let written = std::fs::read_to_string(&new).unwrap();
    let changed = text.lines().zip(written.lines()).filter(|(old, new)| old != new).count();
    assert_eq!((changed, text.lines().count()), (3, written.lines().count()));
    assert!(written.contains("# also"));
}

/// `--free A,B` is `--free A --free B`, with or without a blank.
#[test]
fn free_keys_may_be_a_list() {
    let (mission, trails) = (practice("slow-trap/mission.toml"), practice("slow-trap/trails.ecsv"));
    let keys = ["detector.traps.VV.density_per_px", "detector.traps.Ci.density_per_px"];
    let fitted = |free: &[&str]| {
        let output = ctiplan(&[&["fit", &mission, &trails, "--only", "--json"], free].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let repeated = fitted(&["--free", keys[0], "--free", keys[1]]);
    assert_eq!(fitted(&["--free", &keys.join(",")]), repeated);
    assert_eq!(fitted(&["--free", &keys.join(", ")]), repeated);
}

/// A file in the place of another, or of the command, is recognised.
#[test]
fn misplaced_files_get_a_hint() {
    let (mission, trails) = (practice("slow-trap/mission.toml"), practice("slow-trap/trails.ecsv"));
    for (arguments, said) in [
        (&["validate", &trails, &mission][..], "this is a table of measurements, not a mission file"),
        (&["fit", &trails, &mission], "the mission comes first, then the data"),
        (&["diagnose", &mission, SNAP], "this is a mission file, not a table of measurements"),
        (&[&mission], "help: ctiplan evaluate "),
        (&[&mission, "--json"], "help: ctiplan evaluate "),
        (&["study", &mission], "help: ctiplan study KIND "),
        (&[&trails], "help: ctiplan validate MISSION.toml "),
    ] {
        let output = ctiplan(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(said) && stderr.matches("error: ").count() == 1, "{arguments:?}: {stderr}");
    }
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let case = "tests/practice/notch";
    let (mission, trails) = (format!("{case}/mission.toml"), format!("{case}/trails.ecsv"));
    for (arguments, said) in [
        (&["--free", "detector.traps.Z.density_per_px"][..], "there is no trap species \"Z\""),
        (&["--free", "readout.transfers"], "only keys with real numbers can be fitted"),
        (&["--free", "mission.name"], "only keys with real numbers can be fitted"),
        (&["--free", "detector.reference_fluence_cm2"], "it has no number to start from"),
        (&["--free", "effects.annealing.time_yr"], "the mission has no [effects.annealing]"),
        (&["--holdout", "temperature_k"], "no data set varies in `temperature_k`"),
        (&["--write", "no/such/folder/new.toml"], "cannot write `no/such/folder/new.toml`"),
    ] {
        let mut all = vec!["fit", &mission, &trails];
        all.extend(arguments);
        let output = ctiplan(&all);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(said), "{arguments:?}: {stderr}");
    }
    let output = ctiplan(&["fit", "missions/snap_l2.toml", &trails]);
    assert!(String::from_utf8(output.stderr).unwrap().contains("no key is free"));
}

fn practice(file: &str) -> String {
    format!("tests/practice/{file}")
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn diagnose_writes_what_it_found_and_draws_it() {
    let folder = tempfile::tempdir().unwrap();
    let (new, plots) = (folder.path().join("new.toml"), folder.path().join("plots"));
    let (mission, trails) = (practice("notch/mission.toml"), practice("notch/trails.ecsv"));
    let diagnose = ["diagnose", &mission, &trails, "--no-stability"];
    let files = ["--write", new.to_str().unwrap(), "--plots", plots.to_str().unwrap(), "--json"];
    let found = json(&[&diagnose[..], &files].concat());
    assert_eq!((&found["verdict"], &found["steps"][0]["effect"]), (&"missing".into(), &"notch".into()));
    let validated = json(&["validate", new.to_str().unwrap(), &trails, "--json"]);
    let chi2 = |value: &Value| value["chi2"].as_f64().unwrap();
    // The same errors at the same model: the same chi2, and the same rows are called wrong.
    let likeliest = &validated["likeliest_errors"];
    assert!((chi2(likeliest) - chi2(&found["steps"][0])).abs() < 0.01, "{likeliest}");
    assert_eq!(likeliest["noise"][0]["outliers"], found["noise"][0]["outliers"]);
    for figure in ["error.svg", "before-1-trails.svg", "after-1-trails.svg", "after-1-trails-signal_e.svg"] {
        assert!(std::fs::read_to_string(plots.join(figure)).unwrap().starts_with("<svg"), "{figure}");
    }
    let csv = stdout(&[&diagnose[..], &["--csv"]].concat());
    assert!(csv.starts_with("model,parameter,unit,value,sigma,chi2,n,free,rms_sigma,holdout_rms_sigma,false_alarm"));
    assert!(csv.lines().any(|line| line.starts_with("notch,effects.notch.notch_e,e-,")));
    // Values stand beside the chi2 that they belong to.
    let given: Vec<&str> = csv.lines().filter(|line| line.starts_with("as given,")).collect();
    let value = |line: &&str| line.split(',').nth(3).unwrap().to_string();
    let key = |line: &&str| line.split(',').nth(1).unwrap().to_string();
    let set: Vec<String> = given.iter().map(|line| format!("--set={}={}", key(line), value(line))).collect();
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let given_chi2: f64 = given[0].split(',').nth(5).unwrap().parse().unwrap();
    let validated = json(&[&["validate", &mission, &trails, "--json"], &set[..]].concat());
    // With the errors that are likeliest for the last model, chi2 is not larger.
    assert!(given_chi2 < 1.001 * chi2(&validated) && given_chi2 > 0.5 * chi2(&validated), "{given:?}");
}

#[test]
fn a_diagnosis_that_cannot_be_asked_for_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_string()
    };
    let wrong =
        file("wrong.toml", "[effects.formula]\ntarget = \"value\"\nexpression = \"value * (1 + drift * humidty\"\n");
    let unknown = file("unknown.toml", "[effects.anealing]\ntime_yr = 2.0\n");
    let bare = file("bare.toml", "[formula]\ntarget = \"value\"\n");
    let bad = file("bad.toml", "[effects.formula]\ntarget = \"value\"\n");
    let torn = file("torn.toml", "[effects.formula]\ntarget = \n");
    for (arguments, said) in [
        (vec!["--level", "0"], "a fraction above 0 and up to 0.5"),
        (vec!["--can", "trails"], "no observable is called"),
        (vec!["--free", "detector.traps.A.densty_per_px"], "no key is called"),
        (vec!["--candidates", "nowhere.toml"], "nowhere.toml"),
        (vec!["--candidates", &wrong], "wrong.toml"),
        (vec!["--candidates", &bad], "bad.toml`\n  [effects.formula]"),
        (vec!["--write", &practice("notch/trails.ecsv")], "one of the files that are read"),
        (vec!["--write", &practice("notch/../notch/mission.toml")], "one of the files that are read"),
        (vec!["--candidates", &unknown], "no effect is called `anealing`"),
        (vec!["--candidates", &bare], "only [effects.KIND]"),
        (vec!["--candidates", &torn], "line 2"),
    ] {
        let (mission, trails) = (practice("notch/mission.toml"), practice("notch/trails.ecsv"));
        let output = ctiplan(&[&["diagnose", &mission, &trails], &arguments[..]].concat());
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(said) && stderr.starts_with("error: "), "{arguments:?}: {stderr}");
        assert!(output.stdout.is_empty());
    }
}
