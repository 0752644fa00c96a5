//! `cargo bench`: a galaxy's change of shape by the four ways to read out, and the parts around it.
//!
//! The fiducial galaxy of `missions/snap_l2.toml` after 5 years, 3 species, 1650 transfers, at one sub-pixel position of a
//! stamp of 55 x 55 pixels. `fast` to a relative accuracy of 1e-6 against `exact`, every transfer; how far apart the two
//! are is asserted in `tests/suite/readout.rs`. All on one thread, so that work is compared with work: a stamp is too short for two.

use ctiplan::mission::{Mission, ReadoutMethod};
use ctiplan::model::Model;
use ctiplan::physics::galaxy::Profile;
use ctiplan::plan::evaluate::evaluate;
use divan::Bencher;

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the first pool of the process");
    divan::main();
}

fn snap() -> Mission {
    let mut mission = Mission::read("missions/snap_l2.toml").expect("a valid mission");
    mission.galaxies.truncate(1);
    mission.accuracy.subpixel_grid = 1;
    mission
}

fn change(bencher: Bencher, method: ReadoutMethod) {
    let mut mission = snap();
    mission.accuracy.readout = method;
    let model = Model::new(&mission);
    bencher.bench(|| model.change(0, 5.0));
}

#[divan::bench(sample_count = 200)]
fn delta_e_fast(bencher: Bencher) {
    change(bencher, ReadoutMethod::Fast);
}

#[divan::bench(sample_count = 5)]
fn delta_e_exact(bencher: Bencher) {
    change(bencher, ReadoutMethod::Exact);
}

#[divan::bench]
fn profile(bencher: Bencher) {
    let mission = snap();
    bencher.bench(|| Profile::of(&mission.galaxies[0], &mission.psf));
}

#[divan::bench]
fn stamp(bencher: Bencher) {
    let mission = snap();
    let profile = Profile::of(&mission.galaxies[0], &mission.psf);
    bencher.bench(|| profile.stamp(27, 0.1, 0.2));
}

#[divan::bench(sample_count = 10)]
fn evaluate_snap() {
    let mission = Mission::read("missions/snap_l2.toml").expect("a valid mission");
    divan::black_box(evaluate(&mission).expect("a measurable mission"));
}
