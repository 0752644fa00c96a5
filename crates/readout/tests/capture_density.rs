//! Capture that is faster in denser clouds, against a program that integrates the rate equation of every trap in time.

use ctiplan_readout::{CaptureDensity, Clock, Cloud, Downstream, Method, Readout, Trap};
use ndarray::Array2;

const EXACT: Method = Method::Exact;
const FAST: Method = Method::Fast { relative: 1e-5 };

/// Full well, notch (e-), power, volume at zero charge: Rhodes et al. 2010, equation 1, with Clarke et al. 2012.
#[derive(Clone, Copy)]
struct Well(f64, f64, f64, f64);

impl Well {
    fn height(self, charge_e: f64) -> f64 {
        let Well(full_well_e, notch_e, power, volume_at_zero) = self;
        let above = ((charge_e - notch_e) / (full_well_e - notch_e)).max(0.0).powf(power).min(1.0);
        if charge_e > 0.0 { volume_at_zero + (1.0 - volume_at_zero) * above } else { 0.0 }
    }

    fn cloud(self) -> Cloud {
        let Well(full_well_e, notch_e, power, volume_at_zero) = self;
        Cloud::new(full_well_e, notch_e, power).with_volume_at_zero(volume_at_zero)
    }
}

const WELLS: [Well; 4] = [
    Well(84_700.0, 0.0, 0.5, 0.0),
    Well(84_700.0, 0.0, 0.58, 0.1),
    Well(84_700.0, 90.0, 0.5, 0.0),
    Well(84_700.0, 90.0, 0.31, 0.2),
];

/// Species that need 0.2 and 3 transfers to capture in a cloud of 2000 e-, and less in a denser one.
fn species(power: f64) -> Vec<Trap> {
    let slow = |trap: Trap, capture_transfers: f64| Trap {
        capture_transfers,
        capture_density: Some(CaptureDensity { power, at_e: 2000.0 }),
        ..trap
    };
    vec![slow(Trap::new(0.4, 2.0), 0.2), slow(Trap::new(0.3, 9.0), 3.0)]
}

/// Sky, a galaxy, a lone packet, a faint one and one within the notch.
fn scene(background_e: f64) -> Vec<f64> {
    let galaxy = |row: i32| 2500.0 * (-0.5 * (f64::from(row - 8) / 1.6).powi(2)).exp();
    let source = |row: i32| match row {
        20 => 1500.0,
        24 => 300.0,
        27 => 40.0,
        _ => 0.0,
    };
    (0..34).map(|row| background_e + galaxy(row) + source(row)).collect()
}

/// Steps of the fourth order in which the rate equation is integrated over a transfer.
const STEPS: usize = 100;

/// df/dt = (1 − f) rate − f/τ over one transfer.
fn integrated(mut filled: f64, capture_rate: f64, release_rate: f64) -> f64 {
    let slope = |filled: f64| (1.0 - filled) * capture_rate - filled * release_rate;
    let step = 1.0 / STEPS as f64;
    for _ in 0..STEPS {
        let k1 = slope(filled);
        let k2 = slope(filled + 0.5 * step * k1);
        let k3 = slope(filled + 0.5 * step * k2);
        let k4 = slope(filled + step * k3);
        filled += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    filled
}

/// Every packet in every pixel, one after another, and every trap between two heights at which a cloud has ended.
fn followed(column_e: &[f64], traps: &[Trap], well: Well) -> Vec<f64> {
    let mut packets_e = column_e.to_vec();
    for pixel in (0..packets_e.len()).rev() {
        // Tops of the levels, and fractions filled of each species.
        let mut levels: Vec<(f64, Vec<f64>)> = vec![(1.0, vec![0.0; traps.len()])];
        for charge_e in &mut packets_e[pixel..] {
            let height = well.height(*charge_e);
            let at = levels.iter().position(|(top, _)| *top >= height).unwrap();
            if height > 0.0 && levels[at].0 > height {
                levels.insert(at, (height, levels[at].1.clone()));
            }
            let arrived_e = *charge_e;
            let mut floor = 0.0;
            for (top, filled) in &mut levels {
                for (trap, filled) in traps.iter().zip(filled) {
                    let law = trap.capture_density.unwrap();
                    let density_e = |charge_e: f64| charge_e / well.height(charge_e);
                    let rate = (density_e(arrived_e) / density_e(law.at_e)).powf(law.power) / trap.capture_transfers;
                    let inside = *top <= height;
                    let after = integrated(*filled, if inside { rate } else { 0.0 }, 1.0 / trap.release_transfers);
                    *charge_e -= trap.density_per_px * (*top - floor) * (after - *filled);
                    *filled = after;
                }
                floor = *top;
            }
        }
    }
    packets_e
}

fn readout(traps: Vec<Trap>, well: Well, method: Method) -> Readout {
    Readout { traps, cloud: well.cloud(), method }
}

/// Largest difference of two columns over the largest change that the other made.
fn apart(one: &[f64], other: &[f64], before: &[f64]) -> f64 {
    let most =
        |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    most(one, other) / most(other, before)
}

#[test]
fn each_trap_fills_as_its_rate_equation_says() {
    for well in WELLS {
        for power in [0.5, 1.0] {
            let traps = species(power);
            for background_e in [60.0, 900.0] {
                let column_e = scene(background_e);
                let wanted = followed(&column_e, &traps, well);
                let error = |method, wanted: &[f64]| {
                    apart(&readout(traps.clone(), well, method).column(&column_e, Downstream::NONE), wanted, &column_e)
                };
                let exact = error(EXACT, &wanted);
                let fast = error(FAST, &wanted);
                let levels = error(Method::Fractional { levels: 20_000 }, &wanted);
                println!("power {power}, {background_e} e-: exact {exact:.1e}, fast {fast:.1e}, levels {levels:.1e}");
                // The steps of the integration leave 1e-8; the levels are half of one apart.
                assert!(exact < 1e-7 && fast < 5e-5 && levels < 1e-3, "{exact:e}, {fast:e}, {levels:e}");
            }
        }
    }
}

/// Rows of background in front are followed until the traps settle, instead of being read.
#[test]
fn a_stamp_behind_sky_is_read_as_part_of_its_column() {
    let (rows, background_e) = (150, 60.0);
    for well in WELLS {
        let traps = species(1.0);
        let stamp_e = scene(background_e);
        let whole_e = [vec![background_e; rows], stamp_e.clone()].concat();
        let wanted = readout(traps.clone(), well, EXACT).column(&whole_e, Downstream::NONE);
        for method in [EXACT, FAST] {
            let downstream = Downstream { rows: rows as i64, charge_e: background_e };
            let found = readout(traps.clone(), well, method).column(&stamp_e, downstream);
            let error = apart(&found, &wanted[rows..], &stamp_e);
            println!("{method:?}: {error:.1e}");
            assert!(error < 1e-3, "{method:?}: {error:e}");
        }
    }
}

#[test]
fn a_power_of_zero_is_one_capture_time() {
    let column_e = scene(60.0);
    let downstream = Downstream { rows: 200, charge_e: 60.0 };
    for well in WELLS {
        let by_density = species(0.0);
        let constant: Vec<Trap> = by_density.iter().map(|trap| Trap { capture_density: None, ..*trap }).collect();
        for method in [EXACT, FAST, Method::CarriedTraps] {
            let [one, other] = [by_density.clone(), constant.clone()]
                .map(|traps| readout(traps, well, method).column(&column_e, downstream));
            assert!(apart(&one, &other, &column_e) < 1e-10, "{method:?}");
        }
        for method in [Method::Fractional { levels: 300 }, Method::MonteCarlo { seed: 3 }] {
            let [one, other] = [by_density.clone(), constant.clone()]
                .map(|traps| readout(traps, well, method).column(&column_e, downstream));
            assert_eq!(one, other, "{method:?}");
        }
    }
}

/// In denser clouds than that of the reference capture is faster, in thinner ones slower.
#[test]
fn a_larger_power_weakens_the_capture_of_faint_packets_and_strengthens_that_of_bright_ones() {
    let lost = |signal_e: f64, power: f64| {
        let column_e = [vec![0.0; 4], vec![signal_e], vec![0.0; 30]].concat();
        let read = readout(species(power), WELLS[0], EXACT).column(&column_e, Downstream { rows: 60, charge_e: 0.0 });
        (signal_e - read[4]) / signal_e
    };
    for signal_e in [20.0, 200.0, 1500.0] {
        let lost = [0.0, 0.3, 0.6, 1.0].map(|power| lost(signal_e, power));
        assert!(lost.windows(2).all(|pair| pair[1] < 0.995 * pair[0]), "{signal_e} e-: {lost:?}");
    }
    for signal_e in [3000.0, 50_000.0] {
        let lost = [0.0, 0.3, 0.6, 1.0].map(|power| lost(signal_e, power));
        assert!(lost.windows(2).all(|pair| pair[1] > pair[0]), "{signal_e} e-: {lost:?}");
    }
}

#[test]
fn no_electron_is_made_or_lost() {
    // A cloud in proportion to its charge, or one so thin that nothing is captured, lets go of every electron in the end.
    for (volume_at_zero, power) in [(0.0, 1.0), (0.02, 1.0), (0.02, 2.0)] {
        let column_e = [scene(0.0), vec![0.0; 600]].concat();
        let traps = species(power);
        for method in [EXACT, FAST] {
            let well = Well(84_700.0, 0.0, 1.0, volume_at_zero);
            let read = readout(traps.clone(), well, method).column(&column_e, Downstream { rows: 40, charge_e: 0.0 });
            let (before, after) = (column_e.iter().sum::<f64>(), read.iter().sum::<f64>());
            let moved = column_e.iter().zip(&read).map(|(before, after)| (before - after).abs()).sum::<f64>();
            println!("{power}, {method:?}: {:.1e} of {moved}", (before - after).abs());
            assert!((before - after).abs() < 1e-6 * moved && moved > 1.0, "{method:?}: {before}, {after}");
        }
    }
}

#[test]
fn random_traps_do_the_same_in_the_mean() {
    let traps = species(1.0);
    let column_e = scene(40.0);
    let downstream = Downstream { rows: 30, charge_e: 40.0 };
    let exact = readout(traps.clone(), WELLS[0], EXACT).column(&column_e, downstream);
    let seeds = 3000;
    let (mut sum, mut squares) = (vec![0.0; column_e.len()], vec![0.0; column_e.len()]);
    for seed in 0..seeds {
        let read = readout(traps.clone(), WELLS[0], Method::MonteCarlo { seed }).column(&column_e, downstream);
        for (row, read) in read.iter().enumerate() {
            sum[row] += read;
            squares[row] += read * read;
        }
    }
    for row in 0..column_e.len() {
        let mean = sum[row] / seeds as f64;
        let error = ((squares[row] / seeds as f64 - mean * mean) / seeds as f64).sqrt();
        // As in clocked.rs: not farther off than by chance once in ten thousand such tests; whole electrons change heights a little.
        assert!((mean - exact[row]).abs() < 4.5 * error + 0.01, "row {row}: {mean} +- {error}, {}", exact[row]);
    }
}

#[test]
fn carried_traps_are_the_same_in_a_handful_of_passes() {
    let readout = readout(Clock::single().spread(&species(1.0)), WELLS[1], Method::CarriedTraps);
    let image = Array2::from_shape_vec((34, 1), scene(60.0)).unwrap();
    let wanted = readout.parallel(&image, Downstream { rows: 80, charge_e: 0.0 });
    let found = readout.parallel_carried(&image, 80, 1e-4);
    let [found, wanted, image] = [found, wanted, image].map(|image| image.into_raw_vec_and_offset().0);
    let error = apart(&found, &wanted, &image);
    assert!(error < 1e-4, "{error:e}");
}
