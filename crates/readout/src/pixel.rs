//! Effect of the traps of a pixel on all packets that pass it, in one pass and without approximation.
//!
//! **Watermarks.** Capture is instantaneous, so every trap below the newest cloud is full. A trap higher up was last filled when
//! the last packet that reached it passed, m packets ago: it is still full with probability exp(−m/τ). The state of any number of
//! traps is therefore a short stack of watermarks — a height and the packet that filled it — from which a new packet removes all
//! that it covers. Nothing is binned, so nothing is rounded.
//!
//! **Blocks.** While the packets' charges are held fixed, pixels differ only in which packets pass them: the packet in row r starts
//! in pixel r. The sum over a block of pixels then needs one pass, not one per pixel: a watermark left by a packet exists in as
//! many pixels as that packet has visited, and the visits of an earlier packet are among those of a later one. So each watermark
//! carries the number of its pixels, with which captures and releases are weighted. The pixel in which a packet starts is empty,
//! unlike all others, and is computed separately (see [`super::home_watermarks`]).
//!
//! **Vector.** Columns are passed side by side (see [`super::simd`]). Every packet leaves one watermark. So watermarks are kept in
//! the order of the packets, each with the index of the next higher one below it on the stack, instead of being moved. The packets
//! of a row go through the watermarks that any of them meets, the newest first: usually the one just left by their neighbours, and
//! few more. Only packets with less charge than the traps in their reach would capture are followed one by one.
//!
//! **Phases.** If the clock has several phases (`RETURNS`), part of the released charge returns to the packet that has just left,
//! before the next one comes. Traps are still filled to exp(−m/τ) when the m-th packet after theirs captures; only the recipient of
//! their electrons differs. With one phase none of this is computed.
//!
//! | symbol | here | unit | meaning |
//! |---|---|---|---|
//! | ρ | `density` | per pixel | traps of a species |
//! | 1 − exp(−1/τ) | `release` | 1 | probability of release while one packet passes |
//! | R | `returned` | 1 | probability that the electron returns to the packet that has just left; see [`super::phase`] |
//! | ρ exp(−m/τ) | `left[m]` | per pixel | still filled m packets later |

use super::{Cloud, Trap};

/// The traps of one pixel, tabulated for `S` species (padded with species of no density).
pub(super) struct Pixel<const S: usize, const RETURNS: bool> {
    pub cloud: Cloud,
    pub species: usize,
    pub density: [f64; S],
    pub density_all: f64,
    /// Traps that stay filled where a packet has filled all, after the return, per pixel, of all species.
    pub held_all: f64,
    /// The fraction released to a packet before it captures: 1 − exp(−1/τ) with one phase.
    pub release: [f64; S],
    /// The fraction released after that, to the same packet; 0 with one phase.
    pub returned: [f64; S],
    /// The fraction released from one packet to the next, 1 − exp(−1/τ).
    pub lost: [f64; S],
    /// Traps still filled m packets after the one that filled them, per pixel.
    pub left: Vec<[f64; S]>,
    pub left_all: Vec<f64>,
    /// Released to the m-th packet after the one that filled them before it captures, per pixel.
    pub out_all: Vec<f64>,
}

/// Maximum number of species held in registers.
pub(super) const FEW: usize = 5;

impl<const S: usize, const RETURNS: bool> Pixel<S, RETURNS> {
    /// Indices of species: all places if few and known at compile time, otherwise only those in use.
    #[inline(always)]
    pub(super) fn species(&self) -> std::ops::Range<usize> {
        0..if S <= FEW { S } else { self.species }
    }

    /// Tables for columns of `rows` packets.
    pub fn new(traps: &[Trap], cloud: Cloud, rows: usize) -> Pixel<S, RETURNS> {
        let mut density = [0.0; S];
        let [mut release, mut returned, mut lost] = [[0.0; S]; 3];
        for (s, trap) in traps.iter().enumerate() {
            density[s] = trap.density_per_px;
            release[s] = trap.released();
            returned[s] = trap.returned();
            lost[s] = trap.lost();
        }
        let kept: Vec<f64> = traps.iter().map(Trap::kept).collect();
        // ρ exp(−m/τ), by multiplication: computing exponentials for a stamp's rows would take as long as a pass.
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
        let out = |left: &[f64; S]| (0..S).map(|s| left[s] * (1.0 - returned[s]) * release[s]).sum::<f64>();
        out_all.extend(left.iter().map(out));
        let density_all = density.iter().sum();
        let held_all = (0..S).map(|s| density[s] * (1.0 - returned[s])).sum();
        Pixel {
            cloud,
            species: traps.len(),
            density,
            density_all,
            held_all,
            release,
            returned,
            lost,
            left,
            left_all,
            out_all,
        }
    }
}
