//! As exact as asked for, in a handful of passes instead of thousands.
//!
//! What a packet loses in a pixel is tiny and almost the same in the next, so the charges n after each pixel follow a
//! difference equation, n ← n + δ(n), with a smooth δ. A Runge-Kutta method for *differential* equations would be
//! left with an error of the size of one transfer; a multirevolution method (Calvo, Jay, Montijano & Rández 2004,
//! Numerische Mathematik 97, 635) has coefficients that depend on the number N of transfers in a step and solves the
//! difference equation itself. With u = 1/N, and the classical Runge-Kutta method for u → 0:
//!
//! ```text
//!  c   │ a                                            u = 1/N
//!  (1−u)/2 │ (1−u)/2
//!  (1−u)/2 │ 2u(1−u)/(1+u)   (1−u)(1−3u)/(2(1+u))
//!  1−u     │ u               0                      1−2u
//!  ────────┼───────────────────────────────────────────────────────
//!          │ (1+u)/(6(1−u))  (1−2u)(1−3u)/(3(1−u)²) (1−2u)(1+u)/(3(1−u)²)  (1+u)/(6(1−u))
//! ```
//!
//! These satisfy the eight conditions of order four, where Σ k^p over the N transfers stands in place of ∫ k^p
//! (derived for ctiplan; a test below asks them of every N, and that N = 2 and 3 are exact). Where order three is foretold to
//! do, Kutta's method stands in with one pass less: the same second stage, a third at 1−u, and the weights that the four
//! conditions of order three leave.
//!
//! The journey is cut at row 0 of the image. Below it every packet passes every pixel. Within the image a packet only
//! passes the pixels below its own row; blocks there are summed exactly for fixed charges (see [`super::pixel`]) and
//! are advanced by the midpoint rule, all packets half-way at once, with a correction for their being half-way in different
//! pixels.

use std::ops::Range;

use super::Downstream;
use super::estimate;
use super::lanes::{LANES, Row};
use super::pixel::{Block, Passage, Path, Stage};

/// Transfers up to which a step is done one by one: it would need as many passes anyway.
const SINGLY: i64 = 4;

/// Share of e1 (the change of a block's second-order result from its first-order one) that remains as error because
/// packets which start within the block are not quite in step.
const OUT_OF_STEP: f64 = 0.06;

/// Part of the tolerance that the estimated errors of each region may add up to. They are estimates, and a kink that lies
/// between two passes is not seen by either (`cargo test --release --test readout -- --ignored --nocapture` counts the
/// misses; nearly all are without background, or with all of it in a notch).
const SHARE: f64 = 0.03;

/// Buffers that steps reuse.
pub(super) struct Workspace<L> {
    levels: L,
    stages: [Stage; 4],
    stage_e: Vec<Row>,
}

impl<L: Default> Workspace<L> {
    /// For so many rows.
    pub fn new(rows: usize) -> Workspace<L> {
        let stages = [(); 4].map(|()| Stage::new(rows));
        Workspace { levels: L::default(), stages, stage_e: vec![[0.0; LANES]; rows] }
    }
}

/// Root mean square of the change of packets (e-), to first order: what errors are measured against. Costs one pass.
pub(super) fn displacement<P: Passage>(
    pixel: &P,
    charge_e: &[Row],
    downstream: Downstream,
    work: &mut Workspace<P::Levels>,
) -> f64 {
    let journey = Block { nearest: 0, pixels: charge_e.len() as i64 + downstream.rows };
    let found = &mut work.stages[0];
    pixel.pass(charge_e, None, journey, downstream, &mut work.levels, found);
    // No packet loses more than it has, although a first-order change may.
    let changes = found.change_e.iter().flatten().zip(charge_e.iter().flatten());
    let moved_e = changes.map(|(change, charge)| change.abs().min(change.max(*charge)));
    (moved_e.map(|moved_e| moved_e * moved_e).sum::<f64>() / (charge_e.len() * LANES) as f64).sqrt()
}

/// Clocks columns out with an error of at most about `tolerance_e` (e-, root mean square over the packets).
pub(super) fn columns<P: Passage>(
    pixel: &P,
    charge_e: &mut [Row],
    downstream: Downstream,
    tolerance_e: f64,
    work: &mut Workspace<P::Levels>,
) {
    let start = charge_e.len() as i64 + downstream.rows;
    let alike = pixel.alike_below(downstream).min(start).max(0);
    singly(pixel, charge_e, alike..start, downstream, work);
    let image = downstream.rows.clamp(0, alike)..alike;
    let shared = 0..downstream.rows.min(alike);
    for region in [image, shared] {
        let length = region.end - region.start;
        let staggered = region.start >= downstream.rows;
        let mut position = region.end;
        let mut pixels = length;
        while position > region.start {
            pixels = pixels.clamp(1, position - region.start);
            let block = Block { nearest: position - pixels, pixels };
            // Evenly over the region's pixels.
            let allowed_e = SHARE * tolerance_e * pixels as f64 / length as f64;
            let Attempt { ratio, order } =
                Step { pixel, block, downstream, allowed_e, staggered }.attempt(charge_e, work);
            let stretch = if ratio > 0.0 { 0.9 * ratio.powf(-1.0 / order) } else { 4.0 };
            if ratio <= 1.0 {
                position -= pixels;
                pixels = (pixels as f64 * stretch.clamp(1.0, 4.0)) as i64;
            } else {
                pixels = (pixels as f64 * stretch.clamp(0.1, 0.7)) as i64;
            }
        }
    }
}

/// Clocks columns through some pixels (0 is nearest to the register), the farthest first, one by one.
fn singly<P: Passage>(
    pixel: &P,
    charge_e: &mut [Row],
    pixels: Range<i64>,
    downstream: Downstream,
    work: &mut Workspace<P::Levels>,
) {
    let found = &mut work.stages[0];
    for nearest in pixels.rev() {
        pixel.pass(charge_e, None, Block { nearest, pixels: 1 }, downstream, &mut work.levels, found);
        estimate::add(charge_e, &[(1.0, found)]);
    }
}

/// One step of the journey.
struct Step<'a, P> {
    pixel: &'a P,
    block: Block,
    downstream: Downstream,
    allowed_e: f64,
    staggered: bool,
}

/// How a step went.
struct Attempt {
    /// Estimated error over the allowed one; above 1 the charges were left alone.
    ratio: f64,
    /// Power of the step's length with which the estimate grows.
    order: f64,
}

impl<P: Passage> Step<'_, P> {
    /// Advances the charges if that can be done with the error allowed, by the lowest order that will do.
    fn attempt(&self, charge_e: &mut [Row], work: &mut Workspace<P::Levels>) -> Attempt {
        let Step { pixel, block, downstream, .. } = *self;
        if block.pixels <= SINGLY {
            singly(pixel, charge_e, block.nearest..block.nearest + block.pixels, downstream, work);
            return Attempt { ratio: 0.0, order: 5.0 };
        }
        let Workspace { levels, stages: [k1, k2, k3, k4], stage_e } = work;
        let mut pass = |charge_e: &[Row], found: &mut Stage| {
            pixel.pass(charge_e, None, block, downstream, levels, found);
        };

        pass(charge_e, k1);
        let traps = block.pixels as f64 * pixel.density();
        let first = self.judge(estimate::first(pixel.cloud(), traps, charge_e, k1), 2.0, 0.0);
        if first.ratio <= 1.0 {
            estimate::add(charge_e, &[(1.0, k1)]);
            return first;
        }
        if self.staggered {
            let well = (pixel.cloud(), pixel.density());
            let visits = |row: usize| block.visits(row as i64, downstream).max(1) as f64;
            let end = (block.nearest + block.pixels - downstream.rows).max(0) as usize;
            let way = [&mut k3.change_e[..], &mut k4.change_e];
            estimate::mean_path(well, (visits, end), charge_e, k1, stage_e, way);
            let path = Path { first_e: &k3.change_e, drift_e: &k4.change_e };
            pixel.pass(stage_e, Some(path), block, downstream, levels, k2);
            let errors = estimate::second(k1, k2);
            let second = self.judge(errors.smooth_e, 3.0, errors.kinked_e.max(OUT_OF_STEP * errors.all_e));
            if second.ratio <= 1.0 {
                estimate::add(charge_e, &[(1.0, k2)]);
            }
            return second;
        }
        let tableau = Tableau::of(block.pixels as f64);
        estimate::sum(charge_e, &[(tableau.a21, k1)], stage_e);
        pass(stage_e, k2);
        let errors = estimate::second(k1, k2);
        let second = self.judge(errors.smooth_e, 3.0, errors.kinked_e);
        if second.ratio <= 1.0 {
            estimate::add(charge_e, &[(1.0, k2)]);
            return second;
        }
        let attempt = if errors.next_e <= self.allowed_e {
            let [a31, a32, b1, b2, b3] = tableau.third;
            estimate::sum(charge_e, &[(a31, k1), (a32, k2)], stage_e);
            pass(stage_e, k3);
            estimate::sum(charge_e, &[(b1, k1), (b2, k2), (b3, k3)], stage_e);
            let (smooth_e, kinked_e) = estimate::higher([k1, k2, k3], charge_e, stage_e, 1);
            self.judge(smooth_e, 4.0, kinked_e)
        } else {
            estimate::sum(charge_e, &[(tableau.a31, k1), (tableau.a32, k2)], stage_e);
            pass(stage_e, k3);
            estimate::sum(charge_e, &[(tableau.a41, k1), (tableau.a43, k3)], stage_e);
            pass(stage_e, k4);
            let changes = [(tableau.b1, &*k1), (tableau.b2, k2), (tableau.b3, k3), (tableau.b4, k4)];
            estimate::sum(charge_e, &changes, stage_e);
            let (smooth_e, kinked_e) = estimate::higher([k1, k2, k4], charge_e, stage_e, 2);
            self.judge(smooth_e, 5.0, kinked_e)
        };
        if attempt.ratio <= 1.0 {
            charge_e.copy_from_slice(stage_e);
        }
        attempt
    }

    /// The worse of two errors over what is allowed: that of a smooth change, which grows with a power of the step's
    /// length, and that of its kinks.
    fn judge(&self, smooth_e: f64, order: f64, kinked_e: f64) -> Attempt {
        // Nothing is too much of nothing.
        let ratio = |error_e: f64| if error_e > 0.0 { error_e / self.allowed_e } else { 0.0 };
        if ratio(kinked_e) > ratio(smooth_e) {
            Attempt { ratio: ratio(kinked_e), order: 2.0 }
        } else {
            Attempt { ratio: ratio(smooth_e), order }
        }
    }
}

/// Coefficients for a step of N transfers.
struct Tableau {
    a21: f64,
    a31: f64,
    a32: f64,
    a41: f64,
    a43: f64,
    b1: f64,
    b2: f64,
    b3: f64,
    b4: f64,
    /// The same a21, and then a31, a32, b1, b2 and b3 of order three.
    third: [f64; 5],
}

impl Tableau {
    fn of(transfers: f64) -> Tableau {
        let u = 1.0 / transfers;
        let v = 1.0 - u;
        let b2 = 2.0 * (1.0 - 2.0 * u) / (3.0 * v);
        let b3 = (1.0 - b2) / 2.0;
        let a32 = (1.0 - 2.0 * u) / (3.0 * b3);
        Tableau {
            a21: v / 2.0,
            a31: 2.0 * u * v / (1.0 + u),
            a32: v * (1.0 - 3.0 * u) / (2.0 * (1.0 + u)),
            a41: u,
            a43: 1.0 - 2.0 * u,
            b1: (1.0 + u) / (6.0 * v),
            b2: (1.0 - 2.0 * u) * (1.0 - 3.0 * u) / (3.0 * v * v),
            b3: (1.0 - 2.0 * u) * (1.0 + u) / (3.0 * v * v),
            b4: (1.0 + u) / (6.0 * v),
            third: [v - a32, a32, 1.0 - b2 - b3, b2, b3],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One step of N transfers of the map n ← n + f(n), and N single ones.
    fn step_and_singles(transfers: u32, f: impl Fn([f64; 2]) -> [f64; 2]) -> ([f64; 2], [f64; 2]) {
        let n = f64::from(transfers);
        let tableau = Tableau::of(n);
        let start = [1.0, 0.5];
        let plus = |at: [f64; 2], parts: &[(f64, [f64; 2])]| {
            parts.iter().fold(at, |at, (weight, k)| [at[0] + n * weight * k[0], at[1] + n * weight * k[1]])
        };
        let k1 = f(start);
        let k2 = f(plus(start, &[(tableau.a21, k1)]));
        let k3 = f(plus(start, &[(tableau.a31, k1), (tableau.a32, k2)]));
        let k4 = f(plus(start, &[(tableau.a41, k1), (tableau.a43, k3)]));
        let stepped = plus(start, &[(tableau.b1, k1), (tableau.b2, k2), (tableau.b3, k3), (tableau.b4, k4)]);
        let single = (0..transfers).fold(start, |at, _| {
            let change = f(at);
            [at[0] + change[0], at[1] + change[1]]
        });
        (stepped, single)
    }

    /// The same by the method of order three.
    fn step_of_order_three(transfers: u32, f: impl Fn([f64; 2]) -> [f64; 2]) -> [f64; 2] {
        let n = f64::from(transfers);
        let tableau = Tableau::of(n);
        let [a31, a32, b1, b2, b3] = tableau.third;
        let start = [1.0, 0.5];
        let plus = |parts: &[(f64, [f64; 2])]| {
            parts.iter().fold(start, |at, (weight, k)| [at[0] + n * weight * k[0], at[1] + n * weight * k[1]])
        };
        let k1 = f(start);
        let k2 = f(plus(&[(tableau.a21, k1)]));
        let k3 = f(plus(&[(a31, k1), (a32, k2)]));
        plus(&[(b1, k1), (b2, k2), (b3, k3)])
    }

    #[test]
    fn the_shorter_step_is_of_third_order() {
        for transfers in [5, 6, 10, 30, 1000] {
            let error = |epsilon: f64| {
                let stepped = step_of_order_three(transfers, field(epsilon));
                let single = step_and_singles(transfers, field(epsilon)).1;
                (stepped[0] - single[0]).abs().max((stepped[1] - single[1]).abs())
            };
            let whole = 0.1 / f64::from(transfers);
            let fall = error(whole) / error(whole / 2.0);
            assert!((13.0..20.0).contains(&fall), "{transfers} transfers: {fall}");
        }
    }

    /// Coupled and nonlinear, so that all eight conditions of order four are asked.
    fn field(epsilon: f64) -> impl Fn([f64; 2]) -> [f64; 2] {
        move |[x, y]| [epsilon * (y - x * x), epsilon * (x * y - 0.3 * y * y * y)]
    }

    fn error(transfers: u32, epsilon: f64) -> f64 {
        let (stepped, single) = step_and_singles(transfers, field(epsilon));
        (stepped[0] - single[0]).abs().max((stepped[1] - single[1]).abs())
    }

    #[test]
    fn a_step_is_of_fourth_order_in_the_change_for_every_number_of_transfers() {
        for transfers in [5, 6, 7, 10, 30, 1000] {
            let whole = 0.1 / f64::from(transfers);
            // An error of fifth order falls by 32 where the change is halved.
            let fall = error(transfers, whole) / error(transfers, whole / 2.0);
            assert!((25.0..40.0).contains(&fall), "{transfers} transfers: {fall}");
        }
    }

    #[test]
    fn steps_of_two_and_three_transfers_are_exact() {
        for transfers in [2, 3] {
            assert!(error(transfers, 0.3) < 1e-14, "{transfers} transfers: {}", error(transfers, 0.3));
        }
    }
}
