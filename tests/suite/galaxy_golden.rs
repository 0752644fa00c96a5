//! Galaxies against GalSim (`tests/golden/galaxies.py`).

use ctiplan::physics::galaxy::Profile;
use ctiplan::physics::shape::Moments;
use serde_json::Value;

#[test]
fn galaxies_are_those_of_galsim() {
    let golden: Value = serde_json::from_str(include_str!("../golden/galaxies.json")).unwrap();
    let cases = golden["cases"].as_array().unwrap();
    assert!(cases.len() >= 14);
    for case in cases {
        let name = case["name"].as_str().unwrap();
        let number = |key: &str| case[key].as_f64().unwrap();
        let profile = Profile::new(
            number("sersic_index"),
            number("half_light_px"),
            number("e1"),
            number("fwhm_px"),
            number("moffat_beta"),
        );
        let stamp = number("flux_e") * profile.stamp(30, number("dx_px"), number("dy_px"));
        let rows = case["image_e"].as_array().unwrap();
        let peak = stamp.iter().copied().fold(0.0, f64::max);
        let mut worst = 0.0_f64;
        for (y, row) in rows.iter().enumerate() {
            for (x, expected) in row.as_array().unwrap().iter().enumerate() {
                worst = worst.max((stamp[[y, x]] - expected.as_f64().unwrap()).abs() / peak);
            }
        }
        // Asked for: 1e-3 of the peak.
        assert!(worst < 1e-4, "{name}: a pixel is off by {worst:.1e} of the peak");

        let half_px = case["moments_half_px"].as_u64().unwrap() as usize;
        let stamp = number("flux_e") * profile.stamp(half_px, number("dx_px"), number("dy_px"));
        let moments = Moments::of(&stamp, number("weight_px")).unwrap();
        for (what, value, tolerance) in [
            ("e1", moments.e1, 1e-4),
            ("e2", moments.e2, 1e-4),
            ("size_px", moments.size_px, 1e-4),
            ("x_px", moments.x_px, 1e-4),
            ("y_px", moments.y_px, 1e-4),
            ("flux_e", moments.flux_e, 1e-4 * number("flux_e")),
        ] {
            let expected = case["moments"][what].as_f64().unwrap();
            assert!((value - expected).abs() < tolerance, "{name}: {what} is {value}, GalSim has {expected}");
        }
    }
}
