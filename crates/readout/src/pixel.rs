//! What the traps of a pixel do to all the packets that pass it, in one pass and without approximation.
//!
//! **Levels.** Capture is instantaneous, so every trap below the newest cloud is full, and a trap higher up was last
//! filled when the last packet that reached it went by, m packets ago: it is still full with probability exp(−m/τ).
//! The state of any number of traps is therefore a short stack of levels — a height and the packet that filled it —
//! from which a new packet removes all that it covers. Nothing is divided into bins, so nothing is rounded.
//!
//! **Blocks.** While the packets' charges are held fixed, pixels differ only in which packets pass them: the packet in
//! row r starts in pixel r. The sum over a block of pixels then needs one pass, not one per pixel: a level left by a
//! packet exists in as many pixels as that packet has visited, and the visits of an earlier packet are among those of
//! a later one. So each level carries the number of its pixels, and captures and releases are weighted with it. The pixel that a
//! packet starts in is unlike all others, empty, and is done for itself (see [`super::crests`]).
//!
//! **Lanes.** Columns are passed side by side (see [`super::lanes`]). Every packet leaves one level, so that levels are kept
//! in the order of the packets, each with the place of the next higher one below it on the stack, instead of being moved. The
//! packets of a row go through the levels that any of them meets, one after another, the newest first: mostly the one just left
//! by their neighbours, and few more. Only packets that have less than the traps in their reach would take are followed
//! one by one.
//!
//! | symbol | here | unit | meaning |
//! |---|---|---|---|
//! | ρ | `density` | per pixel | traps of a species |
//! | 1 − exp(−1/τ) | `release` | 1 | chance to be emptied while one packet passes |
//! | ρ exp(−m/τ) | `left[m]` | per pixel | still filled m packets later |

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

use super::crests::Crests;
use super::lanes::{LANES, Lanes, Row};
use super::way::{Path, Reached, Summed, Way, ahead};
use super::{Cloud, Trap};

/// The traps of one pixel, tabulated for `S` species (padded with species of no density).
pub(super) struct Pixel<const S: usize> {
    cloud: Cloud,
    species: usize,
    density: [f64; S],
    density_all: f64,
    /// 1 − exp(−1/τ), the fraction released while a packet passes.
    pub(super) release: [f64; S],
    /// Still filled m packets after the one that filled them, per pixel.
    pub(super) left: Vec<[f64; S]>,
    left_all: Vec<f64>,
    /// Released while the m-th packet after the one that filled them passes, per pixel.
    out_all: Vec<f64>,
}

/// What lies between row 0 and the register (see [`super::Downstream`]), in columns side by side.
pub(super) struct Lead {
    pub rows: i64,
    /// Charge of its packets, e-.
    pub charge_e: Row,
}

/// A run of pixels: those from `nearest` (pixels from the register) up to `nearest + pixels`.
#[derive(Clone, Copy)]
pub(super) struct Block {
    pub nearest: i64,
    pub pixels: i64,
}

impl Block {
    /// How many of the block's pixels the packet of row `row` passes; row −1 is the last one downstream.
    fn visits(self, row: i64, downstream: &Lead) -> i64 {
        (row + 1 + downstream.rows - self.nearest).clamp(0, self.pixels)
    }

    /// Whether the pixel that a row starts in is one of the block's, and how many others of them it passes.
    fn way(self, row: i64, downstream: &Lead) -> (bool, f64) {
        let starts = (self.nearest..self.nearest + self.pixels).contains(&(row + downstream.rows));
        (starts, (self.visits(row, downstream) - i64::from(starts)) as f64)
    }
}

/// What a pixel does to the packets that pass it, in columns side by side.
pub(super) trait Passage: Sync {
    /// State of the traps, to be reused from pass to pass.
    type Levels: Default + Send;

    /// Change of every packet's charge (e-) by a passage through the block, all charges held fixed.
    ///
    /// `charge_e` is the charge on arrival. Exact for one pixel; for a block, to first order in the change, and to second order
    /// where the way is known. What packets lose, the traps hold.
    ///
    /// `found` has the length of `charge_e` and is overwritten.
    fn pass(
        &self,
        charge_e: &[Row],
        way: Way,
        block: Block,
        downstream: &Lead,
        levels: &mut Self::Levels,
        found: &mut Stage,
    );

    /// Traps of the pixel.
    fn density(&self) -> f64;

    /// How high packets reach.
    fn cloud(&self) -> &Cloud;

    /// Distance from the register (pixels) below which blocks may be passed in one step; beyond it pixels are too unlike
    /// one another.
    fn alike_below(&self, downstream: &Lead) -> i64;
}

/// What one pass finds.
pub(super) struct Stage {
    /// Change of every packet, e-.
    pub change_e: Vec<Row>,
    /// The same without what it leaves in the empty pixel that it starts in, which is known exactly, e-.
    pub drift_e: Vec<Row>,
    /// What it took of crests (see [`super::crests`]) that it did not cover, e-: they are known on average only.
    pub doubtful_e: Vec<Row>,
    /// At which earlier packet's level each packet ended, as a number. While these stay the same, the change is a smooth
    /// function of the charges; where they differ from one pass to another, it has a kink in between.
    pub meets: Vec<Row>,
}

impl Stage {
    /// For so many rows.
    pub fn new(rows: usize) -> Stage {
        Stage {
            change_e: vec![[0.0; LANES]; rows],
            drift_e: vec![[0.0; LANES]; rows],
            doubtful_e: vec![[0.0; LANES]; rows],
            meets: vec![[0.0; LANES]; rows],
        }
    }

    /// Rows that do not pass the block.
    fn absent(&mut self, rows: usize) {
        for part in [&mut self.change_e, &mut self.drift_e, &mut self.doubtful_e, &mut self.meets] {
            part[..rows].fill([0.0; LANES]);
        }
    }
}

/// Levels in the order of the packets that left them: none, the background, and from there on one for each row.
pub(super) struct Levels<const S: usize> {
    /// Height of the packet's cloud in the pixels that it passed after its own.
    height: Vec<Row>,
    /// The same in the pixel that it started in.
    crest: Vec<Row>,
    /// Height of what has been filled anew since, in the pixels of the level; only where the packets' way is known.
    floor: Vec<Row>,
    /// Floors that the packets of this row have moved, with their places, should some of the packets turn out to be spent.
    moved: Vec<(usize, Row)>,
    /// The next higher level on the stack below, by its place.
    below: Vec<Row>,
    /// Pixels of the block in which the level exists, the packet's own not among them.
    visits: Vec<f64>,
    /// 1 where the packet's own pixel is in the block, else 0.
    starts: Vec<f64>,
    /// Electrons in the traps of all the block's pixels, by species.
    stored: [Row; S],
    /// The same, each counted as often as there are pixels of the block ahead of its own.
    stored_ahead: [Row; S],
}

impl<const S: usize> Levels<S> {
    /// Notes what the traps hold, should packets turn out to have less than they would fill.
    #[inline(always)]
    fn keep<T: Simd, const TWICE: bool>(&mut self, stored: &[Summed<T, TWICE>; S]) {
        for (s, stored) in stored.iter().enumerate() {
            stored.once.store(&mut self.stored[s]);
            stored.twice.store(&mut self.stored_ahead[s]);
        }
        self.moved.clear();
    }
}

impl<const S: usize> Default for Levels<S> {
    fn default() -> Self {
        Levels {
            height: Vec::new(),
            crest: Vec::new(),
            floor: Vec::new(),
            moved: Vec::new(),
            below: Vec::new(),
            visits: Vec::new(),
            starts: Vec::new(),
            stored: [[0.0; LANES]; S],
            stored_ahead: [[0.0; LANES]; S],
        }
    }
}

/// The place of a level that is higher than all and exists nowhere; and as the number that links hold.
const NONE: usize = 0;
const NOWHERE: f64 = 0.0;
/// The place of the level that the background downstream has left.
const BACKGROUND: usize = 1;
/// The place of the first packet's level.
const PACKETS: usize = 2;

/// What packets of a row do to the levels.
struct Passed {
    height: Row,
    /// In all pixels of the block.
    captured_e: Row,
    /// The places of the levels that they leave above their own.
    below: Row,
    /// The last levels they met, with a mark for those that are spent.
    met: Row,
}

/// Packets of a row of which some have less than the traps in their reach would take.
struct Short {
    row: usize,
    /// The level that they meet first.
    before: usize,
    visits: f64,
    /// Charge that meets the traps in each pixel, e-.
    present_e: Row,
    /// The same in all pixels together, e-.
    has_e: Row,
}

/// Species up to which they are held in registers.
pub(super) const FEW: usize = 5;

impl<const S: usize> Pixel<S> {
    /// Species to go through: all places where they are few and known when the program is compiled, else those there are.
    #[inline(always)]
    pub(super) fn species(&self) -> std::ops::Range<usize> {
        0..if S <= FEW { S } else { self.species }
    }

    /// Tables for columns of `rows` packets.
    pub fn new(traps: &[Trap], cloud: Cloud, rows: usize) -> Pixel<S> {
        let mut density = [0.0; S];
        let mut release = [0.0; S];
        for (s, trap) in traps.iter().enumerate() {
            density[s] = trap.density_per_px;
            release[s] = trap.released();
        }
        let kept: Vec<f64> = traps.iter().map(|trap| (-1.0 / trap.release_transfers).exp()).collect();
        // ρ exp(−m/τ), by multiplication: exponentials of a stamp's rows would take as long as a pass.
        let mut left = vec![density];
        for m in 0..=rows {
            let mut next = [0.0; S];
            for (s, kept) in kept.iter().enumerate() {
                next[s] = left[m][s] * kept;
            }
            left.push(next);
        }
        let left_all = left.iter().map(|left: &[f64; S]| left.iter().sum()).collect();
        let mut out_all = vec![0.0];
        out_all.extend(left.iter().map(|left| (0..S).map(|s| left[s] * release[s]).sum::<f64>()));
        let density_all = density.iter().sum();
        Pixel { cloud, species: traps.len(), density, density_all, release, left, left_all, out_all }
    }

    /// Follows the packets of a row that have less than they would fill. `stored` and `stored_ahead` come as if all had enough,
    /// and are mended where they had not; `levels` tells what the traps held before.
    fn spend(
        &self,
        short: Short,
        (stored, stored_ahead): (&mut [Row; S], &mut [Row; S]),
        path: Option<&Path>,
        levels: &mut Levels<S>,
        passed: &mut Passed,
    ) {
        for lane in 0..LANES {
            if short.has_e[lane] < passed.captured_e[lane] {
                for (place, floor) in &levels.moved {
                    levels.floor[*place][lane] = floor[lane];
                }
                self.climb(&short, lane, path, levels, passed);
                for s in self.species() {
                    stored[s][lane] = levels.stored[s][lane];
                    stored_ahead[s][lane] = levels.stored_ahead[s][lane];
                }
            }
        }
    }

    /// Fills levels from below until all that the packet has is spent, or its height is reached.
    fn climb(&self, short: &Short, lane: usize, path: Option<&Path>, levels: &mut Levels<S>, passed: &mut Passed) {
        let Short { row, before, visits, .. } = *short;
        let mut height = passed.height[lane];
        let packet = row + PACKETS;
        let mut level = before;
        let mut reached = 0.0;
        let mut captured_e = 0.0;
        let available_e = short.has_e[lane];
        loop {
            let top = levels.height[level][lane];
            let visits_there = levels.visits[level];
            let covered = top <= height;
            let ceiling = if covered { top } else { height };
            let mut own_ceiling = ceiling;
            let mut floor = reached;
            if let Some(path) = path {
                floor = levels.floor[level][lane];
                if !covered && level != NONE && visits_there + levels.starts[level] < visits {
                    let present_e = short.present_e[lane] + path.further_e[row][lane];
                    own_ceiling = self.cloud.height(present_e).min(top);
                }
            }
            let mut thickness = ceiling - reached;
            let mut filled = if level == NONE { 0.0 } else { own_ceiling - floor };
            let mut crested = levels.starts[level] * (levels.crest[level][lane].min(height) - floor);
            let m = packet - level;
            let still_filled = visits_there * filled + crested;
            let mut more_e = visits * self.density_all * thickness - self.left_all[m] * still_filled;
            let spent = captured_e + more_e > available_e;
            if spent {
                let share = (available_e - captured_e) / more_e;
                thickness *= share;
                filled *= share;
                crested *= share;
                more_e *= share;
                height = reached + thickness;
            }
            for s in self.species() {
                let (thick_e, filled_e) = (self.density[s] * thickness, self.left[m][s] * filled);
                let crested_e = self.left[m][s] * crested;
                levels.stored[s][lane] += visits * thick_e - visits_there * filled_e - crested_e;
                levels.stored_ahead[s][lane] +=
                    ahead(visits) * thick_e - ahead(visits_there) * filled_e - visits_there * crested_e;
            }
            captured_e += more_e;
            if covered && !spent {
                reached = top;
                level = levels.below[level][lane] as usize;
                continue;
            }
            if path.is_some() {
                levels.floor[level][lane] = if spent { height } else { own_ceiling };
            }
            passed.below[lane] = level as f64;
            passed.met[lane] = level as f64 + if spent { SPENT } else { 0.0 };
            passed.captured_e[lane] = captured_e;
            passed.height[lane] = height;
            return;
        }
    }

    /// See [`Passage::pass`].
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // those of the trait's method, and the processor
    #[allow(clippy::needless_range_loop)] // species and lanes index several arrays at once
    fn pass_by<T: Simd, const SEEK: bool, const KNOWN: bool>(
        &self,
        simd: T,
        charge_e: &[Row],
        way: Way,
        block: Block,
        downstream: &Lead,
        levels: &mut Levels<S>,
        found: &mut Stage,
    ) {
        let (mut sought, known) = match way {
            Way::Sought(path) if SEEK => (Some(path), None),
            Way::Known(path) if KNOWN => (None, Some(path)),
            _ => (None, None),
        };
        let rows = charge_e.len();
        // Rows that start nearer to the register than the block never pass it.
        let first = (block.nearest - downstream.rows).clamp(0, rows as i64) as usize;
        found.absent(first);
        if let Some(path) = &mut sought {
            path.absent(first);
        }
        self.start(first, rows, block, downstream, levels);
        let (zero, one) = (Lanes::all(simd, 0.0), Lanes::all(simd, 1.0));
        let mut stored = [Summed::<T, SEEK>::none(simd); S];
        for s in self.species() {
            stored[s] = Summed {
                once: Lanes::load(simd, &levels.stored[s]),
                twice: Lanes::load(simd, &levels.stored_ahead[s]),
            };
        }
        let mut crests = Crests::new(simd);
        for row in first..rows {
            let packet = row + PACKETS;
            let before = if row == first { BACKGROUND } else { packet - 1 };
            let (starts, visits) = block.way(row as i64, downstream);
            let per_visit = if visits > 0.0 { 1.0 / visits } else { 0.0 };
            levels.visits[packet] = visits;
            levels.starts[packet] = if starts { 1.0 } else { 0.0 };

            let arriving_e = Lanes::load(simd, &charge_e[row]);
            let mut crest = zero;
            if starts {
                // Into empty traps, of no more than it has.
                let most = arriving_e.max(zero) * (1.0 / self.density_all);
                crest = self.cloud.heights(simd, arriving_e).min(most);
            }
            let left_e = crest * self.density_all;
            let mut released = Summed::none(simd);
            for s in self.species() {
                let out = stored[s] * self.release[s];
                stored[s] = stored[s] - out;
                released = released + out;
            }
            let passing_e = match known {
                Some(path) => arriving_e + Lanes::load(simd, &path.mean_e[row]),
                None => arriving_e - left_e,
            };
            let present_e = passing_e + released.once * per_visit;
            let mut height = if visits > 0.0 { self.cloud.heights(simd, present_e) } else { crest };
            let most_e = height * self.density_all;
            // A packet cannot give more than it has.
            let lacks = present_e.below(most_e) & zero.below(most_e);
            let short = visits > 0.0 && lacks.any();
            if short {
                levels.keep(&stored);
            }
            let mut captured = Summed::over(most_e, visits);
            for s in self.species() {
                stored[s] = stored[s] + Summed::over(height * self.density[s], visits);
            }
            let able = lacks.select(zero, one);
            let doubtful_e = crests.pass(simd, self, height, able, &mut stored, &mut captured);
            doubtful_e.store(&mut found.doubtful_e[row]);
            // Down the stack: the levels that some lane meets, one after another.
            let mut reached = zero;
            let mut reached_into = Reached::new(simd, most_e);
            // In the pixels of the level reached into.
            let (mut height_there, mut height_there_is_known) = (height, false);
            let mut stands_before = Lanes::all(simd, before as f64);
            let mut level = before;
            while level != NONE {
                let place = Lanes::all(simd, level as f64);
                let here = stands_before.equals(place);
                let top = Lanes::load(simd, &levels.height[level]);
                let under = Lanes::load(simd, &levels.below[level]);
                let (visits_there, pixels_there) = (levels.visits[level], levels.visits[level] + levels.starts[level]);
                let m = packet - level;
                let mut own = height;
                let mut floor = reached;
                if let Some(path) = known {
                    floor = Lanes::load(simd, &levels.floor[level]);
                    if pixels_there < visits {
                        if !height_there_is_known {
                            let further_e = Lanes::load(simd, &path.further_e[row]);
                            height_there = self.cloud.heights(simd, present_e + further_e);
                            height_there_is_known = true;
                        }
                        own = height_there;
                    }
                }
                let covered = top.at_most(height);
                let ceiling = covered.select(top, own.min(top));
                let filled = here.select(ceiling - floor, zero);
                let mut filled_all = Summed::over(filled, visits_there);
                if levels.starts[level] > 0.0 {
                    let top = Lanes::load(simd, &levels.crest[level]);
                    let filled = here.select(covered.select(height, own).min(top) - floor, zero);
                    filled_all = filled_all + Summed::at(filled, visits_there);
                    let stands = here & covered & height.below(top);
                    if stands.any() {
                        let thickness = stands.select(top - height, zero) * able;
                        crests.leave(simd, self, thickness, height, (m, visits_there));
                    }
                }
                captured = captured - filled_all * self.left_all[m];
                for s in self.species() {
                    stored[s] = stored[s] - filled_all * self.left[m][s];
                }
                if SEEK {
                    let out = self.out_all[m];
                    let out_e = covered.select(filled, zero) * out;
                    reached_into.fills(filled * self.left_all[m]);
                    reached_into.covers(out_e, (filled_all.all() * out).only(simd, covered));
                    reached_into.ends(simd, here & height.below(top), pixels_there);
                }
                if KNOWN {
                    if short {
                        levels.moved.push((level, levels.floor[level]));
                    }
                    here.select(ceiling, floor).store(&mut levels.floor[level]);
                }
                reached = here.select(ceiling, reached);
                // Lanes that stop here keep the place with the other sign.
                stands_before = here.select(covered.select(under, zero - place), stands_before);
                let go_on = zero.below(stands_before).any();
                level = if go_on { stands_before.largest() as usize } else { NONE };
            }
            let mut below = stands_before.abs();
            let mut met = below;
            if let Some(path) = &mut sought {
                let further_e = reached_into.further(simd, released.all(), captured.all(), per_visit);
                further_e.store(&mut path.further_e[row]);
            }
            let has_e = (present_e * visits).max(zero);
            let spent = has_e.below(captured.once);
            if short && spent.any() {
                let mut passed = Passed {
                    height: height.row(),
                    captured_e: captured.once.row(),
                    below: below.row(),
                    met: met.row(),
                };
                let [mut once, mut twice] = [[[0.0; LANES]; S]; 2];
                for s in self.species() {
                    stored[s].once.store(&mut once[s]);
                    stored[s].twice.store(&mut twice[s]);
                }
                let short = Short { row, before, visits, present_e: present_e.row(), has_e: has_e.row() };
                self.spend(short, (&mut once, &mut twice), known, levels, &mut passed);
                for s in self.species() {
                    stored[s] = Summed { once: Lanes::load(simd, &once[s]), twice: Lanes::load(simd, &twice[s]) };
                }
                height = Lanes::load(simd, &passed.height);
                below = Lanes::load(simd, &passed.below);
                met = Lanes::load(simd, &passed.met);
                captured.once = Lanes::load(simd, &passed.captured_e);
                captured.twice = spent.select(captured.once * (ahead(visits) * per_visit), captured.twice);
                if let Some(path) = &mut sought {
                    let further_e = Lanes::load(simd, &path.further_e[row]);
                    spent.select(zero, further_e).store(&mut path.further_e[row]);
                }
            }
            if starts {
                for s in self.species() {
                    stored[s] = stored[s] + Summed::at(crest * self.density[s], visits);
                }
            }
            height.store(&mut levels.height[packet]);
            crest.store(&mut levels.crest[packet]);
            below.store(&mut levels.below[packet]);
            if KNOWN {
                levels.floor[packet] = [0.0; LANES];
            }
            let changed = released - captured;
            if let Some(path) = &mut sought {
                (changed.twice * per_visit - left_e).store(&mut path.mean_e[row]);
            }
            changed.once.store(&mut found.drift_e[row]);
            (changed.once - left_e).store(&mut found.change_e[row]);
            met.store(&mut found.meets[row]);
        }
    }

    /// Levels as the background has left them.
    fn start(&self, first: usize, rows: usize, block: Block, downstream: &Lead, levels: &mut Levels<S>) {
        levels.height.resize(rows + PACKETS, [0.0; LANES]);
        levels.crest.resize(rows + PACKETS, [0.0; LANES]);
        levels.floor.resize(rows + PACKETS, [0.0; LANES]);
        levels.below.resize(rows + PACKETS, [NOWHERE; LANES]);
        levels.visits.resize(rows + PACKETS, 0.0);
        levels.starts.resize(rows + PACKETS, 0.0);
        let visits = block.visits(-1, downstream) as f64;
        let mut height = [0.0; LANES];
        for (lane, charge_e) in downstream.charge_e.into_iter().enumerate().filter(|_| visits > 0.0) {
            // Mostly they are all the same.
            let known = lane > 0 && charge_e == downstream.charge_e[lane - 1];
            height[lane] = if known { height[lane - 1] } else { self.cloud.height(charge_e) };
        }
        // Where the first packets do not come by, neither does the background.
        debug_assert!(first == 0 || visits == 0.0);
        for (place, height, visits) in [(NONE, [f64::INFINITY; LANES], 0.0), (BACKGROUND, height, visits)] {
            levels.height[place] = height;
            levels.crest[place] = height;
            levels.starts[place] = 0.0;
            levels.floor[place] = [0.0; LANES];
            levels.below[place] = [NOWHERE; LANES];
            levels.visits[place] = visits;
        }
        for s in self.species() {
            levels.stored[s] = height.map(|height| visits * height * self.density[s]);
            levels.stored_ahead[s] = height.map(|height| ahead(visits) * height * self.density[s]);
        }
    }
}

/// Added to the place of the last level met by a packet that is spent.
const SPENT: f64 = 0.25;

impl<const S: usize> Passage for Pixel<S> {
    type Levels = Levels<S>;

    // Not part of the caller: this is most of the program's work, and once for each kind of processor is enough.
    #[inline(never)]
    fn pass(
        &self,
        charge_e: &[Row],
        way: Way,
        block: Block,
        downstream: &Lead,
        levels: &mut Levels<S>,
        found: &mut Stage,
    ) {
        dispatch!(Level::new(), simd => match way {
            Way::Unknown => self.pass_by::<_, false, false>(simd, charge_e, way, block, downstream, levels, found),
            Way::Sought(_) => self.pass_by::<_, true, false>(simd, charge_e, way, block, downstream, levels, found),
            Way::Known(_) => self.pass_by::<_, false, true>(simd, charge_e, way, block, downstream, levels, found),
        });
    }

    fn density(&self) -> f64 {
        self.density_all
    }

    fn cloud(&self) -> &Cloud {
        &self.cloud
    }

    fn alike_below(&self, _: &Lead) -> i64 {
        // Pixels differ in known ways: see the module.
        i64::MAX
    }
}
