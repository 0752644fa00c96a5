//! Frames whose columns differ in their traps: `--trap-map`.

use std::path::Path;

use fitsio_pure::value::Value;
use ndarray::{Array2, Axis, s};

use crate::amplifiers::{field, file, run, values, work};

fn electrons() -> Vec<(&'static str, Value)> {
    vec![("BUNIT", Value::String("electron".into()))]
}

/// Every transfer computed, so that columns do not share an accuracy.
const EXACT: [&str; 2] = ["--set", "accuracy.readout=exact"];

fn map(path: &Path, factors: &[f64]) {
    blocks(path, Array2::from_shape_vec((1, factors.len()), factors.to_vec()).unwrap());
}

fn blocks(path: &Path, factors: Array2<f64>) {
    file(path, &[], &[("MAP", 1, factors, vec![])]);
}

#[test]
fn each_column_has_its_own_traps() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let factors = [1.0, 0.0, 2.5, 1.0, 0.5, 2.5, 0.0, 1.0];
    file(&at("in.fits"), &[], &[("SCI", 1, field(40, 8), electrons())]);
    map(&at("map.fits"), &factors);
    let lies = ["--transfers-before", "100"];
    let with_map = ["--trap-map", at("map.fits").to_str().unwrap()].map(str::to_string);
    let with_map: Vec<&str> = with_map.iter().map(String::as_str).collect();
    work("readout", &at("in.fits"), &at("out.fits"), &[&lies[..], &EXACT, &with_map].concat());
    let out = values(&at("out.fits"), 1);
    assert_eq!(out.column(1), values(&at("in.fits"), 1).column(1), "a column without traps");
    for (column, factor) in factors.iter().enumerate().filter(|(_, factor)| **factor > 0.0) {
        let densities = [("fast", 0.12), ("middle", 0.26), ("slow", 0.33)];
        let set = densities.map(|(name, density)| format!("detector.traps.{name}.density_per_px={}", density * factor));
        let set: Vec<&str> = set.iter().flat_map(|key| ["--set", key]).collect();
        work("readout", &at("in.fits"), &at("one.fits"), &[&lies[..], &EXACT, &set, &["--overwrite"]].concat());
        for (ours, alone) in out.column(column).iter().zip(values(&at("one.fits"), 1).column(column)) {
            assert!((ours - alone).abs() < 1e-9, "column {column}: {ours}, {alone}");
        }
    }
    work("correct", &at("out.fits"), &at("back.fits"), &[&lies[..], &with_map].concat());
    let error = values(&at("back.fits"), 1) - values(&at("in.fits"), 1);
    assert!(error.iter().all(|error| error.abs() < 0.05), "{error}");
}

#[test]
fn a_map_is_that_of_the_frame_and_not_of_the_order_of_readout() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let factors = [0.0, 1.0, 2.0, 3.0, 0.5, 0.7, 1.5, 1.2];
    let frame = field(30, 8);
    let mut mirrored = frame.clone();
    mirrored.invert_axis(Axis(1));
    let reversed: Vec<f64> = factors.iter().rev().copied().collect();
    file(&at("in.fits"), &[], &[("SCI", 1, frame, electrons())]);
    file(&at("mirrored.fits"), &[], &[("SCI", 1, mirrored.as_standard_layout().to_owned(), electrons())]);
    map(&at("map.fits"), &factors);
    map(&at("reversed.fits"), &reversed);
    let lies = ["--prescan-px", "1", "--axis", "both"];
    let read = |input: &str, map: &str, more: &[&str]| {
        let map = at(map);
        let options = [&lies[..], &EXACT, &["--overwrite", "--trap-map", map.to_str().unwrap()], more].concat();
        work("readout", &at(input), &at("out.fits"), &options);
        values(&at("out.fits"), 1)
    };
    let out = read("in.fits", "map.fits", &[]);
    let mut other = read("mirrored.fits", "reversed.fits", &["--corner", "lower-right"]);
    other.invert_axis(Axis(1));
    assert_eq!(out, other);
    // Halves that are read to both sides.
    let split = read("in.fits", "map.fits", &["--split", "columns"]);
    assert_eq!(split.slice(s![.., 1..2]).dim(), (30, 1));
    let mut other = read("mirrored.fits", "reversed.fits", &["--split", "columns"]);
    other.invert_axis(Axis(1));
    assert_eq!(split, other);
}

#[test]
fn rows_and_blocks_have_their_own_traps() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let path = |name: &str| at(name).to_str().unwrap().to_string();
    let frame = field(40, 8);
    file(&at("in.fits"), &[], &[("SCI", 1, frame.clone(), electrons())]);
    let read = |map: &Array2<f64>, more: &[&str]| {
        blocks(&at("map.fits"), map.clone());
        work(
            "readout",
            &at("in.fits"),
            &at("out.fits"),
            &[&["--overwrite", "--trap-map", &path("map.fits")], more].concat(),
        );
        values(&at("out.fits"), 1)
    };
    let before = ["--transfers-before", "300"];
    let exact = [&before[..], &EXACT].concat();
    // Rows, and the same as blocks of pixels; half as many numbers where neighbours are equal.
    let rows = Array2::from_shape_fn((4, 1), |(row, _)| [1.0, 0.0, 2.5, 0.3][row]);
    let by_rows = read(&rows, &exact);
    assert_eq!(by_rows, read(&Array2::from_shape_fn((40, 8), |(row, _)| rows[[row / 10, 0]]), &exact));
    let fast = read(&rows, &before);
    let largest = |difference: Array2<f64>| difference.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    let moved_e = largest(&by_rows - &frame);
    // The accuracy of the readout, 1e-3, of each of three bands.
    assert!(largest(&fast - &by_rows) < 3e-3 * moved_e && moved_e > 1.0, "{} of {moved_e}", largest(&fast - &by_rows));
    // Packets in front of pixels without traps lose nothing there: those of the rows that are left out do not matter.
    let only_near = read(&Array2::from_shape_fn((4, 1), |(row, _)| f64::from(row == 0)), &exact);
    assert_ne!(by_rows, only_near);
    // Each pixel of a frame that is read at its upper right is where it was.
    let pixels = Array2::from_shape_fn((20, 4), |(row, column)| ((3 * row + 5 * column) % 7) as f64 / 4.0);
    let upper = read(&pixels, &[&exact[..], &["--corner", "upper-right"]].concat());
    let mut turned = frame.clone();
    turned.invert_axis(Axis(0));
    turned.invert_axis(Axis(1));
    file(&at("in.fits"), &[], &[("SCI", 1, turned.as_standard_layout().to_owned(), electrons())]);
    let mut of_turned = pixels.clone();
    of_turned.invert_axis(Axis(0));
    of_turned.invert_axis(Axis(1));
    let mut other = read(&of_turned.as_standard_layout().to_owned(), &exact);
    other.invert_axis(Axis(0));
    other.invert_axis(Axis(1));
    assert_eq!(upper, other);
    // A correction takes trails out, by transfers in the opposite order.
    file(&at("in.fits"), &[], &[("SCI", 1, frame.clone(), electrons())]);
    for map in [rows, pixels] {
        read(&map, &before);
        let done = work(
            "correct",
            &at("out.fits"),
            &at("back.fits"),
            &[&before[..], &["--overwrite", "--trap-map", &path("map.fits")]].concat(),
        );
        let error_e = largest(values(&at("back.fits"), 1) - &frame);
        assert!(error_e < 0.05, "{error_e}");
        assert!(done["hdus"][1]["iterations"].as_u64().unwrap() <= 2, "{}", done["hdus"][1]["iterations"]);
    }
    // Traps that carry their state on from pixel to pixel need equal pixels.
    let carried = ["--set", "readout.traps_at_start=carried", "--overwrite", "--trap-map", &path("map.fits")];
    let done = run("readout", &at("in.fits"), &at("out.fits"), &carried);
    assert!(
        String::from_utf8_lossy(&done.stderr).contains("for pixels that are all alike")
            && done.status.code() == Some(2)
    );
}

#[test]
fn maps_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    file(&at("in.fits"), &[], &[("SCI", 1, field(12, 4), electrons()), ("SCI", 2, field(12, 4), electrons())]);
    let says = |words: &str| {
        let done = run("readout", &at("in.fits"), &at("out.fits"), &["--trap-map", at("map.fits").to_str().unwrap()]);
        let stderr = String::from_utf8(done.stderr).unwrap();
        assert!(done.status.code() == Some(2) && stderr.contains(words), "{words}: {stderr}");
    };
    map(&at("map.fits"), &[1.0, 1.0, 1.0]);
    says("it has 3 columns, and HDU 1 (SCI) has 4");
    map(&at("map.fits"), &[1.0, 1.0, -1.0, 1.0]);
    says("HDU 1 (MAP), column 3, row 1: -1; allowed: 0 to 1000000");
    map(&at("map.fits"), &[1.0, 1.0, f64::NAN, 1.0]);
    says("column 3, row 1: NaN");
    file(&at("map.fits"), &[], &[("MAP", 1, Array2::ones((5, 4)), vec![])]);
    says("it has 5 rows, and HDU 1 (SCI) has 12");
    file(&at("map.fits"), &[], &[]);
    says("it has no image");
    let row = || Array2::ones((1, 4));
    file(&at("map.fits"), &[], &[("SCI", 1, row(), vec![]), ("SCI", 3, row(), vec![])]);
    says("none of its 2 images has the EXTNAME and EXTVER of HDU 2 (SCI)");
}
