//! Lone packets and blocks against ArCTIc with every transfer computed (`tests/golden/packets.py`).

use ctiplan::readout::{Cloud, Downstream, Method, Readout, Trap};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

#[test]
fn packets_and_blocks_are_those_of_arctic() {
    let golden: Value = serde_json::from_str(include_str!("../golden/packets.json")).unwrap();
    let cases = golden["cases"].as_array().unwrap();
    assert!(cases.len() >= 8);
    for case in cases {
        let name = case["name"].as_str().unwrap();
        let detector = &case["detector"];
        let readout = |method| Readout {
            traps: case["traps"]
                .as_array()
                .unwrap()
                .iter()
                .map(|trap| Trap::new(number(&trap["density_per_px"]), number(&trap["release_transfers"])))
                .collect(),
            cloud: Cloud::new(
                number(&detector["full_well_e"]),
                number(&detector["notch_e"]),
                number(&detector["well_fill_power"]),
            ),
            method,
        };
        let (background, signal) = (number(&case["background_e"]), number(&case["signal_e"]));
        let transfers = case["transfers"].as_u64().unwrap() as usize;
        let block = case["block_px"].as_u64().map_or(1, |rows| rows.max(1) as usize);
        let behind = numbers(&case["behind_e"]);
        let flat = vec![background; transfers + behind.len()];
        let mut column = flat.clone();
        column[transfers - block..transfers].fill(background + signal);
        let mut expected = vec![number(&case["packet_e"])];
        expected.extend(&behind);
        let mut expected_flat = vec![number(&case["background_packet_e"])];
        expected_flat.extend(numbers(&case["background_behind_e"]));

        let exact = readout(Method::Exact);
        for (column, expected) in [(&column, &expected), (&flat, &expected_flat)] {
            let trailed = exact.column(column, Downstream::NONE);
            for (pixel, (value, expected)) in trailed[transfers - 1..].iter().zip(expected).enumerate() {
                // Stored to 10 digits.
                let allowed = 1e-7 * expected.abs() + 1e-6;
                assert!((value - expected).abs() < allowed, "{name}, pixel {pixel}: {value}, ArCTIc has {expected}");
            }
        }
        // The fast method, to the accuracy asked for: relative to the largest displacement of charge.
        let relative = 1e-5;
        let fast = readout(Method::Fast { relative }).column(&column, Downstream::NONE);
        let trailed = exact.column(&column, Downstream::NONE);
        let displaced = trailed.iter().zip(&column).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        for (pixel, (fast, exact)) in fast.iter().zip(&trailed).enumerate() {
            assert!((fast - exact).abs() < relative * displaced, "{name}, pixel {pixel}: {fast}, exact {exact}");
        }
    }
}
