//! A catalogue of galaxies like those of a survey, on the device of SNAP after 5 years: time, and error of the interpolation.
//!
//! `cargo bench --bench catalogue -- GALAXIES ACCURACY...` (100000 and 0.01 if not given). The galaxies are drawn from the law of
//! `[population]`: magnitudes 20 to 24.5, the faintest as bright as the judged galaxy, at all distances from the register, with
//! 2 × 2 sub-pixel positions. The time is that of the changes, without the reading and writing of tables; the rate that of the
//! galaxies that were not fitted, once the polynomials are there.

use std::sync::Mutex;
use std::time::Instant;

use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::shear::SurveyGalaxy;
use ctiplan::physics::galaxy::population_law::DrawnGalaxy;
use ctiplan::physics::galaxy::snr;
use ctiplan::plan::catalogue::emulator::HeldOut;
use ctiplan::plan::catalogue::{Catalogue, Class, Settings};
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
    let (count, accuracies) = numbers.split_first().unwrap_or((&1e5, &[]));
    let mut mission = Mission::read("missions/snap_l2.toml").expect("a valid mission");
    mission.accuracy.subpixel_grid = 2;
    let galaxies = galaxies(&mission, *count as usize);
    println!("{count} galaxies, {} threads", rayon::current_num_threads());
    for &accuracy in if accuracies.is_empty() { &[0.01] } else { accuracies } {
        let how = Settings { emulate: Some(accuracy), seed: 1 };
        let start = Instant::now();
        // Galaxies done, when the polynomials are there and after they were used.
        let reached: Mutex<Vec<(usize, f64)>> = Mutex::default();
        let reach = |done: usize| reached.lock().expect("nobody panics").push((done, start.elapsed().as_secs_f64()));
        let found = Catalogue::of(&Model::new(&mission), &galaxies, 5.0, how, &reach).expect("a change of each galaxy");
        let seconds = start.elapsed().as_secs_f64();
        let reached = reached.into_inner().expect("nobody panics");
        // Galaxies that are read out are done one by one.
        let polynomials = reached.windows(2).max_by_key(|pair| pair[1].0.saturating_sub(pair[0].0));
        if let Some([(before, begun), (after, ended)]) = polynomials {
            let rate = after.saturating_sub(*before) as f64 / (ended - begun) / rayon::current_num_threads() as f64;
            println!("{accuracy}: {rate:.1e} galaxies per second and thread by polynomials");
        }
        for Class { fitted, degree, held_out, is_used, .. } in &found.classes {
            let HeldOut { delta_e, own_median, own_95, own_largest, .. } = held_out;
            println!(
                "{accuracy}: {fitted} fitted, degree {degree}, used: {is_used}, {seconds:.1} s; error of delta e {delta_e:.1e} of the rms \
                 change; over a galaxy's own {own_median:.1e} (median), {own_95:.1e} (95 %), {own_largest:.2} (largest)"
            );
        }
    }
}
