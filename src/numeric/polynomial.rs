//! Polynomials of several variables, fitted by least squares.
//!
//! ```text
//! f(x) = Σ c_k T_k1(x1) T_k2(x2) ...        a1 k1 + a2 k2 + ... ≤ degree
//! ```
//!
//! with Chebyshev polynomials T, for variables between −1 and 1, and a cost a of a power of each variable: a function is smoother
//! in some variables than in others. A function that is even or odd in the last variable needs only even or odd powers of it.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x8};
use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, ArrayView2, Axis};

/// Powers of the last variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parity {
    /// All of them.
    Any,
    /// Even ones: the function is the same at −x.
    Even,
    /// Odd ones: the function changes its sign.
    Odd,
}

/// The terms of a polynomial up to a degree.
#[derive(Clone, Debug)]
pub(crate) struct Terms {
    /// Cost of a power of each variable, in units of the degree.
    costs: Vec<usize>,
    degree: usize,
    terms: Vec<Term>,
}

/// A term: another one times a Chebyshev polynomial of one more variable.
#[derive(Clone, Debug)]
struct Term {
    /// Index of the other one; None for 1.
    times: Option<usize>,
    variable: usize,
    power: usize,
    /// Costs of all its powers.
    cost: usize,
    /// Whether it is part of the polynomial, not only a factor of other terms.
    occurs: bool,
}

impl Terms {
    /// All terms up to a degree, given the cost of a power of each variable.
    pub fn of(costs: &[usize], degree: usize, parity: Parity) -> Terms {
        let mut found = Terms { costs: costs.to_vec(), degree, terms: Vec::new() };
        found.add(0, degree, None, parity);
        found
    }

    /// Adds terms in the variables starting with one, with the degree left, each multiplied by a term.
    fn add(&mut self, variable: usize, left: usize, times: Option<usize>, parity: Parity) {
        if variable == self.costs.len() {
            return;
        }
        let last = variable + 1 == self.costs.len();
        for power in 0..=left / self.costs[variable] {
            let still_left = left - power * self.costs[variable];
            let occurs = last
                && match parity {
                    Parity::Any => true,
                    Parity::Even => power % 2 == 0,
                    Parity::Odd => power % 2 == 1,
                };
            if last && !occurs {
                continue;
            }
            // A factor of 1 is omitted.
            let place = match (power, last) {
                (0, false) => times,
                _ => {
                    self.terms.push(Term { times, variable, power, cost: self.degree - still_left, occurs });
                    Some(self.terms.len() - 1)
                }
            };
            self.add(variable + 1, still_left, place, parity);
        }
    }

    /// Number of terms.
    pub fn count(&self) -> usize {
        self.terms.iter().filter(|term| term.occurs).count()
    }

    /// Degree of each term relative to the largest.
    pub fn shares(&self) -> Vec<f64> {
        let terms = self.terms.iter().filter(|term| term.occurs);
        terms.map(|term| term.cost as f64 / self.degree.max(1) as f64).collect()
    }

    /// Values of the terms, `[(term, point)]`, at points `[(variable, point)]`.
    pub fn values(&self, points: &Array2<f64>) -> Array2<f64> {
        let count = points.len_of(Axis(1));
        let powers = |(variable, cost): (usize, &usize)| {
            chebyshev(points.row(variable).iter().copied().collect(), self.degree / cost)
        };
        let powers: Vec<Vec<Vec<f64>>> = self.costs.iter().enumerate().map(powers).collect();
        let mut all: Vec<Vec<f64>> = Vec::with_capacity(self.terms.len());
        let mut values = Vec::with_capacity(self.count() * count);
        for term in &self.terms {
            let factor = &powers[term.variable][term.power];
            let product: Vec<f64> = match term.times {
                None => factor.clone(),
                Some(place) => all[place].iter().zip(factor).map(|(other, factor)| other * factor).collect(),
            };
            if term.occurs {
                values.extend_from_slice(&product);
            }
            // Terms of the last variable are factors of no others.
            all.push(if term.occurs { Vec::new() } else { product });
        }
        Array2::from_shape_vec((self.count(), count), values).expect("a row for each term")
    }
}

/// Points side by side: the loops over them become instructions on vectors.
const LANES: usize = 16;

/// A number at each of these points.
type Lanes = [f64; LANES];

/// Terms that are added to a function at once: it is loaded and stored once for all of them.
const AT_ONCE: usize = 4;

/// Buffers for the values at points side by side.
struct Side {
    /// The points, by variable.
    points: Vec<Lanes>,
    /// T_0 to T_degree of each variable.
    powers: Vec<Vec<Lanes>>,
    /// Terms that are factors of others, by their index among all.
    factors: Vec<Lanes>,
    /// The functions.
    sums: Vec<Lanes>,
}

impl Terms {
    /// Values of functions, `[(function, point)]`, with coefficients `[(function, term)]`, at points `[(variable, point)]`. As
    /// [`Terms::values`] and a product of matrices, without keeping the terms: these are many more than the functions.
    pub fn sums(&self, coefficients: ArrayView2<f64>, points: &Array2<f64>) -> Array2<f64> {
        let (functions, count) = (coefficients.nrows(), points.ncols());
        // In the order in which they are used: some terms of each function, then the next ones.
        let mut in_order = Vec::with_capacity(functions * coefficients.ncols().div_ceil(AT_ONCE));
        for first in (0..coefficients.ncols()).step_by(AT_ONCE) {
            for function in coefficients.rows() {
                in_order.push(std::array::from_fn(|term| function.get(first + term).copied().unwrap_or(0.0)));
            }
        }
        let powers = self.costs.iter().map(|cost| vec![[1.0; LANES]; self.degree / cost + 1]);
        let mut side = Side {
            points: vec![[0.0; LANES]; self.costs.len()],
            powers: powers.collect(),
            factors: vec![[0.0; LANES]; self.terms.len()],
            sums: vec![[0.0; LANES]; functions],
        };
        let mut all = Array2::zeros((functions, count));
        for start in (0..count).step_by(LANES) {
            let here = LANES.min(count - start);
            for (variable, lanes) in side.points.iter_mut().enumerate() {
                *lanes = std::array::from_fn(|lane| points[[variable, start + lane.min(here - 1)]]);
            }
            dispatch!(Level::new(), simd => self.sum(simd, &in_order, &mut side));
            for (function, sums) in side.sums.iter().enumerate() {
                (0..here).for_each(|lane| all[[function, start + lane]] = sums[lane]);
            }
        }
        all
    }

    /// The functions at some points, with their coefficients: of each function, those of the first terms, and so on.
    #[inline(always)]
    fn sum<S: Simd>(&self, simd: S, coefficients: &[[f64; AT_ONCE]], side: &mut Side) {
        let Side { points, powers, factors, sums } = side;
        for (place, powers) in points.iter().zip(powers.iter_mut()) {
            if let Some(first) = powers.get_mut(1) {
                *first = *place;
            }
            for power in 2..powers.len() {
                for lane in 0..LANES {
                    powers[power][lane] = 2.0 * place[lane] * powers[power - 1][lane] - powers[power - 2][lane];
                }
            }
        }
        sums.fill([0.0; LANES]);
        let mut coefficients = coefficients.chunks_exact(sums.len().max(1));
        let (mut products, mut waiting) = ([[0.0; LANES]; AT_ONCE], 0);
        for (index, term) in self.terms.iter().enumerate() {
            let mut product = powers[term.variable][term.power];
            if let Some(place) = term.times {
                multiply(simd, &mut product, &factors[place]);
            }
            if !term.occurs {
                factors[index] = product;
                continue;
            }
            products[waiting] = product;
            waiting += 1;
            if waiting == AT_ONCE {
                add(simd, sums, coefficients.next().expect("some for these terms"), &products);
                waiting = 0;
            }
        }
        if waiting > 0 {
            // The others have coefficients of 0.
            add(simd, sums, coefficients.next().expect("some for these terms"), &products);
        }
    }
}

/// Adds some terms to the functions. (Closures and iterators would not be compiled for the vectors of the caller.)
#[inline(always)]
fn add<S: Simd>(simd: S, sums: &mut [Lanes], coefficients: &[[f64; AT_ONCE]], products: &[Lanes; AT_ONCE]) {
    let mut half = 0;
    while half < LANES {
        let [a, b, c, d] = [
            part(simd, &products[0], half),
            part(simd, &products[1], half),
            part(simd, &products[2], half),
            part(simd, &products[3], half),
        ];
        for function in 0..sums.len() {
            let of = &coefficients[function];
            let added = (a * of[0] + b * of[1]) + (c * of[2] + d * of[3]);
            let sum = part(simd, &sums[function], half) + added;
            sum.store_slice(&mut sums[function][half..half + 8]);
        }
        half += 8;
    }
}

#[inline(always)]
fn multiply<S: Simd>(simd: S, product: &mut Lanes, factor: &Lanes) {
    let mut half = 0;
    while half < LANES {
        let numbers = part(simd, product, half) * part(simd, factor, half);
        numbers.store_slice(&mut product[half..half + 8]);
        half += 8;
    }
}

#[inline(always)]
fn part<S: Simd>(simd: S, numbers: &Lanes, first: usize) -> f64x8<S> {
    f64x8::from_slice(simd, &numbers[first..first + 8])
}

/// T_0 to T_degree at the given points.
fn chebyshev(places: Vec<f64>, degree: usize) -> Vec<Vec<f64>> {
    let mut all = vec![vec![1.0; places.len()], places];
    for power in 2..=degree {
        // T_k = 2 x T_{k−1} − T_{k−2}
        let of = |(x, (last, before)): (&f64, (&f64, &f64))| 2.0 * x * last - before;
        let next = all[1].iter().zip(all[power - 1].iter().zip(&all[power - 2])).map(of).collect();
        all.push(next);
    }
    all
}

/// Shares of the mean square of the terms that are added to the diagonal of the normal equations, for any term and for those of the
/// highest degree. Terms that the points do not distinguish, and high ones that they hardly determine, get small coefficients. So
/// more terms are possible than the points would support otherwise (ridge regression: Hoerl & Kennard 1970, Technometrics 12, 55).
const RIDGE: f64 = 1e-12;
const HIGHEST: f64 = 1e-3;

/// Exponent of the degree in the latter.
const GROWTH: i32 = 10;

/// Coefficients `[(function, term)]` of several functions from their values `[(function, point)]` and the terms' values, by least
/// squares. None if the normal equations have no solution.
pub(crate) fn fitted(terms: &Terms, at: &Array2<f64>, values: &Array2<f64>) -> Option<Array2<f64>> {
    let (normal, right) = (at.dot(&at.t()), at.dot(&values.t()));
    let count = normal.nrows();
    let mean = normal.diag().sum() / count as f64;
    if mean == 0.0 {
        // All terms are 0 at all points.
        return Some(Array2::zeros((values.nrows(), count)));
    }
    let ridge: Vec<f64> = terms.shares().iter().map(|share| mean * (RIDGE + HIGHEST * share.powi(GROWTH))).collect();
    let normal = DMatrix::from_fn(count, count, |row, column| {
        normal[[row, column]] + if row == column { ridge[row] } else { 0.0 }
    });
    let cholesky = normal.cholesky()?;
    let mut coefficients = Array2::zeros((values.nrows(), count));
    for (function, mut row) in coefficients.rows_mut().into_iter().enumerate() {
        let found = cholesky.solve(&DVector::from_iterator(count, right.column(function).iter().copied()));
        row.iter_mut().zip(found.iter()).for_each(|(coefficient, found)| *coefficient = *found);
    }
    Some(coefficients)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(count: usize) -> Array2<f64> {
        let steps = [0.618_034, 0.414_214, 0.732_051];
        Array2::from_shape_fn((3, count), |(variable, point)| 2.0 * (point as f64 * steps[variable]).fract() - 1.0)
    }

    #[test]
    fn there_are_as_many_terms_as_combinations() {
        // C(5 + 4, 4)
        assert_eq!(Terms::of(&[1; 5], 4, Parity::Any).count(), 126);
        let [even, odd] = [Parity::Even, Parity::Odd].map(|parity| Terms::of(&[1; 5], 4, parity).count());
        assert_eq!((even, odd), (86, 40));
        // 1, x, x², x³, y, x y: a power of y costs as much as two of x.
        let terms = Terms::of(&[1, 2], 3, Parity::Any);
        assert_eq!(terms.count(), 6);
        let mut degrees: Vec<usize> = terms.shares().iter().map(|share| (3.0 * share).round() as usize).collect();
        degrees.sort_unstable();
        assert_eq!(degrees, [0, 1, 2, 2, 3, 3]);
    }

    #[test]
    fn a_polynomial_is_found_from_its_values() {
        let law = |x: f64, y: f64, z: f64| 1.0 - x + 2.0 * x * y * z * z - 0.3 * y * y * y * y;
        let known = points(300);
        // Twice the degree needed: the highest terms are suppressed.
        let terms = Terms::of(&[1; 3], 8, Parity::Even);
        let at = |points: &Array2<f64>| {
            Array2::from_shape_fn((1, points.ncols()), |(_, p)| law(points[[0, p]], points[[1, p]], points[[2, p]]))
        };
        let coefficients = fitted(&terms, &terms.values(&known), &at(&known)).unwrap();
        let rms = |points: &Array2<f64>| {
            let error = coefficients.dot(&terms.values(points)) - at(points);
            error.mapv(|error| error * error).mean().unwrap().sqrt()
        };
        // The sum of squared errors and penalty is at most the penalty of the true function: its one large coefficient of degree 4
        // is 1, and terms are at most 1.
        let penalty = HIGHEST * 0.5_f64.powi(GROWTH) * 1.01;
        assert!(rms(&known) < penalty.sqrt(), "{}", rms(&known));
        // A hundred further points are between them.
        assert!(rms(&points(400)) < penalty.sqrt(), "{}", rms(&points(400)));
    }

    #[test]
    fn sums_are_those_of_all_terms() {
        for parity in [Parity::Any, Parity::Even, Parity::Odd] {
            let terms = Terms::of(&[1, 2, 1], 7, parity);
            let coefficients = Array2::from_shape_fn((5, terms.count()), |(f, t)| {
                ((f * 31 + t * 17) as f64 * 0.618_034).fract() - 0.5
            });
            // More points than lanes, and a part of them.
            for count in [1, 16, 37] {
                let here = points(count);
                let (sums, expected) = (terms.sums(coefficients.view(), &here), coefficients.dot(&terms.values(&here)));
                let off = (&sums - &expected).iter().fold(0.0_f64, |most, off| most.max(off.abs()));
                assert!(off < 1e-12 && sums.dim() == (5, count), "{parity:?} {count}: {off}");
            }
        }
    }

    #[test]
    fn a_polynomial_of_one_parity_has_it() {
        for (parity, sign) in [(Parity::Even, 1.0), (Parity::Odd, -1.0)] {
            let terms = Terms::of(&[1; 3], 5, parity);
            let here = points(10);
            let mut mirrored = here.clone();
            mirrored.row_mut(2).mapv_inplace(|z| -z);
            let difference = terms.values(&here) - sign * terms.values(&mirrored);
            assert!(difference.iter().all(|difference| difference.abs() < 1e-12));
        }
    }
}
