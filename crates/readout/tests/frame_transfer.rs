//! Frame transfer, against a program that moves all packets of image and store at once and follows every pixel in time.

use ctiplan_readout::{Cloud, Downstream, FrameTransfer, Method, Readout, Trap};
use ndarray::Array2;

/// Heights at which the program counts filled traps.
const LEVELS: usize = 20_000;

const CLOUD: (f64, f64) = (2000.0, 0.5);

/// Traps per pixel in the image region, and release times in ms.
const TRAPS: [(f64, f64); 2] = [(0.3, 2.0), (0.2, 15.0)];

const LINE_MS: f64 = 4.0;
const STORE_RATIO: f64 = 0.6;

/// One pixel: fractions filled at each height by species, and when a packet was last there.
struct Pixel {
    density: [f64; 2],
    filled: Vec<[f64; LEVELS]>,
    last_ms: f64,
}

impl Pixel {
    fn new(ratio: f64) -> Pixel {
        Pixel { density: TRAPS.map(|(density, _)| ratio * density), filled: vec![[0.0; LEVELS]; 2], last_ms: 0.0 }
    }

    /// A packet comes at a time: traps release to it since the last one, and it fills those that it reaches.
    fn meet(&mut self, charge_e: &mut f64, at_ms: f64) {
        let per_level = self.density.map(|density| density / LEVELS as f64);
        for (species, filled) in self.filled.iter_mut().enumerate() {
            let kept = (-(at_ms - self.last_ms) / TRAPS[species].1).exp();
            *charge_e += per_level[species] * (1.0 - kept) * filled.iter().sum::<f64>();
            filled.iter_mut().for_each(|filled| *filled *= kept);
        }
        let reached = ((*charge_e / CLOUD.0).powf(CLOUD.1) * LEVELS as f64).round() as usize;
        for (species, filled) in self.filled.iter_mut().enumerate() {
            *charge_e -= per_level[species] * filled[..reached].iter().map(|filled| 1.0 - filled).sum::<f64>();
            filled[..reached].fill(1.0);
        }
        self.last_ms = at_ms;
    }
}

/// What is read of a column that touches a store of n rows.
fn followed_in_time(column_e: &[f64], store_rows: usize, burst_ms: f64) -> Vec<f64> {
    let rows = column_e.len();
    // From the register on.
    let mut pixels: Vec<Pixel> =
        (0..store_rows + rows).map(|place| Pixel::new(if place < store_rows { STORE_RATIO } else { 1.0 })).collect();
    let mut packets_e = column_e.to_vec();
    let mut at_ms = 0.0;
    // In the image, before the first shift; after each shift a packet is in the next pixel.
    for shift in 0..store_rows + rows {
        for (row, charge_e) in packets_e.iter_mut().enumerate() {
            if let Some(place) = (store_rows + row).checked_sub(shift) {
                pixels[place].meet(charge_e, at_ms);
            }
        }
        at_ms += if shift < store_rows { burst_ms } else { LINE_MS };
    }
    packets_e
}

fn detector(method: Method, store_rows: u32, burst_ms: f64) -> FrameTransfer {
    let region = |ratio: f64, transfer_ms: f64| Readout {
        traps: TRAPS.iter().map(|(density, ms)| Trap::new(ratio * density, ms / transfer_ms)).collect(),
        cloud: Cloud::new(CLOUD.0, 0.0, CLOUD.1),
        method,
    };
    FrameTransfer {
        image: region(1.0, burst_ms),
        burst: region(STORE_RATIO, burst_ms),
        store: region(STORE_RATIO, LINE_MS),
        rows: store_rows,
    }
}

/// Sky and a galaxy in its middle.
fn column(rows: usize, centre: usize) -> Vec<f64> {
    let galaxy = |row: usize| 600.0 * (1.0 + ((row as f64 - centre as f64) / 2.0).powi(2)).powf(-2.5);
    (0..rows).map(|row| 100.0 + galaxy(row) + ((row * 37) % 11) as f64).collect()
}

fn farthest(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).fold(0.0, |most, (one, other)| (one - other).abs().max(most))
}

fn read(detector: &FrameTransfer, column_e: &[f64], downstream: Downstream) -> Vec<f64> {
    let image = Array2::from_shape_vec((column_e.len(), 1), column_e.to_vec()).unwrap();
    detector.parallel_after_each(&image, downstream.rows, &[downstream.charge_e]).into_raw_vec_and_offset().0
}

/// Line times of the burst, ms, and the largest error, in units of the largest change: the heights of the program, half of one, of half
/// a trap, in 120 pixels.
const ERRORS: [(f64, f64); 4] = [(LINE_MS, 2e-4), (2.0, 2e-4), (0.5, 2e-4), (0.01, 2e-4)];

#[test]
fn a_whole_column_is_read_as_if_all_pixels_were_followed_in_time() {
    let column_e = column(60, 35);
    for store_rows in [60, 80] {
        for (burst_ms, allowed) in ERRORS {
            let wanted = followed_in_time(&column_e, store_rows, burst_ms);
            for method in [Method::Exact, Method::Fast { relative: 1e-6 }] {
                let found = read(&detector(method, store_rows as u32, burst_ms), &column_e, Downstream::NONE);
                let error = farthest(&found, &wanted) / farthest(&wanted, &column_e);
                println!("{store_rows} rows, {burst_ms} ms, {method:?}: {error:.1e}");
                assert!(error < allowed, "{burst_ms} ms, {method:?}: {error:e}");
            }
        }
    }
}

#[test]
fn without_a_store_it_is_a_readout() {
    let column_e = column(40, 20);
    for method in [Method::Exact, Method::Fast { relative: 1e-6 }] {
        let detector = detector(method, 0, 0.5);
        let plain = detector.image.column(&column_e, Downstream { rows: 5, charge_e: 100.0 });
        assert_eq!(read(&detector, &column_e, Downstream { rows: 5, charge_e: 100.0 }), plain);
    }
}

/// A packet that waits near the galaxy is one of 30, and the way has 200 pixels and more. The sky ahead has lost a little more than is
/// assumed to pixels that no packet had passed.
#[test]
fn a_stamp_behind_sky_is_read_as_part_of_its_column() {
    let (sky, store_rows) = (150, 250);
    let stamp_e = column(30, 15);
    let whole_e = [vec![100.0; sky], stamp_e.clone()].concat();
    for (burst_ms, allowed) in [(LINE_MS, 1e-3), (0.5, 3e-3)] {
        let wanted = followed_in_time(&whole_e, store_rows, burst_ms);
        for method in [Method::Exact, Method::Fast { relative: 1e-6 }] {
            let downstream = Downstream { rows: sky as i64, charge_e: 100.0 };
            let found = read(&detector(method, store_rows as u32, burst_ms), &stamp_e, downstream);
            let error = farthest(&found, &wanted[sky..]) / farthest(&wanted[sky..], &stamp_e);
            println!("stamp, {burst_ms} ms, {method:?}: {error:.1e}");
            assert!(error < allowed, "{burst_ms} ms, {method:?}: {error:e}");
        }
    }
}
