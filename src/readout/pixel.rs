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
//! a later one. So each level carries the number of its pixels, and captures and releases are weighted with it.
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

use super::lanes::{LANES, Lanes, Row};
use super::{Cloud, Downstream, Trap};

/// The traps of one pixel, tabulated for `S` species (padded with species of no density).
pub(super) struct Pixel<const S: usize> {
    cloud: Cloud,
    species: usize,
    density: [f64; S],
    density_all: f64,
    /// 1 − exp(−1/τ), the fraction released while a packet passes.
    release: [f64; S],
    left: Vec<[f64; S]>,
    left_all: Vec<f64>,
}

/// A run of pixels: those from `nearest` (pixels from the register) up to `nearest + pixels`.
#[derive(Clone, Copy)]
pub(super) struct Block {
    pub nearest: i64,
    pub pixels: i64,
}

impl Block {
    /// How many of the block's pixels the packet of row `row` passes; row −1 is the last one downstream.
    pub fn visits(self, row: i64, downstream: Downstream) -> i64 {
        (row + 1 + downstream.rows - self.nearest).clamp(0, self.pixels)
    }
}

/// How packets change on their way through a block: n − first + i drift after i ≥ 1 transfers.
#[derive(Clone, Copy)]
pub(super) struct Path<'a> {
    /// What the packet fills into the empty traps of the pixel it starts in, e-; 0 where that lies outside the block.
    pub first_e: &'a [Row],
    /// Change per transfer otherwise, e-.
    pub drift_e: &'a [Row],
}

/// What a pixel does to the packets that pass it, in columns side by side.
pub(super) trait Passage: Sync {
    /// State of the traps, to be reused from pass to pass.
    type Levels: Default + Send;

    /// Change of every packet's charge (e-) by a passage through the block, all charges held at `charge_e`.
    ///
    /// Exact for one pixel, and for a block to first order in the change. What packets lose, the traps hold. Where `charge_e` are
    /// the charges' means over their ways, `path` tells how each differs from that in the pixels of an earlier packet, and
    /// makes the pass right to second order.
    ///
    /// `found` has the length of `charge_e` and is overwritten.
    fn pass(
        &self,
        charge_e: &[Row],
        path: Option<Path>,
        block: Block,
        downstream: Downstream,
        levels: &mut Self::Levels,
        found: &mut Stage,
    );

    /// Traps of the pixel.
    fn density(&self) -> f64;

    /// How high packets reach.
    fn cloud(&self) -> &Cloud;

    /// Distance from the register (pixels) below which blocks may be passed in one step; beyond it pixels are too unlike
    /// one another.
    fn alike_below(&self, downstream: Downstream) -> i64;
}

/// What one pass finds.
pub(super) struct Stage {
    /// Change of every packet, e-.
    pub change_e: Vec<Row>,
    /// At which earlier packet's level each packet ended, as a number. While these stay the same, the change is a smooth
    /// function of the charges; where they differ from one pass to another, it has a kink in between.
    pub meets: Vec<Row>,
}

impl Stage {
    /// For so many rows.
    pub fn new(rows: usize) -> Stage {
        Stage { change_e: vec![[0.0; LANES]; rows], meets: vec![[0.0; LANES]; rows] }
    }
}

/// Levels in the order of the packets that left them: none, the background, and from there on one for each row.
pub(super) struct Levels<const S: usize> {
    /// Height of the packet's cloud.
    height: Vec<Row>,
    /// Height of what has been filled anew since, in the pixels of the level; only where packets have paths.
    floor: Vec<Row>,
    /// The next higher level on the stack below, by its place.
    below: Vec<Row>,
    /// Pixels of the block in which the level exists.
    visits: Vec<f64>,
    /// Electrons in the traps of all the block's pixels, by species.
    stored: [Row; S],
}

impl<const S: usize> Default for Levels<S> {
    fn default() -> Self {
        Levels {
            height: Vec::new(),
            floor: Vec::new(),
            below: Vec::new(),
            visits: Vec::new(),
            stored: [[0.0; LANES]; S],
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

/// One packet that may not have enough for all the traps that it reaches.
struct Climb {
    row: usize,
    lane: usize,
    /// Charge that meets the traps in each pixel, e-.
    present_e: f64,
    visits: f64,
}

/// Species up to which they are held in registers.
pub(super) const FEW: usize = 5;

impl<const S: usize> Pixel<S> {
    /// Species to go through: all places where they are few and known when the program is compiled, else those there are.
    #[inline(always)]
    fn species(&self) -> std::ops::Range<usize> {
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
        Pixel { cloud, species: traps.len(), density, density_all: density.iter().sum(), release, left, left_all }
    }

    /// Fills levels from below until the packet's height is reached, or all it has is spent.
    fn climb(&self, climb: Climb, path: Option<Path>, levels: &mut Levels<S>, passed: &mut Passed) {
        let Climb { row, lane, present_e, visits } = climb;
        let mut height = passed.height[lane];
        let packet = row + PACKETS;
        let mut level = passed.below[lane] as usize;
        let mut reached = 0.0;
        let mut captured_e = 0.0;
        let available_e = (present_e * visits).max(0.0);
        loop {
            let top = levels.height[level][lane];
            let covered = top <= height;
            let ceiling = if covered { top } else { height };
            let mut own_ceiling = ceiling;
            if let Some(path) = path
                && !covered
                && level != NONE
                && levels.visits[level] < visits
            {
                let further_e = further(path, row, lane, visits, levels.visits[level]);
                own_ceiling = self.cloud.height(present_e + further_e).min(top);
            }
            let floor = if path.is_some() { levels.floor[level][lane] } else { reached };
            let mut thickness = ceiling - reached;
            // There is no level above all others.
            let mut filled = if level == NONE { 0.0 } else { levels.visits[level] * (own_ceiling - floor) };
            let m = packet - level;
            let mut more_e = visits * self.density_all * thickness - self.left_all[m] * filled;
            let spent = captured_e + more_e > available_e;
            if spent {
                let share = (available_e - captured_e) / more_e;
                thickness *= share;
                filled *= share;
                more_e *= share;
                height = reached + thickness;
            }
            for s in self.species() {
                levels.stored[s][lane] += visits * self.density[s] * thickness - self.left[m][s] * filled;
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
    fn pass_by<T: Simd, const ON_A_PATH: bool>(
        &self,
        simd: T,
        charge_e: &[Row],
        path: Option<Path>,
        block: Block,
        downstream: Downstream,
        levels: &mut Levels<S>,
        found: &mut Stage,
    ) {
        let path = if ON_A_PATH { path } else { None };
        let rows = charge_e.len();
        // Rows that start nearer to the register than the block never pass it.
        let first = (block.nearest - downstream.rows).clamp(0, rows as i64) as usize;
        found.change_e[..first].fill([0.0; LANES]);
        found.meets[..first].fill([0.0; LANES]);
        self.start(first, rows, block, downstream, levels);
        let zero = Lanes::all(simd, 0.0);
        let mut stored_e = [zero; S];
        for s in self.species() {
            stored_e[s] = Lanes::load(simd, &levels.stored[s]);
        }
        let mut per_visit = f64::NAN;
        let mut visits = 0.0;
        for row in first..rows {
            let packet = row + PACKETS;
            let before = if row == first { BACKGROUND } else { packet - 1 };
            // The same for all rows beyond the block.
            if visits < block.pixels as f64 {
                visits = block.visits(row as i64, downstream) as f64;
                per_visit = 1.0 / visits;
            }
            levels.visits[packet] = visits;
            let mut released_e = zero;
            for s in self.species() {
                let out_e = stored_e[s] * self.release[s];
                stored_e[s] = stored_e[s] - out_e;
                released_e = released_e + out_e;
            }
            let present_e = Lanes::load(simd, &charge_e[row]) + released_e * per_visit;
            let mut height = self.cloud.heights(simd, present_e);
            let most_e = height * self.density_all;
            let mut captured_e = most_e * visits;
            let (below, met);
            // A packet cannot give more than it has.
            if (present_e.below(most_e) & zero.below(most_e)).any() {
                let mut charge_e = [0.0; LANES];
                let mut passed =
                    Passed { height: [0.0; LANES], captured_e: [0.0; LANES], below: [0.0; LANES], met: [0.0; LANES] };
                present_e.store(&mut charge_e);
                height.store(&mut passed.height);
                passed.below = [before as f64; LANES];
                for s in self.species() {
                    stored_e[s].store(&mut levels.stored[s]);
                }
                for lane in 0..LANES {
                    self.climb(Climb { row, lane, present_e: charge_e[lane], visits }, path, levels, &mut passed);
                }
                for s in self.species() {
                    stored_e[s] = Lanes::load(simd, &levels.stored[s]);
                }
                height = Lanes::load(simd, &passed.height);
                captured_e = Lanes::load(simd, &passed.captured_e);
                below = Lanes::load(simd, &passed.below);
                met = Lanes::load(simd, &passed.met);
            } else {
                for s in self.species() {
                    stored_e[s] = stored_e[s] + height * (visits * self.density[s]);
                }
                // Down the stack: the levels that some lane meets, one after another.
                let mut reached = zero;
                let mut stands_before = Lanes::all(simd, before as f64);
                let mut level = before;
                while level != NONE {
                    let place = Lanes::all(simd, level as f64);
                    let here = stands_before.equals(place);
                    let top = Lanes::load(simd, &levels.height[level]);
                    let under = Lanes::load(simd, &levels.below[level]);
                    let visits_there = levels.visits[level];
                    let mut own_ceiling = height;
                    let mut floor = reached;
                    if let Some(path) = path {
                        floor = Lanes::load(simd, &levels.floor[level]);
                        if visits_there < visits {
                            let drift_e = Lanes::load(simd, &path.drift_e[row]) * (0.5 * (visits - visits_there));
                            let first_e = Lanes::load(simd, &path.first_e[row]) * per_visit;
                            own_ceiling = self.cloud.heights(simd, present_e + (drift_e - first_e));
                        }
                    }
                    let covered = top.at_most(height);
                    let ceiling = covered.select(top, own_ceiling.min(top));
                    let filled = here.select((ceiling - floor) * visits_there, zero);
                    captured_e = captured_e - filled * self.left_all[packet - level];
                    for s in self.species() {
                        stored_e[s] = stored_e[s] - filled * self.left[packet - level][s];
                    }
                    if ON_A_PATH {
                        here.select(ceiling, floor).store(&mut levels.floor[level]);
                    }
                    reached = here.select(ceiling, reached);
                    // Lanes that stop here keep the place with the other sign.
                    stands_before = here.select(covered.select(under, zero - place), stands_before);
                    let go_on = zero.below(stands_before).any();
                    level = if go_on { stands_before.largest() as usize } else { NONE };
                }
                below = stands_before.abs();
                met = below;
            }
            height.store(&mut levels.height[packet]);
            below.store(&mut levels.below[packet]);
            if ON_A_PATH {
                levels.floor[packet] = [0.0; LANES];
            }
            (released_e - captured_e).store(&mut found.change_e[row]);
            met.store(&mut found.meets[row]);
        }
    }

    /// Levels as the background has left them.
    fn start(&self, first: usize, rows: usize, block: Block, downstream: Downstream, levels: &mut Levels<S>) {
        levels.height.resize(rows + PACKETS, [0.0; LANES]);
        levels.floor.resize(rows + PACKETS, [0.0; LANES]);
        levels.below.resize(rows + PACKETS, [NOWHERE; LANES]);
        levels.visits.resize(rows + PACKETS, 0.0);
        let visits = block.visits(-1, downstream) as f64;
        let height = if visits > 0.0 { self.cloud.height(downstream.charge_e) } else { 0.0 };
        // Where the first packets do not come by, neither does the background.
        debug_assert!(first == 0 || visits == 0.0);
        for (place, height, visits) in [(NONE, f64::INFINITY, 0.0), (BACKGROUND, height, visits)] {
            levels.height[place] = [height; LANES];
            levels.floor[place] = [0.0; LANES];
            levels.below[place] = [NOWHERE; LANES];
            levels.visits[place] = visits;
        }
        for s in self.species() {
            levels.stored[s] = [visits * height * self.density[s]; LANES];
        }
    }
}

/// What a packet gains until it is in the pixels of a level, on average, which are further on its way than its mean, e-.
fn further(path: Path, row: usize, lane: usize, visits: f64, visits_of_level: f64) -> f64 {
    0.5 * (visits - visits_of_level) * path.drift_e[row][lane] - path.first_e[row][lane] / visits
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
        path: Option<Path>,
        block: Block,
        downstream: Downstream,
        levels: &mut Levels<S>,
        found: &mut Stage,
    ) {
        dispatch!(Level::new(), simd => match path {
            None => self.pass_by::<_, false>(simd, charge_e, path, block, downstream, levels, found),
            Some(_) => self.pass_by::<_, true>(simd, charge_e, path, block, downstream, levels, found),
        });
    }

    fn density(&self) -> f64 {
        self.density_all
    }

    fn cloud(&self) -> &Cloud {
        &self.cloud
    }

    fn alike_below(&self, _: Downstream) -> i64 {
        // Pixels differ in known ways: see the module.
        i64::MAX
    }
}
