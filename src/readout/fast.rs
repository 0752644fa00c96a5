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
//! (derived for ctiplan; a test below asks them of every N, and that N = 2 and 3 are exact).
//!
//! The journey is cut at row 0 of the image. Below it every packet passes every pixel. Within the image a packet only
//! passes the pixels below its own row; blocks there are summed exactly for fixed charges (see [`super::pixel`]) and
//! are advanced by the midpoint rule, all packets half-way at once, with a correction for their being half-way in different
//! pixels.

use super::pixel::{Block, Passage, Path, Stage, Workspace};
use super::{Downstream, exact};

/// Transfers up to which a step is done one by one: it would need as many passes anyway.
const SINGLY: i64 = 4;

/// Share of e1 (the change of a block's second-order result from its first-order one) that remains as error because
/// packets which start within the block are not quite in step. Chosen with [`SHARE`], so that the random columns of
/// `tests/readout.rs` keep to their tolerances.
const OUT_OF_STEP: f64 = 0.02;

/// Part of the tolerance that the estimated errors of each region may add up to. They are estimates, and a kink that lies
/// between two passes is not seen by either: of 3000 random columns read out to four accuracies, 98 of 12 000 missed their
/// tolerance with a share of 0.1, 17 with 0.03 and 8 with 0.01; nearly all without background, or with all of it in a
/// notch (`cargo test --release --test readout -- --ignored --nocapture`).
const SHARE: f64 = 0.03;

/// Clocks one column out with an error of at most about `tolerance_e` (e-) in any packet.
pub(super) fn column<P: Passage>(
    pixel: &P,
    charge_e: &mut [f64],
    downstream: Downstream,
    tolerance_e: f64,
    work: &mut Workspace<P::Levels>,
) {
    let rows = charge_e.len();
    work.stage_e.resize(rows, 0.0);
    for stage in &mut work.stages {
        stage.resize(rows);
    }
    let start = rows as i64 + downstream.rows;
    let alike = pixel.alike_below(downstream).min(start).max(0);
    exact::through(pixel, charge_e, alike..start, downstream, work);
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
            let step = Step { pixel, block, downstream, allowed_e, staggered };
            let Attempt { ratio, order } = step.attempt(charge_e, work);
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
    /// Advances the charges if that can be done with the error allowed.
    fn attempt(&self, charge_e: &mut [f64], work: &mut Workspace<P::Levels>) -> Attempt {
        if self.block.pixels <= SINGLY {
            let pixels = self.block.nearest..self.block.nearest + self.block.pixels;
            exact::through(self.pixel, charge_e, pixels, self.downstream, work);
            return Attempt { ratio: 0.0, order: 5.0 };
        }
        let Workspace { levels, stages: [k1, k2, k3, k4], stage_e } = work;
        let tableau = Tableau::of(self.block.pixels as f64);
        let mut pass = |charge_e: &[f64], found: &mut Stage| {
            self.pixel.pass(charge_e, None, self.block, self.downstream, levels, found);
        };

        pass(charge_e, k1);
        let first = self.judge_first(charge_e, k1);
        if first.ratio <= 1.0 {
            advance(charge_e, &[(1.0, k1)]);
            return first;
        }
        if self.staggered {
            self.mean_path(charge_e, k1, stage_e, &mut k3.change_e, &mut k4.change_e);
            let path = Path { first_e: &k3.change_e, drift_e: &k4.change_e };
            self.pixel.pass(stage_e, Some(path), self.block, self.downstream, levels, k2);
            let second = self.judge_second(k1, k2);
            if second.ratio <= 1.0 {
                advance(charge_e, &[(1.0, k2)]);
            }
            return second;
        }
        stage_e.copy_from_slice(charge_e);
        advance(stage_e, &[(tableau.a21, k1)]);
        pass(stage_e, k2);
        let second = self.judge_second(k1, k2);
        if second.ratio <= 1.0 {
            advance(charge_e, &[(1.0, k2)]);
            return second;
        }
        stage_e.copy_from_slice(charge_e);
        advance(stage_e, &[(tableau.a31, k1), (tableau.a32, k2)]);
        pass(stage_e, k3);
        stage_e.copy_from_slice(charge_e);
        advance(stage_e, &[(tableau.a41, k1), (tableau.a43, k3)]);
        pass(stage_e, k4);
        stage_e.fill(0.0);
        advance(stage_e, &[(tableau.b1, k1), (tableau.b2, k2), (tableau.b3, k3), (tableau.b4, k4)]);
        let fourth = self.judge_fourth(k1, k2, k4, stage_e);
        if fourth.ratio <= 1.0 {
            for (charge, change) in charge_e.iter_mut().zip(stage_e.iter()) {
                *charge += change;
            }
        }
        fourth
    }

    /// Mean charge of every packet over its way through the block, and the way itself, to first order.
    fn mean_path(&self, charge_e: &[f64], k1: &Stage, mean_e: &mut [f64], first_e: &mut [f64], drift_e: &mut [f64]) {
        for row in 0..charge_e.len() {
            let visits = self.block.visits(row as i64, self.downstream).max(1) as f64;
            let starts_here = row as i64 + self.downstream.rows < self.block.nearest + self.block.pixels;
            first_e[row] = if starts_here { self.pixel.fill(charge_e[row]) } else { 0.0 };
            drift_e[row] = (k1.change_e[row] + first_e[row]) / visits;
            // Mean of n, n − first + drift, n − first + 2 drift, …
            mean_e[row] = charge_e[row] - first_e[row] * (visits - 1.0) / visits + 0.5 * (visits - 1.0) * drift_e[row];
        }
    }

    /// Error of the first-order result k1: at most how far it moves the charges times the steepest change of the captured
    /// charge with them.
    fn judge_first(&self, charge_e: &[f64], k1: &Stage) -> Attempt {
        let moved = k1.change_e.iter().fold(0.0_f64, |most, change| most.max(change.abs()));
        let (low, high) =
            charge_e.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), charge| (low.min(*charge), high.max(*charge)));
        let steepest = self.pixel.steepest(low - moved, high + moved);
        self.ratio(moved * steepest * self.block.pixels as f64, 2.0, 0.0, 0.0)
    }

    /// Error of the second-order result, which is k2 alone. Its distance e1 from the first-order result k1 bounds it where
    /// the change has a kink; where it is smooth, the error is smaller by the ratio of e1 to the change.
    fn judge_second(&self, k1: &Stage, k2: &Stage) -> Attempt {
        let (mut smooth, mut kinked) = (0.0, 0.0);
        let largest = largest_difference(&k1.change_e, &k2.change_e);
        if largest <= self.allowed_e {
            // Whatever the error is, it is no more than this.
            return Attempt { ratio: if largest > 0.0 { largest / self.allowed_e } else { 0.0 }, order: 2.0 };
        }
        for row in 0..k1.change_e.len() {
            let e1 = (k2.change_e[row] - k1.change_e[row]).abs();
            raise(&mut smooth, e1 * share(e1, around(row, |row| k2.change_e[row])));
            if k1.meets[row] != k2.meets[row] {
                raise(&mut kinked, e1);
            }
        }
        self.ratio(smooth, 3.0, kinked, largest)
    }

    /// Error of the fourth-order result `change_e`. Where the change is smooth, the errors e1 and e2 of the orders one
    /// and two foretell it, two ratios e2/e1 further down (in the manner of DOP853, which combines two embedded
    /// estimates: Hairer, Nørsett & Wanner 1993, II.10); where it has a kink, Simpson's rule is off by at most half of
    /// e2, and four times that is allowed for: there may be several kinks.
    fn judge_fourth(&self, k1: &Stage, k2: &Stage, k4: &Stage, change_e: &[f64]) -> Attempt {
        let (mut smooth, mut kinked) = (0.0, 0.0);
        let largest = largest_difference(&k1.change_e, change_e);
        for row in 0..change_e.len() {
            let e2 = (k2.change_e[row] - change_e[row]).abs();
            let ratio = share(e2, around(row, |row| k1.change_e[row] - change_e[row]));
            raise(&mut smooth, e2 * ratio * ratio);
            if k1.meets[row] != k4.meets[row] || k1.meets[row] != k2.meets[row] {
                raise(&mut kinked, 2.0 * e2);
            }
        }
        self.ratio(smooth, 5.0, kinked, largest)
    }

    /// The worst of the three errors over what each is allowed.
    fn ratio(&self, smooth_e: f64, order: f64, kinked_e: f64, e1: f64) -> Attempt {
        let out_of_step = if self.staggered { OUT_OF_STEP * e1 } else { 0.0 };
        [(smooth_e, order), (kinked_e, 2.0), (out_of_step, 2.0)]
            .map(|(error_e, order)| {
                // Nothing is too much of nothing.
                let ratio = if error_e > 0.0 { error_e / self.allowed_e } else { 0.0 };
                Attempt { ratio, order }
            })
            .into_iter()
            .reduce(|worst, other| if other.ratio > worst.ratio { other } else { worst })
            .expect("three of them")
    }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |most, (a, b)| {
        let difference = (a - b).abs();
        if difference > most { difference } else { most }
    })
}

fn raise(most: &mut f64, value: f64) {
    if value > *most {
        *most = value;
    }
}

/// Size of a change at a row and the row before: a change that passes through 0 is not small there.
fn around(row: usize, change: impl Fn(usize) -> f64) -> f64 {
    change(row).abs().max(change(row.saturating_sub(1)).abs())
}

/// The part over the whole, at most 1.
fn share(part: f64, whole: f64) -> f64 {
    if part < whole { part / whole } else { 1.0 }
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
}

impl Tableau {
    fn of(transfers: f64) -> Tableau {
        let u = 1.0 / transfers;
        let v = 1.0 - u;
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
        }
    }
}

/// Adds multiples of changes to the charges.
fn advance(charge_e: &mut [f64], changes: &[(f64, &Stage)]) {
    for (weight, stage) in changes {
        for (charge, change) in charge_e.iter_mut().zip(&stage.change_e) {
            *charge += weight * change;
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
