//! What must hold for any map.

use ctiplan_magnetosphere::drift_shell::{MOMENT, shell};
use ctiplan_magnetosphere::field::{Coefficients, Field, igrf};
use ctiplan_magnetosphere::orbit::GEOSTATIONARY;
use ctiplan_magnetosphere::{Activity, Elements, Exposure, trapped_protons};

fn elements(perigee_km: f64, apogee_km: f64, inclination_deg: f64, perigee_deg: Option<f64>) -> Elements {
    Elements { perigee_km, apogee_km, inclination_deg, argument_of_perigee_deg: perigee_deg }
}

fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|component| component * component).sum::<f64>().sqrt()
}

#[test]
fn the_field_is_the_gradient_of_a_potential_without_sources() {
    let field = Field::of(&igrf(2000.0));
    // At low altitude all degrees count; far out high ones are left out, which no derivative may show.
    for place in [[1.02, 0.1, -0.2], [-0.3, 0.8, 0.7], [1.4, -1.9, 0.6], [-3.0, 2.0, 1.0]] {
        let h = 1e-4;
        let derivative = |component: usize, axis: usize| {
            let shifted = |by: f64| {
                let mut at = place;
                at[axis] += by;
                field.at(at)[component]
            };
            (shifted(h) - shifted(-h)) / (2.0 * h)
        };
        let scale = length(field.at(place)) / length(place);
        let divergence = (0..3).map(|axis| derivative(axis, axis)).sum::<f64>();
        assert!(divergence.abs() < 1e-4 * scale, "{place:?}: {divergence} of {scale}");
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            assert!((derivative(a, b) - derivative(b, a)).abs() < 1e-4 * scale, "{place:?}");
        }
    }
}

#[test]
fn l_of_a_dipole_is_the_distance_at_which_its_lines_cross_the_equator() {
    let field = Field::of(&Coefficients::axial_dipole(MOMENT));
    for l in [1.2, 1.7, 3.0, 6.0] {
        for latitude_deg in [0.0_f64, 0.01, 1.0, 10.0, 25.0, -40.0] {
            let (sin, cos) = latitude_deg.to_radians().sin_cos();
            let radius = l * cos * cos;
            let shell = shell(&field, [radius * cos * 0.6, radius * cos * 0.8, radius * sin]).expect("a shell");
            // Hilton's formula holds to 0.01 %.
            assert!((shell.l / l - 1.0).abs() < 2e-4, "{l} {latitude_deg}: {}", shell.l);
            let b_over_b0 = (1.0 + 3.0 * sin * sin).sqrt() / cos.powi(6);
            assert!((shell.b_over_b0 / b_over_b0 - 1.0).abs() < 6e-4, "{l} {latitude_deg}: {}", shell.b_over_b0);
        }
    }
}

#[test]
fn visits_spend_their_time_as_kepler_says() {
    for orbit in [
        elements(600.0, 600.0, 28.5, None),
        elements(7000.0, 114_000.0, 40.0, None),
        elements(7000.0, 114_000.0, 40.0, Some(95.0)),
    ] {
        let count = 1 << 14;
        let visits: Vec<_> = (0..count).map(|number| orbit.visit(number, f64::INFINITY)).collect();
        let mean = |value: &dyn Fn([f64; 3]) -> f64| {
            visits.iter().map(|visit| visit.weight * value(visit.place)).sum::<f64>() / f64::from(count as u32)
        };
        // ⟨r⟩ = a (1 + e²/2); no longitude is preferred; ⟨sin² latitude⟩ = sin² i/2 where all arguments of perigee count.
        let (a, e) = (orbit.semi_major_axis_km() / 6371.2, orbit.eccentricity());
        assert!((mean(&|_| 1.0) - 1.0).abs() < 1e-3);
        assert!((mean(&length) / (a * (1.0 + 0.5 * e * e)) - 1.0).abs() < 2e-3);
        assert!((mean(&|place| place[0] / length(place))).abs() < 2e-3);
        if orbit.argument_of_perigee_deg.is_none() {
            let expected = 0.5 * orbit.inclination_deg.to_radians().sin().powi(2);
            let sin2 = mean(&|place| (place[2] / length(place)).powi(2));
            assert!((sin2 / expected - 1.0).abs() < 5e-3, "{sin2}");
        }
    }
}

#[test]
fn the_mean_over_the_perigee_is_that_of_orbits_with_it_held() {
    let all = trapped_protons(&elements(7000.0, 114_000.0, 40.0, None), Activity::Maximum);
    let held = |argument: f64| {
        trapped_protons(&elements(7000.0, 114_000.0, 40.0, Some(argument)), Activity::Maximum).flux_cm2_s
    };
    let arguments = 24;
    let each: Vec<Vec<f64>> =
        (0..arguments).map(|index| held(360.0 * f64::from(index) / f64::from(arguments))).collect();
    // 1, 10 and 50 MeV: the flux changes 45-fold with the argument.
    for (index, tolerance) in [(5, 0.006), (10, 0.006), (14, 0.01)] {
        let mean = each.iter().map(|flux| flux[index]).sum::<f64>() / f64::from(arguments);
        assert!((mean / all.flux_cm2_s[index] - 1.0).abs() < tolerance, "{index}: {mean}, {}", all.flux_cm2_s[index]);
    }
}

#[test]
fn orbits_below_and_beyond_the_belts_have_no_trapped_protons() {
    for orbit in [GEOSTATIONARY, elements(60_000.0, 300_000.0, 10.0, None)] {
        let mean = trapped_protons(&orbit, Activity::Minimum);
        // Nothing above 2 MeV.
        assert!(mean.energies_mev.iter().zip(&mean.flux_cm2_s).all(|(energy, flux)| *energy < 2.0 || *flux == 0.0));
    }
    assert!(trapped_protons(&elements(120.0, 120.0, 0.0, None), Activity::Maximum).flux_cm2_s[10] < 1e-3);
}

#[test]
fn exposure_rises_with_energy_and_distance() {
    let low = Exposure::along(&elements(540.0, 540.0, 28.5, None), 2020.0);
    let polar = Exposure::along(&elements(540.0, 540.0, 97.0, None), 2020.0);
    let far = Exposure::along(&elements(100_000.0, 300_000.0, 30.0, None), 2020.0);
    let energies = [1.0, 10.0, 100.0, 1e3, 1e4, 1e5];
    for pair in energies.windows(2) {
        assert!(low.at(pair[0]) <= low.at(pair[1]) && polar.at(pair[0]) <= polar.at(pair[1]));
    }
    assert_eq!(low.at(100.0), 0.0);
    for energy_mev in energies {
        assert!(low.at(energy_mev) <= polar.at(energy_mev) + 1e-9 && polar.at(energy_mev) < far.at(energy_mev));
    }
    assert!(far.at(1.0) > 0.999 && far.at(1.0) < 1.0);
}

#[test]
fn perigees_drift_as_satellites_show() {
    // At the critical inclination, arccos(1/√5) = 63.43°, the perigee stands; the ISS's (420 km, 51.6°) turns 3.7° a day.
    assert!(elements(500.0, 40_000.0, 63.4349, Some(270.0)).perigee_drift_deg_yr().abs() < 0.01);
    let station = elements(415.0, 425.0, 51.64, None).perigee_drift_deg_yr() / 365.25;
    assert!((station - 3.7).abs() < 0.1, "{station}");
}

#[test]
fn longitudes_repeat_if_they_do_not_all_pass_within_the_mission() {
    assert_eq!(GEOSTATIONARY.repeats_longitudes(5.0), Some(1));
    assert_eq!(elements(20_200.0, 20_200.0, 55.0, None).repeats_longitudes(5.0), Some(2));
    assert_eq!(elements(540.0, 540.0, 28.5, None).repeats_longitudes(5.0), None);
    // 24.33 h: 5.9 degrees a day, all longitudes in 61 days.
    let nearly_a_day = elements(2500.0, 70_000.0, 28.0, Some(0.0));
    assert_eq!([0.1, 0.2].map(|within_yr| nearly_a_day.repeats_longitudes(within_yr)), [Some(1), None]);
}

#[test]
fn the_quick_look_passes_over_no_proton() {
    for orbit in [
        elements(410.0, 410.0, 51.6, None),
        elements(540.0, 540.0, 28.5, None),
        elements(825.0, 825.0, 98.8, None),
        elements(300.0, 36_000.0, 63.4, None),
    ] {
        for activity in [Activity::Minimum, Activity::Maximum] {
            let (map, field) = (activity.map(), activity.field());
            let (mut with_flux, mut passed_over) = (0, 0);
            for visit in (0..6000).map(|number| orbit.visit(number, 7.5)).filter(|visit| visit.weight > 0.0) {
                let may = map.may_have_protons(length(field.at(visit.place)), activity.dipole().l(visit.place));
                let Some(shell) = shell(field, visit.place) else { continue };
                let any = map.fluxes(shell.l, shell.b_over_b0).any(|flux| flux > 0.0);
                with_flux += usize::from(any);
                passed_over += usize::from(!may);
                assert!(may || !any, "{orbit:?}: {shell:?}");
            }
            assert!(with_flux > 300 && passed_over > 300, "{with_flux} {passed_over}");
        }
    }
}
