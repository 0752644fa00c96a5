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
//! | symbol | here | unit | meaning |
//! |---|---|---|---|
//! | ρ | `density` | per pixel | traps of a species |
//! | exp(−1/τ) | `keep` | 1 | chance to stay filled while one packet passes |
//! | ρ exp(−m/τ) | `left[m]` | per pixel | still filled m packets later |

use super::{Cloud, Downstream, Trap};

/// The traps of one pixel, tabulated for `S` species (padded with species of no density).
pub(super) struct Pixel<const S: usize> {
    cloud: Cloud,
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
    pub first_e: &'a [f64],
    /// Change per transfer otherwise, e-.
    pub drift_e: &'a [f64],
}

/// Traps between the next level below and `height`, last filled by one packet.
#[derive(Clone, Copy)]
pub(super) struct Level {
    height: f64,
    /// Height of the level below, in the pixels of this one.
    floor: f64,
    /// Row of that packet, plus one.
    packet: usize,
    /// Pixels of the block in which the level exists.
    visits: f64,
}

/// What a pixel does to the packets that pass it.
pub(super) trait Passage: Sync {
    /// State of the traps, to be reused from pass to pass.
    type Levels: Default + Send;

    /// Change of every packet's charge (e-) by a passage through the block, all charges held at `charge_e`.
    ///
    /// Exact for one pixel, and for a block to first order in the change. What packets lose, the traps hold.
    ///
    /// Packets that start within the block are in different pixels at the same share of their ways. Where `charge_e` are
    /// the charges' means over their ways, `path` tells how each differs from that in the pixels of an earlier packet, and
    /// makes the pass right to second order.
    ///
    /// `found` has the length of `charge_e` and is overwritten.
    fn pass(
        &self,
        charge_e: &[f64],
        path: Option<Path>,
        block: Block,
        downstream: Downstream,
        levels: &mut Self::Levels,
        found: &mut Stage,
    );

    /// What a packet fills into a pixel whose traps are all empty, at most, e-.
    fn fill(&self, charge_e: f64) -> f64;

    /// Largest change of the charges captured in a pixel with the charges of packets between two (e-): a Lipschitz
    /// constant of the pass, per pixel.
    fn steepest(&self, low_e: f64, high_e: f64) -> f64;

    /// Distance from the register (pixels) below which blocks may be passed in one step; beyond it pixels are too unlike
    /// one another.
    fn alike_below(&self, downstream: Downstream) -> i64;
}

/// Buffers that passes and steps reuse.
#[derive(Default)]
pub(super) struct Workspace<L> {
    pub levels: L,
    pub stages: [Stage; 4],
    pub stage_e: Vec<f64>,
}

/// What one pass finds.
#[derive(Default)]
pub(super) struct Stage {
    /// Change of every packet, e-.
    pub change_e: Vec<f64>,
    /// Which earlier packets' levels each packet met. While these stay the same, the change is a smooth function of the
    /// charges; where they differ from one pass to another, it has a kink in between.
    pub meets: Vec<u64>,
}

impl Stage {
    pub fn resize(&mut self, rows: usize) {
        self.change_e.resize(rows, 0.0);
        self.meets.resize(rows, 0);
    }
}

impl<const S: usize> Pixel<S> {
    /// Tables for columns of `rows` packets.
    pub fn new(traps: &[Trap], cloud: Cloud, rows: usize) -> Pixel<S> {
        let mut density = [0.0; S];
        let mut release = [0.0; S];
        for (s, trap) in traps.iter().enumerate() {
            density[s] = trap.density_per_px;
            release[s] = -(-1.0 / trap.release_transfers).exp_m1();
        }
        let left: Vec<[f64; S]> = (0..=rows)
            .map(|m| {
                let mut left = [0.0; S];
                for (s, trap) in traps.iter().enumerate() {
                    // ρ exp(−m/τ); 0/0 where a trap releases at once and nothing has passed yet
                    let kept = if m == 0 { 1.0 } else { (-(m as f64) / trap.release_transfers).exp() };
                    left[s] = trap.density_per_px * kept;
                }
                left
            })
            .collect();
        let left_all = left.iter().map(|left| left.iter().sum()).collect();
        Pixel { cloud, density, density_all: density.iter().sum(), release, left, left_all }
    }
}

impl<const S: usize> Passage for Pixel<S> {
    type Levels = Vec<Level>;

    fn fill(&self, charge_e: f64) -> f64 {
        (self.density_all * self.cloud.height(charge_e)).min(charge_e.max(0.0))
    }

    fn steepest(&self, low_e: f64, high_e: f64) -> f64 {
        self.density_all * self.cloud.steepest(low_e, high_e)
    }

    fn alike_below(&self, _: Downstream) -> i64 {
        // Pixels differ in known ways: see the module.
        i64::MAX
    }

    #[allow(clippy::needless_range_loop)] // species index several arrays at once
    fn pass(
        &self,
        charge_e: &[f64],
        path: Option<Path>,
        block: Block,
        downstream: Downstream,
        levels: &mut Vec<Level>,
        found: &mut Stage,
    ) {
        let Stage { change_e, meets } = found;
        // Electrons in the traps of all the block's pixels, by species.
        let mut stored = [0.0; S];
        levels.clear();
        let visited_before = block.visits(-1, downstream) as f64;
        let height_before = self.cloud.height(downstream.charge_e);
        if visited_before > 0.0 && height_before > 0.0 {
            levels.push(Level { height: height_before, floor: 0.0, packet: 0, visits: visited_before });
            for s in 0..S {
                stored[s] = visited_before * height_before * self.density[s];
            }
        }

        // Rows that start nearer to the register than the block never pass it.
        let first = (block.nearest - downstream.rows).clamp(0, charge_e.len() as i64) as usize;
        change_e[..first].fill(0.0);
        meets[..first].fill(0);
        let mut per_visit = f64::NAN;
        let mut visits = 0.0;
        for row in first..charge_e.len() {
            // The same for all rows beyond the block.
            if visits < block.pixels as f64 {
                visits = block.visits(row as i64, downstream) as f64;
                per_visit = 1.0 / visits;
            }
            let mut released = 0.0;
            for s in 0..S {
                let out = stored[s] * self.release[s];
                stored[s] -= out;
                released += out;
            }
            let present = charge_e[row] + released * per_visit;
            let mut height = self.cloud.height(present);
            let mut met = 0_u64;
            if height <= 0.0 {
                change_e[row] = released;
                meets[row] = met;
                continue;
            }

            // A packet cannot give more than it has: traps are then filled from the bottom until it is spent.
            let available = present * visits;
            let mut captured = 0.0;
            let mut reached = 0.0;
            loop {
                let Some(level) = levels.last_mut() else {
                    // Above all levels every trap is empty.
                    let per_height = visits * self.density_all;
                    let spent = captured + per_height * (height - reached) > available;
                    if spent {
                        height = reached + (available - captured) / per_height;
                    }
                    for s in 0..S {
                        stored[s] += (height - reached) * visits * self.density[s];
                    }
                    captured += per_height * (height - reached);
                    met = mixed(met, 0, spent);
                    break;
                };
                let m = row + 1 - level.packet;
                let covered = level.height <= height;
                let ceiling = if covered { level.height } else { height };
                // In the pixels of the level the packet is further on its way than on average.
                let level_ceiling = match path {
                    Some(path) if !covered && level.visits < visits => {
                        let further = 0.5 * (visits - level.visits) * path.drift_e[row] - path.first_e[row] * per_visit;
                        self.cloud.height(present + further).min(level.height)
                    }
                    _ => ceiling,
                };
                let mut thickness = ceiling - reached;
                let mut filled = level.visits * (level_ceiling - level.floor);
                let mut more = visits * self.density_all * thickness - self.left_all[m] * filled;
                let spent = captured + more > available;
                if spent {
                    let share = (available - captured) / more;
                    thickness *= share;
                    filled *= share;
                    more *= share;
                    height = reached + thickness;
                }
                for s in 0..S {
                    stored[s] += visits * self.density[s] * thickness - self.left[m][s] * filled;
                }
                captured += more;
                reached = ceiling;
                met = mixed(met, level.packet + 1, spent);
                if covered && !spent {
                    levels.pop();
                } else {
                    level.floor = if spent { height } else { level_ceiling };
                    break;
                }
            }
            levels.push(Level { height, floor: 0.0, packet: row + 1, visits });
            change_e[row] = released - captured;
            meets[row] = met;
        }
    }
}

/// Adds a level to what a packet has met.
fn mixed(met: u64, level: usize, spent: bool) -> u64 {
    // Any large odd number spreads the rows over 64 bits.
    (met.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ level as u64) << 1 | u64::from(spent)
}
