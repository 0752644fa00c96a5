//! The errors of one file: estimated at some residuals, and their likelihood.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use statrs::statistics::{Data, Median};

use super::Errors;
use crate::analysis::measurement::DataSet;
use crate::numeric::minimum::golden_section;
use crate::physics::observable::Observable;

/// Prior probability that a row is wrong, ε, and how much wider wrong rows scatter, K: one row in twenty may be wrong, by some ten
/// sigma.
const WRONG: f64 = 0.03;
const WIDER: f64 = 15.0;

/// Standard deviation of the prior of ln s: quoted errors are rarely wrong by more than a factor of two.
const SCALE_LN: f64 = 0.35;

/// Standard deviation of the prior of ρ, and its largest value.
const CORRELATION: f64 = 0.4;
const LARGEST_CORRELATION: f64 = 0.97;

/// Correlation times that a series needs: what is correlated over more than a third of it is a trend, and no noise.
const TIMES: f64 = 3.0;

/// Neighbours that a file needs for a correlation to be estimated.
const NEIGHBOURS: usize = 8;

/// Prior probability that a file carries a constant, and the standard deviation of its prior, in median errors.
const PEDESTAL: f64 = 0.3;
const PEDESTAL_SIGMA: f64 = 3.0;

/// The same probability for doses, which begin at zero when the instrument is launched: no more than for a row to be wrong.
const PEDESTAL_OF_DOSES: f64 = WRONG;

/// Rows of a file, and of all files, below which it may have no constant: it would be all that an effect does.
const ROWS_FOR_PEDESTAL: usize = 4;
const ROWS_FOR_ANY: usize = 8;

/// Sweeps through the unknowns at most, and the change of −2 ln L that ends them.
const SWEEPS: usize = 40;
const SETTLED: f64 = 1e-4;

/// Evaluations of the likelihood in a search for ρ, which determine it to 1e-3.
const GOLDEN: usize = 14;

/// Median absolute deviation of a normal variate, inverse.
const MAD: f64 = 1.4826;

/// Rows of one file.
pub(super) struct File {
    pub rows: Range<usize>,
    /// Independent part of each row's error, in the unit of the values.
    pub sigma: Vec<f64>,
    /// For each row its neighbour, and their distance in usual distances.
    pub before: Vec<Option<(usize, f64)>>,
    /// Changes of (value)/sigma with each common error, for one standard deviation of its prior, `[(row, error)]`; the first is the
    /// constant of a file that may have one, and 0 where it has none.
    common: DMatrix<f64>,
    without_pedestal: DMatrix<f64>,
    may_have_pedestal: bool,
    /// Probability that it has one.
    pedestal_probability: f64,
    /// The largest correlation of neighbours; 0 if they are too few.
    largest_correlation: f64,
}

impl File {
    pub fn of(set: &DataSet, start: usize, rows_of_all: usize) -> File {
        let n = set.rows.len();
        let sigma: Vec<f64> = set.rows.iter().map(|row| row.own_sigma()).collect();
        let before = super::series::neighbours(set, |_| true);
        let largest_correlation = match before.iter().flatten().count() {
            0..NEIGHBOURS => 0.0,
            _ => (-TIMES / longest(&before)).exp().min(LARGEST_CORRELATION),
        };
        let may_have_pedestal = n >= ROWS_FOR_PEDESTAL && rows_of_all >= ROWS_FOR_ANY;
        let typical = Data::new(sigma.clone()).median();
        let mut columns: Vec<DVector<f64>> = Vec::new();
        if may_have_pedestal {
            columns.push(DVector::from_fn(n, |row, _| PEDESTAL_SIGMA * typical / sigma[row]));
        }
        let mut groups: Vec<usize> =
            set.rows.iter().filter(|row| row.common.sigma > 0.0).map(|row| row.common.group).collect();
        groups.sort_unstable();
        groups.dedup();
        columns.extend(groups.into_iter().map(|group| {
            let share = |row: usize| {
                let common = set.rows[row].common;
                if common.group == group { common.sigma / sigma[row] } else { 0.0 }
            };
            DVector::from_fn(n, |row, _| share(row))
        }));
        let common = if columns.is_empty() { DMatrix::zeros(n, 0) } else { DMatrix::from_columns(&columns) };
        let mut without_pedestal = common.clone();
        if may_have_pedestal {
            without_pedestal.column_mut(0).fill(0.0);
        }
        let pedestal_probability = if set.observable == Observable::Dose { PEDESTAL_OF_DOSES } else { PEDESTAL };
        File {
            rows: start..start + n,
            sigma,
            before,
            common,
            without_pedestal,
            may_have_pedestal,
            pedestal_probability,
            largest_correlation,
        }
    }

    fn common(&self, has_pedestal: bool) -> &DMatrix<f64> {
        if has_pedestal { &self.common } else { &self.without_pedestal }
    }

    /// (off − common errors)/sigma.
    pub fn standardised(&self, off: &[f64], errors: &Errors) -> Vec<f64> {
        let columns = self.common(errors.has_pedestal);
        let shift = |row: usize| errors.common.iter().enumerate().map(|(k, b)| b * columns[(row, k)]).sum::<f64>();
        off.iter().zip(&self.sigma).enumerate().map(|(row, (off, sigma))| off / sigma - shift(row)).collect()
    }

    pub fn pedestal(&self, errors: &Errors) -> Option<(f64, f64)> {
        self.may_have_pedestal.then(|| {
            let with = Errors { has_pedestal: true, ..errors.clone() };
            let unit = self.pedestal_prior();
            let information = self.information(&with);
            let variance = information.try_inverse().map_or(1.0, |inverse| inverse[(0, 0)]);
            (errors.common[0] * unit, variance.sqrt() * unit)
        })
    }

    /// Standard deviation of the constant's prior, in the unit of the values; 0 if there may be none.
    pub fn pedestal_prior(&self) -> f64 {
        if self.may_have_pedestal { self.common[(0, 0)] * self.sigma[0] } else { 0.0 }
    }

    /// 1 + U'WU.
    fn information(&self, errors: &Errors) -> DMatrix<f64> {
        let white = self.whitened_common(errors);
        white.tr_mul(&white) + DMatrix::identity(white.ncols(), white.ncols())
    }

    /// Columns of the common errors, decorrelated and weighted.
    pub fn whitened_common(&self, errors: &Errors) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = self
            .common(errors.has_pedestal)
            .column_iter()
            .map(|column| DVector::from_vec(self.whitened(column.as_slice(), errors)))
            .collect();
        if columns.is_empty() { DMatrix::zeros(self.sigma.len(), 0) } else { DMatrix::from_columns(&columns) }
    }

    /// z, decorrelated, and weighted by the probability of each row to be right.
    pub fn whitened(&self, z: &[f64], errors: &Errors) -> Vec<f64> {
        let one = |row: usize| {
            let (e, d) = self.innovation(z, &errors.right, errors.correlation, row);
            e * (errors.right[row] / d).sqrt() / errors.scale
        };
        (0..z.len()).map(one).collect()
    }

    /// e and d of a row.
    fn innovation(&self, z: &[f64], right: &[f64], correlation: f64, row: usize) -> (f64, f64) {
        match self.before[row] {
            Some((before, apart)) if correlation > 0.0 => {
                let share = if apart == 1.0 { correlation } else { correlation.powf(apart) };
                (z[row] - share * right[before] * z[before], 1.0 - share * share * right[before])
            }
            _ => (z[row], 1.0),
        }
    }

    /// The likeliest errors at value − model, from several starts, with a constant of the file and without.
    pub fn errors(&self, off: &[f64], near: Option<&Errors>) -> Errors {
        let plain = self.plain(1.0);
        let mut starts = vec![plain.clone(), self.robust(off, &plain)];
        if self.may_have_pedestal {
            let constant = Errors { has_pedestal: true, ..plain };
            starts.push(self.robust(off, &constant));
        }
        starts.extend(near.cloned());
        // With correlated errors and without: what is correlated is not smaller than quoted.
        let both = |start: Errors| {
            let without = self.settled(off, Errors { correlation: 0.0, ..start.clone() }, false);
            [(self.largest_correlation > 0.0).then(|| self.settled(off, start, true)), Some(without)]
        };
        let settled = starts.into_iter().flat_map(both).flatten();
        settled.min_by(|a, b| a.minus_2_ln_l.total_cmp(&b.minus_2_ln_l)).expect("a start")
    }

    /// A start: all rows right, no correlation, no common errors.
    fn plain(&self, scale: f64) -> Errors {
        Errors {
            scale,
            correlation: 0.0,
            has_pedestal: false,
            common: vec![0.0; self.common.ncols()],
            right: vec![1.0; self.sigma.len()],
            minus_2_ln_l: f64::INFINITY,
        }
    }

    /// The same about the median, if there may be a constant, with the scale of the median deviation.
    fn robust(&self, off: &[f64], start: &Errors) -> Errors {
        let z = self.standardised(off, start);
        let median = |values: Vec<f64>| Data::new(values).median();
        let middle = if start.has_pedestal { median(z.clone()) } else { 0.0 };
        let spread = median(z.iter().map(|z| (z - middle).abs()).collect());
        let mut robust = Errors { scale: (MAD * spread).max(0.1), ..start.clone() };
        if start.has_pedestal {
            robust.common[0] = middle / median(self.common.column(0).iter().copied().collect());
        }
        robust
    }

    /// Alternates between the unknowns until −2 ln L settles.
    fn settled(&self, off: &[f64], start: Errors, correlates: bool) -> Errors {
        let mut here = start;
        let mut best: Option<Errors> = None;
        let mut last = f64::INFINITY;
        for _ in 0..SWEEPS {
            let z = self.standardised(off, &here);
            here.right = self.right(&z, &here);
            here.scale = self.scale(&z, &here);
            if correlates {
                here.correlation = self.correlation(&z, &here);
                if here.correlation > 0.0 {
                    here.scale = here.scale.max(1.0);
                }
            }
            if self.common.ncols() > 0 {
                here.common = self.common_errors(off, &here);
            }
            here.minus_2_ln_l = self.minus_2_ln_l(off, &here);
            if !here.minus_2_ln_l.is_finite() {
                break;
            }
            if best.as_ref().is_none_or(|best| here.minus_2_ln_l < best.minus_2_ln_l) {
                best = Some(here.clone());
            }
            if (last - here.minus_2_ln_l).abs() < SETTLED {
                break;
            }
            last = here.minus_2_ln_l;
        }
        best.unwrap_or(Errors { minus_2_ln_l: f64::INFINITY, ..here })
    }

    /// ln of both components of a row's density, up to the same constant.
    fn components(&self, z: &[f64], errors: &Errors, row: usize) -> [f64; 2] {
        let (e, d) = self.innovation(z, &errors.right, errors.correlation, row);
        let s = errors.scale;
        let right = (1.0 - WRONG).ln() - 0.5 * e * e / (s * s * d) - 0.5 * d.ln() - s.ln();
        let wide = WIDER * s;
        [right, WRONG.ln() - 0.5 * (z[row] / wide).powi(2) - wide.ln()]
    }

    fn right(&self, z: &[f64], errors: &Errors) -> Vec<f64> {
        let one = |row: usize| {
            let [right, wrong] = self.components(z, errors, row);
            1.0 / (1.0 + (wrong - right).exp())
        };
        (0..z.len()).map(one).collect()
    }

    /// The likeliest scale: the minimum of 2 n ln s + S/s² + (ln s/w)², by Newton's method in ln s.
    fn scale(&self, z: &[f64], errors: &Errors) -> f64 {
        let square = |row: usize| {
            let (e, d) = self.innovation(z, &errors.right, errors.correlation, row);
            errors.right[row] * e * e / d + (1.0 - errors.right[row]) * (z[row] / WIDER).powi(2)
        };
        let (n, squares) = (z.len() as f64, (0..z.len()).map(square).sum::<f64>());
        let mut ln_s = errors.scale.ln();
        for _ in 0..30 {
            let left = squares * (-2.0 * ln_s).exp();
            let slope = 2.0 * n - 2.0 * left + 2.0 * ln_s / (SCALE_LN * SCALE_LN);
            let step = (slope / (4.0 * left + 2.0 / (SCALE_LN * SCALE_LN))).clamp(-1.0, 1.0);
            ln_s -= step;
            if step.abs() < 1e-6 {
                break;
            }
        }
        ln_s.exp()
    }

    /// The likeliest correlation with the other unknowns as they are.
    fn correlation(&self, z: &[f64], errors: &Errors) -> f64 {
        let cost = |correlation: f64| {
            let linked = (0..z.len()).filter(|&row| self.before[row].is_some());
            let one = |row: usize| {
                let (e, d) = self.innovation(z, &errors.right, correlation, row);
                errors.right[row] * (e * e / (d * errors.scale * errors.scale) + d.ln())
            };
            linked.map(one).sum::<f64>() + (correlation / CORRELATION).powi(2)
        };
        let found = golden_section([0.0, self.largest_correlation], GOLDEN, cost);
        if cost(found) < cost(0.0) { found } else { 0.0 }
    }

    /// The likeliest common errors with the other unknowns as they are: weighted least squares.
    fn common_errors(&self, off: &[f64], errors: &Errors) -> Vec<f64> {
        let z: Vec<f64> = off.iter().zip(&self.sigma).map(|(off, sigma)| off / sigma).collect();
        let white = self.whitened_common(errors);
        let right = white.tr_mul(&DVector::from_vec(self.whitened(&z, errors)));
        let information = white.tr_mul(&white) + DMatrix::identity(white.ncols(), white.ncols());
        information.cholesky().map_or(errors.common.clone(), |factor| factor.solve(&right).as_slice().to_vec())
    }

    fn minus_2_ln_l(&self, off: &[f64], errors: &Errors) -> f64 {
        let z = self.standardised(off, errors);
        let one = |row: usize| {
            let [right, wrong] = self.components(&z, errors, row);
            let larger = right.max(wrong);
            -2.0 * (larger + ((right - larger).exp() + (wrong - larger).exp()).ln())
        };
        let priors = (errors.scale.ln() / SCALE_LN).powi(2)
            + (errors.correlation / CORRELATION).powi(2)
            + errors.common.iter().map(|b| b * b).sum::<f64>();
        let volume = if errors.common.is_empty() {
            0.0
        } else {
            let factor = self.information(errors).cholesky();
            factor.map_or(f64::INFINITY, |factor| 2.0 * factor.l().diagonal().iter().map(|x| x.ln()).sum::<f64>())
        };
        let constant = match (self.may_have_pedestal, errors.has_pedestal) {
            (true, true) => -2.0 * self.pedestal_probability.ln(),
            (true, false) => -2.0 * (1.0 - self.pedestal_probability).ln(),
            _ => 0.0,
        };
        (0..z.len()).map(one).sum::<f64>() + priors + volume + constant
    }

    /// −2 ln of the prior probability of errors over that of errors as quoted: what they cost a model that needs them.
    pub fn improbability(&self, errors: &Errors) -> f64 {
        let wrong = errors.right.iter().map(|right| 1.0 - right).sum::<f64>();
        let of_wrong = 2.0 * ((1.0 - WRONG) * WIDER / WRONG).ln();
        let probability = self.pedestal_probability;
        let constant = if errors.has_pedestal {
            2.0 * ((1.0 - probability) / probability).ln() + errors.common[0].powi(2)
        } else {
            0.0
        };
        (errors.scale.ln() / SCALE_LN).powi(2)
            + (errors.correlation / CORRELATION).powi(2)
            + wrong * of_wrong
            + constant
    }
}

/// Length of the longest series, in usual distances.
fn longest(before: &[Option<(usize, f64)>]) -> f64 {
    let mut lengths: Vec<Option<f64>> = vec![None; before.len()];
    for row in 0..before.len() {
        // From the row back to the first known one, and forward again.
        let mut path = vec![row];
        while let Some((before, _)) =
            before[*path.last().expect("a row")].filter(|(before, _)| lengths[*before].is_none())
        {
            path.push(before);
        }
        for row in path.into_iter().rev() {
            lengths[row] = Some(before[row].map_or(0.0, |(before, apart)| lengths[before].unwrap_or(0.0) + apart));
        }
    }
    lengths.into_iter().flatten().fold(1.0, f64::max)
}
