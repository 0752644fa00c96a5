//! The data of a diagnosis, and a model fitted to them.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal};

use super::work::Work;
use crate::analysis::fit::{self, Fit, Fitted};
use crate::analysis::measurement::{DataSet, questions};
use crate::analysis::whitening::{LARGEST_CORRELATION, Whitening};
use crate::effect::Reach;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::{Question, predict};
use crate::numeric::least_squares::Span;
use crate::physics::conditions::{Conditions, Stated, UnderMission};

/// Rows of all data sets, one after another.
pub(super) struct Case<'a> {
    pub data: &'a [DataSet],
    pub questions: Vec<Question<'a, Stated>>,
    pub values: Vec<f64>,
    pub sigmas: Vec<f64>,
    /// Data set of each row.
    pub set_of: Vec<usize>,
    pub(super) whitening: Whitening,
    pub reach: Reach,
    /// Evaluations of the model at all rows.
    pub work: Arc<Work>,
}

impl<'a> Case<'a> {
    /// Distinct epochs of the data, years since launch, ascending.
    pub fn epochs_yr(&self) -> Vec<f64> {
        fit::epochs_yr(self.data)
    }

    pub fn of(data: &'a [DataSet]) -> Case<'a> {
        let rows = || data.iter().flat_map(|set| &set.rows);
        let set_of: Vec<usize> = data.iter().enumerate().flat_map(|(index, set)| vec![index; set.rows.len()]).collect();
        let questions = questions(data);
        Case {
            data,
            values: rows().map(|row| row.value).collect(),
            sigmas: rows().map(|row| row.sigma).collect(),
            set_of,
            whitening: Whitening::of(data, |_| true),
            reach: Reach::of(questions.iter().map(|question| &**question.at)),
            questions,
            work: Arc::new(Work::of_at_most(u64::MAX)),
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

    /// Predictions in units of each row's sigma, whitened: without the part of the errors that rows have in common.
    ///
    /// # Errors
    /// If the model has no value for a row.
    pub fn predict_sigma(&self, model: &Model) -> Result<DVector<f64>, InputError> {
        let values = predict(model, &self.questions)?;
        self.work.count();
        if values.iter().any(|value| !value.is_finite()) {
            return Err(InputError::new(
                "cannot diagnose",
                "the model has no value for a row; `ctiplan validate` shows which",
            ));
        }
        Ok(self.white(&values))
    }

    /// Predictions under other conditions; None if the model has no value for one, or the change of a row's conditions makes no sense.
    pub fn predict_at(&self, model: &Model, change: &dyn Fn(usize, &mut Conditions) -> bool) -> Option<Vec<f64>> {
        let at = |(row, question): (usize, &Question<Stated>)| -> Option<Conditions> {
            let mut at = question.at.under(&model.mission).ok()?.into_owned();
            change(row, &mut at).then_some(at)
        };
        let at: Vec<Conditions> = self.questions.iter().enumerate().map(at).collect::<Option<_>>()?;
        let questions = self.questions.iter().zip(&at).map(|(question, at)| {
            let Question { observable, galaxy, species, .. } = *question;
            Question { observable, at, galaxy, species }
        });
        let values = predict(model, &questions.collect::<Vec<_>>()).ok()?;
        self.work.count();
        values.iter().all(|value| value.is_finite()).then_some(values)
    }

    /// Values in units of each row's sigma, whitened as above.
    pub fn white(&self, values: &[f64]) -> DVector<f64> {
        DVector::from_vec(self.whitening.linear(&self.over_sigma(values)))
    }

    /// Excess of another model's predictions over those of a fitted one, as it enters the residuals.
    ///
    /// # Errors
    /// As [`Case::predict_sigma`].
    pub fn change(&self, node: &Node, model: &Model) -> Result<DVector<f64>, InputError> {
        Ok(self.predict_sigma(model)? - self.white(&node.fit.values))
    }

    /// (value − model)/sigma, whitened.
    pub fn residuals(&self, model: &[f64]) -> DVector<f64> {
        let off: Vec<f64> = self.values.iter().zip(model).map(|(value, model)| value - model).collect();
        self.white(&off)
    }

    fn over_sigma(&self, values: &[f64]) -> Vec<f64> {
        values.iter().zip(&self.sigmas).map(|(value, sigma)| value / sigma).collect()
    }

    /// The whitening for correlations at the middles of `n` intervals of equal probability of their errors, of all files at once;
    /// none if no correlation was estimated.
    pub fn at_other_correlations(&self, n: usize) -> Vec<Whitening> {
        if self.data.iter().all(|set| set.shared.correlation_sigma == 0.0) {
            return Vec::new();
        }
        let normal = Normal::standard();
        let at = |interval: usize| {
            let off_sigma = normal.inverse_cdf((interval as f64 + 0.5) / n as f64);
            let mut data = self.data.to_vec();
            for set in &mut data {
                let shared = &mut set.shared;
                shared.correlation =
                    (shared.correlation + off_sigma * shared.correlation_sigma).clamp(0.0, LARGEST_CORRELATION);
            }
            Whitening::of(&data, |_| true)
        };
        (0..n).map(at).collect()
    }
}

/// An effect that was added.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Added {
    /// Index of the hypothesis among all.
    pub hypothesis: usize,
    /// Dotted key of its table in the mission.
    pub key: String,
    /// Its fitted parameters, as dotted keys.
    pub free: Vec<String>,
}

/// A model fitted to the data: the mission's own, or one with effects added.
pub(super) struct Node {
    /// In the order in which they were added.
    pub added: Vec<Added>,
    pub model: Model,
    pub fit: Fit,
    /// (value − model)/sigma, whitened.
    pub residuals: DVector<f64>,
    /// Orthonormal directions that the free parameters can absorb, `[(row, direction)]`.
    pub basis: DMatrix<f64>,
}

impl Node {
    /// Fits all free parameters, from the model's own values.
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
        let residuals = case.residuals(&fit.values);
        let basis = orthonormal(&fit.jacobian);
        Ok(Node { added, model, fit, residuals, basis })
    }

    pub fn mission(&self) -> &Mission {
        &self.fit.mission
    }

    pub fn chi2(&self) -> f64 {
        self.fit.chi2
    }

    /// Degrees of freedom: rows less free parameters.
    pub fn freedom(&self) -> f64 {
        (self.fit.n - self.basis.ncols()).max(1) as f64
    }

    /// Added hypotheses, ascending: equal for two nodes with the same effects.
    pub fn set(&self) -> Vec<usize> {
        let mut set: Vec<usize> = self.added.iter().map(|added| added.hypothesis).collect();
        set.sort_unstable();
        set
    }

    /// The mission with its free parameters moved to absorb a change of the predictions, to first order; None if the values make no
    /// sense.
    pub fn absorbing(&self, change: &DVector<f64>) -> Option<Mission> {
        // The derivatives are those of (value − model)/sigma.
        let steps = Span::of(&self.fit.jacobian, FLAT).solve(change);
        let moved = |(fitted, step): (&Fitted, &f64)| (fitted.key.clone(), (fitted.value + step).into());
        self.mission().with(&self.fit.parameters.iter().zip(steps.iter()).map(moved).collect::<Vec<_>>()).ok()
    }

    /// The part that the free parameters cannot absorb.
    pub fn beyond(&self, vector: &DVector<f64>) -> DVector<f64> {
        vector - &self.basis * self.basis.tr_mul(vector)
    }
}

/// Share of a column beyond the span of the others, below which the column is linearly dependent.
pub(super) const FLAT: f64 = 1e-5;

/// Orthonormal basis of the span of columns.
pub(super) fn orthonormal(columns: &DMatrix<f64>) -> DMatrix<f64> {
    Span::of(columns, FLAT).directions().clone()
}
