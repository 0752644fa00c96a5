//! The paper's fractional traps: every species cut into levels at fixed heights, each filled to a fraction.
//!
//! Rhodes et al. 2010, section 3, which found 10 000 levels to reproduce the mean over many real traps. Used here as a reference
//! for the other methods, close to the text rather than fast: its resolution is 1/levels of the well.

use std::ops::Range;

use super::{Cloud, Downstream, Trap, interrupt};

/// Clocks one column out through traps at the heights (i + ½)/levels.
///
/// The levels are in the middle of their slices: multiples of 1/levels, as in the paper, would shift every cloud by half a level to
/// one side. `clouds`: that of each species.
pub(super) fn column(
    traps: &[Trap],
    clouds: &[&Cloud],
    charge_e: &mut [f64],
    downstream: Downstream,
    pixels: Range<i64>,
    levels: usize,
) {
    let filling = vec![vec![0.0; levels]; traps.len()];
    let mut traps = PixelTraps { traps, clouds, levels, filling, occupied: 0 };
    for pixel in pixels.rev() {
        interrupt::check();
        traps.fill_before(pixel, downstream);
        let first = (pixel - downstream.rows).max(0) as usize;
        for charge in &mut charge_e[first..] {
            traps.release(charge);
            traps.capture(charge);
            traps.release_in_place(charge);
        }
    }
}

/// The traps of one pixel.
struct PixelTraps<'a> {
    traps: &'a [Trap],
    clouds: &'a [&'a Cloud],
    levels: usize,
    /// Filled fraction of each level, by species.
    filling: Vec<Vec<f64>>,
    /// Levels up to the highest cloud so far: no trap above is filled.
    occupied: usize,
}

impl PixelTraps<'_> {
    /// The number of levels below a height.
    fn below(&self, height: f64) -> usize {
        ((height * self.levels as f64 + 0.5).floor() as usize).min(self.levels)
    }

    /// Traps per level of a species.
    fn per_level(&self, species: usize) -> f64 {
        self.traps[species].density_per_px / self.levels as f64
    }

    /// As packets that passed before row 0 leave the pixel.
    fn fill_before(&mut self, pixel: i64, downstream: Downstream) {
        self.occupied = 0;
        for (species, (trap, cloud)) in self.traps.iter().zip(self.clouds).enumerate() {
            let passed = pixel < downstream.rows;
            let filled = if passed { self.below(cloud.height(downstream.charge_e)) } else { 0 };
            let filling = &mut self.filling[species];
            filling.fill(0.0);
            filling[..filled].fill(trap.filled_by(downstream.rows - pixel, cloud, downstream.charge_e));
            self.occupied = self.occupied.max(filled);
        }
    }

    /// Traps release into a packet that arrives; those of finite capture time also capture from it.
    fn release(&mut self, charge_e: &mut f64) {
        let arrived_e = *charge_e;
        for (species, (trap, cloud)) in self.traps.iter().zip(self.clouds).enumerate() {
            let per_level = self.per_level(species);
            if trap.capture_transfers > 0.0 {
                let arrived = self.below(cloud.height(arrived_e));
                self.occupied = self.occupied.max(arrived);
                let (keep, full, approach) = trap.passage_of(cloud, arrived_e);
                for (level, fill) in self.filling[species][..self.occupied].iter_mut().enumerate() {
                    let after = if level < arrived { full + (*fill - full) * approach } else { *fill * keep };
                    // Not more than the packet has.
                    let captured = (per_level * (after - *fill)).min((*charge_e).max(0.0));
                    *charge_e -= captured;
                    *fill += captured / per_level;
                }
                continue;
            }
            let release = trap.released();
            for fill in &mut self.filling[species][..self.occupied] {
                *charge_e += per_level * *fill * release;
                *fill -= *fill * release;
            }
        }
    }

    /// Traps that capture at once fill from the lowest level up, as far as the packet reaches and has charge.
    fn capture(&mut self, charge_e: &mut f64) {
        let reached: Vec<usize> = self.clouds.iter().map(|cloud| self.below(cloud.height(*charge_e))).collect();
        let highest = reached.iter().copied().max().unwrap_or(0);
        self.occupied = self.occupied.max(highest);
        for level in 0..highest {
            for (species, trap) in self.traps.iter().enumerate() {
                if trap.capture_transfers > 0.0 || level >= reached[species] {
                    continue;
                }
                let per_level = self.per_level(species);
                let fill = &mut self.filling[species][level];
                let captured = (per_level * (1.0 - *fill)).min(*charge_e);
                if captured <= 0.0 {
                    continue;
                }
                *fill += captured / per_level;
                *charge_e -= captured;
                if *charge_e <= 0.0 {
                    return;
                }
            }
        }
    }

    /// Traps that release before the packet leaves give to it.
    fn release_in_place(&mut self, charge_e: &mut f64) {
        for (species, trap) in self.traps.iter().enumerate() {
            let returned = if trap.capture_transfers > 0.0 { 0.0 } else { trap.returned() };
            if returned > 0.0 {
                let per_level = self.per_level(species);
                for fill in &mut self.filling[species][..self.occupied] {
                    *charge_e += per_level * *fill * returned;
                    *fill -= *fill * returned;
                }
            }
        }
    }
}
