//! The linear problem at a fitted set: steps of its parameters, and strengths of columns, for errors as given.

use nalgebra::{DMatrix, DVector};

use super::super::explanation::{Explanation, Unknown};
use super::super::hypothesis::FARTHEST;
use super::SetSearch;
use super::signature::{Strength, Trial};
use crate::analysis::likelihood::{Errors, Whitener};
use crate::numeric::parallel;

/// The linear problem at a set: steps of its parameters, and strengths of columns, for errors as given.
pub(super) struct Linear {
    whitener: Whitener,
    residuals: DVector<f64>,
    /// Whitened derivatives.
    derivatives: DMatrix<f64>,
    /// Of each parameter: distance to its prior's mean, and its width; None if it stays.
    priors: Vec<Option<(f64, f64)>>,
    off: Vec<f64>,
}

impl Linear {
    pub(super) fn of(search: &SetSearch, line: &Explanation, errors: &[Errors]) -> Linear {
        Linear::without(search, line, errors, None)
    }

    /// The same with one parameter held.
    pub(super) fn without(search: &SetSearch, line: &Explanation, errors: &[Errors], held: Option<usize>) -> Linear {
        let whitener = search.fitter.likelihood.whitener(errors);
        let off = search.fitter.likelihood.off(&line.model);
        let derivatives: Vec<DVector<f64>> =
            line.derivatives.column_iter().map(|column| whitener.apply(column.as_slice())).collect();
        let derivatives =
            if derivatives.is_empty() { DMatrix::zeros(off.len(), 0) } else { DMatrix::from_columns(&derivatives) };
        let derivatives = match held {
            Some(held) => {
                let mut derivatives = derivatives;
                derivatives.column_mut(held).fill(0.0);
                derivatives
            }
            None => derivatives,
        };
        let prior = |(index, unknown): (usize, &Unknown)| {
            let prior = unknown.prior.filter(|_| Some(index) != held)?;
            Some((prior.pull(prior.coordinate(unknown.parameter.start)), prior.width))
        };
        Linear {
            residuals: whitener.apply(&off),
            whitener,
            derivatives,
            priors: line.unknowns.iter().enumerate().map(prior).collect(),
            off,
        }
    }

    /// Normal matrix and right-hand side of parameters and further columns.
    pub(super) fn normal(&self, white: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let (k, q) = (self.derivatives.ncols(), white.ncols());
        let all = DMatrix::from_fn(self.residuals.len(), k + q, |row, column| {
            if column < k { self.derivatives[(row, column)] } else { white[(row, column - k)] }
        });
        let mut normal = all.tr_mul(&all);
        let mut right = all.tr_mul(&self.residuals);
        for (index, prior) in self.priors.iter().enumerate() {
            match prior {
                Some((apart, width)) => {
                    normal[(index, index)] += width.powi(-2);
                    right[index] += apart / (width * width);
                }
                None => normal[(index, index)] += 1.0,
            }
        }
        (normal, right)
    }

    pub(super) fn white(&self, columns: &[Vec<f64>]) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = columns.iter().map(|column| self.whitener.apply(column)).collect();
        if columns.is_empty() { DMatrix::zeros(self.residuals.len(), 0) } else { DMatrix::from_columns(&columns) }
    }

    /// Decrease of the sum of squares with some columns.
    pub(super) fn gain(&self, columns: &[Vec<f64>], strength: Strength) -> f64 {
        let Some(found) = self.solve(columns, strength) else { return 0.0 };
        let squares = |found: &[f64]| {
            let mut left = self.residuals.clone();
            for (column, value) in self.derivatives.column_iter().zip(found) {
                left -= column * *value;
            }
            for (column, value) in self.white(columns).column_iter().zip(&found[self.derivatives.ncols()..]) {
                left -= column * *value;
            }
            left.norm_squared() + self.prior(found)
        };
        self.residuals.norm_squared() + self.prior(&vec![0.0; self.priors.len()]) - squares(&found)
    }

    /// Steps of the parameters, then strengths of the columns.
    pub(super) fn solve(&self, columns: &[Vec<f64>], strength: Strength) -> Option<Vec<f64>> {
        let k = self.derivatives.ncols();
        if strength == Strength::Fixed {
            let mut fixed = self.residuals.clone();
            for column in self.white(columns).column_iter() {
                fixed -= column;
            }
            let (normal, _) = self.normal(&DMatrix::zeros(self.residuals.len(), 0));
            let mut right = self.derivatives.tr_mul(&fixed);
            for (index, prior) in self.priors.iter().enumerate() {
                right[index] += prior.map_or(0.0, |(apart, width)| apart / (width * width));
            }
            let mut found = if k == 0 { Vec::new() } else { normal.cholesky()?.solve(&right).as_slice().to_vec() };
            found.extend(vec![1.0; columns.len()]);
            return Some(found);
        }
        let white = self.white(columns);
        let (mut normal, right) = self.normal(&white);
        // A strength far beyond its trial is not believed.
        for column in 0..columns.len() {
            normal[(k + column, k + column)] += FARTHEST.powi(-2);
        }
        let mut wanted: Vec<usize> = (0..k + columns.len()).collect();
        loop {
            let matrix = DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| normal[(wanted[i], wanted[j])]);
            let vector = DVector::from_fn(wanted.len(), |i, _| right[wanted[i]]);
            let solved = if wanted.is_empty() { vector } else { matrix.cholesky()?.solve(&vector) };
            let negative = wanted.iter().zip(solved.iter()).filter(|(index, value)| **index >= k && **value < 0.0);
            let worst = negative.min_by(|a, b| a.1.total_cmp(b.1)).map(|(index, _)| *index);
            match worst {
                Some(worst) => wanted.retain(|index| *index != worst),
                None => {
                    let mut found = vec![0.0; k + columns.len()];
                    wanted.iter().zip(solved.iter()).for_each(|(index, value)| found[*index] = *value);
                    return Some(found);
                }
            }
        }
    }

    /// The same for strengths of either sign with priors around 0.
    pub(super) fn solve_any(&self, columns: &[Vec<f64>], widths: &[f64]) -> Option<Vec<f64>> {
        let k = self.derivatives.ncols();
        let (mut normal, right) = self.normal(&self.white(columns));
        for (column, width) in widths.iter().enumerate() {
            normal[(k + column, k + column)] += width.powi(-2);
        }
        Some(normal.cholesky()?.solve(&right).as_slice().to_vec())
    }

    /// Gains of pairs of trials of one column each.
    pub(super) fn gains_of_pairs(&self, trials: &[Trial], pairs: &[(usize, usize)]) -> Vec<f64> {
        let mut used: Vec<usize> = pairs.iter().flat_map(|(a, b)| [*a, *b]).collect();
        used.sort_unstable();
        used.dedup();
        let columns: Vec<Vec<f64>> = used.iter().map(|&place| trials[place].changes[0].clone()).collect();
        let (normal, right) = self.normal(&self.white(&columns));
        let k = self.derivatives.ncols();
        let gain = |&(a, b): &(usize, usize)| {
            let place = |trial: usize| k + used.binary_search(&trial).expect("it is used");
            let wanted: Vec<usize> = (0..k).chain([place(a), place(b)]).collect();
            let matrix = DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| {
                normal[(wanted[i], wanted[j])] + if i == j && i >= k { FARTHEST.powi(-2) } else { 0.0 }
            });
            let vector = DVector::from_fn(wanted.len(), |i, _| right[wanted[i]]);
            let Some(found) = matrix.cholesky().map(|factor| factor.solve(&vector)) else { return 0.0 };
            let is_allowed = (k..k + 2).all(|index| found[index] > 0.0);
            if is_allowed { found.dot(&vector) } else { 0.0 }
        };
        parallel::map(pairs.iter(), gain)
    }

    /// value − model after the steps, and with the columns, to first order.
    pub(super) fn left(&self, line: &Explanation, found: &[f64], columns: &[Vec<f64>]) -> Vec<f64> {
        let mut left = self.off.clone();
        for (column, step) in line.derivatives.column_iter().zip(found) {
            left.iter_mut().zip(column.iter()).for_each(|(left, value)| *left -= step * value);
        }
        for (column, strength) in columns.iter().zip(&found[line.unknowns.len()..]) {
            left.iter_mut().zip(column).for_each(|(left, value)| *left -= strength * value);
        }
        left
    }

    /// The priors' part after steps.
    pub(super) fn prior(&self, found: &[f64]) -> f64 {
        let one = |(prior, step): (&Option<(f64, f64)>, &f64)| {
            prior.map_or(0.0, |(apart, width)| ((step - apart) / width).powi(2))
        };
        self.priors.iter().zip(found).map(one).sum()
    }
}
