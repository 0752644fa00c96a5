//! `benches/against_arctic/run`: ctiplan's readout beside ArCTIc's, time and accuracy in one table; and its correction in another.
//!
//! Both trail the same charges through the same traps, those of `missions/snap_l2.toml` (3 species, well fill power 1/2).
//! Accuracy is told from every transfer done (`exact`): of a stamp, the error of Δe over Δe; of a frame, the root mean
//! square of the error of all packets in 8 of its columns over that of their change. Runs alternate; the fastest counts.

mod correction;

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::physics::conditions::Conditions;
use ctiplan::physics::galaxy::{Profile, snr};
use ctiplan::physics::shape::Moments;
use ctiplan::readout::{Downstream, Method, Readout, Trap};
use ndarray::{Array2, Axis, concatenate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rounds of alternating runs.
const ROUNDS: usize = 5;

/// Columns of a frame that are compared with every transfer done.
const COMPARED: usize = 8;

/// Half-width of the stamp, px: five widths of the weight.
const HALF_PX: usize = 27;

fn main() {
    let Ok(python) = std::env::var("ARCTIC_PYTHON") else {
        println!("against_arctic: skipped; benches/against_arctic/run sets up what it needs");
        return;
    };
    if std::env::var_os("CORRECTION_ONLY").is_none() {
        readouts(&python);
        println!();
    }
    correction::compare(&python);
}

/// Trails.
fn readouts(python: &str) {
    let mission = Mission::read("missions/snap_l2.toml").expect("a valid mission");
    let model = Model::new(&mission);
    println!("| case | program | threads | time | error | ArCTIc's time over ctiplan's |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let doses = [("5 yr", model.dose_mev_g(5.0).unwrap()), ("110 yr", mission.reference_dose_mev_g())];
    for (name, dose_mev_g) in doses {
        let at = Conditions { dose_mev_g: Some(dose_mev_g), ..model.conditions(5.0) };
        let readout = model.device(&at).unwrap().readout();
        let case = Case::stamp(&format!("stamp, {name}"), &mission, readout);
        case.compare(python, &[0, 1, 5], 3e-6, &[1]);
        // At an accuracy like that of the express readouts.
        case.compare(python, &[1, 5], 1e-2, &[1]);
    }
    for pixels in [1756, 4096] {
        let readout = model.device_at(5.0).unwrap().readout();
        let case = Case::frame(&format!("{pixels} x {pixels}, 5 yr"), &mission, readout, pixels);
        case.compare(python, &[5], 1e-2, &[1, 2]);
    }
}

/// Charges to trail, and how far a result is off.
struct Case {
    name: String,
    readout: Readout,
    image: Array2<f64>,
    downstream: Downstream,
    background_e: f64,
    weight_px: Option<f64>,
}

impl Case {
    /// The mission's first galaxy on its background, in the middle of a pixel; nothing in the rows downstream, which ArCTIc
    /// takes to be empty.
    fn stamp(name: &str, mission: &Mission, readout: Readout) -> Case {
        let galaxy = &mission.galaxies[0];
        let stamp = Profile::of(galaxy, &mission.psf).stamp(HALF_PX, 0.0, 0.0);
        let background_e = mission.sky.background_e;
        let image = stamp * snr::flux_e(mission, galaxy) + background_e;
        let rows = i64::from(mission.readout.transfers) - 1 - HALF_PX as i64;
        let downstream = Downstream { rows, charge_e: 0.0 };
        Case { name: name.into(), readout, image, downstream, background_e, weight_px: Some(galaxy.weight_px) }
    }

    /// See [`scene`].
    fn frame(name: &str, mission: &Mission, readout: Readout, pixels: usize) -> Case {
        let background_e = mission.sky.background_e;
        let image = scene((pixels, pixels), background_e);
        Case { name: name.into(), readout, image, downstream: Downstream::NONE, background_e, weight_px: None }
    }

    fn by(&self, method: Method) -> Readout {
        Readout { method, ..self.readout.clone() }
    }

    /// Prints a line for each way and number of threads.
    fn compare(&self, python: &str, expresses: &[u32], relative: f64, threads: &[usize]) {
        let error = self.error();
        for &threads in threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let fast = self.by(Method::Fast { relative });
            // A stamp is done too soon to be timed once.
            let repeats = if self.weight_px.is_some() { 300 } else { 1 };
            let mut ours = (f64::INFINITY, Array2::zeros((0, 0)));
            let mut theirs = vec![(f64::INFINITY, Array2::zeros((0, 0))); expresses.len()];
            for _ in 0..ROUNDS {
                // Not the waking of a thread, which takes a stamp's time.
                pool.install(|| {
                    for _ in 0..repeats {
                        let start = Instant::now();
                        let trailed = fast.parallel(&self.image, self.downstream);
                        ours = (ours.0.min(start.elapsed().as_secs_f64()), trailed);
                    }
                });
                for (express, theirs) in expresses.iter().zip(&mut theirs) {
                    let (empty, repeats) = (*express == 0, if *express == 0 { 1 } else { repeats.min(100) });
                    let arctic = Arctic { python, readout: &self.readout, express: *express, threads, empty, repeats };
                    let (seconds, trailed) = arctic.run(&self.image, self.downstream, 0);
                    *theirs = (theirs.0.min(seconds), trailed);
                }
            }
            let line = |program: &str, seconds: f64, error: f64, ratio: &str| {
                println!("| {} | {program} | {threads} | {:.3} ms | {error:.1e} | {ratio} |", self.name, 1e3 * seconds);
            };
            line(&format!("ctiplan, {relative:e}"), ours.0, error(&ours.1), "");
            for (express, (seconds, trailed)) in expresses.iter().zip(&theirs) {
                let ratio = format!("{:.1}", seconds / ours.0);
                line(&format!("ArCTIc, express {express}"), *seconds, error(trailed), &ratio);
            }
        }
    }

    /// How far a result is from every transfer done.
    fn error(&self) -> impl Fn(&Array2<f64>) -> f64 {
        let exact = self.by(Method::Exact);
        let (rows, columns) = self.image.dim();
        let places: Vec<usize> = match self.weight_px {
            Some(_) => (0..columns).collect(),
            None => (0..COMPARED).map(|index| index * columns / COMPARED).collect(),
        };
        let before = self.image.select(Axis(1), &places);
        let flat = Array2::from_elem((rows, 1), self.background_e);
        // Image and background at once.
        let all = concatenate(Axis(1), &[before.view(), flat.view()]).expect("columns of one length");
        let after = exact.parallel(&all, self.downstream);
        let (after, flat) = after.view().split_at(Axis(1), places.len());
        let (after, flat) = (after.to_owned(), flat.to_owned());
        let weight_px = self.weight_px;
        let background_e = self.background_e;
        move |trailed| {
            let trailed = trailed.select(Axis(1), &places);
            match weight_px {
                Some(weight_px) => {
                    let e1 = |image: Array2<f64>| Moments::of(&image, weight_px).expect("a galaxy").e1;
                    let (before, after) = (e1(&before - background_e), e1(&after - &flat));
                    ((e1(&trailed - &flat) - after) / (after - before)).abs()
                }
                None => rms(&trailed - &after) / rms(&after - &before),
            }
        }
    }
}

/// How ArCTIc is run.
struct Arctic<'a> {
    python: &'a str,
    readout: &'a Readout,
    express: u32,
    threads: usize,
    /// Traps of a pixel are empty when its first packet comes.
    empty: bool,
    repeats: usize,
}

impl Arctic<'_> {
    /// ArCTIc's best time, s, and its result: trails, or with iterations a correction.
    fn run(&self, image: &Array2<f64>, downstream: Downstream, iterations: u32) -> (f64, Array2<f64>) {
        let folder = tempfile::tempdir().expect("a place for frames");
        let (source, target) = (folder.path().join("in.f64"), folder.path().join("out.f64"));
        let bytes: Vec<u8> = image.iter().flat_map(|charge_e| charge_e.to_le_bytes()).collect();
        fs::write(&source, bytes).expect("room for a frame");
        let (rows, columns) = image.dim();
        let of = |trap: &Trap| format!("{:e}:{:e}", trap.density_per_px, trap.release_transfers);
        let traps: Vec<String> = self.readout.traps.iter().map(of).collect();
        let output = Command::new(self.python)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/against_arctic/arctic.py"))
            .args([source.as_os_str(), target.as_os_str()])
            .args([rows.to_string(), columns.to_string(), downstream.rows.to_string(), self.express.to_string()])
            .args([self.repeats.to_string(), traps.join(","), "161000".into(), "0.5".into()])
            .args([u8::from(self.empty).to_string(), iterations.to_string()])
            .env("OMP_NUM_THREADS", self.threads.to_string())
            .output()
            .expect("Python runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8_lossy(&output.stdout);
        let seconds = text.lines().last().and_then(|line| line.trim().parse().ok()).expect("a time");
        let numbers = fs::read(&target)
            .expect("a frame")
            .chunks_exact(8)
            .map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight of them")))
            .collect();
        (seconds, Array2::from_shape_vec((rows, columns), numbers).expect("as many as before"))
    }
}

/// Sky with its noise (e-, rows x columns), and one source for every 4000 pixels.
fn scene((rows, columns): (usize, usize), sky_e: f64) -> Array2<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let sky = rand_distr::Normal::new(sky_e, sky_e.sqrt()).expect("a finite width");
    let mut image = Array2::from_shape_simple_fn((rows, columns), || random.sample(sky));
    for _ in 0..rows * columns / 4000 {
        let peak_e = 10_f64.powf(random.random_range(1.5..4.5));
        let (y, x) = (random.random_range(8..rows - 8), random.random_range(8..columns - 8));
        for row in y - 8..=y + 8 {
            for column in x - 8..=x + 8 {
                let square = (row as f64 - y as f64).powi(2) + (column as f64 - x as f64).powi(2);
                image[[row, column]] += peak_e * (1.0 + square / 4.0).powf(-2.5);
            }
        }
    }
    image
}

fn rms(differences: Array2<f64>) -> f64 {
    (differences.iter().map(|difference| difference * difference).sum::<f64>() / differences.len() as f64).sqrt()
}
