//! Effect of the traps of a pixel on the packets that pass it, for finite capture times.
//!
//! Inside the cloud, whose height is that of the charge on arrival, capture and release act together for one transfer; above it
//! there is only release:
//!
//! ```text
//! inside   df/dt = (1 − f)/τc − f/τ      f ← f∞ + (f − f∞) exp(−1/τc − 1/τ),   f∞ = τ/(τ + τc)
//! above    df/dt = −f/τ                  f ← f exp(−1/τ)
//! ```
//!
//! Massey et al. 2014 (MNRAS 439, 887), appendix A. If τc depends on the density of the packet's cloud, f∞ and both factors inside
//! differ from packet to packet. All fractions inside then converge: with P_k, the fraction after k packets if empty
//! before the first, and E_k, the sum of the exponents of all packets,
//!
//! ```text
//! P ← f∞(n) + (P − f∞(n)) exp(−1/τc(n) − 1/τ)      f_k = P_k + (f_m − P_m) exp(−(E_k − E_m))
//! ```
//!
//! A packet no longer fills what it covers, so the watermarks of all earlier packets are kept, each with the fraction filled of
//! every species; they are merged if that misplaces less charge than allowed. Nor do packets upstream find the steady state after
//! one packet of background: [`FiniteCapturePixel::new`] follows the background, packet by packet, until it settles. Pixels left
//! nearly equal by it are passed together: the charge that packets exchange with traps is linear in the fractions filled, so a
//! stretch of N pixels acts as N pixels with their mean, until the packets have changed. The same holds for the pixels that packets
//! start in, as a sum that grows by an empty pixel with each packet, if no packet is spent.
//!
//! Both laws are the same for all watermarks on one side of the cloud's top. So the charge that a packet exchanges with the traps
//! follows from two sums, of the traps filled inside and above. A watermark keeps the fraction at which it came to its side, and
//! the time since then, until a cloud ends on its other side. The cost of a packet is proportional to the number of watermarks
//! between its own height and the previous one.

use std::f64::consts::LOG2_E;
use std::mem::take;
use std::ops::Range;
use std::slice;

use fearless_simd::{Level, dispatch};

use super::block_path::BlockPath;
use super::passage::{Block, Lead, Passage, Stage};
use super::power::{exp2, power};
use super::simd::{LANES, Packets};
use super::{Cloud, Downstream, Phase, Trap};

/// The traps of one pixel, for `S` species (padded with species of no density).
pub(super) struct FiniteCapturePixel<const S: usize> {
    cloud: Cloud,
    density: [f64; S],
    density_all: f64,
    /// f∞, equilibrium fraction filled inside the cloud.
    full: [f64; S],
    /// exp(−m/τ), probability of staying filled above m clouds.
    keep: Vec<[f64; S]>,
    /// exp(−m/τc − m/τ), the factor by which the distance from f∞ decreases inside m clouds.
    approach: Vec<[f64; S]>,
    /// Set if the capture time of some species depends on the density of the cloud; `full` and `approach` are not valid then.
    by_density: Option<ByDensity<S>>,
    /// Charge that may be misplaced in a pixel, by a merger of watermarks or by a background that has not quite settled, e-.
    merge_e: f64,
    /// State of the traps by the number of background packets that have passed the pixel; the last holds for more.
    background: Vec<Stretch<S>>,
}

/// Pixels that the background has left nearly equal.
struct Stretch<const S: usize> {
    /// Number of background packets that passed the first of them. Each further pixel was passed by one more.
    from: usize,
    /// Their mean.
    mean: Watermarks<S>,
}

/// The traps of a pixel, divided at the heights where clouds have ended.
#[derive(Clone)]
pub(super) struct Watermarks<const S: usize> {
    /// Those inside the latest cloud, from the bottom up.
    inside: Vec<Watermark<S>>,
    /// Those above it, from the top down.
    above: Vec<Watermark<S>>,
    /// Sums of thickness times fraction filled.
    filled_inside: [f64; S],
    filled_above: [f64; S],
    /// Packets that have passed.
    packets: usize,
    /// Number of pixels summed here.
    pixels: f64,
    /// Effect of 0, 1, 2, … packets inside their clouds, as far as known, if it depends on the clouds' density or the number of
    /// pixels grows; otherwise empty.
    history: Vec<Course<S>>,
}

/// Effect of packets on traps that were inside the cloud of each of them.
#[derive(Clone, Copy)]
struct Course<const S: usize> {
    /// P, fractions filled of those that were empty before the first packet, summed over all pixels.
    filled: [f64; S],
    /// E, the sum of 1/τc + 1/τ, in powers of 2.
    exponent: [f64; S],
    /// f∞ and exp(−1/τc − 1/τ) of the last of them.
    full: [f64; S],
    approach: [f64; S],
}

impl<const S: usize> Course<S> {
    const START: Course<S> = Course { filled: [0.0; S], exponent: [0.0; S], full: [0.0; S], approach: [1.0; S] };
}

/// Traps between the next watermark below and `top`.
#[derive(Clone, Copy)]
struct Watermark<const S: usize> {
    top: f64,
    /// Fractions filled after `since` packets, by species.
    fill: [f64; S],
    since: usize,
    /// The packet whose cloud ended at the top: its row plus one.
    packet: usize,
}

impl<const S: usize> Watermarks<S> {
    /// From the bottom up.
    fn upwards(&self) -> impl Iterator<Item = &Watermark<S>> {
        self.inside.iter().chain(self.above.iter().rev())
    }
}

impl<const S: usize> Default for Watermarks<S> {
    fn default() -> Self {
        Watermarks {
            inside: Vec::new(),
            above: Vec::new(),
            filled_inside: [0.0; S],
            filled_above: [0.0; S],
            packets: 0,
            pixels: 1.0,
            history: Vec::new(),
        }
    }
}

/// Species whose capture time depends on the density of the cloud.
struct ByDensity<const S: usize> {
    traps: Vec<Trap>,
    /// 1/τc at the density of the reference, and 1/τ, in powers of 2; if all species share a law and the clock has one phase.
    capture: [f64; S],
    release: [f64; S],
    /// That density, and its exponent.
    shared: Option<(f64, f64)>,
}

/// Exponent at which nothing is left: 2^−1000 of a trap. A sum of larger ones would lose the smaller.
const NOTHING_LEFT: f64 = 1000.0;

impl<const S: usize> ByDensity<S> {
    fn new(traps: &[Trap], cloud: &Cloud) -> ByDensity<S> {
        let first = traps[0].capture_density;
        let alike =
            |trap: &Trap| trap.capture_density == first && trap.phase == Phase::SINGLE && trap.capture_transfers > 0.0;
        let shared = first.filter(|_| traps.iter().all(alike)).map(|law| (cloud.density_e(law.at_e), law.power));
        // Species of no density need some value.
        let rate = |time: fn(&Trap) -> f64| std::array::from_fn(|s| LOG2_E / traps.get(s).map_or(1.0, time));
        let (capture, release) = (rate(|trap| trap.capture_transfers), rate(|trap| trap.release_transfers));
        ByDensity { traps: traps.to_vec(), capture, release, shared }
    }

    /// f∞ and the factor of a packet; returns 1/τc + 1/τ in powers of 2.
    #[inline(always)]
    fn inside(&self, cloud: &Cloud, charge_e: f64, course: &mut Course<S>) -> [f64; S] {
        let mut exponent = [0.0; S];
        let Some((reference, of_density)) = self.shared else {
            for (s, trap) in self.traps.iter().enumerate() {
                (_, course.full[s], course.approach[s]) = trap.passage_of(cloud, charge_e);
                exponent[s] = -course.approach[s].log2().max(-NOTHING_LEFT);
            }
            return exponent;
        };
        let ratio = cloud.density_e(charge_e) / reference;
        let strength = if ratio > 0.0 { power(ratio, of_density) } else { 0.0 };
        let rate: [f64; S] = std::array::from_fn(|s| self.capture[s] * strength);
        exponent = std::array::from_fn(|s| (rate[s] + self.release[s]).min(NOTHING_LEFT));
        course.full = std::array::from_fn(|s| rate[s] / (rate[s] + self.release[s]));
        course.approach = exponent.map(|exponent| exp2(-exponent));
        exponent
    }
}

/// Top of the uppermost of some watermarks.
fn top<const S: usize>(watermarks: &[Watermark<S>]) -> f64 {
    watermarks.last().map_or(0.0, |watermark| watermark.top)
}

/// The packet whose cloud ended at the top of a watermark, as a number.
fn mark<const S: usize>(watermark: Option<&Watermark<S>>) -> f64 {
    watermark.map_or(0.0, |watermark| (watermark.packet + 1) as f64)
}

/// Change of a packet of background in one pixel, e-, below which the background always counts as settled.
const SETTLED_E: f64 = 1e-13;

/// N pixels whose states change by d from first to last act on packets as N pixels of their mean, except for N³/12 times the
/// commutator of a change by d/N and a change of the packets (the second term of the Magnus expansion).
const MAGNUS: f64 = 1.0 / 12.0;

impl<const S: usize> FiniteCapturePixel<S> {
    /// Follows the background (e-) of the rows downstream of an image of `rows` until one more packet of it changes nothing.
    pub fn new(
        traps: &[Trap],
        cloud: Cloud,
        downstream: Downstream,
        rows: usize,
        merge_e: f64,
    ) -> FiniteCapturePixel<S> {
        let mut pixel = FiniteCapturePixel {
            cloud,
            density: [0.0; S],
            density_all: traps.iter().map(|trap| trap.density_per_px).sum(),
            full: [0.0; S],
            keep: vec![[1.0; S], [0.0; S]],
            approach: vec![[1.0; S], [0.0; S]],
            by_density: None,
            merge_e,
            background: Vec::new(),
        };
        let by_density = traps.iter().any(|trap| trap.capture_density.is_some());
        pixel.by_density = by_density.then(|| ByDensity::new(traps, &pixel.cloud));
        for (s, trap) in traps.iter().enumerate() {
            pixel.density[s] = trap.density_per_px;
            (pixel.keep[1][s], pixel.full[s], pixel.approach[1][s]) = trap.passage();
        }
        pixel.follow(downstream);
        for packets in 2..=rows {
            for powers in [&mut pixel.keep, &mut pixel.approach] {
                powers.push(std::array::from_fn(|s| powers[packets - 1][s] * powers[1][s]));
            }
        }
        pixel
    }

    /// Passes the background until one more packet of it changes nothing, and stores the states that it leaves.
    fn follow(&mut self, downstream: Downstream) {
        let mut latest = Watermarks::default();
        self.settle(&mut latest);
        self.background.push(Stretch { from: 0, mean: latest.clone() });
        let mut charge_e = downstream.charge_e;
        let steepest = self.density_all * self.cloud.steepest_from(charge_e);
        // Pixels of the open stretch, the number of packets that passed the first of them, and the charge that they differ by.
        let (mut open, mut from, mut differ_e) = (Vec::new(), 1, 0.0);
        let mut quiet = 0;
        for packets in 1..=downstream.rows {
            let change_e = self.packet(&mut latest, charge_e, 0).0;
            // Two in a row, since a change that turns from loss to gain is small once.
            quiet = if change_e.abs() <= self.merge_e.max(SETTLED_E) { quiet + 1 } else { 0 };
            if quiet == 2 {
                break;
            }
            charge_e += change_e;
            self.settle(&mut latest);
            differ_e += change_e.abs();
            // A merger may misplace as much in every pixel.
            if MAGNUS * (open.len() + 1) as f64 * steepest * differ_e > self.merge_e {
                self.close(from, &mut open);
            }
            if open.is_empty() {
                (from, differ_e) = (packets as usize, 0.0);
            }
            open.push(latest.clone());
        }
        // The last pixel represents all that follow.
        let Some(last) = open.pop() else { return };
        let before = open.len();
        self.close(from, &mut open);
        self.background.push(Stretch { from: from + before, mean: last });
    }

    /// Adds a stretch of pixels, the first of which was passed by `from` packets of background.
    fn close(&mut self, from: usize, pixels: &mut Vec<Watermarks<S>>) {
        if !pixels.is_empty() {
            self.background.push(Stretch { from, mean: self.mean(pixels) });
            pixels.clear();
        }
    }

    /// The mean of some pixels that contain no packet.
    fn mean(&self, pixels: &[Watermarks<S>]) -> Watermarks<S> {
        if let [pixel] = pixels {
            return pixel.clone();
        }
        let mut tops: Vec<f64> = pixels.iter().flat_map(Watermarks::upwards).map(|watermark| watermark.top).collect();
        tops.sort_by(f64::total_cmp);
        tops.dedup();
        let mut fills = vec![[0.0; S]; tops.len()];
        for pixel in pixels {
            let mut watermarks = pixel.upwards().peekable();
            for (top, fill) in tops.iter().zip(&mut fills) {
                while watermarks.next_if(|watermark| watermark.top < *top).is_some() {}
                let here = watermarks.peek().map_or([0.0; S], |watermark| watermark.fill);
                fill.iter_mut().zip(here).for_each(|(sum, fill)| *sum += fill / pixels.len() as f64);
            }
        }
        let mut mean = Watermarks::default();
        self.forget(&mut mean);
        for (top, fill) in tops.into_iter().zip(fills) {
            let thickness = top - self::top(&mean.inside);
            mean.filled_inside.iter_mut().zip(fill).for_each(|(sum, fill)| *sum += thickness * fill);
            self.put_inside(&mut mean, Watermark { top, fill, since: 0, packet: 0 });
        }
        mean
    }

    /// The index of the stretch that holds a pixel (counted from the register).
    fn stretch(&self, pixel: i64, rows_downstream: i64) -> usize {
        let passed = (rows_downstream - pixel).max(0) as usize;
        self.background.partition_point(|stretch| stretch.from <= passed) - 1
    }

    /// Passes one packet over the watermarks; returns its change (e-) and the watermarks it met as one number.
    pub fn packet(&self, watermarks: &mut Watermarks<S>, charge_e: f64, packet: usize) -> (f64, f64) {
        self.packet_of(watermarks, charge_e, self.cloud.height(charge_e), packet)
    }

    /// The same for a packet whose height is known.
    fn packet_of(&self, watermarks: &mut Watermarks<S>, charge_e: f64, height: f64, packet: usize) -> (f64, f64) {
        self.reach(watermarks, height, packet);
        let below = watermarks.inside.iter().rev().nth(1);
        let met = mark(watermarks.above.last()) + 1e-7 * mark(below);
        (self.exchange(watermarks, charge_e, height), met)
    }

    /// f∞ and exp(−1/τc − 1/τ) of the next packet's cloud.
    fn inside(&self, watermarks: &mut Watermarks<S>, charge_e: f64) -> ([f64; S], [f64; S]) {
        if watermarks.history.is_empty() {
            return (self.full, self.approach[1]);
        }
        if watermarks.history.len() == watermarks.packets + 1 {
            self.extend_history(watermarks, charge_e);
        }
        let course = &watermarks.history[watermarks.packets + 1];
        (course.full, course.approach)
    }

    /// Adds one packet to the history.
    #[inline(always)]
    fn extend_history(&self, watermarks: &mut Watermarks<S>, charge_e: f64) {
        let mut course = *watermarks.history.last().expect("a history starts before the first packet");
        if let Some(law) = &self.by_density {
            let exponent = law.inside(&self.cloud, charge_e, &mut course);
            course.exponent.iter_mut().zip(exponent).for_each(|(sum, exponent)| *sum += exponent);
        } else {
            (course.full, course.approach) = (self.full, self.approach[1]);
        }
        let Course { filled, full, approach, .. } = course;
        let pixels = watermarks.pixels;
        course.filled = std::array::from_fn(|s| pixels * full[s] + (filled[s] - pixels * full[s]) * approach[s]);
        watermarks.history.push(course);
    }

    /// Capture inside and release everywhere for one transfer; returns the packet's change, e-.
    fn exchange(&self, watermarks: &mut Watermarks<S>, charge_e: f64, height: f64) -> f64 {
        let (full, approach) = self.inside(watermarks, charge_e);
        let (mut captured, mut released) = ([0.0; S], [0.0; S]);
        let (mut captured_e, mut released_e) = (0.0, 0.0);
        for s in 0..S {
            captured[s] = (watermarks.pixels * height * full[s] - watermarks.filled_inside[s]) * (1.0 - approach[s]);
            released[s] = watermarks.filled_above[s] * (1.0 - self.keep[1][s]);
            captured_e += self.density[s] * captured[s];
            released_e += self.density[s] * released[s];
        }
        // No more charge can be captured than there is.
        let available_e = (charge_e + released_e).max(0.0);
        let short = charge_e < self.density_all * height && captured_e > available_e;
        let share = if short { available_e / captured_e } else { 1.0 };
        if short {
            let Watermarks { inside, packets, history, .. } = watermarks;
            for watermark in inside {
                let before = self.filled_inside(history, watermark, *packets);
                let after = self.filled_inside(history, watermark, *packets + 1);
                watermark.fill = std::array::from_fn(|s| before[s] + share * (after[s] - before[s]));
                watermark.since = *packets + 1;
            }
        }
        for s in 0..S {
            watermarks.filled_inside[s] += share * captured[s];
            watermarks.filled_above[s] -= released[s];
        }
        watermarks.packets += 1;
        released_e - share * captured_e
    }

    /// Fractions of a watermark inside the cloud after n packets.
    fn filled_inside(&self, history: &[Course<S>], watermark: &Watermark<S>, packets: usize) -> [f64; S] {
        if !history.is_empty() {
            if packets == watermark.since {
                return watermark.fill;
            }
            let (from, to) = (&history[watermark.since], &history[packets]);
            return std::array::from_fn(|s| {
                let left = match self.by_density {
                    Some(_) => exp2(from.exponent[s] - to.exponent[s]),
                    None => self.approach[packets - watermark.since][s],
                };
                to.filled[s] + (watermark.fill[s] - from.filled[s]) * left
            });
        }
        let approach = &self.approach[packets - watermark.since];
        std::array::from_fn(|s| self.full[s] + (watermark.fill[s] - self.full[s]) * approach[s])
    }

    /// Fractions of a watermark above the cloud after n packets.
    fn filled_above(&self, watermark: &Watermark<S>, packets: usize) -> [f64; S] {
        let keep = &self.keep[packets - watermark.since];
        std::array::from_fn(|s| watermark.fill[s] * keep[s])
    }

    /// Makes `height` the top of the uppermost watermark inside.
    fn reach(&self, watermarks: &mut Watermarks<S>, height: f64, packet: usize) {
        let since = watermarks.packets;
        // Down: watermarks above the height leave the cloud.
        while let Some(watermark) = watermarks.inside.last().copied()
            && watermark.top > height
        {
            watermarks.inside.pop();
            let fill = self.filled_inside(&watermarks.history, &watermark, since);
            let floor = top(&watermarks.inside);
            if floor < height {
                watermarks.inside.push(Watermark { top: height, packet, ..watermark });
            }
            let thickness = watermark.top - floor.max(height);
            for (s, fill) in fill.iter().enumerate() {
                watermarks.filled_inside[s] -= thickness * fill;
                watermarks.filled_above[s] += thickness * fill;
            }
            self.put_above(watermarks, Watermark { fill, since, ..watermark }, floor.max(height));
        }
        // Up: watermarks below the height are covered.
        while top(&watermarks.inside) < height {
            let floor = top(&watermarks.inside);
            let covered = match watermarks.above.pop() {
                Some(watermark) => {
                    let fill = self.filled_above(&watermark, since);
                    if watermark.top > height {
                        watermarks.above.push(watermark);
                        Watermark { top: height, fill, since, packet }
                    } else {
                        Watermark { fill, since, ..watermark }
                    }
                }
                None => Watermark { top: height, fill: [0.0; S], since, packet },
            };
            let thickness = covered.top - floor;
            for (s, fill) in covered.fill.iter().enumerate() {
                watermarks.filled_above[s] -= thickness * fill;
                watermarks.filled_inside[s] += thickness * fill;
            }
            self.put_inside(watermarks, covered);
        }
    }

    /// Adds a watermark on top of those inside. If it is filled almost as its neighbour, both are merged, without loss of charge.
    fn put_inside(&self, watermarks: &mut Watermarks<S>, upper: Watermark<S>) {
        if let Some(lower) = watermarks.inside.pop() {
            let fill = self.filled_inside(&watermarks.history, &lower, upper.since);
            let (below, above) = (lower.top - top(&watermarks.inside), upper.top - lower.top);
            if self.alike(&fill, &upper.fill, below.min(above)) {
                watermarks.inside.push(Watermark { fill: joined(&fill, below, &upper.fill, above), ..upper });
                return;
            }
            watermarks.inside.push(lower);
        }
        watermarks.inside.push(upper);
    }

    /// Adds a watermark, which starts at `floor`, below those above; like [`FiniteCapturePixel::put_inside`].
    fn put_above(&self, watermarks: &mut Watermarks<S>, lower: Watermark<S>, floor: f64) {
        if let Some(upper) = watermarks.above.last_mut() {
            let fill = self.filled_above(upper, lower.since);
            let (below, above) = (lower.top - floor, upper.top - lower.top);
            if self.alike(&fill, &lower.fill, below.min(above)) {
                *upper = Watermark { fill: joined(&lower.fill, below, &fill, above), since: lower.since, ..*upper };
                return;
            }
        }
        watermarks.above.push(lower);
    }

    /// Whether two neighbours may be merged; `thickness` is that of the thinner one.
    fn alike(&self, one: &[f64; S], other: &[f64; S], thickness: f64) -> bool {
        let apart: f64 = (0..S).map(|s| self.density[s] * (one[s] - other[s]).abs()).sum();
        apart * thickness < self.merge_e
    }

    /// Restarts the count of packets.
    fn settle(&self, watermarks: &mut Watermarks<S>) {
        let packets = take(&mut watermarks.packets);
        for watermark in &mut watermarks.inside {
            let fill = self.filled_inside(&watermarks.history, watermark, packets);
            *watermark = Watermark { fill, since: 0, ..*watermark };
        }
        self.forget(watermarks);
        for watermark in &mut watermarks.above {
            *watermark = Watermark { fill: self.filled_above(watermark, packets), since: 0, ..*watermark };
        }
    }

    /// Restarts the history, without packets.
    fn forget(&self, watermarks: &mut Watermarks<S>) {
        watermarks.history.clear();
        watermarks.history.extend(self.by_density.is_some().then_some(Course::START));
    }

    /// Watermarks of a pixel (counted from the register) as the background has left them before row 0 arrives.
    pub fn start(&self, pixel: i64, rows_downstream: i64, watermarks: &mut Watermarks<S>) {
        self.forget(watermarks);
        self.place(pixel, rows_downstream, watermarks);
    }

    /// The same for packets whose history is known.
    fn place(&self, pixel: i64, rows_downstream: i64, watermarks: &mut Watermarks<S>) {
        let left = &self.background[self.stretch(pixel, rows_downstream)].mean;
        watermarks.inside.clone_from(&left.inside);
        watermarks.above.clone_from(&left.above);
        let Watermarks { inside, above, history, .. } = take(watermarks);
        *watermarks = Watermarks { inside, above, history, ..*left };
    }
}

/// Fractions filled of two merged watermarks, weighted by their thicknesses.
fn joined<const S: usize>(lower: &[f64; S], below: f64, upper: &[f64; S], above: f64) -> [f64; S] {
    let share = above / (above + below);
    std::array::from_fn(|s| lower[s] + share * (upper[s] - lower[s]))
}

impl<const S: usize> Passage for FiniteCapturePixel<S> {
    type Watermarks = Watermarks<S>;

    fn pass(
        &self,
        charge_e: &[Packets],
        _: BlockPath,
        block: Block,
        downstream: &Lead,
        watermarks: &mut Watermarks<S>,
        found: &mut Stage,
    ) {
        let Stage { change_e, drift_e, doubtful_e, meets } = found;
        change_e.fill([0.0; LANES]);
        meets.fill([0.0; LANES]);
        // Reuses the buffer of the output that is written last.
        let heights = drift_e;
        heights.copy_from_slice(charge_e);
        self.cloud.heights_in_place(heights);
        for lane in 0..LANES {
            // Vectors without a column of their own repeat the last one.
            if lane > 0 && charge_e.iter().all(|row| row[lane] == row[lane - 1]) {
                change_e.iter_mut().chain(meets.iter_mut()).for_each(|row| row[lane] = row[lane - 1]);
                continue;
            }
            let end = block.nearest + block.pixels;
            let home = block.nearest.max(downstream.rows);
            let first = (home - downstream.rows) as usize;
            let spent = |row: usize| charge_e[row][lane] < self.density_all * heights[row][lane];
            let together = home < end && !(first..charge_e.len()).any(spent);
            let mut pass = |watermarks: &mut Watermarks<S>, row: usize, pixels: i64| {
                let (change, met) = self.packet_of(watermarks, charge_e[row][lane], heights[row][lane], row + 1);
                change_e[row][lane] += pixels as f64 * change;
                meets[row][lane] += met;
            };
            if together {
                self.start(home, downstream.rows, watermarks);
                watermarks.pixels = 0.0;
                watermarks.history = vec![Course::START];
                for row in first..charge_e.len() {
                    // The pixel that it starts in joins, empty.
                    if row as i64 + downstream.rows < end {
                        watermarks.pixels += 1.0;
                    }
                    pass(watermarks, row, 1);
                }
            }
            let mut nearest = block.nearest;
            let end = if together { home } else { end };
            if nearest == end {
                continue;
            }
            // Charges are held fixed: packets have the same effect inside their clouds in all pixels.
            self.forget(watermarks);
            watermarks.pixels = 1.0;
            if self.by_density.is_some() {
                dispatch!(Level::new(), _simd => {
                    for row in charge_e {
                        self.extend_history(watermarks, row[lane]);
                    }
                });
            }
            while nearest < end {
                let alike =
                    if nearest < downstream.rows { self.alike_pixels(nearest, downstream).end } else { nearest + 1 };
                let pixels = alike.min(end) - nearest;
                self.place(nearest, downstream.rows, watermarks);
                let first = (nearest - downstream.rows).clamp(0, charge_e.len() as i64) as usize;
                // Where packets start, no background has passed, and the traps are empty.
                watermarks.packets = if self.by_density.is_some() { first } else { 0 };
                for row in first..charge_e.len() {
                    pass(watermarks, row, pixels);
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

    fn clouds(&self) -> &[Cloud] {
        slice::from_ref(&self.cloud)
    }

    fn knows_paths(&self) -> bool {
        false
    }

    fn alike_pixels(&self, pixel: i64, downstream: &Lead) -> Range<i64> {
        if pixel >= downstream.rows {
            return downstream.rows..i64::MAX;
        }
        let stretch = self.stretch(pixel, downstream.rows);
        let nearest = self.background.get(stretch + 1).map_or(i64::MIN, |next| downstream.rows - next.from as i64 + 1);
        nearest..downstream.rows - self.background[stretch].from as i64 + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CaptureDensity;

    fn traps() -> Vec<Trap> {
        vec![
            Trap { capture_transfers: 0.3, ..Trap::new(0.8, 3.0) },
            Trap { capture_transfers: 2.0, ..Trap::new(0.5, 40.0) },
        ]
    }

    /// The same, with capture faster in denser clouds, by a different law for each.
    fn by_density() -> Vec<Trap> {
        let law = |power, at_e, trap| Trap { capture_density: Some(CaptureDensity { power, at_e }), ..trap };
        let [one, other] = [traps()[0], traps()[1]];
        vec![law(0.3, 1e-4, one), law(1.0, 300.0, other)]
    }

    /// The same watermarks kept from the bottom up, each of which is updated by every packet.
    fn one_by_one(
        pixel: &FiniteCapturePixel<2>,
        traps: &[Trap],
        watermarks: &mut Vec<(f64, [f64; 2])>,
        charge_e: f64,
    ) -> (f64, bool) {
        let inside = [0, 1].map(|s: usize| traps[s].passage_of(&pixel.cloud, charge_e));
        let height = pixel.cloud.height(charge_e);
        let at = watermarks.iter().position(|(top, _)| *top >= height).unwrap_or(watermarks.len());
        let fill = watermarks.get(at).map_or([0.0; 2], |(_, fill)| *fill);
        watermarks.insert(at, (height, fill));
        let exchange = |share: f64, watermarks: &mut Vec<(f64, [f64; 2])>| {
            let (mut captured_e, mut released_e, mut floor) = (0.0, 0.0, 0.0);
            for (index, (top, fill)) in watermarks.iter_mut().enumerate() {
                for (s, fill) in fill.iter_mut().enumerate() {
                    let traps = pixel.density[s] * (*top - floor);
                    let before = *fill;
                    if index <= at {
                        let (_, full, approach) = inside[s];
                        *fill += share * (full - before) * (1.0 - approach);
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
        let (captured_e, released_e) = exchange(1.0, &mut watermarks.clone());
        let share = if captured_e > charge_e + released_e { (charge_e + released_e) / captured_e } else { 1.0 };
        exchange(share, watermarks);
        (released_e - share * captured_e, share < 1.0)
    }

    #[test]
    fn levels_on_either_side_of_a_cloud_are_as_if_each_were_followed() {
        // Tiny and rising, then of all sizes.
        let packets: Vec<f64> = (0..300_u32)
            .map(|row| if row < 40 { 1e-6 * f64::from(row) } else { f64::from(row * row * 37 % 1001) })
            .collect();
        for traps in [traps(), by_density()] {
            follow(&traps, &packets);
        }
    }

    fn follow(traps: &[Trap], packets: &[f64]) {
        let pixel =
            FiniteCapturePixel::<2>::new(traps, Cloud::new(1e4, 0.0, 0.5), Downstream::NONE, packets.len(), 0.0);
        let (mut watermarks, mut followed) = (pixel.background[0].mean.clone(), Vec::new());
        let mut short = 0;
        for &charge_e in packets {
            let (expected_e, spent) = one_by_one(&pixel, traps, &mut followed, charge_e);
            let (change_e, _) = pixel.packet(&mut watermarks, charge_e, 1);
            assert!((change_e - expected_e).abs() < 1e-12, "{charge_e} e-: {change_e}, {expected_e}");
            short += usize::from(spent);
        }
        assert!(short > 0, "some packet has less than its traps would take");
    }

    #[test]
    fn what_a_packet_loses_the_traps_hold() {
        let downstream = Downstream::NONE;
        for traps in [traps(), by_density()] {
            what_is_lost_is_held(&traps, downstream);
        }
    }

    fn what_is_lost_is_held(traps: &[Trap], downstream: Downstream) {
        let pixel = FiniteCapturePixel::<2>::new(traps, Cloud::new(1e4, 0.0, 0.5), downstream, 7, 0.0);
        let mut watermarks = pixel.background[0].mean.clone();
        let held = |watermarks: &Watermarks<2>| -> f64 {
            let mut watermarks = watermarks.clone();
            pixel.settle(&mut watermarks);
            let mut floor = 0.0;
            let mut held = 0.0;
            for watermark in watermarks.inside.iter().chain(watermarks.above.iter().rev()) {
                held += (watermark.top - floor) * (0..2).map(|s| pixel.density[s] * watermark.fill[s]).sum::<f64>();
                floor = watermark.top;
            }
            held
        };
        let mut lost = 0.0;
        for charge_e in [500.0, 20.0, 900.0, 0.0, 3.0, 900.0, 1e-3] {
            let (change_e, _) = pixel.packet(&mut watermarks, charge_e, 1);
            lost -= change_e;
            assert!((held(&watermarks) - lost).abs() < 1e-12);
            assert!(charge_e + change_e >= -1e-15, "{charge_e} e- lost {change_e}");
        }
    }

    #[test]
    fn a_background_settles_in_the_balance_of_capture_and_release() {
        let downstream = Downstream { rows: 1000, charge_e: 100.0 };
        let pixel = FiniteCapturePixel::<2>::new(&traps(), Cloud::new(1e4, 0.0, 0.5), downstream, 1, 1e-9);
        let packets = pixel.background.last().unwrap().from;
        assert!(packets < 500, "{packets} packets until the background settles");
        let settled = &pixel.background.last().unwrap().mean;
        assert!((settled.inside[0].fill[0] - 3.0 / 3.3).abs() < 1e-6);
        assert!((settled.inside[0].fill[1] - 40.0 / 42.0).abs() < 1e-6);
        let mut watermarks = settled.clone();
        // Less the charge of the traps that the packets have filled.
        let charge_e = 100.0 - 0.1 * (0.8 * 3.0 / 3.3 + 0.5 * 40.0 / 42.0);
        assert!(pixel.packet(&mut watermarks, charge_e, 1).0.abs() < 1e-3);
    }

    /// With fixed charges, a block is the sum of its pixels: those that packets start in, with and without a spent packet, and
    /// those that the background has left nearly equal.
    #[test]
    fn a_block_does_what_its_pixels_do_one_by_one() {
        let rows = 40;
        let charges_e: [fn(usize) -> f64; 2] = [
            |row| 60.0 + 900.0 * (-((row as f64 - 15.0) / 4.0).powi(2)).exp(),
            |row| (row * row * 37 % 101) as f64 * 0.01,
        ];
        for (traps, charge_e) in
            [traps(), by_density()].iter().flat_map(|traps| charges_e.map(|charge_e| (traps, charge_e)))
        {
            let charge_e: Vec<Packets> = (0..rows).map(|row| [charge_e(row); LANES]).collect();
            let lead = Lead { rows: 500, charge_e: [60.0; LANES], pixels: 0..i64::MAX };
            let downstream = Downstream { rows: 500, charge_e: 60.0 };
            let pixel = FiniteCapturePixel::<2>::new(traps, Cloud::new(1e4, 0.0, 0.5), downstream, rows, 1e-9);
            let changes = |nearest: i64, pixels: i64| {
                let mut found = Stage::new(rows);
                let block = Block { nearest, pixels };
                pixel.pass(&charge_e, BlockPath::Unknown, block, &lead, &mut Watermarks::default(), &mut found);
                found.change_e.iter().map(|row| row[0]).collect::<Vec<f64>>()
            };
            assert!(pixel.background.len() < 100, "{} stretches of 500 pixels", pixel.background.len());
            for (nearest, pixels) in [(500, 40), (507, 20), (0, 500), (350, 190)] {
                let together = changes(nearest, pixels);
                let mut one_by_one = vec![0.0; rows];
                for nearest in nearest..nearest + pixels {
                    one_by_one.iter_mut().zip(changes(nearest, 1)).for_each(|(sum, change)| *sum += change);
                }
                for (row, (together, one_by_one)) in together.iter().zip(&one_by_one).enumerate() {
                    // As much as mergers may misplace.
                    let off = (together - one_by_one).abs();
                    assert!(off < 1e-9 * pixels as f64, "pixels {nearest} to {}, row {row}: {off:e}", nearest + pixels);
                }
            }
        }
    }

    /// Stretches of the background cover as many packets as it was followed for, without gaps, and their means conserve its charge.
    #[test]
    fn stretches_hold_what_the_background_has_left() {
        let downstream = Downstream { rows: 300, charge_e: 60.0 };
        let followed =
            |merge_e| FiniteCapturePixel::<2>::new(&traps(), Cloud::new(1e4, 0.0, 0.5), downstream, 1, merge_e);
        let (each, together) = (followed(0.0), followed(1e-8));
        assert!(each.background.len() > 3 * together.background.len());
        let held = |pixel: &FiniteCapturePixel<2>, passed: i64| {
            let Watermarks { filled_inside, filled_above, .. } = &pixel.background[pixel.stretch(-passed, 0)].mean;
            (0..2).map(|s| pixel.density[s] * (filled_inside[s] + filled_above[s])).sum::<f64>()
        };
        for (place, stretch) in together.background.iter().enumerate() {
            let next = together.background.get(place + 1).map_or(stretch.from + 1, |next| next.from);
            let pixels = stretch.from..next;
            let mean = pixels.clone().map(|passed| held(&each, passed as i64)).sum::<f64>() / pixels.len() as f64;
            let off = (held(&together, stretch.from as i64) - mean).abs();
            assert!(off < 1e-8 * next as f64, "{pixels:?}: {off:e}");
        }
    }
}
