//! Inputs on which a reader failed, or might: what must hold of any input holds of them. See fuzz/README.md.

#[path = "../../fuzz/src/lib.rs"]
mod readers;

use std::fs;
use std::path::PathBuf;

/// The inputs of a reader, those that its fuzzing starts from too.
fn inputs(reader: &str, seeds: &[&str]) -> Vec<PathBuf> {
    let found = format!("tests/fuzzed/{reader}");
    let folders = seeds.iter().copied().chain([found.as_str()]);
    let files = |folder: &str| fs::read_dir(folder).unwrap_or_else(|error| panic!("{folder}: {error}"));
    let all = folders.flat_map(files).map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
    let mut inputs: Vec<PathBuf> = all.collect();
    inputs.sort();
    inputs
}

fn texts(reader: &str, seeds: &[&str]) -> impl Iterator<Item = String> {
    let inputs = inputs(reader, seeds);
    inputs.into_iter().map(|path| String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned())
}

#[test]
fn missions() {
    texts("mission", &["missions", "missions/broken"]).for_each(|text| readers::mission(&text));
}

#[test]
fn measurements() {
    texts("measurement", &["tests/measurements", "tests/measurements/broken"])
        .for_each(|text| readers::measurement(&text));
}

#[test]
fn formulas() {
    texts("formula", &[]).for_each(|text| readers::formula(&text));
}

#[test]
fn fits() {
    inputs("fits", &["tests/golden", "tests/golden/compressed"])
        .into_iter()
        .for_each(|path| readers::fits(&fs::read(path).unwrap()));
}
