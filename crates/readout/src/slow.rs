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
//! packets that ever reached it, each with the fraction filled of every species; levels are merged where that costs less
//! charge than is asked for. Nor do packets upstream find the steady state after one packet of background:
//! [`SlowPixel::new`] follows the background, packet by packet, until it settles.
//!
//! Both laws are the same for all levels on one side of the cloud's top. So what a packet exchanges with the traps follows
//! from two sums, of the traps filled inside and above; and a level keeps the fraction that it had when it came to its
//! side, and since when, until a cloud ends on its other side. A packet costs as much as the levels between its own height
//! and the one before.

use std::mem::take;

use super::lanes::{LANES, Row};
use super::pixel::{Block, Lead, Passage, Stage};
use super::way::Way;
use super::{Cloud, Downstream, Trap};

/// The traps of one pixel, for `S` species (padded with species of no density).
pub(super) struct SlowPixel<const S: usize> {
    cloud: Cloud,
    density: [f64; S],
    density_all: f64,
    /// f∞, fraction filled in the end inside the cloud.
    full: [f64; S],
    /// exp(−m/τ), chance to stay filled above m clouds.
    keep: Vec<[f64; S]>,
    /// exp(−m/τc − m/τ), what is left inside m clouds of the distance from f∞.
    approach: Vec<[f64; S]>,
    /// Charge that may be misplaced in a pixel: by a merger of levels, or by a background that has not quite settled, e-.
    merge_e: f64,
    /// What the background has left in a pixel that it passed 0, 1, 2, … times; the last holds for more.
    background: Vec<Levels<S>>,
}

/// The traps of a pixel, cut where clouds have ended.
#[derive(Clone)]
pub(super) struct Levels<const S: usize> {
    /// Those inside the latest cloud, from the bottom up.
    inside: Vec<Level<S>>,
    /// Those above it, from the top down.
    above: Vec<Level<S>>,
    /// Sums of thickness times fraction filled.
    filled_inside: [f64; S],
    filled_above: [f64; S],
    /// Packets that came by.
    packets: usize,
}

/// Traps between the next level below and `top`.
#[derive(Clone, Copy)]
struct Level<const S: usize> {
    top: f64,
    /// Fractions filled after so many packets.
    fill: [f64; S],
    since: usize,
    /// Which packet's cloud ended at the top: its row plus one.
    packet: usize,
}

impl<const S: usize> Default for Levels<S> {
    fn default() -> Self {
        Levels { inside: Vec::new(), above: Vec::new(), filled_inside: [0.0; S], filled_above: [0.0; S], packets: 0 }
    }
}

/// Top of the uppermost of some levels.
fn top<const S: usize>(levels: &[Level<S>]) -> f64 {
    levels.last().map_or(0.0, |level| level.top)
}

/// Which packet's cloud ended at the top of a level, as a number.
fn mark<const S: usize>(level: Option<&Level<S>>) -> f64 {
    level.map_or(0.0, |level| (level.packet + 1) as f64)
}

/// Change of a packet of background in one pixel, e-, below which the background counts as settled in any case.
const SETTLED_E: f64 = 1e-13;

impl<const S: usize> SlowPixel<S> {
    /// Follows the background (e-) of the rows downstream of an image of `rows` until one more packet of it changes nothing.
    pub fn new(traps: &[Trap], cloud: Cloud, downstream: Downstream, rows: usize, merge_e: f64) -> SlowPixel<S> {
        let mut pixel = SlowPixel {
            cloud,
            density: [0.0; S],
            density_all: traps.iter().map(|trap| trap.density_per_px).sum(),
            full: [0.0; S],
            keep: vec![[1.0; S], [0.0; S]],
            approach: vec![[1.0; S], [0.0; S]],
            merge_e,
            background: vec![Levels::default()],
        };
        for (s, trap) in traps.iter().enumerate() {
            pixel.density[s] = trap.density_per_px;
            (pixel.keep[1][s], pixel.full[s], pixel.approach[1][s]) = trap.passage();
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
            pixel.settle(&mut after);
            pixel.background.push(after);
        }
        for packets in 2..=rows {
            for powers in [&mut pixel.keep, &mut pixel.approach] {
                powers.push(std::array::from_fn(|s| powers[packets - 1][s] * powers[1][s]));
            }
        }
        pixel
    }

    /// Passes one packet over the levels; its change (e-), and what levels it met as one number.
    pub fn packet(&self, levels: &mut Levels<S>, charge_e: f64, packet: usize) -> (f64, f64) {
        self.packet_of(levels, charge_e, self.cloud.height(charge_e), packet)
    }

    /// The same for a packet whose height is known.
    fn packet_of(&self, levels: &mut Levels<S>, charge_e: f64, height: f64, packet: usize) -> (f64, f64) {
        self.reach(levels, height, packet);
        let below = levels.inside.iter().rev().nth(1);
        let met = mark(levels.above.last()) + 1e-7 * mark(below);
        (self.exchange(levels, charge_e, height), met)
    }

    /// Capture inside and release everywhere for one transfer; the packet's change, e-.
    fn exchange(&self, levels: &mut Levels<S>, charge_e: f64, height: f64) -> f64 {
        let (mut captured, mut released) = ([0.0; S], [0.0; S]);
        let (mut captured_e, mut released_e) = (0.0, 0.0);
        for s in 0..S {
            captured[s] = (height * self.full[s] - levels.filled_inside[s]) * (1.0 - self.approach[1][s]);
            released[s] = levels.filled_above[s] * (1.0 - self.keep[1][s]);
            captured_e += self.density[s] * captured[s];
            released_e += self.density[s] * released[s];
        }
        // More than there is cannot be captured.
        let available_e = (charge_e + released_e).max(0.0);
        let short = charge_e < self.density_all * height && captured_e > available_e;
        let share = if short { available_e / captured_e } else { 1.0 };
        if short {
            for level in &mut levels.inside {
                let before = self.filled_inside(level, levels.packets);
                let after = self.filled_inside(level, levels.packets + 1);
                level.fill = std::array::from_fn(|s| before[s] + share * (after[s] - before[s]));
                level.since = levels.packets + 1;
            }
        }
        for s in 0..S {
            levels.filled_inside[s] += share * captured[s];
            levels.filled_above[s] -= released[s];
        }
        levels.packets += 1;
        released_e - share * captured_e
    }

    /// Fractions of a level inside the cloud after so many packets.
    fn filled_inside(&self, level: &Level<S>, packets: usize) -> [f64; S] {
        let approach = &self.approach[packets - level.since];
        std::array::from_fn(|s| self.full[s] + (level.fill[s] - self.full[s]) * approach[s])
    }

    /// Fractions of a level above the cloud after so many packets.
    fn filled_above(&self, level: &Level<S>, packets: usize) -> [f64; S] {
        let keep = &self.keep[packets - level.since];
        std::array::from_fn(|s| level.fill[s] * keep[s])
    }

    /// Makes `height` the top of the uppermost level inside.
    fn reach(&self, levels: &mut Levels<S>, height: f64, packet: usize) {
        let since = levels.packets;
        // Down: what lies above the height leaves the cloud.
        while let Some(level) = levels.inside.last().copied()
            && level.top > height
        {
            levels.inside.pop();
            let fill = self.filled_inside(&level, since);
            let floor = top(&levels.inside);
            if floor < height {
                levels.inside.push(Level { top: height, packet, ..level });
            }
            let thickness = level.top - floor.max(height);
            for (s, fill) in fill.iter().enumerate() {
                levels.filled_inside[s] -= thickness * fill;
                levels.filled_above[s] += thickness * fill;
            }
            self.put_above(levels, Level { fill, since, ..level }, floor.max(height));
        }
        // Up: what lies below it is covered.
        while top(&levels.inside) < height {
            let floor = top(&levels.inside);
            let covered = match levels.above.pop() {
                Some(level) => {
                    let fill = self.filled_above(&level, since);
                    if level.top > height {
                        levels.above.push(level);
                        Level { top: height, fill, since, packet }
                    } else {
                        Level { fill, since, ..level }
                    }
                }
                None => Level { top: height, fill: [0.0; S], since, packet },
            };
            let thickness = covered.top - floor;
            for (s, fill) in covered.fill.iter().enumerate() {
                levels.filled_above[s] -= thickness * fill;
                levels.filled_inside[s] += thickness * fill;
            }
            self.put_inside(levels, covered);
        }
    }

    /// Adds a level on top of those inside; one that is filled almost as its neighbour joins it, without loss of charge.
    fn put_inside(&self, levels: &mut Levels<S>, upper: Level<S>) {
        if let Some(lower) = levels.inside.pop() {
            let fill = self.filled_inside(&lower, upper.since);
            let (below, above) = (lower.top - top(&levels.inside), upper.top - lower.top);
            if self.alike(&fill, &upper.fill, below.min(above)) {
                levels.inside.push(Level { fill: joined(&fill, below, &upper.fill, above), ..upper });
                return;
            }
            levels.inside.push(lower);
        }
        levels.inside.push(upper);
    }

    /// Adds a level, which starts at `floor`, below those above; as [`SlowPixel::put_inside`].
    fn put_above(&self, levels: &mut Levels<S>, lower: Level<S>, floor: f64) {
        if let Some(upper) = levels.above.last_mut() {
            let fill = self.filled_above(upper, lower.since);
            let (below, above) = (lower.top - floor, upper.top - lower.top);
            if self.alike(&fill, &lower.fill, below.min(above)) {
                *upper = Level { fill: joined(&lower.fill, below, &fill, above), since: lower.since, ..*upper };
                return;
            }
        }
        levels.above.push(lower);
    }

    /// Whether two neighbours, the thinner one so thick, may be taken for one.
    fn alike(&self, one: &[f64; S], other: &[f64; S], thickness: f64) -> bool {
        let apart: f64 = (0..S).map(|s| self.density[s] * (one[s] - other[s]).abs()).sum();
        apart * thickness < self.merge_e
    }

    /// Counts packets from now on.
    fn settle(&self, levels: &mut Levels<S>) {
        let packets = take(&mut levels.packets);
        for level in &mut levels.inside {
            *level = Level { fill: self.filled_inside(level, packets), since: 0, ..*level };
        }
        for level in &mut levels.above {
            *level = Level { fill: self.filled_above(level, packets), since: 0, ..*level };
        }
    }

    /// Levels of a pixel (counted from the register) as the background has left them before row 0 comes.
    pub fn start(&self, pixel: i64, rows_downstream: i64, levels: &mut Levels<S>) {
        let passed = (rows_downstream - pixel).max(0) as usize;
        let left = &self.background[passed.min(self.background.len() - 1)];
        levels.inside.clone_from(&left.inside);
        levels.above.clone_from(&left.above);
        *levels = Levels { inside: take(&mut levels.inside), above: take(&mut levels.above), ..*left };
    }
}

/// Fractions filled of two levels together, by their thicknesses.
fn joined<const S: usize>(lower: &[f64; S], below: f64, upper: &[f64; S], above: f64) -> [f64; S] {
    let share = above / (above + below);
    std::array::from_fn(|s| lower[s] + share * (upper[s] - lower[s]))
}

impl<const S: usize> Passage for SlowPixel<S> {
    type Levels = Levels<S>;

    fn pass(
        &self,
        charge_e: &[Row],
        _: Way,
        block: Block,
        downstream: &Lead,
        levels: &mut Levels<S>,
        found: &mut Stage,
    ) {
        let Stage { change_e, drift_e, doubtful_e, meets } = found;
        change_e.fill([0.0; LANES]);
        meets.fill([0.0; LANES]);
        let alike = Passage::alike_below(self, downstream);
        // Kept in the place of what is told last.
        let heights = drift_e;
        heights.copy_from_slice(charge_e);
        self.cloud.heights_in_place(heights);
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
                self.start(nearest, downstream.rows, levels);
                let first = (nearest - downstream.rows).clamp(0, charge_e.len() as i64) as usize;
                for row in first..charge_e.len() {
                    let (change, met) = self.packet_of(levels, charge_e[row][lane], heights[row][lane], row + 1);
                    change_e[row][lane] += pixels as f64 * change;
                    meets[row][lane] += met;
                }
                nearest += pixels;
            }
        }
        heights.copy_from_slice(change_e);
        doubtful_e.fill([0.0; LANES]);
    }

    fn density(&self) -> f64 {
        self.density_all
    }

    fn cloud(&self) -> &Cloud {
        &self.cloud
    }

    fn alike_below(&self, downstream: &Lead) -> i64 {
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

    /// The same levels kept from the bottom up, each of which is brought up to date by every packet.
    fn one_by_one(pixel: &SlowPixel<2>, levels: &mut Vec<(f64, [f64; 2])>, charge_e: f64) -> (f64, bool) {
        let height = pixel.cloud.height(charge_e);
        let at = levels.iter().position(|(top, _)| *top >= height).unwrap_or(levels.len());
        let fill = levels.get(at).map_or([0.0; 2], |(_, fill)| *fill);
        levels.insert(at, (height, fill));
        let exchange = |share: f64, levels: &mut Vec<(f64, [f64; 2])>| {
            let (mut captured_e, mut released_e, mut floor) = (0.0, 0.0, 0.0);
            for (index, (top, fill)) in levels.iter_mut().enumerate() {
                for (s, fill) in fill.iter_mut().enumerate() {
                    let traps = pixel.density[s] * (*top - floor);
                    let before = *fill;
                    if index <= at {
                        *fill += share * (pixel.full[s] - before) * (1.0 - pixel.approach[1][s]);
                        captured_e += traps * (*fill - before);
                    } else {
                        *fill *= pixel.keep[1][s];
                        released_e += traps * (before - *fill);
                    }
                }
                floor = *top;
            }
            (captured_e, released_e)
        };
        let (captured_e, released_e) = exchange(1.0, &mut levels.clone());
        let share = if captured_e > charge_e + released_e { (charge_e + released_e) / captured_e } else { 1.0 };
        exchange(share, levels);
        (released_e - share * captured_e, share < 1.0)
    }

    #[test]
    fn levels_on_either_side_of_a_cloud_are_as_if_each_were_followed() {
        // Rising and tiny, then of all sizes.
        let packets: Vec<f64> = (0..300_u32)
            .map(|row| if row < 40 { 1e-6 * f64::from(row) } else { f64::from(row * row * 37 % 1001) })
            .collect();
        let pixel = SlowPixel::<2>::new(&traps(), Cloud::new(1e4, 0.0, 0.5), Downstream::NONE, packets.len(), 0.0);
        let (mut levels, mut followed) = (Levels::default(), Vec::new());
        let mut short = 0;
        for charge_e in packets {
            let (expected_e, spent) = one_by_one(&pixel, &mut followed, charge_e);
            let (change_e, _) = pixel.packet(&mut levels, charge_e, 1);
            assert!((change_e - expected_e).abs() < 1e-12, "{charge_e} e-: {change_e}, {expected_e}");
            short += usize::from(spent);
        }
        assert!(short > 0, "some packet has less than its traps would take");
    }

    #[test]
    fn what_a_packet_loses_the_traps_hold() {
        let downstream = Downstream::NONE;
        let pixel = SlowPixel::<2>::new(&traps(), Cloud::new(1e4, 0.0, 0.5), downstream, 7, 0.0);
        let mut levels = Levels::default();
        let held = |levels: &Levels<2>| -> f64 {
            let mut levels = levels.clone();
            pixel.settle(&mut levels);
            let mut floor = 0.0;
            let mut held = 0.0;
            for level in levels.inside.iter().chain(levels.above.iter().rev()) {
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
        let pixel = SlowPixel::<2>::new(&traps(), Cloud::new(1e4, 0.0, 0.5), downstream, 1, 1e-9);
        let packets = pixel.background.len();
        assert!(packets < 500, "{packets} packets until the background settles");
        let settled = pixel.background.last().unwrap();
        assert!((settled.inside[0].fill[0] - 3.0 / 3.3).abs() < 1e-6);
        assert!((settled.inside[0].fill[1] - 40.0 / 42.0).abs() < 1e-6);
        let mut levels = settled.clone();
        // The packets have paid for the traps they filled.
        let charge_e = 100.0 - 0.1 * (0.8 * 3.0 / 3.3 + 0.5 * 40.0 / 42.0);
        assert!(pixel.packet(&mut levels, charge_e, 1).0.abs() < 1e-3);
    }
}
