//! Changes of shape against ArCTIc with every transfer computed, on galaxies drawn by GalSim (`tests/golden/shapes.py`, and
//! `tests/golden/effects.py` with finite capture, spread release times, a notch and another exponent); and against every
//! transfer of a program of its own with traps that never release (`tests/golden/slow_traps.py`).

use ndarray::{Array2, s};
use serde_json::Value;

use super::device::Device;
use super::effects::Effects;
use super::scene::Scene;
use crate::mission::Mission;
use crate::physics::conditions::Conditions;
use crate::physics::damage::SpeciesState;
use crate::physics::galaxy::Profile;
use crate::physics::shape::{Moments, ShapeChange};
use crate::readout::{Clock, Cloud, Downstream, Method};

/// A detector whose transfers take a millisecond.
fn device(traps: Vec<SpeciesState>, cloud: Cloud, background_e: f64, transfers: u32) -> Device {
    let mission = Mission::parse(include_str!("../../missions/snap_l2.toml")).unwrap();
    Device {
        at: Conditions { line_time_ms: 1.0, background_e, transfers, ..Conditions::of(&mission, 0.0) },
        traps,
        cloud,
        clock: Clock::single(),
        store: None,
        persistence: None,
        method: Method::Fast { relative: 1e-6 },
        registers: Vec::new(),
        effects: Effects::of(&mission),
    }
}

/// A species of instantaneous capture with one release time.
fn species(density_per_px: f64, release_transfers: f64) -> SpeciesState {
    let name = String::new();
    SpeciesState {
        name,
        density_per_px,
        release_ms: release_transfers,
        release_sigma: 0.0,
        capture_ms: 0.0,
        capture_density_power: 0.0,
        capture_at_e: 161_000.0,
        well_fill_power: None,
        surface_level_e: None,
    }
}

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
        let traps = case["traps"].as_array().unwrap().iter().map(|trap| SpeciesState {
            release_sigma: trap["release_sigma"].as_f64().unwrap_or(0.0),
            capture_ms: trap["capture_transfers"].as_f64().unwrap_or(0.0),
            ..species(number(&trap["density_per_px"]), number(&trap["release_transfers"]))
        });
        let cloud = Cloud::new(
            number(&detector["full_well_e"]),
            number(&detector["notch_e"]),
            number(&detector["well_fill_power"]),
        );
        let transfers = case["transfers"].as_u64().unwrap() as u32;
        let device = device(traps.collect(), cloud, number(&case["background_e"]), transfers);
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

/// Which way slow traps stretch a galaxy: the paper says along the transfers, ctiplan across.
#[test]
fn traps_that_never_release_stretch_galaxies_across_the_transfers() {
    let golden: Value = serde_json::from_str(include_str!("../../tests/golden/slow_traps.json")).unwrap();
    let cases = golden["cases"].as_array().unwrap();
    assert!(cases.len() >= 8);
    for (index, case) in cases.iter().enumerate() {
        let number = |key: &str| case[key].as_f64().unwrap();
        let galaxy = |key: &str| case["galaxy"][key].as_f64().unwrap();
        let profile = Profile::new(
            galaxy("sersic_index"),
            galaxy("half_light_px"),
            galaxy("e1"),
            galaxy("fwhm_px"),
            galaxy("moffat_beta"),
        );
        let (flux_e, background_e, weight_px) = (number("flux_e"), number("background_e"), number("weight_px"));
        let (dx_px, dy_px) = (galaxy("dx_px"), galaxy("dy_px"));
        let scene = Scene::at(&profile, flux_e, background_e, weight_px, &[(dx_px, 1.0)], &[(dy_px, 1.0)]).unwrap();
        let cloud = Cloud::new(number("full_well_e"), 0.0, number("well_fill_power"));
        let traps = vec![species(number("density_per_px"), 1e9)];
        let device = device(traps, cloud, background_e, number("transfers") as u32);
        let change = scene.change_by(&device).unwrap().unwrap();
        // The scene starts in the steady state of the sky. It leaves out the traps between the heights of the sky before and
        // after its first pixel, which stay full for ever here: second order in the density.
        let density_per_px = number("density_per_px");
        near(case, &change, 2e-4 + 1e-2 * density_per_px * density_per_px);
        if index == 1 {
            // The whole column, as the script reads it.
            let half_px = (5.0 * weight_px).ceil() as usize;
            let charge_e = flux_e * profile.stamp(half_px, dx_px, dy_px);
            let sky_rows = number("transfers") as usize - 1 - half_px;
            let mut image = Array2::from_elem((sky_rows + charge_e.nrows(), charge_e.ncols()), background_e);
            let sky = image.clone();
            let mut stamp = image.slice_mut(s![sky_rows.., ..]);
            stamp += &charge_e;
            let readout = device.readout();
            let read = readout.parallel(&image, Downstream::NONE) - readout.parallel(&sky, Downstream::NONE);
            let read = read.slice(s![sky_rows.., ..]).to_owned();
            let [before, after] = [&charge_e, &read].map(|image| Moments::of(image, weight_px).unwrap());
            near(case, &ShapeChange::between(&before, &after), 2e-4);
        }
        assert!(change.delta_e1 > 0.0);
    }
}

/// Whether a change is that of a golden case, relative to each member; the change of size relative to that of the flux, for it is the
/// small difference of what core and wings lose.
fn near(case: &Value, change: &ShapeChange, tolerance: f64) {
    for (what, value) in [
        ("delta_e1", change.delta_e1),
        ("delta_y_px", change.delta_y_px),
        ("delta_size", change.delta_size),
        ("delta_flux", change.delta_flux),
    ] {
        let expected = case["change"][what].as_f64().unwrap();
        let scale = if what == "delta_size" { change.delta_flux } else { expected };
        let off = (value - expected) / scale;
        println!("{what}: {value:.6e}, every transfer {expected:.6e}, {off:+.1e}");
        assert!(off.abs() < tolerance, "{case}: {what} is {value}, every transfer gives {expected}");
    }
}

/// The same for a Gaussian, where a pencil is enough: each row loses what it has more than the row before it, so a share f of
/// the flux is lost half a pixel behind the slope of the leading side. With the rms size d (px), and d_b that of the
/// difference of two rows, d_b² = d² + 1/12:
///
/// ```text
/// Δe1 / f = (⟨y²⟩ − d²) / 2d²,   ⟨y²⟩ = 2 d_b² − √(π/2) d_b + 1/4,   Δd/d = −Δe1 / 2
/// ```
#[test]
fn a_gaussian_loses_its_leading_side_to_traps_that_never_release() {
    // In a linear well the loss is proportional to the difference of rows. Few traps, so that the galaxy hardly changes; many
    // transfers, so that all of its rows make nearly the same number.
    let device = device(vec![species(0.02, 1e9)], Cloud::new(161_000.0, 0.0, 1.0), 10.0, 20_000);
    for sigma_px in [1.0_f64, 2.0, 4.0] {
        let weight_px = 8.0 * sigma_px;
        let profile = Profile::new(0.5, (2.0 * 2.0_f64.ln()).sqrt() * sigma_px, 0.0, 0.01, 20.0);
        let along = [-0.375, -0.125, 0.125, 0.375].map(|y_px| (y_px, 0.25));
        let scene = Scene::at(&profile, 1000.0, 10.0, weight_px, &[(0.0, 1.0)], &along).unwrap();
        let change = scene.change_by(&device).unwrap().unwrap();
        let d2 = scene.before().size_px.powi(2);
        let d_b = (d2 + 1.0 / 12.0).sqrt();
        let y2 = 2.0 * d_b * d_b - std::f64::consts::FRAC_PI_2.sqrt() * d_b + 0.25;
        let expected = 0.5 * (y2 - d2) / d2;
        let found = -change.delta_e1 / change.delta_flux;
        println!("{sigma_px}: {found} {expected} {}", change.delta_size / change.delta_e1);
        assert!((found - expected).abs() < 0.005, "{sigma_px} px: {found}, on paper {expected}");
        assert!((change.delta_size / change.delta_e1 + 0.5).abs() < 0.02, "{sigma_px} px: {change:?}");
    }
}

/// Two positions in x are as good as twelve, for narrow PSFs too: what they leave is less than what four in y leave.
#[test]
fn few_positions_across_are_as_good_as_many() {
    let device = device(vec![species(0.05, 0.5), species(0.05, 30.0)], Cloud::new(161_000.0, 0.0, 0.5), 120.0, 1650);
    for fwhm_px in [0.7, 1.0, 2.9] {
        let mut largest = [0.0_f64; 3];
        for (sersic_index, half_light_px) in [(1.0, 0.5), (4.0, 0.5), (4.0, 3.0)] {
            let profile = Profile::new(sersic_index, half_light_px, 0.2, fwhm_px, 3.5);
            let at = |positions: [u32; 2]| {
                let scene = Scene::new(&profile, 3000.0, 120.0, 4.0, positions).unwrap();
                scene.change_by(&device).unwrap().unwrap().delta_e1
            };
            let few = super::scene::positions_across(4);
            let off = [([few, 4], [12, 4]), ([few, 4], [few, 16]), ([few, 8], [few, 16])]
                .map(|(few, many)| (at(few) / at(many) - 1.0).abs());
            largest = std::array::from_fn(|place| largest[place].max(off[place]));
        }
        let [two_in_x, four_in_y, eight_in_y] = largest;
        println!("{fwhm_px} px: two in x {two_in_x:.0e}, four in y {four_in_y:.0e}, eight in y {eight_in_y:.0e}");
        assert!(two_in_x < four_in_y, "{fwhm_px} px: {two_in_x:e}, {four_in_y:e}");
    }
}
