//! The data of a diagnosis, and a model fitted to them.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::work::Work;
use crate::analysis::fit::{self, Fit, Fitted};
use crate::analysis::measurement::{DataSet, questions};
use crate::effect::Reach;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::{Question, predict};
use crate::numeric::least_squares::Span;

/// Rows of all data sets, one after another.
pub(super) struct Case<'a> {
    pub data: &'a [DataSet],
    pub questions: Vec<Question<'a>>,
    pub values: Vec<f64>,
    pub sigmas: Vec<f64>,
    /// Data set of each row.
    pub set_of: Vec<usize>,
    /// For each row the row before it in the same trail, and how many pixels lie between: their errors may be shared.
    pub before: Vec<Option<(usize, i32)>>,
    /// Rows in an order in which those come first.
    pub order: Vec<usize>,
    pub reach: Reach,
    /// Evaluations of the model at all rows.
    pub work: Work,
}

impl<'a> Case<'a> {
    pub fn of(data: &'a [DataSet]) -> Case<'a> {
        let rows = || data.iter().flat_map(|set| &set.rows);
        let set_of: Vec<usize> = data.iter().enumerate().flat_map(|(index, set)| vec![index; set.rows.len()]).collect();
        let questions = questions(data);
        let (before, order) = trails(data);
        Case {
            data,
            values: rows().map(|row| row.value).collect(),
            sigmas: rows().map(|row| row.sigma).collect(),
            set_of,
            before,
            order,
            reach: Reach::of(questions.iter().map(|question| question.at)),
            questions,
            work: Work::of_at_most(u64::MAX),
        }
    }

    /// Rows of a data set.
    pub fn rows(&self, set: usize) -> Range<usize> {
        let first = self.data[..set].iter().map(|set| set.rows.len()).sum();
        first..first + self.data[set].rows.len()
    }

    pub fn n(&self) -> usize {
        self.values.len()
    }

    /// Predictions in units of each row's sigma.
    ///
    /// # Errors
    /// Where the model has no value for a row.
    pub fn predict_sigma(&self, model: &Model) -> Result<DVector<f64>, InputError> {
        let values = predict(model, &self.questions)?;
        self.work.count();
        if values.iter().any(|value| !value.is_finite()) {
            return Err(InputError::new(
                "cannot diagnose",
                "the model has no value for a row; `ctiplan validate` tells which",
            ));
        }
        Ok(self.over_sigma(&values))
    }

    pub fn over_sigma(&self, values: &[f64]) -> DVector<f64> {
        DVector::from_iterator(values.len(), values.iter().zip(&self.sigmas).map(|(value, sigma)| value / sigma))
    }
}

/// The row before each in its trail, and an order in which trails are followed from the packet on.
fn trails(data: &[DataSet]) -> (Vec<Option<(usize, i32)>>, Vec<usize>) {
    let (mut before, mut order) = (Vec::new(), Vec::new());
    for set in data {
        let first = before.len();
        let others: Vec<Vec<f64>> =
            set.varying.iter().filter(|name| *name != "trail_px").map(|name| set.against(name)).collect();
        let pixel = |row: usize| set.rows[row].at.trail_px.unwrap_or(0) as i32;
        let trail = |a: usize, b: usize| {
            others.iter().map(|column| column[a].total_cmp(&column[b])).find(|order| order.is_ne())
        };
        let mut rows: Vec<usize> = (0..set.rows.len()).collect();
        rows.sort_by(|&a, &b| trail(a, b).unwrap_or(pixel(a).cmp(&pixel(b))).then(a.cmp(&b)));
        before.resize(first + set.rows.len(), None);
        for pair in rows.windows(2) {
            let apart = pixel(pair[1]) - pixel(pair[0]);
            if trail(pair[0], pair[1]).is_none() && apart > 0 {
                before[first + pair[1]] = Some((first + pair[0], apart));
            }
        }
        order.extend(rows.into_iter().map(|row| first + row));
    }
    (before, order)
}

/// An effect that was added.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Added {
    /// The hypothesis, by its place among all.
    pub hypothesis: usize,
    /// Dotted key of its table in the mission.
    pub key: String,
    /// Its parameters that were fitted, as dotted keys.
    pub free: Vec<String>,
}

/// A model fitted to the data: the mission's own, or one with effects added.
pub(super) struct Node {
    /// In the order in which they were added.
    pub added: Vec<Added>,
    pub model: Model,
    pub fit: Fit,
    /// (value − model)/sigma.
    pub residuals: DVector<f64>,
    /// Orthonormal directions that the free parameters can absorb, `[(row, direction)]`.
    pub basis: DMatrix<f64>,
}

impl Node {
    /// Fits all that is free, from the model's own values.
    pub fn fit(
        case: &Case,
        model: &Model,
        added: Vec<Added>,
        base: &[String],
        options: &fit::Options,
    ) -> Result<Node, InputError> {
        let keys: Vec<String> = base.iter().chain(added.iter().flat_map(|added| &added.free)).cloned().collect();
        let fit = fit::fit_rows(model, case.data, &keys, options, &|_| case.work.count(), |_| true)?;
        let model = model.like(&fit.mission);
        let residuals = case.over_sigma(&case.values) - case.over_sigma(&fit.values);
        let basis = orthonormal(&fit.jacobian);
        Ok(Node { added, model, fit, residuals, basis })
    }

    pub fn mission(&self) -> &Mission {
        &self.fit.mission
    }

    pub fn chi2(&self) -> f64 {
        self.fit.chi2
    }

    /// Rows that are left when every free parameter has taken one.
    pub fn freedom(&self) -> f64 {
        (self.fit.n - self.basis.ncols()).max(1) as f64
    }

    /// Hypotheses that were added, in rising order: what makes two nodes the same.
    pub fn set(&self) -> Vec<usize> {
        let mut set: Vec<usize> = self.added.iter().map(|added| added.hypothesis).collect();
        set.sort_unstable();
        set
    }

    /// The mission with its free parameters where they absorb a change of the predictions to first order; None where that
    /// makes no sense.
    pub fn absorbing(&self, change: &DVector<f64>) -> Option<Mission> {
        // The derivatives are those of (value − model)/sigma.
        let steps = Span::of(&self.fit.jacobian, FLAT).solve(change);
        let moved = |(fitted, step): (&Fitted, &f64)| (fitted.key.clone(), (fitted.value + step).into());
        self.mission().with(&self.fit.parameters.iter().zip(steps.iter()).map(moved).collect::<Vec<_>>()).ok()
    }

    /// What the free parameters cannot absorb.
    pub fn beyond(&self, vector: &DVector<f64>) -> DVector<f64> {
        vector - &self.basis * self.basis.tr_mul(vector)
    }
}

/// Part of a column that others leave, below which it is none.
pub(super) const FLAT: f64 = 1e-5;

/// Orthonormal directions that columns span.
pub(super) fn orthonormal(columns: &DMatrix<f64>) -> DMatrix<f64> {
    Span::of(columns, FLAT).directions().clone()
}
