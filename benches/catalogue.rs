//! A catalogue of galaxies like those of a survey, on the device of SNAP after 5 years: time, and error of the interpolation.
//!
//! `cargo bench --bench catalogue -- GALAXIES ACCURACY` (100000 and 0.01 if not given). The galaxies are drawn from the law of
//! `[population]`: magnitudes 20 to 24.5, the faintest as bright as the judged galaxy, at all distances from the register, with
//! 2 × 2 sub-pixel positions. CPU time is what `time` gives for the command, reading and writing of tables apart.

use std::time::Instant;

use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::shear::SurveyGalaxy;
use ctiplan::physics::galaxy::population_law::DrawnGalaxy;
use ctiplan::physics::galaxy::snr;
use ctiplan::plan::catalogue::{Catalogue, Settings};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const MAGNITUDES: [f64; 2] = [20.0, 24.5];
const PIXEL_ARCSEC: f64 = 0.1;

/// Galaxies of the law.
fn galaxies(mission: &Mission, count: usize) -> Vec<SurveyGalaxy> {
    let judged = SurveyGalaxy::of(mission, &Default::default());
    let faintest_e = snr::flux_e(mission, mission.judged_galaxy());
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut galaxy = || {
        let drawn = DrawnGalaxy::draw(MAGNITUDES, &mut random);
        SurveyGalaxy {
            flux_e: faintest_e * 10_f64.powf(0.4 * (MAGNITUDES[1] - drawn.magnitude)),
            half_light_px: (drawn.half_light_arcsec / PIXEL_ARCSEC).clamp(0.05, 100.0),
            sersic_index: drawn.sersic_index,
            ellipticity: drawn.ellipticity,
            transfers: random.random_range(1..=mission.readout.transfers),
            ..judged
        }
    };
    (0..count).map(|_| galaxy()).collect()
}

fn main() {
    // Cargo adds an argument of its own.
    let numbers: Vec<f64> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    let [count, accuracy] = [0, 1].map(|place| numbers.get(place).copied().unwrap_or([1e5, 0.01][place]));
    let mut mission = Mission::read("missions/snap_l2.toml").expect("a valid mission");
    mission.accuracy.subpixel_grid = 2;
    let galaxies = galaxies(&mission, count as usize);
    let how = Settings { emulate: Some(accuracy), seed: 1 };
    let start = Instant::now();
    let found = Catalogue::of(&Model::new(&mission), &galaxies, 5.0, how, &|_| ()).expect("a change of each galaxy");
    let seconds = start.elapsed().as_secs_f64();
    println!("{count} galaxies, {} of them interpolated: {seconds:.1} s on {} threads", found.emulated, rayon::current_num_threads());
    for class in &found.classes {
        println!("{} galaxies fitted, degree {}; used: {}", class.fitted, class.degree, class.is_used);
        println!("{:?}", class.held_out);
    }
}
