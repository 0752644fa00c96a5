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

use super::simd::Coefficient;
use super::{Cloud, Trap};

/// The traps of one pixel, tabulated for `S` species (padded with species of no density). `C`: the same in all columns (`f64`), or
/// others in each of the columns that are passed side by side ([`super::simd::Packets`]).
pub(super) struct Pixel<const S: usize, const RETURNS: bool, C = f64> {
    pub cloud: Cloud,
    pub species: usize,
    pub density: [C; S],
    pub density_all: C,
    /// One over that.
    pub per_density_all: C,
    /// Traps that stay filled where a packet has filled all, after the return, per pixel.
    pub held: [C; S],
    pub held_all: C,
    /// The fraction released to a packet before it captures: 1 − exp(−1/τ) with one phase.
    pub release: [C; S],
    /// The fraction released after that, to the same packet; 0 with one phase.
    pub returned: [C; S],
    /// That share of all traps, per pixel.
    pub to_return: [C; S],
    /// The fraction that stays filled from one packet to the next: one minus what is lost.
    pub still: [C; S],
    /// Traps still filled m packets after the one that filled them, per pixel.
    pub left: Vec<[C; S]>,
    pub left_all: Vec<C>,
    /// Released to the m-th packet after the one that filled them before it captures, per pixel.
    pub out_all: Vec<C>,
}

/// Maximum number of species held in registers.
pub(super) const FEW: usize = 5;

impl<const S: usize, const RETURNS: bool, C: Coefficient> Pixel<S, RETURNS, C> {
    /// Indices of species: all places if few and known at compile time, otherwise only those in use.
    #[inline(always)]
    pub(super) fn species(&self) -> std::ops::Range<usize> {
        0..if S <= FEW { S } else { self.species }
    }

    /// Tables for columns of `rows` packets, whose pixels all have the same traps.
    pub fn new(traps: &[Trap], cloud: Cloud, rows: usize) -> Pixel<S, RETURNS, C> {
        let rates = Rates::of(traps);
        Pixel::of_each(traps.len(), |_| &rates, cloud, rows)
    }

    /// Tables for columns of `rows` packets, from those of at most `species` species in each column.
    pub fn of_each<'a>(
        species: usize,
        rates: impl Fn(usize) -> &'a Rates<S>,
        cloud: Cloud,
        rows: usize,
    ) -> Pixel<S, RETURNS, C> {
        let none = C::of(|_| 0.0);
        let every = |value: &dyn Fn(&Rates<S>, usize) -> f64| {
            let mut each = [none; S];
            for (s, each) in each.iter_mut().enumerate().take(species) {
                *each = C::of(|column| value(rates(column), s));
            }
            each
        };
        let product = |a: &[C; S], b: &[C; S]| {
            let mut each = [none; S];
            for s in 0..species {
                each[s] = C::of(|column| a[s].lane(column) * b[s].lane(column));
            }
            each
        };
        let sum = |each: &[C; S]| C::of(|column| each.iter().take(species).map(|each| each.lane(column)).sum());
        let density = every(&|rates, s| rates.density_per_px[s]);
        let kept = every(&|rates, s| rates.kept[s]);
        let out = every(&|rates, s| (1.0 - rates.returned[s]) * rates.released[s]);
        let held = every(&|rates, s| rates.density_per_px[s] * (1.0 - rates.returned[s]));
        // ρ exp(−m/τ), by multiplication: computing exponentials for a stamp's rows would take as long as a pass.
        let mut left = vec![density];
        for m in 0..=rows {
            left.push(product(&left[m], &kept));
        }
        let left_all = left.iter().map(sum).collect();
        let mut out_all = vec![none];
        out_all.extend(left.iter().map(|left| sum(&product(left, &out))));
        let density_all = sum(&density);
        Pixel {
            cloud,
            species,
            density,
            density_all,
            per_density_all: C::of(|column| 1.0 / density_all.lane(column)),
            held,
            held_all: sum(&held),
            release: every(&|rates, s| rates.released[s]),
            returned: every(&|rates, s| rates.returned[s]),
            to_return: every(&|rates, s| rates.density_per_px[s] * rates.returned[s]),
            still: every(&|rates, s| 1.0 - if RETURNS { rates.lost[s] } else { rates.released[s] }),
            left,
            left_all,
            out_all,
        }
    }
}

/// Densities and rates of the traps of a pixel, by species; see [`Trap`].
pub(super) struct Rates<const S: usize> {
    density_per_px: [f64; S],
    kept: [f64; S],
    lost: [f64; S],
    released: [f64; S],
    returned: [f64; S],
}

impl<const S: usize> Rates<S> {
    /// Those of at most `S` species.
    pub fn of(traps: &[Trap]) -> Rates<S> {
        let each = |value: fn(&Trap) -> f64| {
            let mut each = [0.0; S];
            each.iter_mut().zip(traps).for_each(|(each, trap)| *each = value(trap));
            each
        };
        Rates {
            density_per_px: each(|trap| trap.density_per_px),
            kept: each(Trap::kept),
            lost: each(Trap::lost),
            released: each(Trap::released),
            returned: each(Trap::returned),
        }
    }
}
