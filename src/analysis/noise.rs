//! The errors of each file as they are likeliest for a model: what is said of them, and data that carry them.

use crate::analysis::likelihood::{Errors, Likelihood};
use crate::analysis::measurement::DataSet;
use crate::analysis::whitening::Shared;

/// Factor by which errors may be wrong; beyond it the data cannot be used.
const AT_MOST: f64 = 3.4;

/// Significance, in its errors, from which a pedestal counts, and from which a correlation or larger errors do. Smaller errors make
/// noise significant, so they need more.
const CLEAR: f64 = 3.5;
const SIGNIFICANT: f64 = 2.0;
const SMALLER: f64 = 4.0;

/// Rows among which one may be wrong.
const ROWS_OF_A_WRONG_ONE: usize = 20;

/// The errors of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct SetNoise {
    /// The file as given.
    pub file: String,
    /// True errors over quoted ones, for all rows; 1 if the scatter does not contradict the quoted ones.
    pub scale: f64,
    /// Correlation of neighbours in a trail or a time series; 0 if it is not significant.
    pub correlation: f64,
    /// Wrong rows, each with its residual in sigma.
    pub wrong: Vec<WrongRow>,
    /// A constant common to all values, in their unit; None if there is none.
    pub pedestal: Option<f64>,
    /// Error of such a constant; None if the file may have none.
    pub pedestal_sigma: Option<f64>,
    /// Degrees of freedom from which a scale other than 1 was estimated.
    freedom: Option<f64>,
}

/// A row that is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongRow {
    /// Its index among the rows of the file.
    pub row: usize,
    /// Its line in the file; None for a table that was not read from a file.
    pub line: Option<usize>,
    /// Its distance from the model, sigma.
    pub off_sigma: f64,
}

impl SetNoise {
    /// Whether such errors are believable without another reason: not too far from the quoted ones, and one row in twenty wrong at most.
    pub(crate) fn is_believable(&self, set: &DataSet) -> bool {
        !self.is_beyond(set) && ROWS_OF_A_WRONG_ONE * self.wrong.len() <= set.rows.len().max(ROWS_OF_A_WRONG_ONE)
    }

    /// Whether the errors are too far from the quoted ones to be allowed for; a floor of systematic errors need not show.
    pub(crate) fn is_beyond(&self, set: &DataSet) -> bool {
        let has_floor = set.rows.iter().any(|row| row.floor > 0.0);
        self.scale > AT_MOST || (self.scale < 1.0 / AT_MOST && !has_floor)
    }
}

/// The quoted errors.
pub(crate) fn as_quoted(data: &[DataSet]) -> Vec<SetNoise> {
    let of = |set: &DataSet| SetNoise {
        file: set.file.clone(),
        scale: 1.0,
        correlation: 0.0,
        wrong: Vec::new(),
        pedestal: None,
        pedestal_sigma: None,
        freedom: None,
    };
    data.iter().map(of).collect()
}

/// The errors as estimated at a model with these residuals value − model.
pub(crate) fn of(likelihood: &Likelihood, data: &[DataSet], errors: &[Errors], off: &[f64]) -> Vec<SetNoise> {
    let of = |(index, set): (usize, &DataSet)| {
        let here = &errors[index];
        let right = here.right.iter().sum::<f64>().max(1.0);
        // An error of ln s of 1/√(2 n), and of ρ of 1/√n.
        let errors_off = here.scale.ln() * (2.0 * right).sqrt();
        let is_scaled = !(-SMALLER..=SIGNIFICANT).contains(&errors_off);
        let is_correlated = here.correlation > SIGNIFICANT / right.sqrt();
        let scale = if is_scaled { here.scale } else { 1.0 };
        let pedestal = likelihood.pedestal(index, here);
        let constant = pedestal.filter(|_| here.has_pedestal);
        let first = likelihood.rows(index).start;
        let wrong = here.wrong().map(|row| WrongRow {
            row,
            line: set.table.lines.get(row).copied(),
            off_sigma: (off[first + row] - constant.map_or(0.0, |(value, _)| value)) / (scale * set.rows[row].sigma),
        });
        SetNoise {
            file: set.file.clone(),
            scale,
            correlation: if is_correlated { here.correlation } else { 0.0 },
            wrong: wrong.collect(),
            pedestal: constant.filter(|(value, sigma)| value.abs() > CLEAR * sigma).map(|(value, _)| value),
            pedestal_sigma: pedestal.map(|(_, sigma)| sigma),
            freedom: (scale != 1.0).then_some(right),
        }
    };
    data.iter().enumerate().map(of).collect()
}

/// Data with the estimated errors: scaled, wrong rows with errors as large as their distances, and a constant as an error in common
/// where a file carries one.
pub(crate) fn allowed_for(
    quoted: &[DataSet],
    noise: &[SetNoise],
    likelihood: &Likelihood,
    errors: Option<&[Errors]>,
) -> Vec<DataSet> {
    let with = |(index, (set, noise)): (usize, (&DataSet, &SetNoise))| {
        let mut set = set.clone();
        for row in &mut set.rows {
            row.sigma *= noise.scale;
            row.common.sigma *= noise.scale;
        }
        for wrong in &noise.wrong {
            set.rows[wrong.row].sigma *= wrong.off_sigma.abs().max(1.0);
        }
        set.shared = Shared {
            correlation: noise.correlation,
            pedestal_sigma: if errors.is_some_and(|errors| errors[index].has_pedestal) {
                likelihood.pedestal_prior(index)
            } else {
                0.0
            },
            wrong: noise.wrong.iter().map(|wrong| wrong.row).collect(),
            freedom: noise.freedom,
            ..Shared::default()
        };
        set
    };
    quoted.iter().zip(noise).enumerate().map(with).collect()
}
