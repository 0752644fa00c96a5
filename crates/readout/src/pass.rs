//! One row of packets after another through a block of pixels: the inner loop of the fast readout.
//!
//! Each row arrives, receives what the traps release, descends the stack of watermarks left by earlier rows as far as its clouds
//! reach, and leaves its own watermark. Packets with less charge than the traps in their reach would capture are followed one by
//! one.

use std::ops::Range;
use std::slice;

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

use super::Cloud;
use super::block_path::{BlockPath, PathMeans, Reached, Returned, Summed, ahead};
use super::home_watermarks::HomeWatermarks;
use super::passage::{Block, Lead, Passage, Stage};
use super::pixel::Pixel;
use super::simd::{Coefficient, LANES, Mask, Packets, Vector};
use super::spent::{Passed, Short};
use super::watermarks::{BACKGROUND, NONE, PACKETS, Watermarks};

/// A pass through a block, in progress. Its state stays in registers if the species are few.
pub(super) struct Pass<'a, T: Simd, C, const S: usize, const RETURNS: bool, const SEEK: bool, const KNOWN: bool> {
    simd: T,
    pixel: &'a Pixel<S, RETURNS, C>,
    known: Option<&'a PathMeans>,
    watermarks: &'a mut Watermarks<S>,
    /// Electrons in the traps of all the block's pixels, by species.
    stored: [Summed<T, SEEK>; S],
    home: HomeWatermarks<T, S>,
}

/// A row of packets on arrival at the traps of the block.
pub(super) struct Arrival<T: Simd, const SEEK: bool> {
    row: usize,
    /// The watermark that it meets first.
    before: usize,
    /// Whether its own pixel is in the block.
    starts: bool,
    /// Pixels of the block that it passes, without its own.
    visits: f64,
    /// 1 / visits, or 0.
    pub per_visit: f64,
    /// Height of its clouds in its own pixel.
    home_height: Vector<T>,
    /// Charge that it leaves in the empty traps of its own pixel, before any return, e-.
    pub left_e: Vector<T>,
    /// Charge released to it, e-.
    released: Summed<T, SEEK>,
    /// Charge that meets the traps in each pixel, e-.
    present_e: Vector<T>,
    /// Height of its clouds.
    height: Vector<T>,
    /// Charge that would fill all empty traps of a pixel below that height, e-.
    most_e: Vector<T>,
    /// Packets that may have less charge than that.
    lacks: Mask<T>,
    /// Whether there are any such packets.
    pub short: bool,
}

/// What a row of packets met on its way down the stack.
pub(super) struct Met<T: Simd, const SEEK: bool> {
    height: Vector<T>,
    captured: Summed<T, SEEK>,
    /// Index of the next watermark below their own on the stack.
    below: Vector<T>,
    /// The last watermark that they met, with a mark for packets that are spent.
    pub last: Vector<T>,
    /// See [`PathMeans::further_e`]; 0 unless it is computed.
    pub further_e: Vector<T>,
}

// Operations on vectors must be inlined into the caller, which knows the processor; closures are not always inlined.

#[allow(clippy::needless_range_loop)] // species index several arrays at once
impl<'a, T: Simd, C: Coefficient, const S: usize, const RETURNS: bool, const SEEK: bool, const KNOWN: bool>
    Pass<'a, T, C, S, RETURNS, SEEK, KNOWN>
{
    /// Before the first row, with the state left by the background.
    #[inline(always)]
    pub fn new(
        simd: T,
        pixel: &'a Pixel<S, RETURNS, C>,
        known: Option<&'a PathMeans>,
        watermarks: &'a mut Watermarks<S>,
    ) -> Self {
        let mut stored = [Summed::<T, SEEK>::none(simd); S];
        for s in pixel.species() {
            stored[s] = Summed {
                once: Vector::load(simd, &watermarks.stored[s]),
                twice: Vector::load(simd, &watermarks.stored_ahead[s]),
            };
        }
        Pass { simd, pixel, known, watermarks, stored, home: HomeWatermarks::new(simd) }
    }

    /// A row arrives: the traps of its own pixel capture what they can, and all others release.
    #[inline(always)]
    pub fn arrive(
        &mut self,
        arriving_e: Vector<T>,
        row: usize,
        before: usize,
        (starts, visits): (bool, f64),
    ) -> Arrival<T, SEEK> {
        let (simd, pixel, cloud) = (self.simd, self.pixel, &self.pixel.cloud);
        let zero = Vector::all(simd, 0.0);
        let per_visit = if visits > 0.0 { 1.0 / visits } else { 0.0 };
        let packet = row + PACKETS;
        self.watermarks.visits[packet] = visits;
        self.watermarks.starts[packet] = if starts { 1.0 } else { 0.0 };
        let mut home_height = zero;
        if starts {
            // Into empty traps, not more than it has.
            let most = arriving_e.max(zero) * pixel.per_density_all;
            home_height = cloud.heights(simd, arriving_e).min(most);
        }
        let left_e = home_height * if RETURNS { pixel.held_all } else { pixel.density_all };
        let mut released = Summed::none(simd);
        for s in pixel.species() {
            let out = self.stored[s] * pixel.release[s];
            self.stored[s] = self.stored[s] - out;
            released = released + out;
        }
        let passing_e = match self.known {
            Some(path) => arriving_e + Vector::load(simd, &path.mean_e[row]),
            None => arriving_e - left_e,
        };
        let present_e = passing_e + released.once * per_visit;
        let height = if visits > 0.0 { cloud.heights(simd, present_e) } else { home_height };
        let most_e = height * pixel.density_all;
        // A packet cannot give more charge than it has.
        let lacks = present_e.below(most_e) & zero.below(most_e);
        let short = visits > 0.0 && lacks.any();
        if short {
            self.watermarks.keep(&self.stored);
        }
        Arrival {
            row,
            before,
            starts,
            visits,
            per_visit,
            home_height,
            left_e,
            released,
            present_e,
            height,
            most_e,
            lacks,
            short,
        }
    }

    /// Down the stack: the watermarks that any lane meets, one after another.
    #[inline(always)]
    pub fn descend(&mut self, arrival: &Arrival<T, SEEK>, doubtful_e: &mut Packets) -> Met<T, SEEK> {
        let Arrival { row, before, visits, height, present_e, most_e, short, .. } = *arrival;
        let (simd, pixel) = (self.simd, self.pixel);
        let (zero, one) = (Vector::all(simd, 0.0), Vector::all(simd, 1.0));
        let packet = row + PACKETS;
        let mut captured = Summed::over(most_e, visits);
        for s in pixel.species() {
            self.stored[s] = self.stored[s] + Summed::over(height * pixel.density[s], visits);
        }
        let able = arrival.lacks.select(zero, one);
        self.home.pass(simd, pixel, height, able, &mut self.stored, &mut captured).store(doubtful_e);
        let mut reached = zero;
        let mut reached_into = Reached::new(simd, most_e);
        // In the pixels of the watermark reached into.
        let (mut height_there, mut height_there_is_known) = (height, false);
        let mut stands_before = Vector::all(simd, before as f64);
        let mut watermark = before;
        while watermark != NONE {
            let place = Vector::all(simd, watermark as f64);
            let here = stands_before.equals(place);
            let top = Vector::load(simd, &self.watermarks.height[watermark]);
            let under = Vector::load(simd, &self.watermarks.below[watermark]);
            let (visits_there, starts_there) = (self.watermarks.visits[watermark], self.watermarks.starts[watermark]);
            let pixels_there = visits_there + starts_there;
            let m = packet - watermark;
            let mut own = height;
            let mut floor = reached;
            if let Some(path) = self.known {
                floor = Vector::load(simd, &self.watermarks.floor[watermark]);
                if pixels_there < visits {
                    if !height_there_is_known {
                        let further_e = Vector::load(simd, &path.further_e[row]);
                        height_there = pixel.cloud.heights(simd, present_e + further_e);
                        height_there_is_known = true;
                    }
                    own = height_there;
                }
            }
            let covered = top.at_most(height);
            let ceiling = covered.select(top, own.min(top));
            let filled = here.select(ceiling - floor, zero);
            let mut filled_all = Summed::over(filled, visits_there);
            if starts_there > 0.0 {
                let top = Vector::load(simd, &self.watermarks.home_height[watermark]);
                let filled = here.select(covered.select(height, own).min(top) - floor, zero);
                filled_all = filled_all + Summed::at(filled, visits_there);
                let stands = here & covered & height.below(top);
                if stands.any() {
                    let thickness = stands.select(top - height, zero) * able;
                    self.home.leave(simd, pixel, thickness, height, (m, visits_there));
                }
            }
            captured = captured - filled_all * pixel.left_all[m];
            for s in pixel.species() {
                self.stored[s] = self.stored[s] - filled_all * pixel.left[m][s];
            }
            if SEEK {
                let out = pixel.out_all[m];
                let out_e = covered.select(filled, zero) * out;
                reached_into.fills(filled * pixel.left_all[m]);
                reached_into.covers(out_e, (filled_all.all() * out).only(simd, covered));
                reached_into.ends(simd, here & height.below(top), pixels_there);
            }
            if KNOWN {
                if short {
                    self.watermarks.moved.push((watermark, self.watermarks.floor[watermark]));
                }
                here.select(ceiling, floor).store(&mut self.watermarks.floor[watermark]);
            }
            reached = here.select(ceiling, reached);
            // Lanes that stop here keep the index with a minus sign.
            stands_before = here.select(covered.select(under, zero - place), stands_before);
            let go_on = zero.below(stands_before).any();
            watermark = if go_on { stands_before.largest() as usize } else { NONE };
        }
        let below = stands_before.abs();
        let further_e = match SEEK {
            true => {
                let (own_e, returned) =
                    if RETURNS { self.to_return(height) } else { (zero, Summed::<T, SEEK>::none(simd)) };
                let returned = Returned { own_e, own: Summed::<T, true>::over(own_e, visits), all: returned.all() };
                reached_into.further(simd, arrival.released.all(), captured.all(), returned, arrival.per_visit)
            }
            false => zero,
        };
        Met { height, captured, below, last: below, further_e }
    }

    /// Charge that returns to packets with clouds of this height when they leave, e-: in each pixel from below that height, and in
    /// all pixels from all heights.
    #[inline(always)]
    fn to_return(&self, height: Vector<T>) -> (Vector<T>, Summed<T, SEEK>) {
        let (mut own_e, mut all) = (Vector::all(self.simd, 0.0), Summed::none(self.simd));
        for s in self.pixel.species() {
            own_e = own_e + height * self.pixel.to_return[s];
            all = all + self.stored[s] * self.pixel.returned[s];
        }
        (own_e, all)
    }

    /// Follows the packets of a row with less charge than the traps in their reach would capture, one by one.
    #[inline(always)]
    pub fn mend(&mut self, arrival: &Arrival<T, SEEK>, met: &mut Met<T, SEEK>) {
        let Arrival { row, before, visits, present_e, .. } = *arrival;
        let (simd, pixel) = (self.simd, self.pixel);
        let zero = Vector::all(simd, 0.0);
        let has_e = (present_e * visits).max(zero);
        let spent = has_e.below(met.captured.once);
        if !spent.any() {
            return;
        }
        let mut passed = Passed {
            height: met.height.row(),
            captured_e: met.captured.once.row(),
            below: met.below.row(),
            met: met.last.row(),
        };
        let [mut once, mut twice] = [[[0.0; LANES]; S]; 2];
        for s in pixel.species() {
            self.stored[s].once.store(&mut once[s]);
            self.stored[s].twice.store(&mut twice[s]);
        }
        let short = Short { row, before, visits, present_e: present_e.row(), has_e: has_e.row() };
        pixel.spend(short, (&mut once, &mut twice), self.known, self.watermarks, &mut passed);
        for s in pixel.species() {
            self.stored[s] = Summed { once: Vector::load(simd, &once[s]), twice: Vector::load(simd, &twice[s]) };
        }
        met.height = Vector::load(simd, &passed.height);
        met.below = Vector::load(simd, &passed.below);
        met.last = Vector::load(simd, &passed.met);
        met.captured.once = Vector::load(simd, &passed.captured_e);
        met.captured.twice = spent.select(met.captured.once * (ahead(visits) * arrival.per_visit), met.captured.twice);
        met.further_e = spent.select(zero, met.further_e);
    }

    /// The row leaves its watermark; returns its change in the block, e-.
    #[inline(always)]
    pub fn leave(&mut self, arrival: &Arrival<T, SEEK>, met: &Met<T, SEEK>) -> Summed<T, SEEK> {
        let packet = arrival.row + PACKETS;
        let mut changed = arrival.released - met.captured;
        if RETURNS {
            for s in self.pixel.species() {
                let back = self.stored[s] * self.pixel.returned[s];
                self.stored[s] = self.stored[s] - back;
                changed = changed + back;
            }
        }
        if arrival.starts {
            for s in self.pixel.species() {
                let left_e = arrival.home_height * self.pixel.held[s];
                self.stored[s] = self.stored[s] + Summed::at(left_e, arrival.visits);
            }
        }
        met.height.store(&mut self.watermarks.height[packet]);
        arrival.home_height.store(&mut self.watermarks.home_height[packet]);
        met.below.store(&mut self.watermarks.below[packet]);
        if KNOWN {
            self.watermarks.floor[packet] = [0.0; LANES];
        }
        changed
    }
}

impl<const S: usize, const RETURNS: bool, C: Coefficient> Pixel<S, RETURNS, C> {
    /// See [`Passage::pass`]. `SEEK`: the path of the packets is to be computed; `KNOWN`: it is known.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // those of the trait's method, and the processor
    #[allow(clippy::needless_range_loop)] // rows index several arrays at once
    fn pass_by<T: Simd, const SEEK: bool, const KNOWN: bool>(
        &self,
        simd: T,
        charge_e: &[Packets],
        path: BlockPath,
        block: Block,
        downstream: &Lead,
        watermarks: &mut Watermarks<S>,
        found: &mut Stage,
    ) {
        let (mut sought, known) = match path {
            BlockPath::Sought(path) if SEEK => (Some(path), None),
            BlockPath::Known(path) if KNOWN => (None, Some(path)),
            _ => (None, None),
        };
        let rows = charge_e.len();
        // Rows that start nearer to the register than the block never pass it.
        let first = (block.nearest - downstream.rows).clamp(0, rows as i64) as usize;
        found.absent(first);
        if let Some(path) = &mut sought {
            path.absent(first);
        }
        watermarks.start(self, first, rows, block, downstream);
        let mut pass = Pass::<T, C, S, RETURNS, SEEK, KNOWN>::new(simd, self, known, watermarks);
        for row in first..rows {
            let before = if row == first { BACKGROUND } else { row - 1 + PACKETS };
            let (starts, visits) = block.passage_of(row as i64, downstream);
            let arrival = pass.arrive(Vector::load(simd, &charge_e[row]), row, before, (starts, visits));
            let mut met = pass.descend(&arrival, &mut found.doubtful_e[row]);
            if arrival.short {
                pass.mend(&arrival, &mut met);
            }
            let changed = pass.leave(&arrival, &met);
            if let Some(path) = &mut sought {
                met.further_e.store(&mut path.further_e[row]);
                (changed.twice * arrival.per_visit - arrival.left_e).store(&mut path.mean_e[row]);
            }
            changed.once.store(&mut found.drift_e[row]);
            (changed.once - arrival.left_e).store(&mut found.change_e[row]);
            met.last.store(&mut found.meets[row]);
        }
    }
}

impl<const S: usize, const RETURNS: bool, C: Coefficient> Passage for Pixel<S, RETURNS, C> {
    type Watermarks = Watermarks<S>;

    // Not inlined into the caller: this is most of the program's work, compiled once for each kind of processor.
    #[inline(never)]
    fn pass(
        &self,
        charge_e: &[Packets],
        path: BlockPath,
        block: Block,
        downstream: &Lead,
        watermarks: &mut Watermarks<S>,
        found: &mut Stage,
    ) {
        dispatch!(Level::new(), simd => match path {
            BlockPath::Unknown => self.pass_by::<_, false, false>(simd, charge_e, path, block, downstream, watermarks, found),
            BlockPath::Sought(_) => self.pass_by::<_, true, false>(simd, charge_e, path, block, downstream, watermarks, found),
            BlockPath::Known(_) => self.pass_by::<_, false, true>(simd, charge_e, path, block, downstream, watermarks, found),
        });
    }

    fn density(&self) -> f64 {
        self.density_all.largest()
    }

    fn clouds(&self) -> &[Cloud] {
        slice::from_ref(&self.cloud)
    }

    fn knows_paths(&self) -> bool {
        true
    }

    fn alike_pixels(&self, _: i64, _: &Lead) -> Range<i64> {
        // Pixels differ only in known ways: see the module.
        i64::MIN..i64::MAX
    }
}
