//! Errors estimated from the rows, file by file: scale, correlation along trails, wrong rows, a constant pedestal.
//!
//! Quoted errors of flight data are wrong by a factor, correlated along trails, and some rows are wrong altogether. All of this is
//! estimated from the scatter of rows about everything that may be smooth (`smooth`), never from the residuals of a model alone,
//! since these would include a missing effect. The search then uses data with these errors (`allowed_for`). At the adopted model
//! they are estimated once more; if they differ, the search is repeated with the new ones.

mod restricted_likelihood;
mod smooth;
pub(super) mod wrong_rows;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use statrs::statistics::{Data, Median};

use super::fitted_model::{Case, Node};
use super::result::Reason;
use super::search::Expansion;
use super::unrecorded;
use crate::analysis::measurement::DataSet;
use crate::analysis::validate::along_neighbours;
use crate::analysis::whitening::{Neighbours, Shared, trails};
use restricted_likelihood::Likeliest;

/// Rows of a file below which its errors are taken as quoted.
pub(super) const FEW: usize = 16;

/// Probabilities below which quoted errors are rejected. Errors that are too small turn noise into effects; errors that are too
/// large only hide effects.
const TOO_SMALL: f64 = 0.02;
pub(super) const TOO_LARGE: f64 = 1e-4;

/// The same if they were rejected before: a search must not alternate.
const STILL: f64 = 0.2;

/// Factor by which errors may be wrong; if it is exceeded (by more than its own error), the data cannot be used.
const AT_MOST: f64 = 3.4;

/// Differences of the logarithm of scales, and of correlations, below which two estimates are equal.
const SAME_SCALE: f64 = 0.15;
const SAME_CORRELATION: f64 = 0.15;

/// Sigma within which a row is right although another model had marked it as wrong.
const NEAR: f64 = 3.5;

/// Standard deviations by which chi2 exceeds quoted errors, so that they do not hide what is missing.
const EXCEEDED: f64 = 3.0;

/// Significance, in its errors, from which a pedestal counts.
const CLEAR: f64 = 3.5;

/// The errors of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct SetNoise {
    /// The file as given.
    pub file: String,
    /// True errors over quoted ones, for all rows; 1 if the scatter does not contradict the quoted ones.
    pub scale: f64,
    /// Correlation of neighbours in a trail; 0 if it is not significant.
    pub correlation: f64,
    /// Its error.
    pub(super) correlation_sigma: f64,
    /// The neighbours that it refers to.
    pub neighbours: Neighbours,
    /// Wrong rows, each with its residual in sigma.
    pub wrong: Vec<WrongRow>,
    /// Rows, by index, that a poorer model had marked as wrong and the model that explains the data has shown to be right.
    pub(super) right: Vec<usize>,
    /// A constant common to all values, in their unit; None if there is none.
    pub pedestal: Option<f64>,
    /// Error of such a constant; None if the file does not constrain it.
    pub pedestal_sigma: Option<f64>,
    /// Degrees of freedom from which a scale other than 1 was estimated.
    freedom: Option<f64>,
    /// Whether the scale is from a model that leaves only noise, larger than the errors.
    by_model: bool,
}

/// A row that is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongRow {
    /// Its index among the rows of the file.
    pub row: usize,
    /// Its line in the file; None for a table that was not read from a file.
    pub line: Option<usize>,
    /// Its distance from the prediction of the others, sigma.
    pub off_sigma: f64,
    /// Whether it was found with a model that explains all others, not from the surrounding rows.
    pub(super) by_model: bool,
}

impl WrongRow {
    fn over(self, scale: f64) -> WrongRow {
        WrongRow { off_sigma: self.off_sigma / scale, ..self }
    }
}

impl SetNoise {
    fn as_quoted(set: &DataSet) -> SetNoise {
        SetNoise {
            file: set.file.clone(),
            scale: 1.0,
            correlation: 0.0,
            correlation_sigma: 0.0,
            neighbours: Neighbours::default(),
            wrong: Vec::new(),
            right: Vec::new(),
            pedestal: None,
            pedestal_sigma: None,
            freedom: None,
            by_model: false,
        }
    }

    /// Whether the errors are too far from the quoted ones: the factor by which they are too large, or too small.
    pub(super) fn is_beyond(&self) -> bool {
        is_far_too_small(self.scale) || is_far_too_large(self.scale)
    }

    fn is_like(&self, other: &SetNoise) -> bool {
        let rows = |noise: &SetNoise| noise.wrong.iter().map(|wrong| wrong.row).collect::<Vec<_>>();
        (self.scale / other.scale).ln().abs() < SAME_SCALE
            && (self.correlation - other.correlation).abs() < SAME_CORRELATION
            && rows(self) == rows(other)
    }
}

/// Whether quoted errors are too small to be used, by the true ones over them.
pub(super) fn is_far_too_small(scale: f64) -> bool {
    scale > AT_MOST
}

/// Whether quoted errors are too large to be used, by the true ones over them.
pub(super) fn is_far_too_large(scale: f64) -> bool {
    scale < 1.0 / AT_MOST
}

/// The quoted errors.
pub(super) fn as_quoted(data: &[DataSet]) -> Vec<SetNoise> {
    data.iter().map(SetNoise::as_quoted).collect()
}

/// Errors multiplied by a factor.
pub(super) fn larger(noise: &[SetNoise], factor: f64) -> Vec<SetNoise> {
    noise.iter().map(|noise| SetNoise { scale: factor * noise.scale, ..noise.clone() }).collect()
}

/// The same wrong rows, with the quoted scales.
pub(super) fn with_scales_of_1(noise: &[SetNoise]) -> Vec<SetNoise> {
    let as_quoted = |noise: &SetNoise| {
        let wrong = noise.wrong.iter().map(|wrong| if wrong.by_model { *wrong } else { wrong.over(1.0 / noise.scale) });
        SetNoise { scale: 1.0, freedom: None, wrong: wrong.collect(), ..noise.clone() }
    };
    noise.iter().map(as_quoted).collect()
}

/// The same scales, with no row marked, as wrong or as right.
pub(super) fn unmarked(noise: &[SetNoise]) -> Vec<SetNoise> {
    noise.iter().map(|noise| SetNoise { wrong: Vec::new(), right: Vec::new(), ..noise.clone() }).collect()
}

/// Whether two estimates are equivalent for a search.
pub(super) fn is_same(one: &[SetNoise], other: &[SetNoise]) -> bool {
    one.iter().zip(other).all(|(one, other)| one.is_like(other))
}

/// Rows of all files below which no pedestals are allowed for: with few values, a pedestal may be all that an effect does.
const FEW_IN_ALL: usize = 8;

/// Data with the estimated errors, and with pedestals allowed for.
pub(super) fn allowed_for(quoted: &[DataSet], noise: &[SetNoise]) -> Vec<DataSet> {
    let rows: usize = quoted.iter().map(|set| set.rows.len()).sum();
    let with = |(set, noise): (&DataSet, &SetNoise)| {
        let mut set = set.clone();
        for row in &mut set.rows {
            row.sigma *= noise.scale;
            row.common.sigma *= noise.scale;
        }
        for wrong in &noise.wrong {
            // Its error is raised to its distance from the others.
            set.rows[wrong.row].sigma *= wrong.off_sigma.abs().max(1.0);
        }
        set.shared = Shared {
            correlation: noise.correlation,
            correlation_sigma: noise.correlation_sigma,
            neighbours: noise.neighbours,
            pedestal: rows >= FEW_IN_ALL,
            wrong: noise.wrong.iter().map(|wrong| wrong.row).collect(),
            right: noise.right.clone(),
            freedom: noise.freedom,
        };
        set
    };
    quoted.iter().zip(noise).map(with).collect()
}

/// The errors of all files, estimated from residuals at a fitted model beyond every change that an effect could make. Rows that a
/// model has shown to be wrong stay so.
pub(super) fn estimate(case: &Case, quoted: &[DataSet], expansion: &Expansion, known: &[SetNoise]) -> Vec<SetNoise> {
    let node = &expansion.node;
    let signatures: Vec<DVector<f64>> = node
        .basis
        .column_iter()
        .chain(expansion.trials.iter().flatten().flat_map(|trial| trial.basis.column_iter()))
        .map(|column| case.coloured(column.as_slice()))
        .collect();
    let per_kelvin = unrecorded::per_kelvin(case, node);
    let of = |(index, set): (usize, &DataSet)| {
        let rows = case.rows(index);
        if rows.len() < FEW {
            let known = &known[index];
            let as_known = if known.by_model { known.clone() } else { SetNoise::as_quoted(set) };
            return SetNoise { wrong: by_model(known), right: known.right.clone(), ..as_known };
        }
        let model = &node.fit.values[rows.clone()];
        let as_quoted = |signature: &DVector<f64>| {
            let signature = signature.rows_range(rows.clone());
            let column = signature.iter().zip(&set.rows).zip(&case.sigmas[rows.clone()]);
            DVector::from_iterator(rows.len(), column.map(|((value, row), sigma)| value * sigma / row.own_sigma()))
        };
        let residuals = set.rows.iter().zip(model).map(|(row, model)| (row.value - model) / row.own_sigma());
        let residuals = DVector::from_iterator(rows.len(), residuals);
        let signatures = signatures.iter().map(as_quoted).collect();
        let drifts =
            per_kelvin.as_ref().map(|change| smooth::of_epochs(set, &change[rows.clone()])).unwrap_or_default();
        let smooth = smooth::directions(smooth::of_groups(set), smooth::columns(set, model), signatures, drifts);
        of_set(set, &residuals, &smooth, &known[index])
    };
    quoted.iter().enumerate().map(of).collect()
}

/// The same at a model that explains the data: marked rows stay wrong if they are as far from it as wrong rows are, and are right
/// after all if they are within noise.
pub(super) fn confirmed(case: &Case, node: &Node, noise: &[SetNoise]) -> Vec<SetNoise> {
    let of = |(index, noise): (usize, &SetNoise)| {
        let first = case.rows(index).start;
        let (mut wrong, mut right) = (Vec::new(), noise.right.clone());
        for row in &noise.wrong {
            let place = first + row.row;
            // Their errors had been raised to their distances.
            let sigma = case.sigmas[place] / row.off_sigma.abs().max(1.0);
            let off_sigma = (case.values[place] - node.fit.values[place]) / sigma;
            match off_sigma.abs() {
                far if far > wrong_rows::FAR => wrong.push(WrongRow { off_sigma, by_model: true, ..*row }),
                near if near < NEAR => right.push(row.row),
                _ => wrong.push(*row),
            }
        }
        SetNoise { wrong, right, ..noise.clone() }
    };
    noise.iter().enumerate().map(of).collect()
}

/// The errors of one file, estimated from its residuals (in quoted errors) about everything smooth.
fn of_set(set: &DataSet, residuals: &DVector<f64>, smooth: &DMatrix<f64>, known: &SetNoise) -> SetNoise {
    let mut wrong: Vec<WrongRow> = by_model(known);
    // Systematic errors stated as a floor need not show in the scatter.
    let has_floor = set.rows.iter().any(|row| row.floor > 0.0);
    let least_scatter = if has_floor { 1.0 } else { 1.0 / AT_MOST };
    let most = wrong_rows::most(residuals.len()).saturating_sub(wrong.len());
    let far = wrong_rows::of(residuals, smooth, least_scatter);
    let far = if wrong_rows::share_a_condition(set, &far) { Vec::new() } else { far };
    for (row, off_sigma) in far.into_iter().take(most) {
        if wrong.iter().all(|known| known.row != row) && !known.right.contains(&row) {
            wrong.push(WrongRow { row, line: set.table.lines.get(row).copied(), off_sigma, by_model: false });
        }
    }
    wrong.sort_by_key(|wrong| wrong.row);
    let is_wrong = |row: usize| wrong.iter().any(|wrong| wrong.row == row);
    let links = trails(set, |row| !is_wrong(row));
    let right: Vec<usize> = (0..residuals.len()).filter(|row| !is_wrong(*row)).collect();
    let found = Likeliest::of(residuals, smooth, &links, &right);
    let law = ChiSquared::new(found.freedom).expect("above 0");
    let squares = found.freedom * found.scale * found.scale;
    let too_small = if known.scale > 1.0 { STILL } else { TOO_SMALL };
    let too_large = if known.scale < 1.0 { STILL } else { TOO_LARGE };
    let believed = law.sf(squares) > too_small && (has_floor || law.cdf(squares) > too_large);
    let scale = if believed { 1.0 } else { found.scale.min(roughness(set, residuals, &found)) };
    let (scale, freedom) = match known.by_model {
        true => (scale.max(known.scale), known.freedom),
        false => (scale, (!believed).then_some(found.freedom)),
    };
    SetNoise {
        scale,
        by_model: known.by_model,
        correlation: found.correlation,
        correlation_sigma: found.correlation_sigma,
        neighbours: found.neighbours,
        // In units of the estimated errors.
        wrong: wrong.into_iter().map(|wrong| wrong.over(if wrong.by_model { 1.0 } else { scale })).collect(),
        freedom,
        right: known.right.clone(),
        ..SetNoise::as_quoted(set)
    }
}

/// Whether rows (by their indices among all, each with its residual) of some file are no accidents: of one sign, and all at one value of
/// a condition; or all rows of an epoch, two or more, of one sign.
pub(super) fn share_a_condition(case: &Case, rows: &[(usize, f64)]) -> bool {
    let of_one_file = (0..case.data.len()).any(|set| {
        let here = case.rows(set);
        let of_set = rows.iter().filter(|(row, _)| here.contains(row)).map(|(row, off)| (row - here.start, *off));
        wrong_rows::share_a_condition(&case.data[set], &of_set.collect::<Vec<_>>())
    });
    let times_yr: Vec<f64> = case.questions.iter().map(|question| question.at.t_yr).collect();
    of_one_file || wrong_rows::are_whole_epoch(&times_yr, rows)
}

/// Rows found wrong with a model that explains all others.
fn by_model(noise: &SetNoise) -> Vec<WrongRow> {
    noise.wrong.iter().filter(|wrong| wrong.by_model).copied().collect()
}

/// Scatter from row to row up to which errors are enlarged: what remains of a strong effect that is not smooth is no noise.
/// Unbounded if neighbours share their errors, or if the scatter is not clearly below the scale.
fn roughness(set: &DataSet, residuals: &DVector<f64>, found: &Likeliest) -> f64 {
    let scatter = along_neighbours(set, residuals.as_slice(), crate::analysis::validate::second_differences);
    // A scatter estimated from n rows is good to 1.6/√n (simulated); this is the least of several.
    let clearly = scatter * (1.0 + 6.4 / (residuals.len() as f64).sqrt());
    if found.correlation > 0.0 || clearly > found.scale { f64::INFINITY } else { scatter.max(1.0) }
}

/// The same with further wrong rows, by their indices among all, each with its residual in sigma.
pub(super) fn with_wrong(quoted: &[DataSet], noise: &[SetNoise], wrong: &[(usize, f64)]) -> Vec<SetNoise> {
    let mut all = noise.to_vec();
    for &(place, off_sigma) in wrong {
        let (mut set, mut row) = (0, place);
        while row >= quoted[set].rows.len() {
            row -= quoted[set].rows.len();
            set += 1;
        }
        let line = quoted[set].table.lines.get(row).copied();
        all[set].wrong.retain(|known| known.row != row);
        all[set].wrong.push(WrongRow { row, line, off_sigma, by_model: true });
        all[set].wrong.sort_by_key(|wrong| wrong.row);
    }
    all
}

/// The same with larger errors for a file in which a model leaves only noise, but more than its errors. None if this was done
/// before, or if the factor is beyond what can be allowed for.
pub(super) fn with_larger(case: &Case, noise: &[SetNoise], node: &Node, reason: &Reason) -> Option<Vec<SetNoise>> {
    let Reason::SmallErrors { file, factor } = reason else { return None };
    let index = noise.iter().position(|noise| noise.file == *file && !noise.by_model)?;
    let freedom = case.rows(index).len() as f64 * node.freedom() / case.n() as f64;
    let larger =
        SetNoise { scale: noise[index].scale * factor, freedom: Some(freedom), by_model: true, ..noise[index].clone() };
    let mut all = noise.to_vec();
    all[index] = larger;
    (!all[index].is_beyond()).then_some(all)
}

/// Share of the typical value of a file, and number of its typical errors, above which a pedestal is most of what was measured: not an
/// offset of the measurement that was overlooked.
const MOST: f64 = 0.5;
const FAR_ABOVE_ERRORS: f64 = 20.0;

/// Files in which a pedestal is most of the values, at a fitted model.
pub(super) fn dominated_by_pedestals(case: &Case, node: &Node) -> Vec<String> {
    let is_most = |(set, value, _): &(usize, f64, f64)| {
        let rows = case.rows(*set);
        let typical = |numbers: &[f64]| Data::new(numbers.iter().map(|x| x.abs()).collect::<Vec<_>>()).median();
        value.abs() > MOST * typical(&case.values[rows.clone()])
            && value.abs() > FAR_ABOVE_ERRORS * typical(&case.sigmas[rows])
    };
    case.pedestals(node).into_iter().filter(is_most).map(|(set, ..)| case.data[set].file.clone()).collect()
}

/// Quoted errors that look far too large are kept if free parameters alone leave more than them: what is missing stands above them
/// all the same. Values of a calibration file, smoothed by its makers, are like that.
pub(super) fn kept_if_exceeded(case: &Case, base: &Node, known: &[SetNoise], found: Vec<SetNoise>) -> Vec<SetNoise> {
    let taken = base.freedom() / case.n() as f64;
    let kept = |(set, found): (usize, SetNoise)| {
        let rows = case.rows(set);
        let freedom = (rows.len() as f64 * taken).max(1.0);
        let chi2 = base.residuals.rows_range(rows).norm_squared() * known[set].scale.powi(2);
        if !is_far_too_large(found.scale) || chi2 < freedom + EXCEEDED * (2.0 * freedom).sqrt() {
            return found;
        }
        let mut quoted = with_scales_of_1(&[found]).remove(0);
        quoted.wrong.retain(|wrong| wrong.by_model || wrong.off_sigma.abs() > wrong_rows::FAR);
        quoted
    };
    found.into_iter().enumerate().map(kept).collect()
}

/// The same with the pedestals at a fitted model.
pub(super) fn with_pedestals(case: &Case, node: &Node, noise: &[SetNoise]) -> Vec<SetNoise> {
    let mut all = noise.to_vec();
    for (set, value, sigma) in case.pedestals(node) {
        all[set].pedestal = (value.abs() > CLEAR * sigma).then_some(value);
        all[set].pedestal_sigma = Some(sigma);
    }
    all
}
