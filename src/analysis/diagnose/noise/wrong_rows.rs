//! Rows that are wrong, found one by one.
//!
//! A row is wrong where it is far from what all others predict by what is smooth (an externally studentised residual: Cook &
//! Weisberg 1982, Residuals and Influence in Regression, section 2.2), in units of a scatter that a few wrong rows do not move: the
//! median. The farthest is left out, the rest is smoothed again, until none is far, or more than one in twenty is: then it is
//! no accident of single rows; neither are rows next to one another that are off in the same direction.

use nalgebra::{DMatrix, DVector};

use crate::numeric::least_squares::Span;

/// Distance from which on a row is wrong, in units of the scatter.
const FAR: f64 = 5.0;

/// One row in this number may be wrong.
const ONE_IN: usize = 20;

/// Part of a row's residual that is its own, below which nothing is told of it: it may be all that shows an effect.
const ITS_OWN: f64 = 0.3;

/// Median of |x| of normal x.
const MEDIAN: f64 = 0.674_489_750_196;

/// How many rows of a file may be wrong.
pub(super) fn most(rows: usize) -> usize {
    rows.div_ceil(ONE_IN)
}

/// Rows that are wrong, each with how far it is from what the others predict, in quoted errors; rising.
/// A scatter of less than the least one, in quoted errors, is not believed.
pub(super) fn of(residuals: &DVector<f64>, smooth: &DMatrix<f64>, least_scatter: f64) -> Vec<(usize, f64)> {
    let most = most(residuals.len());
    let mut wrong: Vec<usize> = Vec::new();
    loop {
        let right: Vec<usize> = (0..residuals.len()).filter(|row| !wrong.contains(row)).collect();
        let directions = Span::of(&smooth.select_rows(&right), 1e-6).directions().clone();
        let here = residuals.select_rows(&right);
        let left = &here - &directions * directions.tr_mul(&here);
        let studentised = |place: usize| {
            let own = 1.0 - directions.row(place).norm_squared();
            (own > ITS_OWN).then(|| left[place] / own.sqrt())
        };
        let all: Vec<(usize, f64)> =
            (0..right.len()).filter_map(|place| Some((right[place], studentised(place)?.abs()))).collect();
        let Some(farthest) = all.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else { return Vec::new() };
        let mut sizes: Vec<f64> = all.iter().map(|(_, size)| *size).collect();
        sizes.sort_by(f64::total_cmp);
        let scatter = (sizes[sizes.len() / 2] / MEDIAN).max(least_scatter);
        if farthest.1 < FAR * scatter {
            break;
        }
        if wrong.len() == most {
            return Vec::new();
        }
        wrong.push(farthest.0);
    }
    wrong.sort_unstable();
    let right: Vec<usize> = (0..residuals.len()).filter(|row| !wrong.contains(row)).collect();
    let found = Span::of(&smooth.select_rows(&right), 1e-6).solve(&residuals.select_rows(&right));
    let far: Vec<(usize, f64)> =
        wrong.into_iter().map(|row| (row, residuals[row] - (smooth.row(row) * &found)[0])).collect();
    // Neighbours that are off in the same direction are no accidents of single rows.
    let together = far.windows(2).any(|pair| pair[1].0 == pair[0].0 + 1 && pair[0].1.signum() == pair[1].1.signum());
    if together { Vec::new() } else { far }
}
