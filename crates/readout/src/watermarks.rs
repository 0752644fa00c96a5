//! The stack of watermarks that packets leave in the traps of a block of pixels; see [`super::pixel`].

use fearless_simd::prelude::*;

use super::block_path::{Summed, ahead};
use super::passage::{Block, Lead};
use super::pixel::Pixel;
use super::simd::{Coefficient, LANES, Packets};

/// Index of a watermark that is higher than all and exists nowhere; and the same as stored in links.
pub(super) const NONE: usize = 0;
const NOWHERE: f64 = 0.0;
/// Index of the watermark left by the background downstream.
pub(super) const BACKGROUND: usize = 1;
/// Index of the first packet's watermark.
pub(super) const PACKETS: usize = 2;

/// Watermarks in the order of the packets that left them: none, the background, and then one for each row.
pub(super) struct Watermarks<const S: usize> {
    /// Height of the packet's cloud in the pixels that it passed after its own.
    pub height: Vec<Packets>,
    /// The same in the pixel that it started in.
    pub home_height: Vec<Packets>,
    /// Height up to which the pixels of the watermark have been refilled since; only if the packets' path is known.
    pub floor: Vec<Packets>,
    /// Floors moved by the packets of this row, with their indices, in case some of the packets turn out to be spent.
    pub moved: Vec<(usize, Packets)>,
    /// Index of the next higher watermark below it on the stack.
    pub below: Vec<Packets>,
    /// Pixels of the block in which the watermark exists, without the packet's own.
    pub visits: Vec<f64>,
    /// 1 if the packet's own pixel is in the block, else 0.
    pub starts: Vec<f64>,
    /// Electrons in the traps of all the block's pixels, by species.
    pub stored: [Packets; S],
    /// The same, weighted by the number of pixels of the block ahead of each.
    pub stored_ahead: [Packets; S],
}

impl<const S: usize> Watermarks<S> {
    /// Saves the content of the traps, in case packets turn out to have less charge than they would fill.
    #[inline(always)]
    pub fn keep<T: Simd, const TWICE: bool>(&mut self, stored: &[Summed<T, TWICE>; S]) {
        for (s, stored) in stored.iter().enumerate() {
            stored.once.store(&mut self.stored[s]);
            stored.twice.store(&mut self.stored_ahead[s]);
        }
        self.moved.clear();
    }

    /// Watermarks as the background has left them.
    pub fn start<const RETURNS: bool, C: Coefficient>(
        &mut self,
        pixel: &Pixel<S, RETURNS, C>,
        first: usize,
        rows: usize,
        block: Block,
        downstream: &Lead,
    ) {
        self.height.resize(rows + PACKETS, [0.0; LANES]);
        self.home_height.resize(rows + PACKETS, [0.0; LANES]);
        self.floor.resize(rows + PACKETS, [0.0; LANES]);
        self.below.resize(rows + PACKETS, [NOWHERE; LANES]);
        self.visits.resize(rows + PACKETS, 0.0);
        self.starts.resize(rows + PACKETS, 0.0);
        let visits = block.visits(-1, downstream) as f64;
        let mut height = [0.0; LANES];
        for (lane, charge_e) in downstream.charge_e.into_iter().enumerate().filter(|_| visits > 0.0) {
            // Usually they are all the same.
            let known = lane > 0 && charge_e == downstream.charge_e[lane - 1];
            height[lane] = if known { height[lane - 1] } else { pixel.cloud.height(charge_e) };
        }
        // Pixels that the first packets do not pass are not passed by the background either.
        assert!(first == 0 || visits == 0.0);
        for (place, height, visits) in [(NONE, [f64::INFINITY; LANES], 0.0), (BACKGROUND, height, visits)] {
            self.height[place] = height;
            self.home_height[place] = height;
            self.starts[place] = 0.0;
            self.floor[place] = [0.0; LANES];
            self.below[place] = [NOWHERE; LANES];
            self.visits[place] = visits;
        }
        for s in pixel.species() {
            let held = |lane: usize| pixel.held[s].lane(lane);
            self.stored[s] = std::array::from_fn(|lane| visits * height[lane] * held(lane));
            self.stored_ahead[s] = std::array::from_fn(|lane| ahead(visits) * height[lane] * held(lane));
        }
    }
}

impl<const S: usize> Default for Watermarks<S> {
    fn default() -> Self {
        Watermarks {
            height: Vec::new(),
            home_height: Vec::new(),
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
