//! Columns with traps of their own, read side by side, are read as each of them alone.

use ctiplan_readout::{Cloud, Downstream, Method, Readout, Trap};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const ROWS: usize = 60;

/// One detector at a random number of doses and temperatures, some of them twice, the first of them without traps.
fn traps(random: &mut ChaCha8Rng, columns: usize) -> Vec<Vec<Trap>> {
    let species: Vec<(f64, f64)> = (0..random.random_range(1..=4))
        .map(|_| (10_f64.powf(random.random_range(-2.0..0.5)), 10_f64.powf(random.random_range(-0.5..2.5))))
        .collect();
    let mut each = vec![Vec::new()];
    while each.len() < columns {
        let (dose, slower) = (10_f64.powf(random.random_range(-1.0..0.0)), random.random_range(0.7..1.4));
        let traps: Vec<Trap> = species
            .iter()
            .map(|(density_per_px, release)| Trap::new(dose * density_per_px, slower * release))
            .collect();
        each.extend(std::iter::repeat_n(traps, random.random_range(1..3)));
    }
    each.truncate(columns);
    each
}

fn image(random: &mut ChaCha8Rng, background_e: &[f64]) -> Array2<f64> {
    let mut image = Array2::from_shape_fn((ROWS, background_e.len()), |(_, column)| background_e[column]);
    for mut column in image.columns_mut() {
        let (first, charge_e) = (random.random_range(3..20), 10_f64.powf(random.random_range(2.0..4.5)));
        let last = first + random.random_range(1..20);
        column.slice_mut(ndarray::s![first..last]).mapv_inplace(|background_e| background_e + charge_e);
    }
    image
}

fn squares(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| (one - other).powi(2)).sum()
}

/// Root mean square change of an image that is read exactly, and by how much the fast readout misses it: the columns side by side,
/// and each alone.
fn changes_and_misses(trial: usize, random: &mut ChaCha8Rng, relative: f64) -> [f64; 3] {
    let columns = random.random_range(1..40);
    let traps = traps(random, columns);
    let traps: Vec<&[Trap]> = traps.iter().map(Vec::as_slice).collect();
    let background_e: Vec<f64> = (0..columns).map(|_| [0.0, 3.0, 100.0][random.random_range(0..3)]).collect();
    let image = image(random, &background_e);
    let rows = [0, 400, 1700, -20][trial % 4];
    let cloud = Cloud::new(1e5, [0.0, 50.0][trial / 4 % 2], 0.6);
    let readout = Readout { traps: vec![], cloud, method: Method::Fast { relative } };
    let read = readout.parallel_with_traps_of_each(&image, rows, &background_e, &traps);
    let mut sums = [0.0; 3];
    for column in 0..columns {
        let before_e = image.column(column).to_vec();
        let alone = |method| {
            let readout = Readout { traps: traps[column].to_vec(), method, ..readout.clone() };
            readout.column(&before_e, Downstream { rows, charge_e: background_e[column] })
        };
        let exact = alone(Method::Exact);
        sums[0] += squares(&exact, &before_e);
        sums[1] += squares(&exact, &read.column(column).to_vec());
        sums[2] += squares(&exact, &alone(readout.method));
    }
    sums.map(|sum| (sum / image.len() as f64).sqrt())
}

#[test]
fn columns_with_traps_of_their_own_are_read_as_accurately_as_each_alone() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut missed = 0;
    for trial in 0..60 {
        for relative in [1e-3, 1e-5] {
            let [change_e, together_e, alone_e] = changes_and_misses(trial, &mut random, relative);
            let allowed_e = relative * change_e + 1e-8;
            missed += usize::from(together_e > allowed_e);
            // The bounds that choose the steps are estimates.
            let most_e = 2.0 * allowed_e.max(alone_e);
            assert!(together_e <= most_e, "trial {trial}, {relative}: {together_e:e} e-, each alone {alone_e:e} e-");
        }
    }
    assert!(missed <= 3, "{missed} of 120 images missed their accuracy");
}

/// The arithmetic is that of equal traps: steps are the same, so that even their errors agree.
#[test]
fn columns_with_nearly_equal_traps_are_read_as_those_with_equal_ones() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let background_e = [3.0; 16];
    for trial in 0..20 {
        let traps = traps(&mut random, 2).pop().expect("two columns");
        let mut nearly = traps.clone();
        nearly[0].density_per_px *= 1.0 + 1e-12;
        let each: Vec<&[Trap]> = (0..16).map(|column| if column % 2 == 0 { &*traps } else { &*nearly }).collect();
        let image = image(&mut random, &background_e);
        let (method, cloud) = (Method::Fast { relative: 1e-3 }, Cloud::new(1e5, 10.0, 0.6));
        let readout = Readout { traps: traps.clone(), cloud, method };
        let rows = [0, 700, -20][trial % 3];
        let equal = readout.parallel_after_each(&image, rows, &background_e);
        let side_by_side = readout.parallel_with_traps_of_each(&image, rows, &background_e, &each);
        for (one, other) in equal.iter().zip(&side_by_side) {
            assert!((one - other).abs() < 1e-7, "trial {trial}: {one} and {other} e-");
        }
    }
}

/// Traps that cannot be read side by side are read as ever: those with a capture time, or at the surface; and no traps at all.
#[test]
fn columns_that_have_no_room_beside_them_are_read_by_themselves() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let plain = Trap::new(0.3, 20.0);
    let slow = Trap { capture_transfers: 0.5, ..plain };
    let surface = Trap { surface_level_e: Some(800.0), ..plain };
    let traps: [&[Trap]; 6] = [&[plain], &[slow], &[], &[surface], &[plain, surface], &[plain]];
    let background_e = [3.0, 3.0, 0.0, 100.0, 0.0, 0.0];
    let image = image(&mut random, &background_e);
    for method in [Method::Exact, Method::Fast { relative: 1e-4 }] {
        let with = |traps: &[Trap]| Readout { traps: traps.to_vec(), cloud: Cloud::new(1e5, 10.0, 0.6), method };
        let fast = method != Method::Exact;
        for (traps, room) in traps.iter().zip([fast, false, false, false, false, fast]) {
            assert_eq!(with(traps).has_room_beside(), room);
        }
        let read = with(&[]).parallel_with_traps_of_each(&image, 300, &background_e, &traps);
        for (column, traps) in traps.iter().enumerate() {
            let downstream = Downstream { rows: 300, charge_e: background_e[column] };
            let alone = with(traps).column(&image.column(column).to_vec(), downstream);
            let allowed = 1e-4 * squares(&alone, &image.column(column).to_vec()).sqrt();
            let miss = squares(&alone, &read.column(column).to_vec()).sqrt();
            assert!(miss <= allowed, "column {column}: {miss:e} e-, allowed {allowed:e} e-");
        }
    }
}
