//! Packets with less charge than the traps in their reach would capture, followed one by one.

use super::block_path::{PathMeans, ahead};
use super::pixel::Pixel;
use super::simd::{Coefficient, LANES, Packets};
use super::watermarks::{NONE, PACKETS, Watermarks};

/// Added to the index of the last watermark met by a packet that is spent.
const SPENT: f64 = 0.25;

/// Effect of the packets of a row on the watermarks.
pub(super) struct Passed {
    pub height: Packets,
    /// In all pixels of the block.
    pub captured_e: Packets,
    /// The indices of the watermarks that they leave above their own.
    pub below: Packets,
    /// The last watermarks they met, with a mark for packets that are spent.
    pub met: Packets,
}

/// A row of packets, some with less charge than the traps in their reach would capture.
pub(super) struct Short {
    pub row: usize,
    /// The watermark that they meet first.
    pub before: usize,
    pub visits: f64,
    /// Charge that meets the traps in each pixel, e-.
    pub present_e: Packets,
    /// The same, summed over all pixels, e-.
    pub has_e: Packets,
}

impl<const S: usize, const RETURNS: bool, C: Coefficient> Pixel<S, RETURNS, C> {
    /// Follows the packets of a row that hold less charge than they would fill. `stored` and `stored_ahead` assume enough charge
    /// for all, and are corrected for these packets; `watermarks` holds the previous state of the traps.
    pub(super) fn spend(
        &self,
        short: Short,
        (stored, stored_ahead): (&mut [Packets; S], &mut [Packets; S]),
        path: Option<&PathMeans>,
        watermarks: &mut Watermarks<S>,
        passed: &mut Passed,
    ) {
        for lane in 0..LANES {
            if short.has_e[lane] < passed.captured_e[lane] {
                for (place, floor) in &watermarks.moved {
                    watermarks.floor[*place][lane] = floor[lane];
                }
                self.climb(&short, lane, path, watermarks, passed);
                for s in self.species() {
                    stored[s][lane] = watermarks.stored[s][lane];
                    stored_ahead[s][lane] = watermarks.stored_ahead[s][lane];
                }
            }
        }
    }

    /// Fills watermarks from below until the packet's charge is used up, or its height is reached.
    fn climb(
        &self,
        short: &Short,
        lane: usize,
        path: Option<&PathMeans>,
        watermarks: &mut Watermarks<S>,
        passed: &mut Passed,
    ) {
        let Short { row, before, visits, .. } = *short;
        let mut height = passed.height[lane];
        let packet = row + PACKETS;
        let mut watermark = before;
        let mut reached = 0.0;
        let mut captured_e = 0.0;
        let available_e = short.has_e[lane];
        loop {
            let top = watermarks.height[watermark][lane];
            let visits_there = watermarks.visits[watermark];
            let covered = top <= height;
            let ceiling = if covered { top } else { height };
            let mut own_ceiling = ceiling;
            let mut floor = reached;
            if let Some(path) = path {
                floor = watermarks.floor[watermark][lane];
                if !covered && watermark != NONE && visits_there + watermarks.starts[watermark] < visits {
                    let present_e = short.present_e[lane] + path.further_e[row][lane];
                    own_ceiling = self.cloud.height(present_e).min(top);
                }
            }
            let mut thickness = ceiling - reached;
            let mut filled = if watermark == NONE { 0.0 } else { own_ceiling - floor };
            let mut home_filled =
                watermarks.starts[watermark] * (watermarks.home_height[watermark][lane].min(height) - floor);
            let m = packet - watermark;
            let still_filled = visits_there * filled + home_filled;
            let mut more_e =
                visits * self.density_all.lane(lane) * thickness - self.left_all[m].lane(lane) * still_filled;
            let spent = captured_e + more_e > available_e;
            if spent {
                let share = (available_e - captured_e) / more_e;
                thickness *= share;
                filled *= share;
                home_filled *= share;
                more_e *= share;
                height = reached + thickness;
            }
            for s in self.species() {
                let left = self.left[m][s].lane(lane);
                let (thick_e, filled_e) = (self.density[s].lane(lane) * thickness, left * filled);
                let home_filled_e = left * home_filled;
                watermarks.stored[s][lane] += visits * thick_e - visits_there * filled_e - home_filled_e;
                watermarks.stored_ahead[s][lane] +=
                    ahead(visits) * thick_e - ahead(visits_there) * filled_e - visits_there * home_filled_e;
            }
            captured_e += more_e;
            if covered && !spent {
                reached = top;
                watermark = watermarks.below[watermark][lane] as usize;
                continue;
            }
            if path.is_some() {
                watermarks.floor[watermark][lane] = if spent { height } else { own_ceiling };
            }
            passed.below[lane] = watermark as f64;
            passed.met[lane] = watermark as f64 + if spent { SPENT } else { 0.0 };
            passed.captured_e[lane] = captured_e;
            passed.height[lane] = height;
            return;
        }
    }
}
