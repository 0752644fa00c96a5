//! Columns side by side: each step of the program acts on several of them at once.
//!
//! Columns are independent but go through the same steps. So each operation on the packets of a row acts on vectors of charges, one
//! for each column, with the widest instructions of the processor (SSE2 to AVX-512, NEON; chosen at run time, by crate
//! `fearless_simd`). No operation is contracted, and columns are grouped in the same way everywhere, so the results are the same to
//! the bit on all of them.

use std::borrow::Cow;
use std::ops::{Add, BitAnd, Div, Mul, Sub};

use fearless_simd::prelude::*;
use fearless_simd::{f64x8, mask64x8};
use ndarray::{ArrayView1, ArrayView2};

/// Columns that are read out side by side: two of the widest registers, so that one computes while the other waits.
pub(super) const LANES: usize = 16;

/// Values of one row, one for each of the columns.
pub(super) type Packets = [f64; LANES];

/// Some columns of an image (`[[row, column]]`, e-; at most [`LANES`], ascending), one array for each row; the last is repeated.
pub(super) fn gather(image: ArrayView2<f64>, columns: &[usize], lanes: &mut Vec<Packets>) {
    let (first, last) = (columns[0], columns[columns.len() - 1]);
    let neighbours = last - first + 1 == columns.len();
    lanes.clear();
    lanes.extend(image.rows().into_iter().map(|row| match row.to_slice() {
        Some(row) if neighbours => {
            let mut lanes = [row[last]; LANES];
            lanes[..columns.len()].copy_from_slice(&row[first..=last]);
            lanes
        }
        Some(row) => side_by_side(row, columns),
        None => std::array::from_fn(|lane| row[columns[lane.min(columns.len() - 1)]]),
    }));
}

/// Charges of a row, copied if they are not contiguous.
pub(super) fn in_one_piece(charge_e: ArrayView1<f64>) -> Cow<[f64]> {
    charge_e.to_slice().map_or_else(|| charge_e.to_vec().into(), Cow::from)
}

/// Values of some columns, the last of them repeated.
pub(super) fn side_by_side(numbers: &[f64], columns: &[usize]) -> Packets {
    std::array::from_fn(|lane| numbers[columns[lane.min(columns.len() - 1)]])
}

/// A factor on the values of a row: the same for all columns, or one for each.
pub(super) trait Coefficient: Copy + Sync {
    /// From the factor of each column.
    fn of(each: impl Fn(usize) -> f64) -> Self;

    /// That of one column.
    fn lane(&self, lane: usize) -> f64;

    /// The largest.
    fn largest(&self) -> f64;

    /// The product with the values of a row.
    fn times<S: Simd>(&self, values: Vector<S>) -> Vector<S>;
}

impl Coefficient for f64 {
    #[inline(always)]
    fn of(each: impl Fn(usize) -> f64) -> f64 {
        each(0)
    }

    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }

    #[inline(always)]
    fn largest(&self) -> f64 {
        *self
    }

    #[inline(always)]
    fn times<S: Simd>(&self, values: Vector<S>) -> Vector<S> {
        Vector(from_fn(|n| values.0[n] * *self))
    }
}

impl Coefficient for Packets {
    #[inline(always)]
    fn of(each: impl Fn(usize) -> f64) -> Packets {
        std::array::from_fn(each)
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self[lane]
    }

    #[inline(always)]
    fn largest(&self) -> f64 {
        self.iter().copied().fold(0.0, f64::max)
    }

    #[inline(always)]
    fn times<S: Simd>(&self, values: Vector<S>) -> Vector<S> {
        Vector(from_fn(|n| values.0[n] * f64x8::from_slice(values.0[n].simd, &self[8 * n..8 * n + 8])))
    }
}

/// The values of a row as vectors of the processor. Comparisons with NaN are false.
#[derive(Clone, Copy)]
pub(super) struct Vector<S: Simd>([f64x8<S>; N]);

/// A boolean for each column.
#[derive(Clone, Copy)]
pub(super) struct Mask<S: Simd>([mask64x8<S>; N]);

/// Vectors per row.
const N: usize = LANES / 8;

impl<S: Simd> Vector<S> {
    /// The same value everywhere.
    #[inline(always)]
    pub fn all(simd: S, value: f64) -> Self {
        Vector([f64x8::splat(simd, value); N])
    }

    /// From memory.
    #[inline(always)]
    pub fn load(simd: S, values: &Packets) -> Self {
        Vector(from_fn(|n| f64x8::from_slice(simd, &values[8 * n..8 * n + 8])))
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self, values: &mut Packets) {
        for n in 0..N {
            self.0[n].store_slice(&mut values[8 * n..8 * n + 8]);
        }
    }

    /// To a new row in memory.
    #[inline(always)]
    pub fn row(self) -> Packets {
        let mut row = [0.0; LANES];
        self.store(&mut row);
        row
    }

    /// √x, with relative error 1e-14, for x between 1e-30 and 1e30. A root with half the digits and one Newton step take less than
    /// half the time of the processor's own instruction, which would be half of the total.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let mut roots = self.0;
        for pair in roots.chunks_exact_mut(2) {
            let (low, high) = (pair[0], pair[1]);
            let root = low.narrow(high).sqrt();
            let half_inverse = 0.5 / root;
            let ((root_low, root_high), (half_low, half_high)) = (root.widen(), half_inverse.widen());
            pair[0] = root_low + (low - root_low * root_low) * half_low;
            pair[1] = root_high + (high - root_high * root_high) * half_high;
        }
        Vector(roots)
    }

    /// |x|
    #[inline(always)]
    pub fn abs(self) -> Self {
        Vector(from_fn(|n| self.0[n].abs()))
    }

    /// The smaller of two numbers.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Vector(from_fn(|n| self.0[n].min(other.0[n])))
    }

    /// The larger of two numbers.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Vector(from_fn(|n| self.0[n].max(other.0[n])))
    }

    /// Where x < y.
    #[inline(always)]
    pub fn below(self, other: Self) -> Mask<S> {
        Mask(from_fn(|n| self.0[n].simd_lt(other.0[n])))
    }

    /// Where x ≤ y.
    #[inline(always)]
    pub fn at_most(self, other: Self) -> Mask<S> {
        Mask(from_fn(|n| self.0[n].simd_le(other.0[n])))
    }

    /// Where x = y.
    #[inline(always)]
    pub fn equals(self, other: Self) -> Mask<S> {
        Mask(from_fn(|n| self.0[n].simd_eq(other.0[n])))
    }

    /// The largest.
    #[inline(always)]
    pub fn largest(self) -> f64 {
        let mut most = self.0[0];
        for n in 1..N {
            most = most.max(self.0[n]);
        }
        most.reduce_max()
    }

    /// The sum, in the order of the lanes.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.0.iter().flat_map(|numbers| numbers.as_slice()).sum()
    }
}

impl<S: Simd> Mask<S> {
    /// One number or the other.
    #[inline(always)]
    pub fn select(self, yes: Vector<S>, no: Vector<S>) -> Vector<S> {
        Vector(from_fn(|n| self.0[n].select(yes.0[n], no.0[n])))
    }

    /// Whether any is true.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0.iter().any(|truths| truths.any_true())
    }
}

/// `std::array::from_fn`, which the compiler does not always unroll.
#[inline(always)]
fn from_fn<T: Copy>(make: impl Fn(usize) -> T) -> [T; N] {
    let mut made = [make(0); N];
    // Iterators with `skip` are separate calls in a debug build.
    let mut n = 1;
    while n < N {
        made[n] = make(n);
        n += 1;
    }
    made
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<S: Simd> $trait for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Vector(from_fn(|n| self.0[n].$method(other.0[n])))
            }
        }
    };
    ($trait:ident<f64>, $method:ident) => {
        impl<S: Simd> $trait<f64> for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                Vector(from_fn(|n| self.0[n].$method(other)))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);
operator!(Add<f64>, add);

impl<S: Simd, C: Coefficient> Mul<C> for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: C) -> Self {
        factor.times(self)
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Mask(from_fn(|n| self.0[n] & other.0[n]))
    }
}
