//! Predictions of many rows at once, against one by one.

use ctiplan::mission::Mission;
use ctiplan::model::Beside;
use ctiplan::model::Model;
use ctiplan::model::predict::{Question, predict};
use ctiplan::physics::conditions::Conditions;
use ctiplan::physics::observable::Observable;
use ctiplan::readout::{Downstream, Method};
use ndarray::{Array2, s};

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
            ..model.conditions(f64::from(4 + row % 3))
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

/// Packets at many doses and temperatures are columns side by side, of which those without damage are read apart.
#[test]
fn packets_at_many_doses_and_temperatures_are_those_read_one_by_one() {
    let base = include_str!("../../missions/snap_l2.toml");
    for effects in ["", "[effects.notch]\nnotch_e = 80.0\n", "[effects.prelaunch-traps]\nVV = 0.02\nCO = 0.01\n"] {
        let model = Model::new(&Mission::parse(&format!("{base}\n{effects}")).unwrap());
        let ats: Vec<Conditions> = (0..40)
            .map(|row| {
                let at = model.conditions(0.25 * f64::from(row));
                let temperature_k = at.temperature_k + 3.0 * f64::from(row % 4);
                let background_e = if row % 5 == 0 { 40.0 } else { 120.0 };
                let signal_e = Some(400.0 * f64::from(1 + row % 7));
                Conditions { signal_e, trail_px: Some(1 + row % 6), temperature_k, background_e, ..at }
            })
            .collect();
        let of = |at| Question { observable: Observable::Trail, at, galaxy: None, species: None };
        let together = predict(&model, &ats.iter().map(of).collect::<Vec<_>>()).unwrap();
        let largest_e = together.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        for (at, together_e) in ats.iter().zip(together) {
            let alone_e = one(&model, Observable::Trail, at);
            assert!((together_e - alone_e).abs() < 1e-5 * largest_e, "{effects} {together_e} e-, alone {alone_e} e-");
        }
    }
}

fn one(model: &Model, observable: Observable, at: &Conditions) -> f64 {
    predict(model, &[Question { observable, at, galaxy: None, species: None }]).unwrap()[0]
}

/// A packet whose charge is known as read is the one whose charge is known before transfer; blocks and ringing amplifiers too.
#[test]
fn packets_known_as_read_are_those_known_before_transfer() {
    let ringing = "[effects.signal-ringing]\nfraction = 0.02\nlength_px = 3.0\nperiod_px = 6.0\n";
    let noisy = "[effects.preflash]\nelectrons = 20.0\n[effects.prelaunch-traps]\nVV = 0.5\n";
    for effects in ["", ringing, noisy] {
        let text = format!("{}\n{effects}", include_str!("../../missions/snap_l2.toml"));
        let model = Model::new(&Mission::parse(&text).unwrap());
        for (signal_e, block_px, preceding) in
            [(300.0, None, None), (4e4, None, Some((700.0, 12))), (900.0, Some(20), None), (15.0, None, None)]
        {
            let before = Conditions {
                signal_e: Some(signal_e),
                block_px,
                preceding_e: preceding.map(|(charge_e, _)| charge_e),
                preceding_px: preceding.map(|(_, ahead_px)| ahead_px),
                trail_px: Some(2),
                first_px: Some(1),
                last_px: Some(3),
                ..model.conditions(4.0)
            };
            // The charge of a packet's own pixel, or of the last row of a block behind its own rows.
            let read_e = match block_px {
                None => one(&model, Observable::PacketCharge, &before),
                Some(rows) => {
                    let device = model.device(&before).unwrap();
                    let background_e = device.at.background_e;
                    let flat = Array2::from_elem((rows as usize, 1), background_e);
                    let downstream =
                        Downstream { rows: i64::from(before.transfers) - i64::from(rows), charge_e: background_e };
                    let read = |charge_e: &Array2<f64>| device.read(charge_e, downstream, Beside::Same).unwrap();
                    (read(&(&flat + signal_e)) - read(&flat))[[rows as usize - 1, 0]]
                }
            };
            assert!((read_e / signal_e - 1.0).abs() > 1e-6, "{read_e} e- of {signal_e} e-");
            let as_read = Conditions { signal_e: None, signal_read_e: Some(read_e), ..before.clone() };
            let observable = if block_px.is_some() { Observable::Eper } else { Observable::Trail };
            for observable in [observable, Observable::Cti] {
                let (known, found) = (one(&model, observable, &before), one(&model, observable, &as_read));
                // To the accuracy of the readout, which is relative to what it changes.
                assert!((found / known - 1.0).abs() < 1e-5, "{effects} {observable}, {signal_e}: {known}, {found}");
            }
        }
    }
}

#[test]
fn a_packet_that_the_model_never_reads_is_said_so() {
    let limited = "[effects.formula]\ntarget = \"read_e\"\nexpression = \"min(read_e, 5000)\"\n";
    let mission = Mission::parse(&format!("{}\n{limited}", include_str!("../../missions/snap_l2.toml"))).unwrap();
    let model = Model::new(&mission);
    let at = Conditions { signal_read_e: Some(9000.0), trail_px: Some(1), ..model.conditions(4.0) };
    let error = predict(&model, &[Question { observable: Observable::Trail, at: &at, galaxy: None, species: None }]);
    let error = error.unwrap_err().to_string();
    assert!(error.contains("reads 9000 e- of no packet"), "{error}");
}

/// A preceding packet is in the same column: traps that it fills take nothing from the packet, and its own trail is part of the value.
#[test]
fn a_preceding_packet_passes_the_same_traps_first() {
    let model = Model::new(&Mission::parse(include_str!("../../missions/snap_l2.toml")).unwrap());
    let alone = Conditions { signal_e: Some(1000.0), trail_px: Some(3), ..model.conditions(4.0) };
    let behind = |preceding_e: f64, preceding_px: u32| Conditions {
        preceding_e: Some(preceding_e),
        preceding_px: Some(preceding_px),
        ..alone.clone()
    };
    let read = |at: &Conditions| one(&model, Observable::PacketCharge, at);
    let nothing = (read(&behind(0.0, 5)) - read(&alone)).abs();
    assert!(nothing < 1e-5 * (1000.0 - read(&alone)), "{nothing}");
    assert!(read(&behind(5000.0, 1)) > read(&behind(5000.0, 40)) && read(&behind(5000.0, 40)) > read(&alone));
    let at = behind(5000.0, 4);
    let device = model.device(&at).unwrap();
    let background_e = device.at.background_e;
    let flat = Array2::from_elem((8, 1), background_e);
    let mut packets = flat.clone();
    (packets[[0, 0]], packets[[4, 0]]) = (background_e + 5000.0, background_e + 1000.0);
    let downstream = Downstream { rows: i64::from(at.transfers) - 5, charge_e: background_e };
    let difference = device.read(&packets, downstream, Beside::Background).unwrap()
        - device.read(&flat, downstream, Beside::Background).unwrap();
    assert!((read(&at) - difference[[4, 0]]).abs() < 1e-4);
    assert!((one(&model, Observable::Trail, &at) - difference[[7, 0]] / 1000.0).abs() < 1e-7);
}

/// Of a long block only the last rows are read out; they are those of the whole block, behind its front and any packet before it.
#[test]
fn the_front_of_a_long_block_is_not_felt() {
    let base = include_str!("../../missions/snap_l2.toml");
    for (effects, line_time_ms) in [
        ("", 400.0),
        ("[effects.notch]\nnotch_e = 80.0\n", 400.0),
        ("[effects.finite-capture]\ncapture_ms = 3.0\n", 400.0),
        // Traps that forget within a few rows and empty the first ten.
        ("[effects.prelaunch-traps]\nVV = 3.0\nCO = 30.0\n", 20_000.0),
        // Slow traps, which capture slowly too.
        (
            "[effects.extra-species]\ndensity_per_px = 2.0\nrelease_ms = 4e4\n[effects.finite-capture]\ncapture_ms = 3e3\n",
            400.0,
        ),
    ] {
        let model = Model::new(&Mission::parse(&format!("{base}\n{effects}")).unwrap());
        for ((background_e, signal_e), preceding_e) in
            [(0.0, 150.0), (120.0, 9000.0)].into_iter().flat_map(|charges| [(charges, Some(500.0)), (charges, None)])
        {
            let at = Conditions {
                signal_e: Some(signal_e),
                background_e,
                trail_px: Some(2),
                block_px: Some(700),
                preceding_e,
                preceding_px: preceding_e.map(|_| 60),
                line_time_ms,
                ..model.conditions(6.0)
            };
            let mut device = model.device(&at).unwrap();
            device.method = Method::Exact;
            let flat = Array2::from_elem((770, 1), background_e);
            let mut block = flat.clone();
            block[[0, 0]] += preceding_e.unwrap_or(0.0);
            block.slice_mut(s![60..760, ..]).fill(background_e + signal_e);
            let downstream = Downstream { rows: i64::from(at.transfers) - 760, charge_e: background_e };
            let whole = device.read(&block, downstream, Beside::Same).unwrap()
                - device.read(&flat, downstream, Beside::Same).unwrap();
            let trail_e = one(&model, Observable::Eper, &at);
            // The accuracy that the mission requests of a readout.
            assert!(
                (trail_e - whole[[761, 0]]).abs() < 1e-4 * whole[[760, 0]],
                "{effects} {signal_e}: {trail_e}, {} e-",
                whole[[761, 0]]
            );
        }
    }
}
