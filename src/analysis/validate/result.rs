//! A model compared with data: residuals, data set by data set, and their significant trends.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use statrs::function::erf::erfc;

use super::residual_trend::Trend;
use super::scatter::scatter;
use crate::analysis::independence::Independence;
use crate::analysis::measurement::DataSet;
use crate::analysis::noise::SetNoise;
use crate::analysis::whitening::Whitening;
use crate::io::table::{Cell, Column, Datatype, Table};
use crate::mission::Mission;
use crate::warning::Warning;

/// False-alarm probability below which a finding is reported.
pub(crate) const SPOKEN: f64 = 1e-3;

/// Kind of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// Residuals depend on a condition.
    Trend,
    /// The mean residual differs from zero.
    Offset,
    /// The quoted errors are too small.
    SmallErrors,
    /// The quoted errors are too large.
    LargeErrors,
    /// Neighbouring rows are not independent.
    Correlated,
}

/// A significant property of the residuals of one data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The data set, by its index.
    pub set: usize,
    /// Its kind.
    pub claim: Claim,
    /// Probability that noise alone looks like that in any of the data sets.
    pub chance: f64,
}

/// A model compared with data.
#[derive(Clone, Debug)]
pub struct Validation {
    /// The mission.
    pub mission: Mission,
    /// Results for each data set, in the order given.
    pub sets: Vec<SetResult>,
    /// Sum of squared residuals.
    pub chi2: f64,
    /// Rows.
    pub n: usize,
    /// Residual trends on all conditions and covariates that vary, the most significant first.
    pub trends: Vec<Trend>,
    /// Independence of neighbouring rows.
    pub independence: Independence,
    /// Significant deviations of the model; empty if there are none.
    pub findings: Vec<Finding>,
    /// The errors that are likeliest if the model is right; None if they were not asked for.
    pub likeliest: Option<Likeliest>,
}

/// The errors of all files that are likeliest if a model is right.
#[derive(Clone, Debug, Serialize)]
pub struct Likeliest {
    /// File by file.
    pub noise: Vec<SetNoise>,
    /// Sum of squared residuals with these errors.
    pub chi2: f64,
}

/// One data set compared with the model.
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
    /// Scatter of the residuals about smooth misfits, in units of sigma. Near 1 if the quoted errors are correct.
    pub scatter_sigma: f64,
}

impl SetResult {
    pub(super) fn new(data: &DataSet, model: Vec<f64>) -> SetResult {
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

    /// The noise level for residual trends: 1, the quoted errors, unless the scatter is clearly larger.
    pub fn noise_sigma(&self) -> f64 {
        // A scatter estimated from n rows is accurate to 1.6/√n (simulated).
        let clearly = 1.0 + 2.0 * 1.6 / (self.data.rows.len() as f64).sqrt();
        if self.scatter_sigma > clearly { self.scatter_sigma } else { 1.0 }
    }

    /// Probability that, by noise alone, the mean residual is as large in any of `trials` trials.
    pub fn bias_alarm(&self, trials: usize) -> f64 {
        let errors = self.bias_sigma.abs() * (self.data.rows.len() as f64).sqrt() / self.noise_sigma();
        trials as f64 * erfc(errors / std::f64::consts::SQRT_2)
    }

    /// The name of the file without its folder.
    pub fn name(&self) -> &str {
        self.data.file.rsplit(['/', '\\']).next().expect("a last part")
    }

    /// (value − model)/sigma, row by row, without the common errors of rows.
    pub fn residuals(&self) -> Vec<f64> {
        residuals(&self.data, &self.model)
    }
}

fn residuals(data: &DataSet, model: &[f64]) -> Vec<f64> {
    Whitening::of(std::slice::from_ref(data), |_| true).linear(&off_sigma(data, model))
}

fn off_sigma(data: &DataSet, model: &[f64]) -> Vec<f64> {
    data.rows.iter().zip(model).map(|(row, model)| (row.value - model) / row.sigma).collect()
}

impl SetResult {
    /// (value − model)/sigma, row by row, uncorrected.
    pub(crate) fn off_sigma(&self) -> Vec<f64> {
        off_sigma(&self.data, &self.model)
    }
}

impl Validation {
    /// rms of the residuals, in units of sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.n as f64).sqrt()
    }

    /// The data sets' tables with columns `model` and `residual_sigma`, each with a file name.
    pub fn tables(&self) -> Vec<(String, Table)> {
        let with_model = |(index, set): (usize, &SetResult)| {
            let mut table = set.data.table.clone();
            // In astropy's spelling.
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

    /// The most significant trend of a data set, by its index; None if none is significant.
    pub fn trend(&self, set: usize) -> Option<&Trend> {
        strongest(&self.trends, set)
    }

    /// Whether chi2 of all rows is larger than expected from noise.
    pub fn exceeds_noise(&self) -> bool {
        self.chi2_chances()[1] < SPOKEN
    }

    /// Probabilities that noise alone gives a chi2 of all rows as small, and as large.
    pub fn chi2_chances(&self) -> [f64; 2] {
        chi2_chances(self.chi2, self.n)
    }

    /// Whether chi2 of all rows is smaller than expected from the quoted errors.
    pub fn falls_short_of_noise(&self) -> bool {
        self.chi2_chances()[0] < SPOKEN
    }

    /// Conditions of the data that are the mission's although columns look like them.
    pub fn warnings(&self) -> Vec<&Warning> {
        self.sets.iter().filter_map(|set| set.data.warning.as_ref()).collect()
    }

    /// Whether the model explains the data: chi2 is consistent with noise, and there are no findings.
    pub fn within_noise(&self) -> bool {
        !self.exceeds_noise() && !self.falls_short_of_noise() && self.findings.is_empty()
    }

    /// Rows with the largest residuals: data set, row, residual.
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

/// A file's name without folder and extension, with the number of its data set, which distinguishes equal names.
pub(crate) fn file_stem(index: usize, data: &DataSet) -> String {
    let stem =
        std::path::Path::new(&data.file).file_stem().map_or_else(|| "data".into(), |stem| stem.to_string_lossy());
    format!("{}-{}", index + 1, plain_name(&stem))
}

/// A safe file name for a name: letters, digits, and nothing special to a shell.
pub(crate) fn plain_name(name: &str) -> String {
    name.chars().map(|letter| if letter.is_alphanumeric() || "._".contains(letter) { letter } else { '_' }).collect()
}

/// The most significant trend of a data set; None if none is significant.
pub(super) fn strongest(trends: &[Trend], set: usize) -> Option<&Trend> {
    trends.iter().find(|trend| trend.set == set && trend.false_alarm < SPOKEN)
}

/// Probabilities that noise alone has no more, and no less, chi2 in that many rows.
pub(crate) fn chi2_chances(chi2: f64, rows: usize) -> [f64; 2] {
    ChiSquared::new(rows as f64).map_or([1.0; 2], |law| [law.cdf(chi2), law.sf(chi2)])
}
