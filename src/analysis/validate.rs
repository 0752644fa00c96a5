//! Model against measurements: how far off, where, and against which condition the residuals lean.
//!
//! Nothing is adjusted here. A residual is (value − model)/sigma.

mod findings;
mod json;
pub mod lean;

use rayon::prelude::*;
use statrs::function::erf::erfc;

use crate::analysis::measurement::{DataSet, questions};
use crate::error::InputError;
use crate::io::table::{Cell, Column, Datatype, Table};
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::predict;
pub use findings::{Claim, Finding};
use lean::{Lean, Trial};

/// A model held against data.
#[derive(Clone, Debug)]
pub struct Validation {
    /// The mission.
    pub mission: Mission,
    /// Set by set, in the order given.
    pub sets: Vec<SetResult>,
    /// Sum of squared residuals.
    pub chi2: f64,
    /// Rows.
    pub n: usize,
    /// Leanings on all conditions and covariates that vary, the most significant first.
    pub leans: Vec<Lean>,
    /// Where the model fails; empty where it does not.
    pub findings: Vec<Finding>,
}

/// One data set against the model.
#[derive(Clone, Debug)]
pub struct SetResult {
    /// The data.
    pub data: DataSet,
    /// The model, row by row.
    pub model: Vec<f64>,
    /// Sum of squared residuals.
    pub chi2: f64,
    /// rms of value − model, in the observable's unit.
    pub rms: f64,
    /// Mean residual, in units of sigma; its error is 1/√n.
    pub bias_sigma: f64,
    /// Scatter of the residuals about smooth misfits, in units of sigma. Near 1 where the quoted errors are right.
    pub scatter_sigma: f64,
}

impl SetResult {
    fn new(data: &DataSet, model: Vec<f64>) -> SetResult {
        let residuals = residuals(data, &model);
        let n = data.rows.len() as f64;
        let rms =
            (data.rows.iter().zip(&model).map(|(row, model)| (row.value - model).powi(2)).sum::<f64>() / n).sqrt();
        SetResult {
            data: data.clone(),
            chi2: residuals.iter().map(|residual| residual * residual).sum(),
            rms,
            bias_sigma: residuals.iter().sum::<f64>() / n,
            scatter_sigma: scatter(data, &residuals),
            model,
        }
    }

    /// rms of the residuals, in units of sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.data.rows.len() as f64).sqrt()
    }

    /// The noise that leanings are judged by: 1, the quoted errors, unless the scatter is clearly larger.
    pub fn noise_sigma(&self) -> f64 {
        // A scatter estimated from n rows is good to 1.6/√n (simulated).
        let clearly = 1.0 + 2.0 * 1.6 / (self.data.rows.len() as f64).sqrt();
        if self.scatter_sigma > clearly { self.scatter_sigma } else { 1.0 }
    }

    /// Chance that noise alone makes a mean residual as large in any of so many trials.
    pub fn bias_alarm(&self, trials: usize) -> f64 {
        let errors = self.bias_sigma.abs() * (self.data.rows.len() as f64).sqrt() / self.noise_sigma();
        trials as f64 * erfc(errors / std::f64::consts::SQRT_2)
    }

    /// The name of the file without its folder.
    pub fn name(&self) -> &str {
        self.data.file.rsplit(['/', '\\']).next().expect("a last part")
    }

    /// (value − model)/sigma, row by row.
    pub fn residuals(&self) -> Vec<f64> {
        residuals(&self.data, &self.model)
    }
}

fn residuals(data: &DataSet, model: &[f64]) -> Vec<f64> {
    data.rows.iter().zip(model).map(|(row, model)| (row.value - model) / row.sigma).collect()
}

impl Validation {
    /// rms of the residuals, in units of sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.n as f64).sqrt()
    }

    /// The data sets' tables with columns `model` and `residual_sigma`, each with the name of a file.
    pub fn tables(&self) -> Vec<(String, Table)> {
        let with_model = |(index, set): (usize, &SetResult)| {
            let mut table = set.data.table.clone();
            // As astropy spells them.
            let unit = match set.data.observable.unit() {
                "" => None,
                "e-" => Some("electron".to_string()),
                "px" => Some("pix".to_string()),
                unit => Some(unit.to_string()),
            };
            for (name, unit, values) in [("model", unit, set.model.clone()), ("residual_sigma", None, set.residuals())]
            {
                table.columns.retain(|column| column.name != name);
                table.columns.push(Column {
                    name: name.into(),
                    unit,
                    datatype: Datatype::Float(64),
                    cells: values.into_iter().map(Cell::Number).collect(),
                    ..Column::default()
                });
            }
            (format!("{}.ecsv", file_stem(index, &set.data)), table)
        };
        self.sets.iter().enumerate().map(with_model).collect()
    }

    /// By how many of its standard deviations chi2 is more than noise makes: that of n independent rows is n ± √(2n).
    pub fn excess(&self) -> f64 {
        (self.chi2 - self.n as f64) / (2.0 * self.n as f64).sqrt()
    }

    /// The most significant trend of a data set, by its place; None where none is significant.
    pub fn trend(&self, set: usize) -> Option<&Lean> {
        findings::strongest(&self.leans, set)
    }

    /// Whether chi2 of all rows is more than noise makes.
    pub fn exceeds_noise(&self) -> bool {
        findings::chi2_chances(self.chi2, self.n)[1] < findings::SPOKEN
    }

    /// Whether chi2 of all rows is less than noise of the quoted errors makes.
    pub fn falls_short_of_noise(&self) -> bool {
        findings::chi2_chances(self.chi2, self.n)[0] < findings::SPOKEN
    }

    /// Whether the model explains the data: chi2 is what noise makes, and there is nothing to say of the residuals.
    pub fn within_noise(&self) -> bool {
        !self.exceeds_noise() && !self.falls_short_of_noise() && self.findings.is_empty()
    }

    /// Rows that are farthest off: data set, row, residual.
    pub fn worst(&self, count: usize) -> Vec<(usize, usize, f64)> {
        let rows = self.sets.iter().enumerate().flat_map(|(set, result)| {
            result.residuals().into_iter().enumerate().map(move |(row, residual)| (set, row, residual))
        });
        let mut rows: Vec<_> = rows.collect();
        rows.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        rows.truncate(count);
        rows
    }
}

/// A file's name without folder and ending, with the number of its data set, which tells two of one name apart.
pub(crate) fn file_stem(index: usize, data: &DataSet) -> String {
    let stem =
        std::path::Path::new(&data.file).file_stem().map_or_else(|| "data".into(), |stem| stem.to_string_lossy());
    format!("{}-{}", index + 1, plain_name(&stem))
}

/// The name of a file that is called so: letters, digits, and nothing that a shell reads.
pub(crate) fn plain_name(name: &str) -> String {
    name.chars().map(|letter| if letter.is_alphanumeric() || "._".contains(letter) { letter } else { '_' }).collect()
}

/// Holds a mission against data. The seed is that of the simulated noise with which leanings are compared.
///
/// # Errors
/// Where the model has no value for a row.
pub fn validate(mission: &Mission, data: &[DataSet], seed: u64) -> Result<Validation, InputError> {
    let model = Model::new(mission);
    let values = predict(&model, &questions(data))?;
    let mut sets = Vec::new();
    let mut rest = values.as_slice();
    for set in data {
        let (values, after) = rest.split_at(set.rows.len());
        rest = after;
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            let fault = set.table.fault(Some(row), None, format!("the model has no {} here", set.observable));
            return Err(fault.with_help("the galaxy has lost its shape: so large a change cannot be measured"));
        }
        sets.push(SetResult::new(set, values.to_vec()));
    }
    let chi2 = sets.iter().map(|set| set.chi2).sum();
    let n = sets.iter().map(|set| set.data.rows.len()).sum();
    let trials: Vec<Trial> = sets
        .par_iter()
        .enumerate()
        .flat_map(|(index, set)| set.data.varying.par_iter().filter_map(move |name| Trial::of(index, &set.data, name)))
        .collect();
    let residuals: Vec<Vec<f64>> = sets.iter().map(SetResult::residuals).collect();
    let scatter: Vec<f64> = sets.iter().map(SetResult::noise_sigma).collect();
    let leans = lean::all(&trials, &residuals, &scatter, seed);
    let findings = findings::of(&sets, &leans);
    Ok(Validation { mission: mission.clone(), sets, chi2, n, leans, findings })
}

/// Scatter about what is smooth: the median second difference of neighbouring residuals, as the standard deviation of
/// normal noise that has it. Neighbours are those in the condition along which that is least.
fn scatter(data: &DataSet, residuals: &[f64]) -> f64 {
    along_neighbours(data, residuals, second_differences)
}

/// The least that a measure of roughness comes to when rows are put in the order of one condition after another.
pub(crate) fn along_neighbours(data: &DataSet, residuals: &[f64], roughness: fn(&[f64]) -> f64) -> f64 {
    let along = |first: &String| {
        // Sorted by all other conditions, then by this one.
        let others = data.varying.iter().filter(|name| *name != first).chain([first]);
        let columns: Vec<Vec<f64>> = others.map(|name| data.against(name)).collect();
        let mut rows: Vec<usize> = (0..residuals.len()).collect();
        rows.sort_by(|a, b| {
            let differs = columns.iter().map(|column| column[*a].total_cmp(&column[*b])).find(|order| order.is_ne());
            differs.unwrap_or(a.cmp(b))
        });
        roughness(&rows.into_iter().map(|row| residuals[row]).collect::<Vec<_>>())
    };
    data.varying.iter().map(along).fold(roughness(residuals), f64::min)
}

/// Rows below which a scatter is not estimated.
const FEW: usize = 8;

fn second_differences(residuals: &[f64]) -> f64 {
    if residuals.len() < FEW {
        return 1.0;
    }
    let mut differences: Vec<f64> =
        residuals.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs()).collect();
    differences.sort_by(f64::total_cmp);
    // The median of |a − 2b + c| of three normal numbers is 0.6745 √6.
    differences[differences.len() / 2] / (0.674_489_750_196 * 6.0_f64.sqrt())
}
