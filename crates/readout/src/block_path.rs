//! The path of packets through a block of pixels, as needed by the second order.
//!
//! The first order holds the charges at their values on arrival, and neglects their changes along the path. The second order holds
//! them at their means over the path instead: the result for a pixel is then correct to second order if all packets are in step. In
//! the image they are not. Packet r has passed r − p pixels when it comes to pixel p, and there meets the watermarks of packets
//! that have passed fewer; and a watermark exists only in the last pixels of the path, where its packet has been. So two means are
//! accumulated along with the first order: over all pixels of the path, and over those of the watermark that the packet reaches
//! into, which is the only one that it fills in part. Both are exact sums over the pixels, to first order: a quantity that exists
//! in the last v pixels of the path counts v times in a sum, and v (v − 1)/2 times in the sum of sums from which means are made,
//! since a change in a pixel acts on all pixels ahead of it.

use std::ops::{Add, Mul, Sub};

use fearless_simd::prelude::*;

use super::simd::{Coefficient, LANES, Mask, Packets, Vector};

/// Changes of packets along their path through a block, to first order, as needed by the second order.
pub(super) struct PathMeans {
    /// Change of each packet before it reaches a pixel of its path, averaged over the path, e-. The pixel that it starts in is
    /// omitted, since there everything is known.
    pub mean_e: Vec<Packets>,
    /// Excess over that mean, with the charge released there, in the pixels of the watermark that the packet reached into, e-.
    pub further_e: Vec<Packets>,
}

impl PathMeans {
    /// For columns of `rows` packets.
    pub fn new(rows: usize) -> PathMeans {
        PathMeans { mean_e: vec![[0.0; LANES]; rows], further_e: vec![[0.0; LANES]; rows] }
    }

    /// For rows that do not pass the block.
    pub fn absent(&mut self, rows: usize) {
        self.mean_e[..rows].fill([0.0; LANES]);
        self.further_e[..rows].fill([0.0; LANES]);
    }
}

/// What is known of the packets' path during a pass through a block.
pub(super) enum BlockPath<'a> {
    /// Nothing, and it is not computed.
    Unknown,
    /// To be computed.
    Sought(&'a mut PathMeans),
    /// Known completely.
    Known(&'a PathMeans),
}

/// A quantity summed over the pixels of the path, e-, and, if `TWICE`, the sum of its sums up to each pixel.
#[derive(Clone, Copy)]
pub(super) struct Summed<T: Simd, const TWICE: bool> {
    pub once: Vector<T>,
    pub twice: Vector<T>,
}

// Operations on vectors must be inlined into the caller, which knows the processor; closures are not always inlined.

impl<T: Simd, const TWICE: bool> Summed<T, TWICE> {
    /// Nothing.
    #[inline(always)]
    pub fn none(simd: T) -> Self {
        let zero = Vector::all(simd, 0.0);
        Summed { once: zero, twice: zero }
    }

    /// The same value in each of the last `pixels` pixels.
    #[inline(always)]
    pub fn over(each: Vector<T>, pixels: f64) -> Self {
        Summed { once: each * pixels, twice: if TWICE { each * ahead(pixels) } else { each } }
    }

    /// The same, with a different number of pixels in each lane.
    #[inline(always)]
    fn over_each(each: Vector<T>, pixels: Vector<T>) -> Self {
        Summed { once: each * pixels, twice: if TWICE { each * pixels * (pixels + -1.0) * 0.5 } else { each } }
    }

    /// In one pixel, with `ahead` pixels ahead of it.
    #[inline(always)]
    pub fn at(value: Vector<T>, ahead: f64) -> Self {
        Summed { once: value, twice: if TWICE { value * ahead } else { value } }
    }

    /// Both sums.
    #[inline(always)]
    pub fn all(self) -> Summed<T, true> {
        Summed { once: self.once, twice: self.twice }
    }

    /// Zero where `so` is false.
    #[inline(always)]
    pub fn only(self, simd: T, so: Mask<T>) -> Self {
        let zero = Vector::all(simd, 0.0);
        Summed { once: so.select(self.once, zero), twice: if TWICE { so.select(self.twice, zero) } else { zero } }
    }
}

impl<T: Simd, const TWICE: bool> Add for Summed<T, TWICE> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Summed { once: self.once + other.once, twice: if TWICE { self.twice + other.twice } else { self.twice } }
    }
}

impl<T: Simd, const TWICE: bool> Sub for Summed<T, TWICE> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Summed { once: self.once - other.once, twice: if TWICE { self.twice - other.twice } else { self.twice } }
    }
}

impl<T: Simd, C: Coefficient, const TWICE: bool> Mul<C> for Summed<T, TWICE> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: C) -> Self {
        Summed { once: self.once * factor, twice: if TWICE { self.twice * factor } else { self.twice } }
    }
}

/// Sum, over the last `pixels` pixels of a block, of the number of pixels ahead of each.
#[inline(always)]
pub(super) fn ahead(pixels: f64) -> f64 {
    0.5 * pixels * (pixels - 1.0)
}

/// Charge that returns to the packets of a row when they leave a pixel.
pub(super) struct Returned<T: Simd> {
    /// From below their own height, in each pixel, e-.
    pub own_e: Vector<T>,
    /// The same, summed over all pixels.
    pub own: Summed<T, true>,
    /// From all heights, summed over all pixels.
    pub all: Summed<T, true>,
}

/// Charge exchanged by the packets of a row in the pixels of the watermarks that they reach into.
pub(super) struct Reached<T: Simd> {
    /// Number of those pixels.
    pixels: Vector<T>,
    /// Captured in each of them, e-.
    captured_e: Vector<T>,
    /// Released in each of them, e-, by the watermarks that the packets have covered.
    released_e: Vector<T>,
    /// The same, summed over all pixels of those watermarks.
    released: Summed<T, true>,
}

impl<T: Simd> Reached<T> {
    /// Before any watermark is met, for packets that would fill `most_e` empty traps of a pixel.
    #[inline(always)]
    pub fn new(simd: T, most_e: Vector<T>) -> Reached<T> {
        let zero = Vector::all(simd, 0.0);
        Reached { pixels: zero, captured_e: most_e, released_e: zero, released: Summed::none(simd) }
    }

    /// `filled_e` traps of each pixel are already filled.
    #[inline(always)]
    pub fn fills(&mut self, filled_e: Vector<T>) {
        self.captured_e = self.captured_e - filled_e;
    }

    /// A covered watermark, which released `released_e` in each of its pixels and `released` in all of them.
    #[inline(always)]
    pub fn covers(&mut self, released_e: Vector<T>, released: Summed<T, true>) {
        self.released_e = self.released_e + released_e;
        self.released = self.released + released;
    }

    /// The watermark reached into by the lanes `at` exists in `pixels` pixels.
    #[inline(always)]
    pub fn ends(&mut self, simd: T, at: Mask<T>, pixels: f64) {
        self.pixels = at.select(Vector::all(simd, pixels), self.pixels);
    }

    /// See [`PathMeans::further_e`]; from the totals released, captured and returned over 1 / `per_visit` pixels.
    #[inline(always)]
    pub fn further(
        self,
        simd: T,
        released: Summed<T, true>,
        captured: Summed<T, true>,
        returned: Returned<T>,
        per_visit: f64,
    ) -> Vector<T> {
        let (zero, one) = (Vector::all(simd, 0.0), Vector::all(simd, 1.0));
        let per_pixel = one / self.pixels.max(one);
        // Watermarks that were not covered exist in no other pixels.
        let released_there = Summed::over_each(self.released_e, self.pixels) + released - self.released;
        let returned_there = Summed::over_each(returned.own_e, self.pixels) + returned.all - returned.own;
        let changed = released - captured + returned.all;
        let changed_there = released_there - Summed::over_each(self.captured_e, self.pixels) + returned_there;
        let mean_e = changed.twice * per_visit;
        let mean_there_e = changed.once - changed_there.once + changed_there.twice * per_pixel;
        let more_released_e = released_there.once * per_pixel - released.once * per_visit;
        zero.below(self.pixels).select(mean_there_e - mean_e + more_released_e, zero)
    }
}
