//! The phases of the clock, traps at the surface, and traps that carry their state on: from the keys of a mission to its verdict,
//! and against ArCTIc (`tests/golden/clocked.py`). Clocks of several phases are held against a program of their own in
//! `crates/readout/tests/clocked.rs`.

use ctiplan::analysis::diagnose::{Options, Progress, diagnose};
use ctiplan::analysis::measurement::{DataSet, questions};
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::predict::predict;
use ctiplan::plan::evaluate::evaluate;
use ctiplan::readout::{Clock, Cloud, Downstream, Method, Readout, Trap};
use ctiplan::warning::Warning;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

const SNAP: &str = include_str!("../../missions/snap_l2.toml");

fn mission(add: &str) -> Mission {
    Mission::parse(&format!("{SNAP}\n{add}")).unwrap_or_else(|error| panic!("{error}"))
}

/// Change of e1 of the first galaxy after five years.
fn change(mission: &Mission) -> f64 {
    Model::new(mission).change(0, 5.0).unwrap().unwrap().delta_e1
}

#[test]
fn lists_that_say_what_is_assumed_change_nothing() {
    let short = mission("[readout.clock]\nphases = 3");
    let long = mission(
        "[readout.clock]\nphases = 3\nholds = [[1], [2], [3]]\ndwell = [0.5, 0.5, 0.5]\ntrap_share = [2.0, 2.0, 2.0]",
    );
    assert_eq!(change(&short), change(&long));
    assert_eq!(change(&mission("[readout.clock]\nphases = 1")), change(&mission("")));
    // A mission as resolved has the same clock.
    assert_eq!(Mission::parse(&long.to_toml()).unwrap(), long);
}

/// To first order a clock takes traps away from each species: those that release before half of the way to the next packet.
#[test]
fn a_clock_acts_like_fewer_traps_of_fast_species() {
    let plain = mission("");
    let mut fewer = plain.clone();
    for species in &mut fewer.detector.traps {
        // At the operating temperature, which is that of the quoted release times.
        species.density_per_px *= (-plain.readout.line_time_ms / 3.0 / species.release_ms).exp();
    }
    let clocked = change(&mission("[readout.clock]\nphases = 3"));
    assert!((change(&fewer) / clocked - 1.0).abs() < 2e-3, "{clocked}, {}", change(&fewer));
    assert!((change(&plain) / clocked - 1.0).abs() > 0.1);
}

#[test]
fn species_much_faster_than_the_line_are_warned_of_unless_phases_are_named() {
    let fast = "[[detector.traps]]\nname = \"fast\"\ndensity_per_px = 1.0\nrelease_ms = 3e-4\nenergy_ev = 0.1\n";
    let warned = |add: &str| {
        let found = evaluate(&mission(&format!("{fast}{add}"))).unwrap();
        found
            .warnings
            .iter()
            .find(|warning| matches!(warning, Warning::ReleasesInPlace { .. }))
            .map(ToString::to_string)
    };
    let warning = warned("").expect("a transfer is one step");
    assert!(warning.contains("[readout.clock]"), "{warning}");
    assert_eq!(warned("[readout.clock]\nphases = 3"), None);
    // Its electrons come back to their packets.
    let with_clock = |add: &str| change(&mission(&format!("{add}[readout.clock]\nphases = 3")));
    assert!((with_clock(fast) / with_clock("") - 1.0).abs() < 1e-4);
}

#[test]
fn traps_at_the_surface_are_met_by_bright_packets_alone() {
    let surface = |level: f64| {
        mission(&format!(
            "[[detector.traps]]\nname = \"surface\"\ndensity_per_px = 50.0\nrelease_ms = 40.0\nenergy_ev = 0.3\n\
             surface_level_e = {level:e}\n"
        ))
    };
    let (plain, above, below) = (change(&mission("")), change(&surface(1e5)), change(&surface(140.0)));
    assert!((above / plain - 1.0).abs() < 1e-4, "{above}, {plain}");
    assert!((below / plain - 1.0).abs() > 0.01, "{below}, {plain}");
    // A fit may free it.
    let lower = surface(1e5).with(&[("detector.traps.surface.surface_level_e".into(), 140.0.into())]).unwrap();
    assert_eq!(lower, surface(140.0));
    let refused = lower.with(&[("detector.traps.surface.surface_level_e".into(), 2e5.into())]).unwrap_err();
    assert!(refused.to_string().contains("below the full well"), "{refused}");
}

#[test]
fn traps_that_carry_their_state_on_are_said_to_be_computed_one_by_one() {
    let carried = |add: &str| {
        let text = SNAP.replace("transfers = 1650", "transfers = 100\ntraps_at_start = \"carried\"");
        Mission::parse(&format!("{text}\n{add}"))
    };
    let found = evaluate(&carried("").unwrap()).unwrap();
    assert!(found.warnings.contains(&Warning::CarriedTraps));
    let error = carried("[accuracy]\nreadout = \"monte-carlo\"").unwrap_err().to_string();
    assert!(error.contains("one by one"), "{error}");
}

#[test]
fn columns_are_those_of_arctic() {
    let golden: Value = serde_json::from_str(include_str!("../golden/clocked.json")).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let numbers = |value: &Value| value.as_array().unwrap().iter().map(number).collect::<Vec<f64>>();
    let mut carried_cases = 0;
    for case in golden["cases"].as_array().unwrap() {
        let trap = |trap: &Value| Trap {
            surface_level_e: trap["surface_level_e"].as_f64(),
            ..Trap::new(number(&trap["density_per_px"]), number(&trap["release_transfers"]))
        };
        let (before_e, after_e) = (numbers(&case["before_e"]), numbers(&case["after_e"]));
        let largest_e = before_e.iter().zip(&after_e).map(|(before, after)| after - before).fold(0.0, f64::max);
        let carried = case["carried"].as_bool().unwrap();
        carried_cases += usize::from(carried);
        let fast = Method::Fast { relative: 1e-5 };
        for method in if carried { vec![Method::CarriedTraps] } else { vec![Method::Exact, fast] } {
            let readout = Readout {
                traps: case["traps"].as_array().unwrap().iter().map(trap).collect(),
                cloud: Cloud::new(number(&golden["full_well_e"]), 0.0, number(&case["well_fill_power"])),
                method,
            };
            let rows = case["offset"].as_i64().unwrap();
            let found_e = readout.column(&before_e, Downstream { rows, charge_e: 0.0 });
            let off = found_e.iter().zip(&after_e).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
            // Every transfer as ArCTIc does it, to the digits that are stored; `fast` to its accuracy, a root mean square over the rows.
            let allowed = if method == fast { 1e-3 } else { 1e-8 };
            assert!(off < allowed * largest_e, "{}, {method:?}: {off:e} of {largest_e}", case["name"]);
        }
    }
    assert_eq!(carried_cases, 4);
}

/// Trails at three line times of a detector that is clocked in three phases, to a model of one.
#[test]
fn a_detector_that_is_clocked_in_phases_is_diagnosed() {
    let plain = mission("");
    let truth = mission("[readout.clock]\nphases = 3");
    let rows = [8.0, 25.0, 80.0].iter().flat_map(|line_time_ms| {
        [1.0, 3.0, 5.0].iter().flat_map(move |t_yr| {
            [1, 2, 3, 5, 8, 12, 20].map(|trail_px| format!("{line_time_ms},{t_yr},{trail_px},0,1e-4\n"))
        })
    });
    let text = format!(
        "# observable: trail\n# signal_e: 1000\nline_time_ms,t_yr,trail_px,value,sigma\n{}",
        rows.collect::<String>()
    );
    let mut data = vec![DataSet::of(Table::parse("trails.csv", &text).unwrap(), &plain).unwrap()];
    let values = predict(&Model::new(&truth), &questions(&data)).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(21);
    for (row, value) in data[0].rows.iter_mut().zip(values) {
        let noise: f64 = StandardNormal.sample(&mut random);
        row.value = value + noise * row.sigma;
    }
    let silent = Progress { stage: &|_, _| (), advance: &|| () };
    let options = Options { free: plain.fit.free.clone(), stability: false, ..Options::default() };
    let found = diagnose(&plain, &data, &options, &silent).unwrap();
    let effects: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
    assert_eq!(effects, ["clocking"], "{}", found.reason);
    let share = &found.steps[0].parameters[0];
    let sigma = share.sigma.unwrap();
    assert!((share.value - 1.0 / 3.0).abs() < 3.5 * sigma && sigma < 0.05, "{share:?}");
}

/// Speed is not asserted; that a clock of equal phases divides no species is.
#[test]
fn equal_phases_divide_no_species() {
    for phases in 1..=6 {
        assert_eq!(Clock::of_phases(phases).kinds(), 1);
    }
}

/// SNAP with a store, by its keys.
fn with_store(keys: &str) -> Mission {
    Mission::parse(&SNAP.replace("[sky]", &format!("[readout.store]\nrows = 1756\n{keys}\n\n[sky]"))).unwrap()
}

#[test]
fn a_store_without_traps_leaves_the_burst_through_the_image() {
    let stored = change(&with_store("burst_line_time_ms = 0.1\ntrap_ratio = 0.0"));
    let mut plain = mission("");
    plain.readout.line_time_ms = 0.1;
    assert_eq!(stored, change(&plain));
}

#[test]
fn a_burst_at_the_line_time_makes_every_transfer_count() {
    // Packets pass 1650 pixels of the image, 106 of the store in the burst and 1650 as it is read: 3406 in place of 1650. Those in which
    // packets of the stamp start or wait are less than 2 % of them.
    let ratio = change(&with_store("burst_line_time_ms = 25.0")) / change(&mission(""));
    assert!((ratio / (3406.0 / 1650.0) - 1.0).abs() < 0.02, "{ratio}");
}

/// SNAP after exposures of 300 s, with a species that releases in some time (ms) in place of CO.
fn repeated(release_ms: f64, scene: Option<&str>) -> Mission {
    let text = SNAP.replace("release_ms = 5000.0", &format!("release_ms = {release_ms:e}"));
    let before = scene.map_or(String::new(), |scene| {
        format!("[survey]\nexposure_s = 300.0\nslew_s = 30.0\n[survey.persistence]\nexposures = 3\nscene = \"{scene}\"\nrows = 1756\n")
    });
    let text = format!("{text}\n[accuracy]\nsubpixel_grid = 1\n{before}");
    Mission::parse(&text).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn traps_that_are_fast_compared_with_the_cadence_keep_no_charge() {
    let plain = change(&repeated(5000.0, None));
    for scene in ["same", "sky"] {
        let after = change(&repeated(5000.0, Some(scene)));
        // exp(−60) of the traps are still filled; both are read to their accuracy.
        assert!((after / plain - 1.0).abs() < 1e-4, "{scene}: {after}, {plain}");
    }
}

#[test]
fn traps_that_are_slow_compared_with_the_cadence_take_less_from_the_same_scene() {
    let flux = |scene: Option<&str>| {
        let mission = repeated(1e6, scene);
        Model::new(&mission).change(0, 5.0).unwrap().unwrap().delta_flux.abs()
    };
    let [plain, same, sky] = [None, Some("same"), Some("sky")].map(flux);
    assert!(same < 0.9 * plain, "{same}, {plain}");
    // Sky fills what it fills directly before a galaxy as well, but for the pixels in which packets start.
    assert!(sky <= plain && sky > 0.97 * plain, "{sky}, {plain}");
}

#[test]
fn measurements_are_read_after_the_exposures_before_them() {
    let trail = |scene: Option<&str>| {
        let text = "# observable: packet_charge\n# signal_e: 1000\n# t_yr: 5\nvalue,sigma\n1000,1\n";
        let mission = repeated(1e6, scene);
        let data = vec![DataSet::of(Table::parse("packets.csv", text).unwrap(), &mission).unwrap()];
        predict(&Model::new(&mission), &questions(&data)).unwrap()[0]
    };
    let [plain, same] = [None, Some("same")].map(trail);
    assert!(same > plain + 1.0 && same <= 1000.0, "{same} e-, {plain} e-");
}
