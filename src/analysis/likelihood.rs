//! Measurements, a model's predictions, and what is believed of the errors → −2 ln L.
//!
//! One file's errors have four unknowns, which belong to each model that is compared and are estimated anew for it, at its
//! residuals, without another evaluation of the model: their scale s, the correlation ρ of neighbours, the errors that rows have in
//! common (a constant of the file among them), and for every row the probability g that it is right. With z = (value − model −
//! common errors)/sigma, and for row i its neighbour j before it in the same trail or time series,
//!
//! ```text
//! e_i = z_i − ρ g_j z_j,    d_i = 1 − ρ² g_j
//! −2 ln L = Σ −2 ln[(1 − ε) N(e_i; 0, s² d_i) + ε N(z_i; 0, (K s)²)]
//!           + (ln s / 0.35)² + (ρ / 0.4)² + b'b + ln det(1 + U'W U)
//! ```
//!
//! The second component is that of rows that are wrong (Box & Tiao 1968, Biometrika 55, 119). Common errors U b are linear, with
//! unit Gaussian priors on b, and integrated over: their price is the determinant. The scale and the correlation have priors as
//! wide as quoted errors are usually wrong. Correlation never makes errors smaller than quoted: where ρ > 0, s is at least 1. So a
//! factor 1.4 on all errors costs 0.9, a factor 3 costs 9.9, and a wrong row about 12; none of it is an exception.

mod file;
pub(crate) mod series;
mod whitener;

use std::ops::Range;

use crate::analysis::measurement::DataSet;
use file::File;
pub(crate) use whitener::Whitener;

/// The errors of one file as estimated at one model.
#[derive(Clone, Debug)]
pub struct Errors {
    /// True errors over quoted ones.
    pub scale: f64,
    /// Correlation of neighbours: ρ at their usual distance, its power at others.
    pub correlation: f64,
    /// Whether the file carries a constant.
    pub has_pedestal: bool,
    /// Common errors, in units of their priors' standard deviations; the constant of the file first if it may have one.
    pub common: Vec<f64>,
    /// Probability that a row is right.
    pub right: Vec<f64>,
    /// −2 ln L of the file.
    pub minus_2_ln_l: f64,
}

/// Probability of being right below which a row is called wrong: as likely wrong as not.
const CALLED_WRONG: f64 = 0.5;

impl Errors {
    /// The rows that are called wrong, by their index in the file.
    pub fn wrong(&self) -> impl Iterator<Item = usize> {
        self.right.iter().enumerate().filter(|(_, right)| **right < CALLED_WRONG).map(|(row, _)| row)
    }
}

/// What stays the same while models change: the files' errors as quoted, and which rows are neighbours.
pub struct Likelihood {
    files: Vec<File>,
    values: Vec<f64>,
}

impl Likelihood {
    /// For all rows of some files.
    pub fn of(data: &[DataSet]) -> Likelihood {
        let rows: usize = data.iter().map(|set| set.rows.len()).sum();
        let mut first = 0;
        let mut file = |set: &DataSet| {
            let start = first;
            first += set.rows.len();
            File::of(set, start, rows)
        };
        let files = data.iter().map(&mut file).collect();
        Likelihood { files, values: data.iter().flat_map(|set| set.rows.iter().map(|row| row.value)).collect() }
    }

    /// Rows of a file.
    pub fn rows(&self, file: usize) -> Range<usize> {
        self.files[file].rows.clone()
    }

    /// value − model of every row.
    pub fn off(&self, model: &[f64]) -> Vec<f64> {
        self.values.iter().zip(model).map(|(value, model)| value - model).collect()
    }

    /// The errors that make value − model likeliest, from several starts; `near` is the estimate at a similar model.
    pub fn errors(&self, off: &[f64], near: Option<&[Errors]>) -> Vec<Errors> {
        let of = |(index, file): (usize, &File)| file.errors(&off[file.rows.clone()], near.map(|near| &near[index]));
        self.files.iter().enumerate().map(of).collect()
    }

    /// The value of a file's constant, and its error, both in the unit of the values; None if it may have none.
    pub fn pedestal(&self, file: usize, errors: &Errors) -> Option<(f64, f64)> {
        self.files[file].pedestal(errors)
    }

    /// Standard deviation of the prior of a file's constant, in the unit of the values; 0 if it may have none.
    pub fn pedestal_prior(&self, file: usize) -> f64 {
        self.files[file].pedestal_prior()
    }

    /// −2 ln of the prior probability of a file's errors over that of errors as quoted.
    pub fn improbability(&self, file: usize, errors: &Errors) -> f64 {
        self.files[file].improbability(errors)
    }

    /// The transformation that makes errors independent and equal to 1.
    pub(crate) fn whitener(&self, errors: &[Errors]) -> Whitener {
        Whitener::of(self.files.iter().zip(errors))
    }
}

/// −2 ln L of all files.
pub fn minus_2_ln_l(errors: &[Errors]) -> f64 {
    errors.iter().map(|errors| errors.minus_2_ln_l).sum()
}
