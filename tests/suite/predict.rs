//! Predictions of many rows at once, against one by one.

use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::predict::{Question, predict};
use ctiplan::physics::conditions::Conditions;
use ctiplan::physics::observable::Observable;

/// The readout of measured shapes is coarser than that of `evaluate`, which does not show.
#[test]
fn shapes_are_those_of_evaluate() {
    for text in [include_str!("../../missions/snap_l2.toml"), include_str!("../practice/one-epoch/mission.toml")] {
        let model = Model::new(&Mission::parse(text).unwrap());
        let at = model.conditions(4.0);
        for galaxy in 0..4 {
            let question = Question { observable: Observable::DeltaE1, at: &at, galaxy: Some(galaxy), species: None };
            let here = predict(&model, &[question]).unwrap()[0];
            let there = model.change(galaxy, 4.0).unwrap().unwrap().delta_e1;
            assert!((here / there - 1.0).abs() < 2e-5, "{here}, {there}");
        }
    }
}

/// Shapes at many doses are interpolated between a few; alone, each is computed.
#[test]
fn shapes_at_many_doses_are_those_computed_one_by_one() {
    let base = include_str!("../../missions/snap_l2.toml");
    for (effects, largest_mev_g) in [
        ("", 8e6),
        (
            "[effects.prelaunch-traps]\nVV = 0.02\nCO = 0.01\n[effects.signal-bounce]\nfraction = 0.004\nlength_px = 2.0\n",
            8e6,
        ),
        // The dose of 110 years, where the change is far from linear.
        ("", 1.78e8),
    ] {
        let mission = Mission::parse(&format!("{base}\n{effects}")).unwrap();
        let model = Model::new(&mission);
        let ats: Vec<Conditions> = (0..40)
            .map(|row| Conditions {
                dose_mev_g: Some(largest_mev_g * (f64::from(row) / 39.0).powf(1.3)),
                background_e: if row % 4 == 0 { 60.0 } else { 120.0 },
                ..model.conditions(0.0)
            })
            .collect();
        for observable in [Observable::DeltaE1, Observable::DeltaY, Observable::DeltaFlux, Observable::DeltaSize] {
            let questions: Vec<Question> =
                ats.iter().map(|at| Question { observable, at, galaxy: Some(0), species: None }).collect();
            let together = predict(&model, &questions).unwrap();
            let largest = together.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            for (question, together) in questions.iter().zip(&together).step_by(9) {
                let alone = predict(&model, std::slice::from_ref(question)).unwrap()[0];
                // A quarter of how far interpolation lets a new point be off.
                assert!((together - alone).abs() < 5e-5 * largest, "{observable}: {together}, alone {alone}");
            }
        }
    }
}

#[test]
fn order_and_threads_change_no_bit() {
    let mission = Mission::parse(include_str!("../../missions/snap_l2.toml")).unwrap();
    let model = Model::new(&mission);
    let ats: Vec<Conditions> = (0..30)
        .map(|row| Conditions {
            signal_e: Some(500.0 + 100.0 * f64::from(row % 5)),
            trail_px: Some(1 + row / 5),
            block_px: Some(40),
            ..model.conditions(4.0)
        })
        .collect();
    let observables = [Observable::Trail, Observable::PacketCharge, Observable::Eper, Observable::DeltaE1];
    let questions: Vec<Question> = ats
        .iter()
        .enumerate()
        .map(|(row, at)| Question { observable: observables[row % 4], at, galaxy: Some(row % 4), species: None })
        .collect();
    let here = predict(&model, &questions).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(5).build().unwrap();
    assert_eq!(pool.install(|| predict(&model, &questions)).unwrap(), here);
    let backwards: Vec<Question> = questions.iter().rev().copied().collect();
    let mut found = predict(&model, &backwards).unwrap();
    found.reverse();
    assert_eq!(found, here);
}
