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
    let below = |height: f64| ((height * levels as f64 + 0.5).floor() as usize).min(levels);
    let mut filling = vec![vec![0.0; levels]; traps.len()];
    for pixel in pixels.rev() {
        interrupt::check();
        // Packets that passed before row 0 have filled the traps within their reach.
        let filled_before =
            |cloud: &Cloud| if pixel < downstream.rows { below(cloud.height(downstream.charge_e)) } else { 0 };
        // No trap above the highest cloud so far is filled.
        let mut occupied = 0;
        for ((trap, cloud), species) in traps.iter().zip(clouds).zip(&mut filling) {
            let filled_before = filled_before(cloud);
            species.fill(0.0);
            species[..filled_before].fill(trap.filled_by(downstream.rows - pixel, cloud, downstream.charge_e));
            occupied = occupied.max(filled_before);
        }
        let first = (pixel - downstream.rows).max(0) as usize;
        for charge in &mut charge_e[first..] {
            let arrived_e = *charge;
            for ((trap, cloud), filling) in traps.iter().zip(clouds).zip(&mut filling) {
                let per_level = trap.density_per_px / levels as f64;
                if trap.capture_transfers > 0.0 {
                    let arrived = below(cloud.height(arrived_e));
                    occupied = occupied.max(arrived);
                    let (keep, full, approach) = trap.passage_of(cloud, arrived_e);
                    for (level, fill) in filling[..occupied].iter_mut().enumerate() {
                        let after = if level < arrived { full + (*fill - full) * approach } else { *fill * keep };
                        // Not more than the packet has.
                        let captured = (per_level * (after - *fill)).min((*charge).max(0.0));
                        *charge -= captured;
                        *fill += captured / per_level;
                    }
                    continue;
                }
                let release = trap.released();
                for fill in &mut filling[..occupied] {
                    *charge += per_level * *fill * release;
                    *fill -= *fill * release;
                }
            }
            let reached: Vec<usize> = clouds.iter().map(|cloud| below(cloud.height(*charge))).collect();
            let highest = reached.iter().copied().max().unwrap_or(0);
            occupied = occupied.max(highest);
            let mut available = *charge;
            'capture: for level in 0..highest {
                for ((trap, filling), reached) in traps.iter().zip(&mut filling).zip(&reached) {
                    if trap.capture_transfers > 0.0 || level >= *reached {
                        continue;
                    }
                    let per_level = trap.density_per_px / levels as f64;
                    let captured = (per_level * (1.0 - filling[level])).min(available);
                    if captured <= 0.0 {
                        continue;
                    }
                    filling[level] += captured / per_level;
                    available -= captured;
                    if available <= 0.0 {
                        break 'capture;
                    }
                }
            }
            if highest > 0 {
                *charge = available;
            }
            for (trap, filling) in traps.iter().zip(&mut filling) {
                let returned = if trap.capture_transfers > 0.0 { 0.0 } else { trap.returned() };
                if returned > 0.0 {
                    for fill in &mut filling[..occupied] {
                        *charge += trap.density_per_px / levels as f64 * *fill * returned;
                        *fill -= *fill * returned;
                    }
                }
            }
        }
    }
}
