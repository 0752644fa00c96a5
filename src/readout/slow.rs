//! What the traps of a pixel do to the packets that pass it where capture takes time.
//!
//! Inside the cloud, whose height is that of the charge on arrival, capture and release go on together for one transfer;
//! above it there is release alone:
//!
//! ```text
//! inside   df/dt = (1 − f)/τc − f/τ      f ← f∞ + (f − f∞) exp(−1/τc − 1/τ),   f∞ = τ/(τ + τc)
//! above    df/dt = −f/τ                  f ← f exp(−1/τ)
//! ```
//!
//! Massey et al. 2014 (MNRAS 439, 887), appendix A. A packet no longer fills what it covers, so that a level remembers all
//! packets that ever reached it: levels are kept from the bottom up, each with the fraction filled of every species, and
//! are merged where that costs less charge than is asked for. Nor do packets upstream find the steady state after one
//! packet of background: [`SlowPixel::new`] follows the background, packet by packet, until it settles.

use super::lanes::{LANES, Row};
use super::pixel::{Block, Passage, Path, Stage};
use super::{Cloud, Downstream, Trap};

/// The traps of one pixel, for `S` species (padded with species of no density).
pub(super) struct SlowPixel<const S: usize> {
    cloud: Cloud,
    density: [f64; S],
    density_all: f64,
    /// exp(−1/τ), chance to stay filled above the cloud.
    keep: [f64; S],
    /// f∞, fraction filled in the end inside the cloud.
    full: [f64; S],
    /// exp(−1/τc − 1/τ), what is left inside the cloud of the distance from it.
    approach: [f64; S],
    /// Charge that may be misplaced in a pixel: by a merger of levels, or by a background that has not quite settled, e-.
    merge_e: f64,
    /// What the background has left in a pixel that it passed 0, 1, 2, … times; the last holds for more.
    background: Vec<Vec<Level<S>>>,
}

/// Traps between the next level below and `top`.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Level<const S: usize> {
    top: f64,
    fill: [f64; S],
    /// Which packet's cloud ended at the top: its row plus one.
    packet: usize,
}

/// Change of a packet of background in one pixel, e-, below which the background counts as settled in any case.
const SETTLED_E: f64 = 1e-13;

impl<const S: usize> SlowPixel<S> {
    /// Follows the background (e-) of the rows downstream of an image until one more packet of it changes nothing.
    pub fn new(traps: &[Trap], cloud: Cloud, downstream: Downstream, merge_e: f64) -> SlowPixel<S> {
        let mut pixel = SlowPixel {
            cloud,
            density: [0.0; S],
            density_all: traps.iter().map(|trap| trap.density_per_px).sum(),
            keep: [0.0; S],
            full: [0.0; S],
            approach: [0.0; S],
            merge_e,
            background: vec![Vec::new()],
        };
        for (s, trap) in traps.iter().enumerate() {
            pixel.density[s] = trap.density_per_px;
            (pixel.keep[s], pixel.full[s], pixel.approach[s]) = trap.passage();
        }
        let mut charge_e = downstream.charge_e;
        let mut quiet = 0;
        for _ in 0..downstream.rows {
            let mut after = pixel.background.last().expect("the empty pixel at least").clone();
            let change_e = pixel.packet(&mut after, charge_e, 0).0;
            // Twice, since a change that turns from loss to gain is small once.
            quiet = if change_e.abs() <= merge_e.max(SETTLED_E) { quiet + 1 } else { 0 };
            if quiet == 2 {
                break;
            }
            charge_e += change_e;
            pixel.background.push(after);
        }
        pixel
    }

    /// Passes one packet over the levels; its change (e-), and what levels it met as one number.
    #[allow(clippy::needless_range_loop)] // species index several arrays at once
    pub fn packet(&self, levels: &mut Vec<Level<S>>, charge_e: f64, packet: usize) -> (f64, f64) {
        let height = self.cloud.height(charge_e);
        let inside = self.cut(levels, height, packet);
        let above = levels.get(inside).map_or(0.0, |level| (level.packet + 1) as f64);
        let met = above + 1e-7 * if inside > 1 { (levels[inside - 2].packet + 1) as f64 } else { 0.0 };
        // More than all the traps it covers cannot be captured.
        let share = if inside > 0 && charge_e < self.density_all * height {
            self.affordable(levels, inside, charge_e)
        } else {
            1.0
        };
        let mut change_e = 0.0;
        let mut floor = 0.0;
        for (index, level) in levels.iter_mut().enumerate() {
            let thickness = level.top - floor;
            floor = level.top;
            for s in 0..S {
                let before = level.fill[s];
                let after = if index < inside {
                    let after = self.full[s] + (before - self.full[s]) * self.approach[s];
                    before + share * (after - before)
                } else {
                    before * self.keep[s]
                };
                level.fill[s] = after;
                change_e += self.density[s] * thickness * (before - after);
            }
        }
        self.merge(levels);
        (change_e, met)
    }

    /// Makes `height` the top of a level; the number of levels up to there.
    fn cut(&self, levels: &mut Vec<Level<S>>, height: f64, packet: usize) -> usize {
        if height <= 0.0 {
            return 0;
        }
        let at = levels.iter().position(|level| level.top >= height).unwrap_or(levels.len());
        match levels.get(at) {
            Some(level) if level.top == height => {}
            Some(level) => {
                let fill = level.fill;
                levels.insert(at, Level { top: height, fill, packet });
            }
            None => levels.push(Level { top: height, fill: [0.0; S], packet }),
        }
        at + 1
    }

    /// Share of the capture inside the cloud that the packet, with what is released above it, can pay for.
    fn affordable(&self, levels: &[Level<S>], inside: usize, charge_e: f64) -> f64 {
        let (mut captured, mut released) = (0.0, 0.0);
        let mut floor = 0.0;
        for (index, level) in levels.iter().enumerate() {
            let thickness = level.top - floor;
            floor = level.top;
            for s in 0..S {
                let traps = self.density[s] * thickness;
                if index < inside {
                    captured += traps * (self.full[s] - level.fill[s]) * (1.0 - self.approach[s]);
                } else {
                    released += traps * level.fill[s] * (1.0 - self.keep[s]);
                }
            }
        }
        let available = (charge_e + released).max(0.0);
        if captured > available { available / captured } else { 1.0 }
    }

    /// Joins neighbours that are almost equally filled, without loss of charge.
    fn merge(&self, levels: &mut Vec<Level<S>>) {
        let mut kept = 0;
        let mut floor = 0.0;
        for next in 1..levels.len() {
            let (lower, upper) = (levels[kept], levels[next]);
            let (below, above) = (lower.top - floor, upper.top - lower.top);
            let apart: f64 = (0..S).map(|s| self.density[s] * (upper.fill[s] - lower.fill[s]).abs()).sum();
            if apart * below.min(above) < self.merge_e {
                let share = above / (above + below);
                let mut joined = upper;
                for s in 0..S {
                    joined.fill[s] = lower.fill[s] + share * (upper.fill[s] - lower.fill[s]);
                }
                levels[kept] = joined;
            } else {
                floor = lower.top;
                kept += 1;
                levels[kept] = upper;
            }
        }
        levels.truncate(kept + 1);
    }

    /// Levels of a pixel (counted from the register) as the background has left them before row 0 comes.
    pub fn start(&self, pixel: i64, downstream: Downstream, levels: &mut Vec<Level<S>>) {
        let passed = (downstream.rows - pixel).max(0) as usize;
        levels.clone_from(&self.background[passed.min(self.background.len() - 1)]);
    }
}

impl<const S: usize> Passage for SlowPixel<S> {
    type Levels = Vec<Level<S>>;

    fn pass(
        &self,
        charge_e: &[Row],
        _: Option<Path>,
        block: Block,
        downstream: Downstream,
        levels: &mut Vec<Level<S>>,
        found: &mut Stage,
    ) {
        let Stage { change_e, meets } = found;
        change_e.fill([0.0; LANES]);
        meets.fill([0.0; LANES]);
        let alike = Passage::alike_below(self, downstream);
        for lane in 0..LANES {
            // Lanes without a column of their own repeat the last one.
            if lane > 0 && charge_e.iter().all(|row| row[lane] == row[lane - 1]) {
                change_e.iter_mut().chain(meets.iter_mut()).for_each(|row| row[lane] = row[lane - 1]);
                continue;
            }
            let mut nearest = block.nearest;
            while nearest < block.nearest + block.pixels {
                // Pixels that all packets pass, and that the background has left alike, count as one.
                let pixels = (alike.min(block.nearest + block.pixels) - nearest).max(1);
                self.start(nearest, downstream, levels);
                let first = (nearest - downstream.rows).clamp(0, charge_e.len() as i64) as usize;
                for row in first..charge_e.len() {
                    let (change, met) = self.packet(levels, charge_e[row][lane], row + 1);
                    change_e[row][lane] += pixels as f64 * change;
                    meets[row][lane] += met;
                }
                nearest += pixels;
            }
        }
    }

    fn density(&self) -> f64 {
        self.density_all
    }

    fn cloud(&self) -> &Cloud {
        &self.cloud
    }

    fn alike_below(&self, downstream: Downstream) -> i64 {
        downstream.rows.min(downstream.rows - self.background.len() as i64 + 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn traps() -> Vec<Trap> {
        vec![
            Trap { capture_transfers: 0.3, ..Trap::new(0.8, 3.0) },
            Trap { capture_transfers: 2.0, ..Trap::new(0.5, 40.0) },
        ]
    }

    #[test]
    fn what_a_packet_loses_the_traps_hold() {
        let downstream = Downstream::NONE;
        let pixel = SlowPixel::<2>::new(&traps(), Cloud::new(1e4, 0.0, 0.5), downstream, 0.0);
        let mut levels = Vec::new();
        let held = |levels: &[Level<2>]| -> f64 {
            let mut floor = 0.0;
            let mut held = 0.0;
            for level in levels {
                held += (level.top - floor) * (0..2).map(|s| pixel.density[s] * level.fill[s]).sum::<f64>();
                floor = level.top;
            }
            held
        };
        let mut lost = 0.0;
        for charge_e in [500.0, 20.0, 900.0, 0.0, 3.0, 900.0, 1e-3] {
            let (change_e, _) = pixel.packet(&mut levels, charge_e, 1);
            lost -= change_e;
            assert!((held(&levels) - lost).abs() < 1e-12);
            assert!(charge_e + change_e >= -1e-15, "{charge_e} e- lost {change_e}");
        }
    }

    #[test]
    fn a_background_settles_in_the_balance_of_capture_and_release() {
        let downstream = Downstream { rows: 1000, charge_e: 100.0 };
        let pixel = SlowPixel::<2>::new(&traps(), Cloud::new(1e4, 0.0, 0.5), downstream, 1e-9);
        let packets = pixel.background.len();
        assert!(packets < 500, "{packets} packets until the background settles");
        let settled = pixel.background.last().unwrap();
        assert!((settled[0].fill[0] - 3.0 / 3.3).abs() < 1e-6);
        assert!((settled[0].fill[1] - 40.0 / 42.0).abs() < 1e-6);
        let mut levels = settled.clone();
        // The packets have paid for the traps they filled.
        let charge_e = 100.0 - 0.1 * (0.8 * 3.0 / 3.3 + 0.5 * 40.0 / 42.0);
        assert!(pixel.packet(&mut levels, charge_e, 1).0.abs() < 1e-3);
    }
}
