//! Effect of the traps of a pixel if species have different clouds: traps of another origin or position fill with another power of
//! the charge, and traps at the surface only if a packet exceeds a level.
//!
//! Every cloud has its own stack of watermarks (see [`super::pixel`]). Charge released from all of them joins the one packet, whose
//! charge then gives the height of each cloud. A packet with less charge than the traps in its reach would capture fills every
//! cloud up to the same share of its height: with one cloud, from the bottom.
//!
//! Pixels that all packets pass are equal and count as one; those of the image are computed one by one.

use std::ops::Range;

use super::block_path::BlockPath;
use super::encounter::Encounter;
use super::passage::{Block, Lead, Passage, Stage};
use super::simd::{LANES, Packets};
use super::{Cloud, Trap};

/// The traps of one pixel.
pub(super) struct SeveralClouds {
    clouds: Vec<Cloud>,
    /// The index of the cloud of each species.
    cloud_of: Vec<usize>,
    /// Fraction of each species released to a packet before it captures, and after that.
    released: Vec<f64>,
    returned: Vec<f64>,
    /// ρ exp(−m/τ) of each species, m packets after they were filled.
    left: Vec<Vec<f64>>,
}

/// Watermarks of every cloud, and electrons in the traps of every species.
#[derive(Clone, Default)]
pub(super) struct Stacks {
    watermarks: Vec<Vec<Watermark<usize>>>,
    stored_e: Vec<f64>,
}

/// Traps between the next watermark below and `height`, last filled by one packet: here its row plus one; 0 for the background.
#[derive(Clone, Copy)]
pub(super) struct Watermark<T> {
    pub height: f64,
    pub filled: T,
}

/// The distinct clouds of some species, and for each species the index of its cloud.
pub(super) fn clouds_of(traps: &[Trap], cloud: &Cloud) -> (Vec<Cloud>, Vec<usize>) {
    let mut clouds: Vec<Cloud> = Vec::new();
    let mut of = |trap: &Trap| {
        let own = trap.own_cloud(cloud);
        clouds.iter().position(|known| *known == own).unwrap_or_else(|| {
            clouds.push(own);
            clouds.len() - 1
        })
    };
    let places = traps.iter().map(&mut of).collect();
    (clouds, places)
}

impl SeveralClouds {
    /// Tables for columns of `rows` packets.
    pub fn new(traps: &[Trap], (clouds, cloud_of): (Vec<Cloud>, Vec<usize>), rows: usize) -> SeveralClouds {
        let after = |m: usize| {
            let left = |trap: &Trap| trap.density_per_px * (-(m as f64) / trap.release_transfers).exp();
            traps.iter().map(left).collect()
        };
        let released = traps.iter().map(Trap::released).collect();
        let returned = traps.iter().map(Trap::returned).collect();
        SeveralClouds { clouds, cloud_of, released, returned, left: (0..=rows + 1).map(after).collect() }
    }

    /// Traps as left by a background (e-) that has passed, or empty if there was none.
    pub fn start(&self, background_e: Option<f64>, stacks: &mut Stacks) {
        stacks.watermarks.resize_with(self.clouds.len(), Vec::new);
        let heights: Vec<f64> =
            self.clouds.iter().map(|cloud| background_e.map_or(0.0, |charge_e| cloud.height(charge_e))).collect();
        for (watermarks, height) in stacks.watermarks.iter_mut().zip(&heights) {
            watermarks.clear();
            watermarks.push(Watermark { height: *height, filled: 0 });
        }
        stacks.stored_e.clear();
        let held = |s: usize| heights[self.cloud_of[s]] * self.left[0][s] * (1.0 - self.returned[s]);
        stacks.stored_e.extend((0..self.cloud_of.len()).map(held));
    }

    /// Passes the packet of a row; returns its change (e-), and the watermarks it met as one number.
    pub fn packet(&self, stacks: &mut Stacks, charge_e: f64, row: usize) -> (f64, f64) {
        let mut present_e = charge_e;
        for (stored_e, released) in stacks.stored_e.iter_mut().zip(&self.released) {
            let out_e = *stored_e * released;
            *stored_e -= out_e;
            present_e += out_e;
        }
        let heights: Vec<f64> = self.clouds.iter().map(|cloud| cloud.height(present_e)).collect();
        let wanted_e = self.wanted_e(stacks, &heights, row);
        // A packet cannot give more charge than it has.
        let spent = wanted_e > present_e;
        let at = |heights: &[f64]| self.wanted_e(stacks, heights, row);
        let share = if spent { share(&stacks.watermarks, &heights, present_e.max(0.0), at) } else { 1.0 };
        let mut met = Encounter::default().and(u64::from(spent));
        let Stacks { watermarks, stored_e } = stacks;
        for (cloud, (watermarks, height)) in watermarks.iter_mut().zip(&heights).enumerate() {
            let height = share * height;
            layers(watermarks, height, |thickness, packet| {
                for s in (0..stored_e.len()).filter(|s| self.cloud_of[*s] == cloud) {
                    stored_e[s] += thickness * self.empty(s, row, packet);
                }
            });
            while watermarks.last().is_some_and(|watermark| watermark.height <= height) {
                watermarks.pop();
            }
            met = met.and(watermarks.last().map_or(0, |watermark| watermark.filled as u64 + 1));
            watermarks.push(Watermark { height, filled: row + 1 });
        }
        let taken_e = if spent { present_e.max(0.0) } else { wanted_e };
        let mut left_e = present_e - taken_e;
        for (stored_e, returned) in stored_e.iter_mut().zip(&self.returned) {
            let back_e = *stored_e * returned;
            *stored_e -= back_e;
            left_e += back_e;
        }
        (left_e - charge_e, met.number())
    }

    /// Empty traps of a species, per pixel, where they were last filled by a given packet, or never.
    fn empty(&self, species: usize, row: usize, packet: Option<usize>) -> f64 {
        self.left[0][species] - packet.map_or(0.0, |packet| self.left[row + 1 - packet][species])
    }

    /// Charge that the empty traps below some heights would capture, e-.
    fn wanted_e(&self, stacks: &Stacks, heights: &[f64], row: usize) -> f64 {
        let mut wanted_e = 0.0;
        for (cloud, (watermarks, height)) in stacks.watermarks.iter().zip(heights).enumerate() {
            layers(watermarks, *height, |thickness, packet| {
                let species = (0..self.cloud_of.len()).filter(|s| self.cloud_of[*s] == cloud);
                wanted_e += thickness * species.map(|s| self.empty(s, row, packet)).sum::<f64>();
            });
        }
        wanted_e
    }
}

/// The share of their heights up to which clouds capture a given charge (e-): linear between watermarks. `wanted_e` is the charge
/// captured up to given heights.
pub(super) fn share<T>(
    watermarks: &[Vec<Watermark<T>>],
    heights: &[f64],
    available_e: f64,
    wanted_e: impl Fn(&[f64]) -> f64,
) -> f64 {
    let at = |share: f64| {
        let heights: Vec<f64> = heights.iter().map(|height| share * height).collect();
        wanted_e(&heights)
    };
    let places = watermarks.iter().zip(heights);
    let mut shares: Vec<f64> = places
        .flat_map(|(watermarks, height)| watermarks.iter().map(move |watermark| watermark.height / height))
        .filter(|share| *share > 0.0 && *share < 1.0)
        .chain([1.0])
        .collect();
    shares.sort_by(f64::total_cmp);
    let mut below = (0.0, 0.0);
    for share in shares {
        let wanted_e = at(share);
        if wanted_e > available_e {
            return below.0 + (share - below.0) * (available_e - below.1) / (wanted_e - below.1);
        }
        below = (share, wanted_e);
    }
    1.0
}

/// The layers of traps below a height, from the bottom up: their thickness and what filled them last, if anything did.
pub(super) fn layers<T: Copy>(watermarks: &[Watermark<T>], height: f64, mut layer: impl FnMut(f64, Option<T>)) {
    let mut reached = 0.0;
    for watermark in watermarks.iter().rev() {
        let top = watermark.height.min(height);
        layer(top - reached, Some(watermark.filled));
        reached = top;
        if watermark.height > height {
            return;
        }
    }
    layer(height - reached, None);
}

impl Passage for SeveralClouds {
    type Watermarks = Stacks;

    fn pass(
        &self,
        charge_e: &[Packets],
        _: BlockPath,
        block: Block,
        downstream: &Lead,
        stacks: &mut Stacks,
        found: &mut Stage,
    ) {
        let Stage { change_e, drift_e, doubtful_e, meets } = found;
        for part in [&mut *change_e, &mut *meets, &mut *doubtful_e] {
            part.fill([0.0; LANES]);
        }
        for lane in 0..LANES {
            // Lanes without a column of their own repeat the last one.
            let repeats = |row: &Packets| lane > 0 && row[lane] == row[lane - 1];
            if charge_e.iter().chain([&downstream.charge_e]).all(repeats) {
                change_e.iter_mut().chain(meets.iter_mut()).for_each(|row| row[lane] = row[lane - 1]);
                continue;
            }
            let mut nearest = block.nearest;
            let end = block.nearest + block.pixels;
            while nearest < end {
                let pixels = self.alike_pixels(nearest, downstream).end.min(end) - nearest;
                self.start((nearest < downstream.rows).then_some(downstream.charge_e[lane]), stacks);
                let first = (nearest - downstream.rows).clamp(0, charge_e.len() as i64) as usize;
                for row in first..charge_e.len() {
                    let (change, met) = self.packet(stacks, charge_e[row][lane], row);
                    change_e[row][lane] += pixels as f64 * change;
                    meets[row][lane] += met;
                }
                nearest += pixels;
            }
        }
        drift_e.copy_from_slice(change_e);
    }

    fn density(&self) -> f64 {
        self.left[0].iter().sum()
    }

    fn clouds(&self) -> &[Cloud] {
        &self.clouds
    }

    fn knows_paths(&self) -> bool {
        false
    }

    fn alike_pixels(&self, pixel: i64, downstream: &Lead) -> Range<i64> {
        if pixel < downstream.rows { i64::MIN..downstream.rows } else { pixel..pixel + 1 }
    }
}
