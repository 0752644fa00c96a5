//! Pixels of a store in which packets wait between a burst and the readout, with the history of their traps.
//!
//! Packets 0 to w pass the pixel in which packet w waits one burst transfer after another, and the others one line after another.
//! In b transfers of the burst and l lines a filled trap stays filled with the probability exp(−b/τ_burst − l/τ_line). Otherwise
//! such a pixel is like any other: see `every_transfer.rs`.
//!
//! For capture at once, one cloud for all species, and a clock of one phase.

use std::ops::Range;

use super::{Cloud, Trap};

/// Traps of a pixel in which a packet waits.
pub(super) struct WaitingPixel<'a> {
    cloud: &'a Cloud,
    density: Vec<f64>,
    /// Probability that a trap is still filled after a number of transfers of the burst (second index), by species.
    burst: Vec<Vec<f64>>,
    /// The same for lines of the readout.
    lines: Vec<Vec<f64>>,
}

/// Traps between the level below and `height`, last filled by the packet of a row; −1 for the last one downstream.
struct Level {
    height: f64,
    row: i64,
}

impl<'a> WaitingPixel<'a> {
    /// For traps whose release times are in lines, with `burst_per_line` burst transfers in the time of one, and columns of `rows`
    /// packets.
    pub fn new(traps: &[Trap], cloud: &'a Cloud, burst_per_line: f64, rows: usize) -> WaitingPixel<'a> {
        let still_filled = |steps_per_line: f64| -> Vec<Vec<f64>> {
            let after = |trap: &Trap, steps: usize| match steps {
                0 => 1.0,
                _ => (-(steps as f64) / (trap.release_transfers * steps_per_line)).exp(),
            };
            traps.iter().map(|trap| (0..=rows + 1).map(|steps| after(trap, steps)).collect()).collect()
        };
        WaitingPixel {
            cloud,
            density: traps.iter().map(|trap| trap.density_per_px).collect(),
            burst: still_filled(burst_per_line),
            lines: still_filled(1.0),
        }
    }

    /// All packets of a column pass, of which that of row `waiting` waits. Traps up to `background` (a height) were filled by the
    /// last packet downstream, one transfer of the burst before.
    pub fn pass(&self, charge_e: &mut [f64], waiting: usize, background: f64) {
        let species = 0..self.density.len();
        let mut levels = vec![Level { height: background, row: -1 }];
        let mut stored_e: Vec<f64> = self.density.iter().map(|density| background * density).collect();
        for (row, charge_e) in (0_i64..).zip(charge_e) {
            let left = |s: usize, from: i64| self.left(s, from..row, waiting as i64);
            for (s, stored_e) in stored_e.iter_mut().enumerate() {
                let out_e = *stored_e * (1.0 - left(s, row - 1));
                *stored_e -= out_e;
                *charge_e += out_e;
            }
            let height = self.cloud.height(*charge_e);
            let mut reached = 0.0;
            while reached < height {
                let (top, filled) = match levels.last() {
                    Some(level) => (level.height.min(height), Some(level.row)),
                    None => (height, None),
                };
                let empty = |s: usize| 1.0 - filled.map_or(0.0, |filled| left(s, filled));
                let wanted_e = |s: usize| (top - reached) * self.density[s] * empty(s);
                let all_e: f64 = species.clone().map(wanted_e).sum();
                // A packet cannot give more charge than it has.
                let share = if all_e > *charge_e { *charge_e / all_e } else { 1.0 };
                stored_e.iter_mut().enumerate().for_each(|(s, stored_e)| *stored_e += share * wanted_e(s));
                *charge_e -= share * all_e;
                if share < 1.0 {
                    reached += share * (top - reached);
                    break;
                }
                reached = top;
                if levels.last().is_some_and(|level| level.height <= height) {
                    levels.pop();
                }
            }
            levels.push(Level { height: reached, row });
        }
    }

    /// Probability that a trap stays filled between the packets of two rows.
    fn left(&self, species: usize, rows: Range<i64>, waiting: i64) -> f64 {
        let burst = rows.end.min(waiting) - rows.start.min(waiting);
        let lines = rows.end.max(waiting) - rows.start.max(waiting);
        self.burst[species][burst as usize] * self.lines[species][lines as usize]
    }
}
