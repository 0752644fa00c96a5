//! Packets pass a block of pixels: what goes in, what comes out, and who can do it.

use std::ops::Range;

use super::Cloud;
use super::block_path::BlockPath;
use super::simd::{LANES, Packets};

/// What lies between row 0 and the register (see [`super::Downstream`]), in columns side by side.
pub(super) struct Lead {
    pub rows: i64,
    /// Charge of its packets, e-.
    pub charge_e: Packets,
    /// Pixels to pass: those that have traps.
    pub pixels: Range<i64>,
}

/// A run of pixels: those from `nearest` (pixels from the register) up to `nearest + pixels`.
#[derive(Clone, Copy)]
pub(super) struct Block {
    pub nearest: i64,
    pub pixels: i64,
}

impl Block {
    /// How many of the block's pixels the packet of row `row` passes; row −1 is the last one downstream.
    pub fn visits(self, row: i64, downstream: &Lead) -> i64 {
        (row + 1 + downstream.rows - self.nearest).clamp(0, self.pixels)
    }

    /// Whether the pixel that a row starts in is one of the block's, and how many others of them it passes.
    pub fn passage_of(self, row: i64, downstream: &Lead) -> (bool, f64) {
        let starts = (self.nearest..self.nearest + self.pixels).contains(&(row + downstream.rows));
        (starts, (self.visits(row, downstream) - i64::from(starts)) as f64)
    }
}

/// What a pixel does to the packets that pass it, in columns side by side.
pub(super) trait Passage: Sync {
    /// State of the traps, to be reused from pass to pass.
    type Watermarks: Default + Send;

    /// Change of every packet's charge (e-) by a passage through the block, all charges held fixed.
    ///
    /// `charge_e` is the charge on arrival. Exact for one pixel; for a block, to first order in the change, and to second order
    /// if the path is known. What packets lose, the traps hold.
    ///
    /// `found` has the length of `charge_e` and is overwritten.
    fn pass(
        &self,
        charge_e: &[Packets],
        path: BlockPath,
        block: Block,
        downstream: &Lead,
        watermarks: &mut Self::Watermarks,
        found: &mut Stage,
    );

    /// Traps of the pixel.
    fn density(&self) -> f64;

    /// How high packets reach, among the traps of each kind.
    fn clouds(&self) -> &[Cloud];

    /// Whether a pass can find the path of packets that start within a block, and follow a known one ([`BlockPath`]); otherwise such blocks
    /// are advanced to first order only.
    fn knows_paths(&self) -> bool;

    /// The pixels that are so much like one, which is one of them, that they may be passed in one step.
    fn alike_pixels(&self, pixel: i64, downstream: &Lead) -> Range<i64>;
}

/// What one pass finds.
pub(super) struct Stage {
    /// Change of every packet, e-.
    pub change_e: Vec<Packets>,
    /// The same without what it leaves in the empty pixel that it starts in, which is known exactly, e-.
    pub drift_e: Vec<Packets>,
    /// What it took of watermarks at home (see [`super::home_watermarks`]) that it did not cover, e-: they are known on average only.
    pub doubtful_e: Vec<Packets>,
    /// At which earlier packet's watermark each packet ended, as a number. While these stay the same, the change is a smooth
    /// function of the charges; if they differ from one pass to another, it has a kink in between.
    pub meets: Vec<Packets>,
}

impl Stage {
    /// For columns of `rows` packets.
    pub fn new(rows: usize) -> Stage {
        Stage {
            change_e: vec![[0.0; LANES]; rows],
            drift_e: vec![[0.0; LANES]; rows],
            doubtful_e: vec![[0.0; LANES]; rows],
            meets: vec![[0.0; LANES]; rows],
        }
    }

    /// For columns of another number of packets.
    pub fn resize(&mut self, rows: usize) {
        for part in [&mut self.change_e, &mut self.drift_e, &mut self.doubtful_e, &mut self.meets] {
            part.resize(rows, [0.0; LANES]);
        }
    }

    /// Rows that do not pass the block.
    pub fn absent(&mut self, rows: usize) {
        for part in [&mut self.change_e, &mut self.drift_e, &mut self.doubtful_e, &mut self.meets] {
            part[..rows].fill([0.0; LANES]);
        }
    }
}
