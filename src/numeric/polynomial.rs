//! Polynomials of several variables, fitted by least squares.
//!
//! ```text
//! f(x) = Σ c_k T_k1(x1) T_k2(x2) ...        a1 k1 + a2 k2 + ... ≤ degree
//! ```
//!
//! with Chebyshev polynomials T, for variables between −1 and 1, and a cost a of a power of each variable: a function is smoother
//! in some variables than in others. A function that is even or odd in the last variable needs only even or odd powers of it.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, Axis};

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
