//! Packets, blocks and shapes with slow capture, spread release times, notches and other exponents, against ArCTIc with
//! every transfer computed, and against the contract's law where ArCTIc has another (`tests/golden/effects.py`).

use ctiplan::readout::{Cloud, Downstream, Method, Readout, Trap};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn readout(case: &Value, method: Method) -> Readout {
    let detector = &case["detector"];
    let trap = |trap: &Value| Trap {
        release_sigma: trap["release_sigma"].as_f64().unwrap_or(0.0),
        capture_transfers: trap["capture_transfers"].as_f64().unwrap_or(0.0),
        ..Trap::new(number(&trap["density_per_px"]), number(&trap["release_transfers"]))
    };
    Readout {
        traps: case["traps"].as_array().unwrap().iter().map(trap).collect(),
        cloud: Cloud::new(
            number(&detector["full_well_e"]),
            number(&detector["notch_e"]),
            number(&detector["well_fill_power"]),
        ),
        method,
    }
}

#[test]
fn packets_and_blocks_with_every_effect_are_those_of_other_programs() {
    let golden: Value = serde_json::from_str(include_str!("../golden/effects.json")).unwrap();
    for case in golden["cases"].as_array().unwrap() {
        let name = case["name"].as_str().unwrap();
        let (background_e, signal_e) = (number(&case["background_e"]), number(&case["signal_e"]));
        let transfers = case["transfers"].as_i64().unwrap();
        let block_px = case["block_px"].as_i64().unwrap();
        let flat = vec![background_e; block_px as usize + 60];
        let mut column = flat.clone();
        column[..block_px as usize].fill(background_e + signal_e);
        let downstream = Downstream { rows: transfers - block_px, charge_e: background_e };
        let readout = readout(case, Method::Fast { relative: 1e-6 });
        let (read, flat) = (readout.column(&column, downstream), readout.column(&flat, downstream));
        let last = block_px as usize - 1;
        let found: Vec<f64> = read[last..].iter().zip(&flat[last..]).map(|(read, flat)| read - flat).collect();
        // ArCTIc; and the contract's own law where ArCTIc has another, by up to 2e-4 of the trail.
        for (whose, truth, allowed) in [("ArCTIc", case, 1e-3), ("the contract", &case["contract"], 2e-5)] {
            if truth.is_null() {
                continue;
            }
            let (behind, background) = (numbers(&truth["behind_e"]), numbers(&truth["background_behind_e"]));
            let mut expected = vec![number(&truth["packet_e"]) - number(&truth["background_packet_e"])];
            expected.extend(behind.iter().zip(&background).map(|(behind, background)| behind - background));
            assert_eq!(expected.len(), found.len());
            let off = |row: usize| (found[row] - expected[row]).abs();
            let lost = off(0) / (expected[0] - signal_e).abs();
            let largest = expected[1..].iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            let trail = (1..found.len()).map(off).fold(0.0, f64::max) / largest;
            println!("{name}, {whose}: {lost:.1e} of the loss, {trail:.1e} of the trail");
            assert!(
                lost < allowed && trail < allowed,
                "{name}, {whose}: {lost:.1e} of the loss, {trail:.1e} of the trail"
            );
        }
    }
}

#[test]
fn columns_through_galaxies_are_those_of_other_programs() {
    let golden: Value = serde_json::from_str(include_str!("../golden/effects.json")).unwrap();
    for case in golden["shapes"].as_array().unwrap() {
        let name = case["name"].as_str().unwrap();
        let before = numbers(&case["column_before_e"]);
        let background = vec![number(&case["background_e"]); before.len()];
        let half = before.len() as i64 / 2;
        // Nothing has passed before the stamp.
        let downstream = Downstream { rows: case["transfers"].as_i64().unwrap() - 1 - half, charge_e: 0.0 };
        let readout = readout(case, Method::Fast { relative: 1e-6 });
        let truth = if case["contract"].is_null() { case } else { &case["contract"] };
        for (column, expected) in [(&before, "column_e"), (&background, "column_background_e")] {
            let expected = numbers(&truth[expected]);
            let moved = expected.iter().zip(column).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let found = readout.column(column, downstream);
            let off = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{name}: {off:.1e} e- of {moved:.1} e-");
            // Release times are resolved to 1e-6, and golden values kept to ten digits.
            assert!(off <= 2e-5 * moved + 1e-6, "{name}: off by {off:.1e} e-, {moved:.1} e- were moved");
        }
    }
}
