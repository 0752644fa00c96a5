//! Changes of shape against ArCTIc with every transfer computed, on galaxies drawn by GalSim (`tests/golden/shapes.py`, and
//! `tests/golden/effects.py` with finite capture, spread release times, a notch and another exponent).

use serde_json::Value;

use super::damage::SpeciesState;
use super::device::Device;
use super::effects::Effects;
use super::scene::Scene;
use crate::conditions::Conditions;
use crate::galaxy::Profile;
use crate::mission::Mission;
use crate::readout::{Cloud, Method};

#[test]
fn changes_of_shape_are_those_of_arctic() {
    let golden: Value = serde_json::from_str(include_str!("../../tests/golden/shapes.json")).unwrap();
    let effects: Value = serde_json::from_str(include_str!("../../tests/golden/effects.json")).unwrap();
    let (cases, effects) = (golden["cases"].as_array().unwrap(), effects["shapes"].as_array().unwrap());
    assert!(cases.len() >= 5 && effects.len() >= 5);
    // Stamps of the script start at traps that nothing has passed; here they start in the steady state of the sky
    // downstream, which slow capture takes some rows to reach (0.3 % of delta_e1). Its columns are compared from the same
    // start: see effects_golden.rs.
    let at_once = |case: &&Value| case["traps"][0]["capture_transfers"].is_null();
    for case in cases.iter().chain(effects.iter().filter(at_once)) {
        let name = case["name"].as_str().unwrap();
        let (detector, galaxy, psf) = (&case["detector"], &case["galaxy"], &case["psf"]);
        let number = |value: &Value| value.as_f64().unwrap();
        // Transfers of a millisecond.
        let traps = case["traps"].as_array().unwrap().iter().map(|trap| SpeciesState {
            name: String::new(),
            density_per_px: number(&trap["density_per_px"]),
            release_ms: number(&trap["release_transfers"]),
            release_sigma: trap["release_sigma"].as_f64().unwrap_or(0.0),
            capture_ms: trap["capture_transfers"].as_f64().unwrap_or(0.0),
        });
        let mission = Mission::parse(include_str!("../../missions/snap_l2.toml")).unwrap();
        let device = Device {
            at: Conditions {
                line_time_ms: 1.0,
                background_e: number(&case["background_e"]),
                transfers: case["transfers"].as_u64().unwrap() as u32,
                ..Conditions::of(&mission, 0.0)
            },
            traps: traps.collect(),
            cloud: Cloud::new(
                number(&detector["full_well_e"]),
                number(&detector["notch_e"]),
                number(&detector["well_fill_power"]),
            ),
            method: Method::Fast { relative: 1e-6 },
            registers: Vec::new(),
            effects: Effects::of(&mission),
        };
        let profile = Profile::new(
            number(&galaxy["sersic_index"]),
            number(&galaxy["half_light_px"]),
            number(&galaxy["e1"]),
            number(&psf["fwhm_px"]),
            number(&psf["moffat_beta"]),
        );
        // The positions of the script: evenly spaced in x and y; the mirror images in x are left out.
        let across = [(0.125, 0.5), (0.375, 0.5)];
        let along = [-0.375, -0.125, 0.125, 0.375].map(|y| (y, 0.25));
        let (flux_e, weight_px) = (number(&galaxy["flux_e"]), number(&galaxy["weight_px"]));
        let scene = Scene::at(&profile, flux_e, number(&case["background_e"]), weight_px, &across, &along);
        let change = scene.unwrap().change_by(&device).unwrap().unwrap();
        for (what, value) in [
            ("delta_e1", change.delta_e1),
            ("delta_y_px", change.delta_y_px),
            ("delta_size", change.delta_size),
            ("delta_flux", change.delta_flux),
        ] {
            let expected = number(&case["mean"][what]);
            println!("{name} {what}: {value:.6e}, ArCTIc {expected:.6e}, {:+.1e}", value / expected - 1.0);
            assert!((value / expected - 1.0).abs() < 2e-3, "{name}: {what} is {value}, ArCTIc has {expected}");
        }
    }
}
