//! Every transfer, one by one, as the contract states: the reference for all other methods.

use std::ops::Range;

use super::finite_capture::FiniteCapturePixel;
use super::several_clouds::{SeveralClouds, Stacks};
use super::{Cloud, Downstream, Trap, interrupt};

/// Traps between the next level below and `height`, last filled by one packet.
struct Level {
    height: f64,
    /// Index of that packet plus one; 0 for the last one downstream.
    packet: usize,
}

/// Clocks one column out through some pixels, from the farthest from the register to the nearest.
pub(super) fn column(traps: &[Trap], cloud: &Cloud, charge_e: &mut [f64], downstream: Downstream, pixels: Range<i64>) {
    let rows = charge_e.len();
    let released: Vec<f64> = traps.iter().map(Trap::released).collect();
    let returned: Vec<f64> = traps.iter().map(Trap::returned).collect();
    // ρ exp(−m/τ), m packets later.
    let left: Vec<Vec<f64>> = (1..=rows + 1)
        .map(|m| traps.iter().map(|trap| trap.density_per_px * (-(m as f64) / trap.release_transfers).exp()).collect())
        .collect();
    let mut levels: Vec<Level> = Vec::new();
    let mut stored_e = vec![0.0; traps.len()];
    for pixel in pixels.rev() {
        interrupt::check();
        levels.clear();
        let passed_before = pixel < downstream.rows;
        let background = if passed_before { cloud.height(downstream.charge_e) } else { 0.0 };
        levels.push(Level { height: background, packet: 0 });
        for ((stored_e, trap), returned) in stored_e.iter_mut().zip(traps).zip(&returned) {
            *stored_e = background * trap.density_per_px * (1.0 - returned);
        }
        let first = (pixel - downstream.rows).max(0) as usize;
        for row in first..rows {
            for (stored_e, released) in stored_e.iter_mut().zip(&released) {
                let out_e = *stored_e * released;
                *stored_e -= out_e;
                charge_e[row] += out_e;
            }
            let height = cloud.height(charge_e[row]);
            // Traps between `reached` and the level's height were last filled by its packet.
            let mut reached = 0.0;
            while reached < height {
                let (top, left) = match levels.last() {
                    Some(level) => (level.height.min(height), Some(&left[row - level.packet])),
                    None => (height, None),
                };
                let wanted_e =
                    |s: usize| (top - reached) * (traps[s].density_per_px - left.map_or(0.0, |left| left[s]));
                let all_e: f64 = (0..traps.len()).map(wanted_e).sum();
                // A packet cannot give more charge than it has.
                let share = if all_e > charge_e[row] { charge_e[row] / all_e } else { 1.0 };
                for (s, stored_e) in stored_e.iter_mut().enumerate() {
                    *stored_e += share * wanted_e(s);
                }
                charge_e[row] -= share * all_e;
                if share < 1.0 {
                    reached += share * (top - reached);
                    break;
                }
                reached = top;
                if levels.last().is_some_and(|level| level.height <= height) {
                    levels.pop();
                }
            }
            levels.push(Level { height: reached, packet: row + 1 });
            for (stored_e, returned) in stored_e.iter_mut().zip(&returned) {
                let back_e = *stored_e * returned;
                *stored_e -= back_e;
                charge_e[row] += back_e;
            }
        }
    }
}

/// The same for finite capture times.
pub(super) fn slow_column<const S: usize>(
    pixel: &FiniteCapturePixel<S>,
    charge_e: &mut [f64],
    rows_downstream: i64,
    pixels: Range<i64>,
) {
    let mut levels = Default::default();
    for place in pixels.rev() {
        interrupt::check();
        pixel.start(place, rows_downstream, &mut levels);
        let first = (place - rows_downstream).max(0) as usize;
        for (row, charge_e) in charge_e.iter_mut().enumerate().skip(first) {
            *charge_e += pixel.packet(&mut levels, *charge_e, row + 1).0;
        }
    }
}

/// The same if species have different clouds.
pub(super) fn column_of_several_clouds(
    pixel: &SeveralClouds,
    charge_e: &mut [f64],
    downstream: Downstream,
    pixels: Range<i64>,
) {
    let mut stacks = Stacks::default();
    for place in pixels.rev() {
        interrupt::check();
        pixel.start((place < downstream.rows).then_some(downstream.charge_e), &mut stacks);
        let first = (place - downstream.rows).max(0) as usize;
        for (row, charge_e) in charge_e.iter_mut().enumerate().skip(first) {
            *charge_e += pixel.packet(&mut stacks, *charge_e, row).0;
        }
    }
}

/// Pixels from the register on. Each starts in the state left in the previous one by the first packet that passed it; `start` is
/// the first state. `pass(state, charge_e, packet)` gives the change of a packet, e-; the packets of a state are numbered
/// consecutively.
pub(super) fn carried<State: Clone>(
    charge_e: &mut [f64],
    rows_downstream: i64,
    start: State,
    pass: impl Fn(&mut State, f64, usize) -> f64,
) {
    let mut start = start;
    for place in 0..charge_e.len() as i64 + rows_downstream {
        interrupt::check();
        let mut state = start.clone();
        let first = (place - rows_downstream).max(0) as usize;
        for (row, charge_e) in charge_e.iter_mut().enumerate().skip(first) {
            *charge_e += pass(&mut state, *charge_e, place as usize + row - first);
            if row == first {
                start = state.clone();
            }
        }
    }
}
