//! Watermarks that remain in the pixels in which their packets started.
//!
//! A packet of the image finds empty traps in its own pixel and leaves more charge there than in any later pixel. It arrives at the
//! next one with less, and so do the packets behind it, which no longer reach the top of the watermark left at home. In a flat
//! background, where packets differ in nothing else, every packet leaves such a watermark, and a passing galaxy covers them all.

use fearless_simd::prelude::*;

use super::block_path::Summed;
use super::pixel::Pixel;
use super::simd::{Coefficient, Vector};

/// The parts of such watermarks above all clouds that have passed since, summed over all pixels: where they are many, they are
/// nearly equal.
pub(super) struct HomeWatermarks<T: Simd, const S: usize> {
    any: bool,
    number: Vector<T>,
    /// Their thickness, summed over them.
    thickness: Vector<T>,
    /// The number of pixels ahead of theirs, summed over them.
    ahead: Vector<T>,
    /// Their mean lower edge.
    floor: Vector<T>,
    /// Electrons in their traps, by species.
    stored_e: [Vector<T>; S],
}

impl<T: Simd, const S: usize> HomeWatermarks<T, S> {
    /// None yet.
    #[inline(always)]
    pub fn new(simd: T) -> Self {
        let zero = Vector::all(simd, 0.0);
        HomeWatermarks { any: false, number: zero, thickness: zero, ahead: zero, floor: zero, stored_e: [zero; S] }
    }

    /// A row of packets of the given heights passes. The traps that they cover are full already, and are neither captured nor
    /// stored again. Electrons of partly covered watermarks are only returned. `able` is 0 for packets that may lack charge for all
    /// traps in their reach; these are not followed here.
    #[inline(always)]
    pub fn pass<const TWICE: bool, const RETURNS: bool, C: Coefficient>(
        &mut self,
        simd: T,
        pixel: &Pixel<S, RETURNS, C>,
        height: Vector<T>,
        able: Vector<T>,
        stored: &mut [Summed<T, TWICE>; S],
        captured: &mut Summed<T, TWICE>,
    ) -> Vector<T> {
        let (zero, one) = (Vector::all(simd, 0.0), Vector::all(simd, 1.0));
        if !self.any {
            return zero;
        }
        let number = self.number.max(one);
        let thickness = self.thickness / number;
        let rise = (height - self.floor).max(zero).min(thickness);
        let share = zero.below(rise).select(rise / thickness, zero) * able;
        let ahead = self.ahead / number;
        let mut in_part_e = zero;
        for s in pixel.species() {
            let still_e = self.stored_e[s] * pixel.still[s];
            let covered_e = still_e * share;
            self.stored_e[s] = still_e - covered_e;
            in_part_e = in_part_e + covered_e;
            let covered = Summed { once: covered_e, twice: covered_e * ahead };
            *captured = *captured - covered;
            stored[s] = stored[s] - covered;
        }
        let stay = share.below(one);
        self.thickness = stay.select(self.thickness * (one - share), zero);
        self.number = stay.select(self.number, zero);
        self.ahead = stay.select(self.ahead, zero);
        self.floor = self.floor.max(height);
        stay.select(in_part_e, zero)
    }

    /// Adds a watermark if it has any thickness, with this floor and `ahead` pixels ahead; filled m packets ago.
    #[inline(always)]
    pub fn leave<const RETURNS: bool, C: Coefficient>(
        &mut self,
        simd: T,
        pixel: &Pixel<S, RETURNS, C>,
        thickness: Vector<T>,
        floor: Vector<T>,
        (m, ahead): (usize, f64),
    ) {
        let (zero, one) = (Vector::all(simd, 0.0), Vector::all(simd, 1.0));
        let more = zero.below(thickness).select(one, zero);
        self.any = true;
        self.number = self.number + more;
        self.floor = self.floor + (floor - self.floor) * more / self.number.max(one);
        self.thickness = self.thickness + thickness;
        self.ahead = self.ahead + more * ahead;
        for s in pixel.species() {
            self.stored_e[s] = self.stored_e[s] + thickness * pixel.left[m][s];
        }
    }
}
