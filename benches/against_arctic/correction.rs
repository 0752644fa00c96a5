//! ctiplan's `correct` beside ArCTIc's `remove_cti`: time and error of the corrected frame.
//!
//! Frames are a noisy sky of 60 e- with one source for every 4000 pixels, trailed by ctiplan with an error below 1e-4 e-. ArCTIc
//! makes 5 iterations at express 5. By its default a pixel's traps are not empty when its first packet comes
//! (`empty_traps_for_first_transfers`); frames for that are trailed so too, transfer by transfer.

use std::time::Instant;

use ctiplan::image::correct::correct;
use ctiplan::image::invert::Columns;
use ctiplan::image::{Stop, invert, uncertain};
use ctiplan::readout::{Cloud, Downstream, Method, Readout, Trap};
use ndarray::Array2;

use crate::{Arctic, rms, scene};

const SKY_E: f64 = 60.0;
const ITERATIONS: usize = 20;

/// Rounds of alternating runs.
const ROUNDS: usize = 3;

/// Species of `missions/snap_l2.toml` (share of the traps, release time in transfers), so many traps per pixel altogether.
fn detector(traps_per_px: f64) -> Readout {
    let species = [(0.35, 10.0), (0.49, 0.486), (0.7, 200.0)];
    let all: f64 = species.iter().map(|(share, _)| share).sum();
    Readout {
        traps: species.map(|(share, release)| Trap::new(traps_per_px * share / all, release)).to_vec(),
        cloud: Cloud::new(161_000.0, 0.0, 0.5),
        method: Method::Fast { relative: 1e-3 },
    }
}

/// Prints the table.
pub fn compare(python: &str) {
    println!("| frame, traps per pixel | program | threads | time | error, e- rms | ArCTIc's time over ctiplan's |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for traps_per_px in [0.05, 1.0, 2.7] {
        beside(python, (2048, 128), traps_per_px);
    }
    alone((4096, 2048), 3.0, 0.1);
}

fn line(name: &str, program: &str, threads: usize, (seconds, error_e): (f64, f64), ratio: &str) {
    println!("| {name} | {program} | {threads} | {:.0} ms | {error_e:.1e} | {ratio} |", 1e3 * seconds);
}

/// Both programs on one thread: ctiplan as accurate as ArCTIc, and by its defaults.
fn beside(python: &str, shape: (usize, usize), traps_per_px: f64) {
    let name = format!("{} x {}, {traps_per_px}", shape.0, shape.1);
    let readout = detector(traps_per_px);
    let before = scene(shape, SKY_E);
    let error_e = |image: &Array2<f64>| rms(image - &before);
    let trailed = |method| Readout { method, ..readout.clone() }.parallel(&before, Downstream::NONE);
    let observed = trailed(Method::Fast { relative: 1e-4 });
    let frames = [("", true, observed.clone()), (", default", false, trailed(Method::CarriedTraps))];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for (convention, empty, arctics) in frames {
        let arctic = Arctic { python, readout: &readout, express: 5, threads: 1, empty, repeats: 1 };
        let remove = || arctic.run(&arctics, Downstream::NONE, 5);
        let mut theirs = remove();
        let theirs_e = error_e(&theirs.1);
        let mut ours = vec![
            (
                format!("ctiplan, {theirs_e:.1e} e- requested"),
                Stop::at_error(theirs_e, ITERATIONS),
                (f64::INFINITY, 0.0),
            ),
            ("ctiplan, default".into(), Stop::at_residual(1e-4, ITERATIONS), (f64::INFINITY, 0.0)),
        ];
        for round in 0..ROUNDS {
            for (_, stop, best) in &mut ours {
                let start = Instant::now();
                let corrected = pool.install(|| correct(&readout, &observed, Downstream::NONE, *stop));
                assert!(corrected.converged);
                *best = (best.0.min(start.elapsed().as_secs_f64()), error_e(&corrected.image));
            }
            if round > 0 {
                theirs.0 = theirs.0.min(remove().0);
            }
        }
        line(&name, &format!("ArCTIc{convention}"), 1, (theirs.0, theirs_e), "");
        for (program, _, best) in ours {
            line(&name, &program, 1, best, &format!("{:.1}", theirs.0 / best.0));
        }
    }
}

/// ctiplan alone on a large frame, on two threads.
fn alone(shape: (usize, usize), traps_per_px: f64, asked_e: f64) {
    let name = format!("{} x {}, {traps_per_px}", shape.0, shape.1);
    let readout = &detector(traps_per_px);
    let before = scene(shape, SKY_E);
    let observed = readout.parallel(&before, Downstream::NONE);
    let transport = Columns { readout, downstream: Downstream::NONE };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    let (mut seconds, mut error_e) = ([f64::INFINITY; 2], 0.0);
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let corrected = pool.install(|| invert(&transport, &observed, None, Stop::at_error(asked_e, ITERATIONS)));
        let corrected = corrected.unwrap_or_else(|never| match never {});
        seconds[0] = seconds[0].min(start.elapsed().as_secs_f64());
        let found = pool.install(|| uncertain(&transport, &observed, None, &corrected, (asked_e, ITERATIONS)));
        let found = found.unwrap_or_else(|never| match never {});
        seconds[1] = seconds[1].min(start.elapsed().as_secs_f64());
        assert!(corrected.converged && found.count() == 0, "{} pixels", found.count());
        error_e = rms(&corrected.image - &before);
    }
    line(&name, &format!("ctiplan, {asked_e} e- requested"), 2, (seconds[0], error_e), "");
    line(&name, "the same, with the search for uncertain pixels", 2, (seconds[1], error_e), "");
}
