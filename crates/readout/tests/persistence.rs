//! Frames read one after another, against a program that follows every pixel through all of them in time.

use ctiplan_readout::{Cloud, Downstream, Method, Persistence, Readout, Trap};
use ndarray::Array2;

const EXACT: Method = Method::Exact;
const FAST: Method = Method::Fast { relative: 1e-6 };

/// Full well (e-), and power.
const CLOUD: (f64, f64) = (2000.0, 0.5);

/// Heights at which the program counts filled traps.
const LEVELS: usize = 20_000;

/// Times in units of one transfer.
const EXPOSURE: f64 = 300.0;
const DEAD: f64 = 250.0;

/// Traps that release within the readout, and during the exposures.
const TRAPS: [(f64, f64); 3] = [(0.2, 3.0), (0.3, 150.0), (0.4, 900.0)];

/// Fractions filled at each height by species.
struct Pixel(Vec<Vec<f64>>);

impl Pixel {
    /// Traps release for some lines; gives what they release, e-.
    fn release(&mut self, traps: &[(f64, f64)], lines: f64) -> f64 {
        let mut released_e = 0.0;
        for ((density, release), filled) in traps.iter().zip(&mut self.0) {
            let kept = (-lines / release).exp();
            released_e += density / LEVELS as f64 * (1.0 - kept) * filled.iter().sum::<f64>();
            filled.iter_mut().for_each(|filled| *filled *= kept);
        }
        released_e
    }

    /// A packet fills the traps that it reaches.
    fn capture(&mut self, traps: &[(f64, f64)], charge_e: &mut f64) {
        let height = (*charge_e / CLOUD.0).powf(CLOUD.1).min(1.0);
        let reached = (height * LEVELS as f64).round() as usize;
        for ((density, _), filled) in traps.iter().zip(&mut self.0) {
            let empty: f64 = filled[..reached].iter().map(|filled| 1.0 - filled).sum();
            *charge_e -= density / LEVELS as f64 * empty;
            filled[..reached].fill(1.0);
        }
    }
}

/// Frames of one column, all of whose rows are given, read one after another; each moves all its packets at once.
fn followed_in_time(frames_e: &[Vec<f64>], traps: &[(f64, f64)]) -> Vec<Vec<f64>> {
    let rows = frames_e[0].len();
    let mut pixels: Vec<Pixel> = (0..rows).map(|_| Pixel(vec![vec![0.0; LEVELS]; traps.len()])).collect();
    // Lines since a pixel was looked at.
    let mut since = vec![0.0; rows];
    let mut read = Vec::new();
    for frame_e in frames_e {
        let mut packets_e = frame_e.clone();
        for (pixel, charge_e) in packets_e.iter_mut().enumerate() {
            // What was released before the exposure is gone.
            pixels[pixel].release(traps, since[pixel]);
            *charge_e += pixels[pixel].release(traps, EXPOSURE);
            pixels[pixel].capture(traps, charge_e);
            since[pixel] = 0.0;
        }
        for line in 1..rows {
            for (pixel, charge_e) in pixels.iter_mut().zip(&mut packets_e[line..]) {
                *charge_e += pixel.release(traps, 1.0);
                pixel.capture(traps, charge_e);
            }
        }
        // Packets of the last row have gone, and no other comes.
        for (pixel, since) in since.iter_mut().enumerate() {
            *since = DEAD - (rows - 1 - pixel) as f64;
        }
        read.push(packets_e);
    }
    read
}

fn detector(method: Method, traps: &[(f64, f64)], frames: u32, same_scene: bool, rows: usize) -> Persistence {
    Persistence {
        readout: Readout {
            traps: traps.iter().map(|(density, release)| Trap::new(*density, *release)).collect(),
            cloud: Cloud::new(CLOUD.0, 0.0, CLOUD.1),
            method,
        },
        frames,
        same_scene,
        rows: rows as u32,
        dead_transfers: DEAD,
        exposure_transfers: EXPOSURE,
    }
}

/// Sky and a galaxy in its middle.
fn column(rows: usize, centre: usize, ripple_e: usize) -> Vec<f64> {
    let galaxy = |row: usize| 600.0 * (1.0 + ((row as f64 - centre as f64) / 2.0).powi(2)).powf(-2.5);
    (0..rows).map(|row| 100.0 + galaxy(row) + (ripple_e * ((row * 37) % 11)) as f64).collect()
}

fn farthest(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).fold(0.0, |most, (one, other)| (one - other).abs().max(most))
}

fn read(detector: &Persistence, column_e: &[f64], downstream: Downstream) -> Vec<f64> {
    let image = Array2::from_shape_vec((column_e.len(), 1), column_e.to_vec()).unwrap();
    detector.parallel_after_each(&image, downstream.rows, &[downstream.charge_e]).into_raw_vec_and_offset().0
}

#[test]
fn a_whole_column_is_read_as_if_all_pixels_were_followed_through_all_frames() {
    let column_e = column(60, 35, 1);
    let sky_e = vec![100.0; 60];
    for same_scene in [true, false] {
        let before_e = if same_scene { &column_e } else { &sky_e };
        let frames_e = [vec![before_e.clone(); 3], vec![column_e.clone()]].concat();
        let followed = followed_in_time(&frames_e, &TRAPS);
        let plain = &followed_in_time(std::slice::from_ref(&column_e), &TRAPS)[0];
        let wanted = &followed[3];
        let persists = farthest(wanted, plain) / farthest(plain, &column_e);
        for method in [EXACT, FAST] {
            let found =
                read(&detector(method, &TRAPS, 3, same_scene, 60), &column_e, Downstream { rows: 0, charge_e: 100.0 });
            let error = farthest(&found, wanted) / farthest(plain, &column_e);
            println!("same scene {same_scene}, {method:?}: {error:.1e}; persistence {persists:.2}");
            // The heights of the program: half of one, of a trap, in 60 pixels.
            assert!(error < 2e-4 && persists > 50.0 * error, "{error:e}, {persists}");
        }
    }
}

/// The sky around the stamp is not part of the image: that ahead has lost a little more than is assumed to pixels that no packet had passed, and has
/// what they released.
#[test]
fn a_stamp_within_sky_is_read_as_part_of_its_column() {
    let (ahead, behind) = (100, 40);
    let stamp_e = column(30, 15, 0);
    let whole_e = [vec![100.0; ahead], stamp_e.clone(), vec![100.0; behind]].concat();
    let rows = whole_e.len();
    for same_scene in [true, false] {
        let before_e = if same_scene { whole_e.clone() } else { vec![100.0; rows] };
        let frames_e = [vec![before_e; 2], vec![whole_e.clone()]].concat();
        let wanted = &followed_in_time(&frames_e, &TRAPS)[2][ahead..ahead + 30];
        for method in [EXACT, FAST] {
            let downstream = Downstream { rows: ahead as i64, charge_e: 100.0 };
            let found = read(&detector(method, &TRAPS, 2, same_scene, rows), &stamp_e, downstream);
            let error = farthest(&found, wanted) / farthest(wanted, &stamp_e);
            println!("stamp, same scene {same_scene}, {method:?}: {error:.1e}");
            assert!(error < 1e-2, "{method:?}: {error:e}");
        }
    }
}

#[test]
fn traps_that_are_fast_compared_with_the_cadence_keep_nothing() {
    let traps = [(0.3, 2.0), (0.2, 8.0)];
    let column_e = column(40, 20, 3);
    for downstream in [Downstream::NONE, Downstream { rows: 50, charge_e: 100.0 }] {
        for method in [EXACT, FAST] {
            for same_scene in [true, false] {
                let detector = detector(method, &traps, 2, same_scene, 120);
                let plain = detector.readout.column(&column_e, downstream);
                let found = read(&detector, &column_e, downstream);
                let error = farthest(&found, &plain) / farthest(&plain, &column_e);
                let allowed = if method == EXACT { 1e-10 } else { 1e-5 };
                assert!(error < allowed, "{method:?}: {error:e}");
            }
        }
    }
}

#[test]
fn slow_traps_that_are_full_take_less_from_the_same_scene() {
    let stamp_e = column(30, 15, 0);
    let downstream = Downstream { rows: 300, charge_e: 100.0 };
    // From traps that last through the readout to those that last through many exposures.
    let lost = |release: f64, frames: u32| {
        let read = read(&detector(EXACT, &[(0.3, release)], frames, true, 360), &stamp_e, downstream);
        stamp_e[15] - read[15]
    };
    for (release, least, most) in [(100.0, 0.9, 1.0), (1000.0, 0.2, 0.8), (20_000.0, 0.0, 0.1)] {
        let kept = lost(release, 4) / lost(release, 0);
        assert!((least..most).contains(&kept), "{release}: {kept}");
    }
}

#[test]
fn no_frames_before_are_a_readout() {
    let column_e = column(40, 20, 3);
    for downstream in
        [Downstream::NONE, Downstream { rows: -7, charge_e: 100.0 }, Downstream { rows: 50, charge_e: 100.0 }]
    {
        for traps in [TRAPS.to_vec(), vec![(30.0, 4.0)]] {
            let detector = detector(EXACT, &traps, 0, true, 120);
            let plain = detector.readout.column(&column_e, downstream);
            let found = read(&detector, &column_e, downstream);
            assert!(farthest(&found, &plain) < 1e-9, "{downstream:?}: {:e}", farthest(&found, &plain));
        }
    }
}
