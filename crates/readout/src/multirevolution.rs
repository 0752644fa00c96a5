//! Readout to the requested accuracy, in a handful of passes instead of thousands.
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
//! These satisfy the eight conditions of order four, with Σ k^p over the N transfers in place of ∫ k^p (derived for ctiplan; a test
//! below checks them for every N, and that N = 2 and 3 are exact). If order three is predicted to suffice, Kutta's method is used,
//! with one pass less: the same second stage, a third at 1−u, and weights from the four conditions of order three.
//!
//! The journey is divided at row 0 of the image. Below it every packet passes every pixel. Within the image a packet passes only
//! the pixels below its own row. Blocks there are summed exactly for fixed charges (see [`super::pixel`]) and are advanced to
//! second order, all packets at their means over the path (see [`super::block_path`]).

use std::ops::Range;

use super::block_path::{BlockPath, PathMeans};
use super::estimate;
use super::interrupt;
use super::passage::{Block, Lead, Passage, Stage};
use super::simd::{LANES, Packets};

/// Up to this many transfers, a step is done one by one: it would need as many passes anyway.
const SINGLY: i64 = 4;

/// Maximum number of doublings of the transfers done one by one before a longer step is tried again.
const PATIENCE: u32 = 4;

/// Share of e1 (the difference of a block's second-order and first-order results) that may remain as error if packets start within
/// the block: from kinks between its pixels, which no pass over all of them sees.
const OUT_OF_STEP: f64 = 0.013;

/// A fourth-order result is not computed if its predicted error exceeds the allowed one by this factor.
const HOPELESS: f64 = 10.0;

/// Share of the tolerance allowed for the sum of first-order errors in each region: they are upper bounds from the steepest slope,
/// usually too large by several times.
const SHARE_OF_BOUNDS: f64 = 0.5;

/// Share of the tolerance allowed for the sum of the other estimated errors in each region. They are estimates: a kink between two
/// passes is seen by neither (`cargo test --release --test suite readout:: -- --ignored --nocapture` counts the misses; nearly all
/// are without background, or with all of it in a notch).
const SHARE: f64 = 0.02;

/// Share of what a region's steps have left of its allowed error, that any step may make. (The first steps must be short where
/// wells are empty, since a root of the charge is steepest there; by their length alone they might make next to no error.)
const STEP_SHARE: f64 = 0.03;

/// Change of a packet over the tolerance, up to which it does not matter whether its charge runs out.
const NEGLIGIBLE: f64 = 1e-4;

/// Share of the tolerance if any charge fills part of the wells: where a packet's charge runs out depends on those ahead of it, so
/// their errors add up in one packet.
const PASSED_ON: f64 = 0.2;

/// Buffers that steps reuse.
pub(super) struct Workspace<L> {
    pub watermarks: L,
    pub stages: [Stage; 4],
    pub stage_e: Vec<Packets>,
    pub path: PathMeans,
}

impl<L: Default> Workspace<L> {
    /// For columns of `rows` packets.
    pub fn new(rows: usize) -> Workspace<L> {
        let stages = [(); 4].map(|()| Stage::new(rows));
        Workspace { watermarks: L::default(), stages, stage_e: vec![[0.0; LANES]; rows], path: PathMeans::new(rows) }
    }

    /// The buffers of a single pass over `rows` rows.
    pub fn single(&mut self, rows: usize) -> (&mut L, &mut Stage) {
        self.stages[0].resize(rows);
        (&mut self.watermarks, &mut self.stages[0])
    }
}

/// The target accuracy.
#[derive(Clone, Copy)]
pub(super) struct Aim {
    /// Allowed error of the packets (e-, root mean square).
    tolerance_e: f64,
    /// First-order error of the whole journey in one step, over the allowed error.
    first_order: f64,
    /// Pixels of the journey.
    pixels: i64,
}

impl Aim {
    /// Predicted first-order error over the allowed error, for `pixels` that are allowed a share of the whole error.
    fn predicted(&self, pixels: i64, share: f64) -> f64 {
        self.first_order * (pixels as f64 / self.pixels as f64).powf(GROWTH) / share
    }
}

/// Exponent of the number of pixels in the bound of the first-order error: one power each for the path and the traps on it, and a
/// little more because the steepest slope along the path counts.
const GROWTH: f64 = 2.5;

/// Predicted first-order error around the brightest pixel, over the allowed error. Up to the first value a first-order step is
/// tried at once; beyond the second it is hopeless everywhere.
const LIKELY_FIRST: f64 = 2.0;
const HOPELESS_FIRST: f64 = 1000.0;

/// An accuracy relative to the change of these packets, both as root mean squares. Costs one pass.
pub(super) fn aim<P: Passage>(
    pixel: &P,
    charge_e: &[Packets],
    downstream: &Lead,
    relative: f64,
    work: &mut Workspace<P::Watermarks>,
) -> Aim {
    let pixels = &downstream.pixels;
    let journey = Block { nearest: pixels.start, pixels: pixels.end - pixels.start };
    let found = &mut work.stages[0];
    pixel.pass(charge_e, BlockPath::Unknown, journey, downstream, &mut work.watermarks, found);
    let tolerance_e = relative * estimate::moved(pixel.clouds(), charge_e, found);
    let bound_e = estimate::first(pixel.clouds(), journey.pixels as f64 * pixel.density(), charge_e, found);
    Aim { tolerance_e, first_order: ratio(bound_e, SHARE_OF_BOUNDS * tolerance_e), pixels: journey.pixels }
}

/// Clocks columns out with at most about the target error.
pub(super) fn columns<P: Passage>(
    pixel: &P,
    charge_e: &mut [Packets],
    downstream: &Lead,
    aim: Aim,
    work: &mut Workspace<P::Watermarks>,
) {
    let Range { start: nearest, end } = downstream.pixels;
    let image = downstream.rows.clamp(nearest, end)..end;
    let shared = nearest..downstream.rows.min(end);
    for region in [image, shared] {
        let length = region.end - region.start;
        let passed_on = if estimate::volume_at_zero(pixel.clouds()) > 0.0 { PASSED_ON } else { 1.0 };
        let staggered = region.start >= downstream.rows;
        let mut position = region.end;
        let mut wanted = length;
        let mut by_first = true;
        let (mut refused, mut shortened) = (0, false);
        // Of the region's allowed error, what earlier steps have left.
        let mut left = 1.0;
        while position > region.start {
            interrupt::check();
            let alike = pixel.alike_pixels(position - 1, downstream).start.max(region.start);
            let pixels = wanted.clamp(1, position - alike);
            let block = Block { nearest: position - pixels, pixels };
            let by_length = pixels as f64 / length as f64;
            let share = by_length.max(STEP_SHARE * left).min(left);
            let tolerance_e = aim.tolerance_e * passed_on * share;
            // If it failed once, it seldom suffices later.
            let first_order = if by_first { aim.predicted(pixels, share) } else { HOPELESS_FIRST };
            let evenly = by_length > STEP_SHARE * left;
            let step = Step { pixel, block, downstream, tolerance_e, evenly, staggered, first_order };
            let attempt = step.attempt(charge_e, work);
            by_first &= attempt.by_first;
            let Attempt { ratio, stretch, .. } = attempt;
            if ratio <= 1.0 {
                position -= pixels;
                left -= share * ratio;
                let longer = (pixels as f64 * stretch.clamp(1.0, 4.0)) as i64;
                // A step cut short by unequal pixels does not exclude longer ones.
                wanted = if pixels < wanted { longer.max(wanted) } else { longer };
                (refused, shortened) = (0, false);
            } else if pixels as f64 * stretch > SINGLY as f64 {
                // The estimate promises too much if the change is not smooth.
                let less = if shortened { 0.5 } else { 1.0 };
                wanted = (pixels as f64 * stretch.clamp(0.1, 0.7) * less) as i64;
                shortened = true;
            } else {
                // Not tried again at once, and less often after repeated failures.
                let next = region.start.max(position - (SINGLY << (1 + refused).min(PATIENCE)));
                singly(pixel, charge_e, next..position, downstream, work);
                position = next;
                wanted = 2 * SINGLY;
                refused += 1;
            }
        }
    }
}

/// Clocks columns through some pixels (0 is nearest to the register), the farthest first, one by one.
fn singly<P: Passage>(
    pixel: &P,
    charge_e: &mut [Packets],
    pixels: Range<i64>,
    downstream: &Lead,
    work: &mut Workspace<P::Watermarks>,
) {
    let found = &mut work.stages[0];
    for nearest in pixels.rev() {
        interrupt::check();
        pixel.pass(charge_e, BlockPath::Unknown, Block { nearest, pixels: 1 }, downstream, &mut work.watermarks, found);
        estimate::add(charge_e, &[(1.0, found)]);
    }
}

/// One step of the journey.
struct Step<'a, P> {
    pixel: &'a P,
    block: Block,
    downstream: &'a Lead,
    /// Error allowed, e-.
    tolerance_e: f64,
    /// Whether that is proportional to the step's length, rather than the same for all short steps.
    evenly: bool,
    /// Packets start within the block.
    staggered: bool,
    /// Predicted first-order error, over the allowed one.
    first_order: f64,
}

/// The outcome of a step.
struct Attempt {
    /// Estimated error over the allowed error; if above 1, the charges are unchanged.
    ratio: f64,
    /// Length of the next step over that of this one, at best.
    stretch: f64,
    /// Whether the first order sufficed.
    by_first: bool,
}

impl<P: Passage> Step<'_, P> {
    /// Advances the charges if possible within the allowed error, with the lowest sufficient order.
    fn attempt(&self, charge_e: &mut [Packets], work: &mut Workspace<P::Watermarks>) -> Attempt {
        let Step { pixel, block, downstream, .. } = *self;
        if block.pixels <= SINGLY {
            singly(pixel, charge_e, block.nearest..block.nearest + block.pixels, downstream, work);
            return Attempt { ratio: 0.0, stretch: f64::INFINITY, by_first: true };
        }
        let only_first = self.staggered && !pixel.knows_paths();
        let seek = self.staggered && !only_first && self.first_order > LIKELY_FIRST;
        let Workspace { watermarks, stages: [k1, ..], path, .. } = work;
        let first_path = if seek { BlockPath::Sought(path) } else { BlockPath::Unknown };
        pixel.pass(charge_e, first_path, block, downstream, watermarks, k1);
        let least_e = estimate::volume_at_zero(pixel.clouds()) * pixel.density();
        if estimate::exhausted(least_e, self.staggered, NEGLIGIBLE * self.tolerance_e, charge_e, k1) {
            return Attempt { ratio: f64::INFINITY, stretch: 0.0, by_first: self.first_order <= HOPELESS_FIRST };
        }
        if only_first || self.first_order <= HOPELESS_FIRST {
            let traps = block.pixels as f64 * pixel.density();
            let ratio = ratio(estimate::first(pixel.clouds(), traps, charge_e, k1), SHARE_OF_BOUNDS * self.tolerance_e);
            if ratio <= 1.0 {
                estimate::add(charge_e, &[(1.0, k1)]);
            }
            if ratio <= 1.0 || only_first {
                return Attempt { ratio, stretch: self.stretch(ratio, 2.0), by_first: true };
            }
        }
        if self.staggered { self.by_paths(seek, charge_e, work) } else { self.by_higher_orders(charge_e, work) }
    }

    /// A step of packets that start within the block, of second order along their paths; the first pass is done, and sought the
    /// paths or not.
    fn by_paths(&self, sought: bool, charge_e: &mut [Packets], work: &mut Workspace<P::Watermarks>) -> Attempt {
        let Step { pixel, block, downstream, .. } = *self;
        let Workspace { watermarks, stages: [k1, k2, ..], path, .. } = work;
        if !sought {
            pixel.pass(charge_e, BlockPath::Sought(path), block, downstream, watermarks, k1);
        }
        pixel.pass(charge_e, BlockPath::Known(path), block, downstream, watermarks, k2);
        let errors = estimate::second(k1, k2);
        let attempt = self.judge(errors.smooth_e, 3.0, errors.kinked_e.max(OUT_OF_STEP * errors.all_e));
        if attempt.ratio <= 1.0 {
            estimate::add(charge_e, &[(1.0, k2)]);
        }
        attempt
    }

    /// A step of packets that all pass the whole block, of second, third or fourth order; the first pass is done.
    fn by_higher_orders(&self, charge_e: &mut [Packets], work: &mut Workspace<P::Watermarks>) -> Attempt {
        let Step { pixel, block, downstream, .. } = *self;
        let Workspace { watermarks, stages: [k1, k2, k3, k4], stage_e, .. } = work;
        let mut pass = |charge_e: &[Packets], found: &mut Stage| {
            pixel.pass(charge_e, BlockPath::Unknown, block, downstream, watermarks, found);
        };
        let tableau = Tableau::of(block.pixels as f64);
        estimate::sum(charge_e, &[(tableau.a21, k1)], stage_e);
        pass(stage_e, k2);
        let errors = estimate::second(k1, k2);
        let second = self.judge(errors.smooth_e, 3.0, errors.kinked_e);
        if second.ratio <= 1.0 {
            estimate::add(charge_e, &[(1.0, k2)]);
            // By the order that goes farthest with each pass.
            let fourth = self.judge(errors.fourth_e, 5.0, errors.kinked_e);
            let longer = if fourth.stretch / 4.0 > second.stretch / 2.0 { fourth.stretch } else { second.stretch };
            return Attempt { stretch: longer, ..second };
        }
        let fourth = self.judge(errors.fourth_e, 5.0, 0.0);
        if fourth.ratio > HOPELESS {
            return fourth;
        }
        let attempt = if errors.third_e <= SHARE * self.tolerance_e {
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

    /// The worse of two errors over the allowed error: that of a smooth change, which grows with a power of the step's length, and
    /// that of its kinks.
    fn judge(&self, smooth_e: f64, order: f64, kinked_e: f64) -> Attempt {
        let [smooth, kinked] = [smooth_e, kinked_e].map(|error_e| ratio(error_e, SHARE * self.tolerance_e));
        let stretch = self.stretch(smooth, order).min(self.stretch(kinked, 2.0));
        Attempt { ratio: smooth.max(kinked), stretch, by_first: false }
    }

    /// How much longer a step may be whose error over the allowed one is this, and grows with this power of its length.
    fn stretch(&self, ratio: f64, order: f64) -> f64 {
        let exponent = if self.evenly { order - 1.0 } else { order };
        if ratio > 0.0 { 0.9 * ratio.powf(-1.0 / exponent) } else { f64::INFINITY }
    }
}

/// An error over the allowed error. A zero error is within any allowance, even 0.
fn ratio(error_e: f64, allowed_e: f64) -> f64 {
    if error_e > 0.0 { error_e / allowed_e } else { 0.0 }
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
    use crate::passage::Lead;
    use crate::pixel::Pixel;
    use crate::{Cloud, Phase, Trap};

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

    /// Coupled and nonlinear, so that all eight conditions of order four are tested.
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
            // An error of fifth order decreases by 32 if the change is halved.
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

    /// Errors (rms, e-) of the first and the second order for a whole image, compared with its transfers one by one.
    fn block_errors<const RETURNS: bool>(charges_e: &[f64], traps: &[Trap]) -> [f64; 2] {
        let pixel = Pixel::<3, RETURNS>::new(traps, Cloud::new(84_700.0, 0.0, 0.5), charges_e.len());
        let charge_e: Vec<Packets> = charges_e.iter().map(|charge_e| [*charge_e; LANES]).collect();
        let block = Block { nearest: 0, pixels: charge_e.len() as i64 };
        let mut work = Workspace::new(charge_e.len());
        let mut singles_e = charge_e.clone();
        let nothing = Lead { rows: 0, charge_e: [0.0; LANES], pixels: 0..i64::MAX };
        singly(&pixel, &mut singles_e, 0..block.pixels, &nothing, &mut work);
        let Workspace { watermarks, stages: [k1, k2, ..], path, .. } = &mut work;
        pixel.pass(&charge_e, BlockPath::Sought(path), block, &nothing, watermarks, k1);
        pixel.pass(&charge_e, BlockPath::Known(path), block, &nothing, watermarks, k2);
        [&*k1, k2].map(|found| {
            let off = |row: usize| charge_e[row][0] + found.change_e[row][0] - singles_e[row][0];
            ((0..charge_e.len()).map(|row| off(row).powi(2)).sum::<f64>() / charge_e.len() as f64).sqrt()
        })
    }

    #[test]
    fn blocks_of_the_image_are_advanced_to_second_order() {
        let galaxy = |row: usize| 800.0 * (1.0 + ((row as f64 - 22.0) / 3.0).powi(2)).powf(-2.5);
        let noise = |row: usize| ((row * 7919) % 31) as f64;
        // If all packets are equal, most of the effect is what they leave in their own pixels; see `super::home_watermarks`.
        let flat: Vec<f64> = (0..40).map(|row| 120.0 + galaxy(row)).collect();
        let noisy: Vec<f64> = (0..40).map(|row| 120.0 + galaxy(row) + noise(row)).collect();
        let phase = Phase { over: 0.2, ahead: 0.3, tie: 0.1 };
        for (charges_e, returns) in [(&flat, false), (&noisy, false), (&flat, true), (&noisy, true)] {
            let traps = |scale: f64| {
                let phase = if returns { phase } else { Phase::SINGLE };
                [(0.5, 0.6), (0.3, 9.0), (0.2, 60.0)].map(|(d, t)| Trap { phase, ..Trap::new(scale * d, t) })
            };
            let errors = if returns { block_errors::<true> } else { block_errors::<false> };
            let [first, second] = errors(charges_e, &traps(1.0));
            let [first_of_half, second_of_half] = errors(charges_e, &traps(0.5));
            // An error of second order in the traps decreases by 4 if they are halved, one of third order by 8.
            assert!((3.9..4.1).contains(&(first / first_of_half)), "{first:e}, {first_of_half:e}");
            assert!((7.8..8.2).contains(&(second / second_of_half)), "{second:e}, {second_of_half:e}");
            assert!(second < 0.01 * first, "{second:e}, {first:e}");
        }
    }
}
