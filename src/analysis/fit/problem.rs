//! The least-squares problem: mission, data and free keys → residuals and their derivatives.

use nalgebra::{DMatrix, DVector};
use toml::Value;

use super::parameter::Parameter;
use crate::analysis::measurement::{DataSet, questions};
use crate::analysis::whitening::Whitening;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::{Question, predict};
use crate::numeric::parallel;
use crate::physics::conditions::Stated;

/// A least-squares problem: everything that is constant while parameters change.
pub(crate) struct Problem<'a> {
    pub(super) base: &'a Model,
    pub(super) parameters: Vec<Parameter>,
    pub(super) questions: Vec<Question<'a, Stated>>,
    pub(super) values: Vec<f64>,
    pub(super) sigmas: Vec<f64>,
    whitening: Whitening,
    pub(super) progress: &'a (dyn Fn(f64) + Sync),
}

/// A point in a problem's parameters.
#[derive(Clone, Debug)]
pub(crate) struct Optimum {
    pub at: Vec<f64>,
    pub chi2: f64,
}

/// Sum of squares.
pub(super) fn chi2(residuals: &[f64]) -> f64 {
    residuals.iter().map(|residual| residual * residual).sum()
}

/// Norm of a parameter's signature orthogonal to the others, below which it is linearly dependent.
pub(super) const LOOSE: f64 = 1e-9;

/// Effect of a factor e, in sigma over all rows together, below which a parameter is not counted as free.
const IDLE: f64 = 0.1;

impl<'a> Problem<'a> {
    /// The problem for some rows (by their indices among all).
    ///
    /// # Errors
    /// As [`super::fit`].
    pub(crate) fn new(
        model: &'a Model,
        data: &'a [DataSet],
        keys: &[String],
        progress: &'a (dyn Fn(f64) + Sync),
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Problem<'a>, InputError> {
        let parameters = keys.iter().map(|key| Parameter::of(&model.mission, key)).collect::<Result<Vec<_>, _>>()?;
        for (index, key) in keys.iter().enumerate() {
            if keys[..index].contains(key) {
                return Err(InputError::new("cannot fit", format!("duplicate key `{key}`")));
            }
        }
        let rows = || data.iter().flat_map(|set| &set.rows).enumerate().filter(|(index, _)| wanted(*index));
        let questions = questions(data).into_iter().enumerate();
        let problem = Problem {
            base: model,
            questions: questions.filter(|(index, _)| wanted(*index)).map(|(_, question)| question).collect(),
            values: rows().map(|(_, row)| row.value).collect(),
            sigmas: rows().map(|(_, row)| row.sigma).collect(),
            whitening: Whitening::of(data, &wanted),
            parameters,
            progress,
        };
        let n = problem.values.len();
        if n < keys.len() {
            let refusal =
                InputError::new("cannot fit", format!("{} keys are free, and there are {n} rows", keys.len()));
            return Err(refusal.with_help("free fewer keys, or give more data"));
        }
        Ok(problem)
    }

    /// The mission with other values.
    ///
    /// # Errors
    /// If the combination of values is invalid.
    pub(crate) fn mission(&self, at: &[f64]) -> Result<Mission, InputError> {
        let numbers = self.parameters.iter().zip(at);
        let numbers: Option<Vec<_>> =
            numbers.map(|(parameter, value)| Some((parameter.handle.as_ref()?, *value))).collect();
        if let Some(mission) = numbers.and_then(|numbers| self.base.mission.with_handles(numbers.into_iter())) {
            return Ok(mission);
        }
        // With all its messages.
        let setting = |(parameter, value): (&Parameter, &f64)| (parameter.key.clone(), Value::Float(*value));
        self.base.mission.with(&self.parameters.iter().zip(at).map(setting).collect::<Vec<_>>())
    }

    /// (value − model)/sigma of every row, without the common errors of rows.
    ///
    /// # Errors
    /// If the model has no value.
    pub(super) fn residuals(&self, at: &[f64]) -> Result<Vec<f64>, InputError> {
        let mission = self.mission(at)?;
        let model = self.base.like(&mission);
        let found = predict(&model, &self.questions)?;
        if let Some(row) = found.iter().position(|value| !value.is_finite()) {
            let said: Vec<String> = self
                .parameters
                .iter()
                .zip(at)
                .map(|(parameter, value)| format!("{} = {value}", parameter.key))
                .collect();
            let problem = format!(
                "the model has no {} for row {} of the data ({})",
                self.questions[row].observable,
                row + 1,
                said.join(", ")
            );
            return Err(InputError::new("cannot fit", problem).with_help("the galaxy may have lost its shape"));
        }
        let residuals: Vec<f64> = self
            .values
            .iter()
            .zip(&found)
            .zip(&self.sigmas)
            .map(|((value, model), sigma)| (value - model) / sigma)
            .collect();
        let residuals = self.whitening.linear(&residuals);
        (self.progress)(chi2(&residuals));
        Ok(residuals)
    }

    /// Derivatives of the residuals with respect to the parameters, `[(row, parameter)]`, from central differences; 0 for event
    /// epochs, which have none.
    pub(super) fn jacobian(&self, at: &[f64]) -> Result<DMatrix<f64>, InputError> {
        let derivative = |(index, parameter): (usize, &Parameter)| -> Result<DVector<f64>, InputError> {
            if parameter.is_event_epoch {
                return Ok(DVector::zeros(self.values.len()));
            }
            let (low, high) = parameter.around(at[index]);
            let moved = |value: f64| {
                let mut at = at.to_vec();
                at[index] = value;
                self.residuals(&at).map(DVector::from_vec)
            };
            Ok((moved(high)? - moved(low)?) / (high - low))
        };
        let columns: Vec<DVector<f64>> = parallel::try_map(self.parameters.iter().enumerate(), derivative)?;
        Ok(DMatrix::from_columns(&columns))
    }

    /// Derivatives without those of parameters that would have to change by many factors e to have any effect: that far away the
    /// derivatives are different.
    pub(super) fn without_idle(&self, mut jacobian: DMatrix<f64>, at: &[f64]) -> DMatrix<f64> {
        for (index, mut column) in jacobian.column_iter_mut().enumerate() {
            if self.parameters[index].is_log() && column.norm() * at[index] < IDLE {
                column.fill(0.0);
            }
        }
        jacobian
    }
}
