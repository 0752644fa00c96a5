//! Arithmetic on whole columns of packets between two passes: sums of changes, and errors estimated from their differences.
//!
//! Errors are root mean squares over all packets, e-.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

use super::Cloud;
use super::passage::Stage;
use super::simd::{LANES, Packets, Vector};

/// Adds multiples of changes to the charges.
pub(super) fn add(charge_e: &mut [Packets], changes: &[(f64, &Stage)]) {
    dispatch!(Level::new(), simd => {
        for (row, charge_e) in charge_e.iter_mut().enumerate() {
            plus(simd, Vector::load(simd, charge_e), row, changes).store(charge_e);
        }
    });
}

/// Charges with multiples of changes added.
pub(super) fn sum(charge_e: &[Packets], changes: &[(f64, &Stage)], sum_e: &mut [Packets]) {
    dispatch!(Level::new(), simd => {
        for (row, (charge_e, sum_e)) in charge_e.iter().zip(sum_e).enumerate() {
            plus(simd, Vector::load(simd, charge_e), row, changes).store(sum_e);
        }
    });
}

#[inline(always)]
fn plus<S: Simd>(simd: S, mut charge_e: Vector<S>, row: usize, changes: &[(f64, &Stage)]) -> Vector<S> {
    for (weight, stage) in changes {
        charge_e = charge_e + Vector::load(simd, &stage.change_e[row]) * *weight;
    }
    charge_e
}

/// Change of the packets, as a root mean square. None loses more than it has, although a first-order change may exceed it.
///
/// If any charge fills part of the wells, most of the change is the charge that a packet leaves in the empty pixel it starts in.
/// This is known exactly and excluded: an accuracy relative to it would be meaningless for the rest.
pub(super) fn moved(clouds: &[Cloud], charge_e: &[Packets], k1: &Stage) -> f64 {
    let changes = if volume_at_zero(clouds) > 0.0 { &k1.drift_e } else { &k1.change_e };
    dispatch!(Level::new(), simd => {
        let zero = Vector::all(simd, 0.0);
        let mut moved = MeanSquare::new(simd);
        for (charge_e, change_e) in charge_e.iter().zip(changes) {
            let (charge_e, change_e) = (Vector::load(simd, charge_e), Vector::load(simd, change_e));
            moved.add(change_e.max(zero - charge_e.max(zero)));
        }
        moved.root()
    })
}

/// The largest volume at zero charge of some clouds.
pub(super) fn volume_at_zero(clouds: &[Cloud]) -> f64 {
    clouds.iter().map(Cloud::volume_at_zero).fold(0.0, f64::max)
}

/// Whether some packet may run out of charge on the way: it loses charge, or starts within the block (`starts`), and ends with less
/// than a pixel's traps within the volume at zero charge would capture if all were empty (`least_e`, e-). Its loss stops where its
/// charge is used up, and no pass over all pixels sees where. Changes up to `negligible_e` do not matter.
pub(super) fn exhausted(least_e: f64, starts: bool, negligible_e: f64, charge_e: &[Packets], k1: &Stage) -> bool {
    if least_e == 0.0 {
        return false;
    }
    dispatch!(Level::new(), simd => {
        let [zero, negligible_e, least_e] = [0.0, negligible_e, least_e].map(|value| Vector::all(simd, value));
        charge_e.iter().zip(&k1.change_e).any(|(charge_e, change_e)| {
            let (charge_e, change_e) = (Vector::load(simd, charge_e), Vector::load(simd, change_e));
            let moves = if starts { charge_e.abs().max(change_e.abs()) } else { zero - change_e };
            ((charge_e + change_e).below(least_e) & negligible_e.below(moves)).any()
        })
    })
}

/// Error of a first-order result: how far it moves a packet, times the steepest slope of the charge captured by `traps` traps, and
/// as much again for its neighbours' moves; half of all that on average over the path.
pub(super) fn first(clouds: &[Cloud], traps: f64, charge_e: &[Packets], k1: &Stage) -> f64 {
    dispatch!(Level::new(), simd => {
        let zero = Vector::all(simd, 0.0);
        let mut error = MeanSquare::new(simd);
        for (row, charge_e) in charge_e.iter().enumerate() {
            let (charge_e, change_e) = (Vector::load(simd, charge_e), Vector::load(simd, &k1.change_e[row]));
            let moved_e = Vector::load(simd, &k1.drift_e[row]).abs();
            let steepest = clouds
                .iter()
                .fold(zero, |most, cloud| most.max(cloud.steepest(simd, charge_e, charge_e + change_e)));
            let error_e = steepest * moved_e * traps;
            let doubtful_e = Vector::load(simd, &k1.doubtful_e[row]).abs() * DOUBTFUL;
            error.add(zero.below(moved_e).select(error_e, zero) + doubtful_e);
        }
        error.root()
    })
}

/// Errors of a second-order result.
pub(super) struct Second {
    /// For smooth changes.
    pub smooth_e: f64,
    /// For changes with a kink.
    pub kinked_e: f64,
    /// Distance from the first-order result.
    pub all_e: f64,
    /// Predicted for a third-order result, including kinks.
    pub third_e: f64,
    /// Predicted for a fourth-order result, without kinks.
    pub fourth_e: f64,
}

/// Share of the distance between results of two orders that remains as error at a kink: both rules treat it as smooth, and miss
/// only part of the distance on one side of it.
const KINKED: f64 = 0.1;

/// Share of the charge taken from home_watermarks, known only on average, that may be wrong.
const DOUBTFUL: f64 = 0.1;

/// Errors of the second-order result, which is k2 alone. At a kink its distance e1 from the first-order result k1 is a safe bound;
/// for a smooth change the error is smaller by the ratio of e1 to the change.
pub(super) fn second(k1: &Stage, k2: &Stage) -> Second {
    dispatch!(Level::new(), simd => {
        let zero = Vector::all(simd, 0.0);
        let [mut smooth, mut kinked, mut all, mut third, mut fourth] = [(); 5].map(|()| MeanSquare::new(simd));
        let mut before = zero;
        for row in 0..k1.change_e.len() {
            let change_e = Vector::load(simd, &k2.drift_e[row]);
            let e1 = (change_e - Vector::load(simd, &k1.drift_e[row])).abs();
            // Where a change passes through 0, its scale is not small.
            let ratio = share(simd, e1, change_e.abs().max(before));
            let as_before = Vector::load(simd, &k1.meets[row]).equals(Vector::load(simd, &k2.meets[row]));
            // Each order reduces the error by this ratio.
            smooth.add(e1 * ratio);
            let doubtful_e = Vector::load(simd, &k2.doubtful_e[row]).abs() * DOUBTFUL;
            kinked.add(as_before.select(zero, e1 * KINKED) + doubtful_e);
            all.add(e1);
            third.add(e1 * ratio * as_before.select(ratio, Vector::all(simd, 2.0 * KINKED)));
            fourth.add(e1 * ratio * ratio * ratio);
            before = change_e.abs();
        }
        let [smooth_e, kinked_e, all_e, third_e, fourth_e] = [smooth, kinked, all, third, fourth].map(|error| error.root());
        Second { smooth_e, kinked_e, all_e, third_e, fourth_e }
    })
}

/// Errors (smooth, kinked) of a result of higher order, `after_e`. For a smooth change, the errors e1 and e2 of orders one and two
/// predict it by `ratios` further factors of e2/e1 (in the manner of DOP853, which combines two embedded estimates: Hairer, Nørsett
/// & Wanner 1993, II.10). At a kink, the error is a share of e2, doubled because there may be several kinks. The stages are the
/// first two and the last.
pub(super) fn higher(
    [k1, k2, last]: [&Stage; 3],
    charge_e: &[Packets],
    after_e: &[Packets],
    ratios: i32,
) -> (f64, f64) {
    dispatch!(Level::new(), simd => {
        let zero = Vector::all(simd, 0.0);
        let [mut smooth, mut kinked] = [(); 2].map(|()| MeanSquare::new(simd));
        let mut before = zero;
        for row in 0..charge_e.len() {
            let change_e = Vector::load(simd, &after_e[row]) - Vector::load(simd, &charge_e[row]);
            let e1 = (Vector::load(simd, &k1.change_e[row]) - change_e).abs();
            let e2 = (Vector::load(simd, &k2.change_e[row]) - change_e).abs();
            let ratio = share(simd, e2, e1.max(before));
            let meets = Vector::load(simd, &k1.meets[row]);
            let as_before =
                meets.equals(Vector::load(simd, &k2.meets[row])) & meets.equals(Vector::load(simd, &last.meets[row]));
            smooth.add(e2 * if ratios == 1 { ratio } else { ratio * ratio });
            kinked.add(as_before.select(zero, e2 * (2.0 * KINKED)));
            before = e1;
        }
        (smooth.root(), kinked.root())
    })
}

/// Accumulates a root mean square.
struct MeanSquare<S: Simd> {
    squares: Vector<S>,
    rows: usize,
}

impl<S: Simd> MeanSquare<S> {
    /// Of no values yet.
    #[inline(always)]
    fn new(simd: S) -> MeanSquare<S> {
        MeanSquare { squares: Vector::all(simd, 0.0), rows: 0 }
    }

    /// Adds a row of values.
    #[inline(always)]
    fn add(&mut self, values: Vector<S>) {
        self.rows += 1;
        self.squares = self.squares + values * values;
    }

    /// The root of the mean of the squares.
    #[inline(always)]
    fn root(&self) -> f64 {
        (self.squares.sum() / (self.rows * LANES).max(1) as f64).sqrt()
    }
}

/// The part over the whole, at most 1.
#[inline(always)]
fn share<S: Simd>(simd: S, part: Vector<S>, whole: Vector<S>) -> Vector<S> {
    part.below(whole).select(part / whole, Vector::all(simd, 1.0))
}
