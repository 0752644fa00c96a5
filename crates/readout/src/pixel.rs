//! What the traps of a pixel do to all the packets that pass it, in one pass and without approximation.
//!
//! **Watermarks.** Capture is instantaneous, so every trap below the newest cloud is full, and a trap higher up was last
//! filled when the last packet that reached it went by, m packets ago: it is still full with probability exp(−m/τ).
//! The state of any number of traps is therefore a short stack of watermarks — a height and the packet that filled it —
//! from which a new packet removes all that it covers. Nothing is divided into bins, so nothing is rounded.
//!
//! **Blocks.** While the packets' charges are held fixed, pixels differ only in which packets pass them: the packet in
//! row r starts in pixel r. The sum over a block of pixels then needs one pass, not one per pixel: a watermark left by a
//! packet exists in as many pixels as that packet has visited, and the visits of an earlier packet are among those of
//! a later one. So each watermark carries the number of its pixels, and captures and releases are weighted with it. The pixel that a
//! packet starts in is unlike all others, empty, and is done for itself (see [`super::home_watermarks`]).
//!
//! **Vector.** Columns are passed side by side (see [`super::simd`]). Every packet leaves one watermark, so that watermarks are kept
//! in the order of the packets, each with the place of the next higher one below it on the stack, instead of being moved. The
//! packets of a row go through the watermarks that any of them meets, one after another, the newest first: mostly the one just left
//! by their neighbours, and few more. Only packets that have less than the traps in their reach would take are followed
//! one by one.
//!
//! | symbol | here | unit | meaning |
//! |---|---|---|---|
//! | ρ | `density` | per pixel | traps of a species |
//! | 1 − exp(−1/τ) | `release` | 1 | chance to be emptied while one packet passes |
//! | ρ exp(−m/τ) | `left[m]` | per pixel | still filled m packets later |

use super::{Cloud, Trap};

/// The traps of one pixel, tabulated for `S` species (padded with species of no density).
pub(super) struct Pixel<const S: usize> {
    pub cloud: Cloud,
    pub species: usize,
    pub density: [f64; S],
    pub density_all: f64,
    /// 1 − exp(−1/τ), the fraction released while a packet passes.
    pub release: [f64; S],
    /// Still filled m packets after the one that filled them, per pixel.
    pub left: Vec<[f64; S]>,
    pub left_all: Vec<f64>,
    /// Released while the m-th packet after the one that filled them passes, per pixel.
    pub out_all: Vec<f64>,
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
}
