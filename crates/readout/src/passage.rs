//! Packets pass a block of pixels: input, output, and the interface for it.

use std::ops::Range;

use super::Cloud;
use super::block_path::BlockPath;
use super::simd::{LANES, Packets};

/// What lies between row 0 and the register (see [`super::Downstream`]), for several columns.
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
    /// Number of the block's pixels that the packet of row `row` passes; row −1 is the last one downstream.
    pub fn visits(self, row: i64, downstream: &Lead) -> i64 {
        (row + 1 + downstream.rows - self.nearest).clamp(0, self.pixels)
    }

    /// Whether the pixel in which a row starts is in the block, and how many other pixels of the block it passes.
    pub fn passage_of(self, row: i64, downstream: &Lead) -> (bool, f64) {
        let starts = (self.nearest..self.nearest + self.pixels).contains(&(row + downstream.rows));
        (starts, (self.visits(row, downstream) - i64::from(starts)) as f64)
    }
}

/// Effect of a pixel on the packets that pass it, for several columns.
pub(super) trait Passage: Sync {
    /// State of the traps, reused from pass to pass.
    type Watermarks: Default + Send;

    /// Change of every packet's charge (e-) over the block, all charges held fixed.
    ///
    /// `charge_e` is the charge on arrival. Exact for one pixel; for a block, to first order in the change, and to second order if
    /// the path is known. The charge that packets lose is held by the traps.
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

    /// The clouds of the packets, one for each kind of trap.
    fn clouds(&self) -> &[Cloud];

    /// Whether a pass can compute the path of packets that start within a block, and use a known one ([`BlockPath`]); otherwise
    /// such blocks are advanced to first order only.
    fn knows_paths(&self) -> bool;

    /// The pixels around `pixel` that are so similar to it that they may be passed in one step.
    fn alike_pixels(&self, pixel: i64, downstream: &Lead) -> Range<i64>;
}

/// The results of one pass.
pub(super) struct Stage {
    /// Change of every packet, e-.
    pub change_e: Vec<Packets>,
    /// The same without the charge left in the empty pixel that it starts in, which is known exactly, e-.
    pub drift_e: Vec<Packets>,
    /// Charge taken from home watermarks (see [`super::home_watermarks`]) that it did not cover, e-: known only on average.
    pub doubtful_e: Vec<Packets>,
    /// The earlier packet at whose watermark each packet ended, as a number. While these stay the same, the change is a smooth
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

    /// For columns of a different number of packets.
    pub fn resize(&mut self, rows: usize) {
        for part in [&mut self.change_e, &mut self.drift_e, &mut self.doubtful_e, &mut self.meets] {
            part.resize(rows, [0.0; LANES]);
        }
    }

    /// For rows that do not pass the block.
    pub fn absent(&mut self, rows: usize) {
        for part in [&mut self.change_e, &mut self.drift_e, &mut self.doubtful_e, &mut self.meets] {
            part[..rows].fill([0.0; LANES]);
        }
    }
}
