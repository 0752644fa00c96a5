//! Errors as the rows tell them, file by file: scale, correlation along trails, rows that are wrong, a constant pedestal.
//!
//! Quoted errors of flown data are wrong by a factor, shared along trails, and some rows are wrong altogether. All of that is
//! told from how rows differ from what is smooth around them (`smooth`): never from what a model leaves, or a missing effect
//! would hide in it. The search then sees data with these errors (`allowed_for`). At the model that a search adopts they are
//! estimated once more; where they come out otherwise, it is repeated with these.

mod restricted_likelihood;
mod smooth;
mod wrong_rows;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::evidence::Found;
use super::fitted_model::{Case, Node};
use super::result::Reason;
use super::search::Expansion;
use crate::analysis::measurement::DataSet;
use crate::analysis::validate::along_neighbours;
use crate::analysis::whitening::{Neighbours, Shared, trails};
use restricted_likelihood::Likeliest;

/// Rows of a file below which its errors are taken as quoted.
const FEW: usize = 16;

/// Chances below which quoted errors are not believed: too small ones make effects out of noise, too large ones only hide them.
const TOO_SMALL: f64 = 0.02;
const TOO_LARGE: f64 = 1e-4;

/// The same where they were not believed before: a search is not to go back and forth.
const STILL: f64 = 0.2;

/// Factor by which errors may be wrong; beyond it (by more than its own error) nothing is to be made of the data.
const AT_MOST: f64 = 3.4;

/// Logarithm of scales, and difference of correlations, below which two estimates are one.
const SAME_SCALE: f64 = 0.15;
const SAME_CORRELATION: f64 = 0.15;

/// Sigma within which a row is right of which another model said that it is wrong.
const NEAR: f64 = 3.5;

/// Pedestals from so many of their errors on are evidence.
const CLEAR: f64 = 3.5;

/// The errors of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct SetNoise {
    /// The file as given.
    pub file: String,
    /// True errors over quoted ones, of all rows alike; 1 where the scatter does not contradict them.
    pub scale: f64,
    /// Correlation of neighbours in a trail; 0 where it is not clear.
    pub correlation: f64,
    /// Which neighbours that is meant of.
    pub neighbours: Neighbours,
    /// Rows that are wrong, each with how far off it is, in sigma.
    pub wrong: Vec<WrongRow>,
    /// Rows, by their places, that a worse model had called wrong, and the one that explains the data has shown to be right.
    pub(super) right: Vec<usize>,
    /// A constant that all values have in common, in their unit; None where there is none.
    pub pedestal: Option<f64>,
    /// Error of a constant; None where the file cannot tell one.
    pub pedestal_sigma: Option<f64>,
    /// Degrees of freedom that a scale other than 1 was estimated from.
    freedom: Option<f64>,
    /// Whether the scale is known from a model that leaves nothing but noise, more of it than the errors say.
    by_model: bool,
}

/// A row that is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongRow {
    /// Its place among the rows of the file.
    pub row: usize,
    /// Its line in the file; None for a table that was not read from a file.
    pub line: Option<usize>,
    /// How far it is from what the others predict, in sigma.
    pub off_sigma: f64,
    /// Whether that is known from a model which explains all others, not from the rows around it.
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
            neighbours: Neighbours::default(),
            wrong: Vec::new(),
            right: Vec::new(),
            pedestal: None,
            pedestal_sigma: None,
            freedom: None,
            by_model: false,
        }
    }

    /// Whether the errors are too far from the quoted ones: by which factor they are too large, or too small.
    pub(super) fn is_beyond(&self) -> bool {
        self.scale > AT_MOST || self.scale < 1.0 / AT_MOST
    }

    fn is_like(&self, other: &SetNoise) -> bool {
        let rows = |noise: &SetNoise| noise.wrong.iter().map(|wrong| wrong.row).collect::<Vec<_>>();
        (self.scale / other.scale).ln().abs() < SAME_SCALE
            && (self.correlation - other.correlation).abs() < SAME_CORRELATION
            && rows(self) == rows(other)
    }
}

/// Errors as they are quoted.
pub(super) fn as_quoted(data: &[DataSet]) -> Vec<SetNoise> {
    data.iter().map(SetNoise::as_quoted).collect()
}

/// Errors so many times larger.
pub(super) fn larger(noise: &[SetNoise], factor: f64) -> Vec<SetNoise> {
    noise.iter().map(|noise| SetNoise { scale: factor * noise.scale, ..noise.clone() }).collect()
}

/// The same rows wrong, with the scales that are quoted.
pub(super) fn with_scales_of_1(noise: &[SetNoise]) -> Vec<SetNoise> {
    let as_quoted = |noise: &SetNoise| {
        let wrong = noise.wrong.iter().map(|wrong| if wrong.by_model { *wrong } else { wrong.over(1.0 / noise.scale) });
        SetNoise { scale: 1.0, freedom: None, wrong: wrong.collect(), ..noise.clone() }
    };
    noise.iter().map(as_quoted).collect()
}

/// Whether two estimates are the same for a search.
pub(super) fn is_same(one: &[SetNoise], other: &[SetNoise]) -> bool {
    one.iter().zip(other).all(|(one, other)| one.is_like(other))
}

/// Rows of all files below which no pedestals are allowed for: one of a few values may be all that an effect does.
const FEW_IN_ALL: usize = 8;

/// Data with the errors that were estimated, and pedestals allowed for.
pub(super) fn allowed_for(quoted: &[DataSet], noise: &[SetNoise]) -> Vec<DataSet> {
    let rows: usize = quoted.iter().map(|set| set.rows.len()).sum();
    let with = |(set, noise): (&DataSet, &SetNoise)| {
        let mut set = set.clone();
        for row in &mut set.rows {
            row.sigma *= noise.scale;
        }
        for wrong in &noise.wrong {
            // As far off as its error is then.
            set.rows[wrong.row].sigma *= wrong.off_sigma.abs().max(1.0);
        }
        set.shared = Shared {
            correlation: noise.correlation,
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

/// The errors of all files, told from residuals at a fitted model and every way in which an effect could change them. Rows that
/// are known to be wrong from a model stay so.
pub(super) fn estimate(case: &Case, quoted: &[DataSet], expansion: &Expansion, known: &[SetNoise]) -> Vec<SetNoise> {
    let node = &expansion.node;
    let signatures: Vec<DVector<f64>> = node
        .basis
        .column_iter()
        .chain(expansion.trials.iter().flatten().flat_map(|trial| trial.basis.column_iter()))
        .map(|column| case.coloured(column.as_slice()))
        .collect();
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
            DVector::from_iterator(rows.len(), column.map(|((value, row), sigma)| value * sigma / row.sigma))
        };
        let residuals = set.rows.iter().zip(model).map(|(row, model)| (row.value - model) / row.sigma);
        let residuals = DVector::from_iterator(rows.len(), residuals);
        let signatures = signatures.iter().map(as_quoted).collect();
        let smooth = smooth::directions(smooth::columns(set, model), signatures);
        of_set(set, &residuals, &smooth, &known[index])
    };
    quoted.iter().enumerate().map(of).collect()
}

/// The same, at a model that explains the data: rows that are as far from it as rows are that are wrong stay so, and those are right
/// after all that are no farther than noise puts rows.
pub(super) fn confirmed(case: &Case, node: &Node, noise: &[SetNoise]) -> Vec<SetNoise> {
    let of = |(index, noise): (usize, &SetNoise)| {
        let first = case.rows(index).start;
        let (mut wrong, mut right) = (Vec::new(), noise.right.clone());
        for row in &noise.wrong {
            let place = first + row.row;
            // Their errors were made as large as they are far off.
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

/// The errors of one file, told from its residuals (in quoted errors) about what is smooth.
fn of_set(set: &DataSet, residuals: &DVector<f64>, smooth: &DMatrix<f64>, known: &SetNoise) -> SetNoise {
    let mut wrong: Vec<WrongRow> = by_model(known);
    // Systematic errors that are stated as a floor need not show in the scatter.
    let has_floor = set.rows.iter().any(|row| row.floor > 0.0);
    let least_scatter = if has_floor { 1.0 } else { 1.0 / AT_MOST };
    let most = wrong_rows::most(residuals.len()).saturating_sub(wrong.len());
    for (row, off_sigma) in wrong_rows::of(residuals, smooth, least_scatter).into_iter().take(most) {
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
        neighbours: found.neighbours,
        // In errors as they are.
        wrong: wrong.into_iter().map(|wrong| wrong.over(if wrong.by_model { 1.0 } else { scale })).collect(),
        freedom,
        right: known.right.clone(),
        ..SetNoise::as_quoted(set)
    }
}

/// Rows that are wrong as a model tells that explains all others.
fn by_model(noise: &SetNoise) -> Vec<WrongRow> {
    noise.wrong.iter().filter(|wrong| wrong.by_model).copied().collect()
}

/// Scatter from row to row beyond which errors are not enlarged: what is left of a strong effect where it is not smooth is no
/// noise. Without bound where neighbours share their errors, and where the scatter is not clearly less than the scale.
fn roughness(set: &DataSet, residuals: &DVector<f64>, found: &Likeliest) -> f64 {
    let scatter = along_neighbours(set, residuals.as_slice(), crate::analysis::validate::second_differences);
    // A scatter estimated from n rows is good to 1.6/√n (simulated); this is the least of several.
    let clearly = scatter * (1.0 + 6.4 / (residuals.len() as f64).sqrt());
    if found.correlation > 0.0 || clearly > found.scale { f64::INFINITY } else { scatter.max(1.0) }
}

/// The same with more rows that are wrong, by their places among all, each with how far it is off, in sigma.
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

/// The same with larger errors of the file in which a model leaves more noise than they say, and nothing else; None where a search found
/// no such model, and where that was done before or is more than can be allowed for.
pub(super) fn with_larger(case: &Case, noise: &[SetNoise], found: &Found) -> Option<Vec<SetNoise>> {
    let (Reason::SmallErrors { file, factor }, Some(node)) = (&found.reason, &found.nearest) else { return None };
    let index = noise.iter().position(|noise| noise.file == *file && !noise.by_model)?;
    let freedom = case.rows(index).len() as f64 * node.freedom() / case.n() as f64;
    let larger =
        SetNoise { scale: noise[index].scale * factor, freedom: Some(freedom), by_model: true, ..noise[index].clone() };
    let mut all = noise.to_vec();
    all[index] = larger;
    (!all[index].is_beyond()).then_some(all)
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
