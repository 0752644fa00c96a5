//! Errors if chi2 is not parabolic.
//!
//! The error of a parameter is the distance, all others being refitted, at which chi2 has increased by 1 (Avni 1976, ApJ 210, 642).
//! Linear theory predicts it; if a model is curved (a release time far below the line time, a time constant of many years) it is
//! larger on one side. It is searched from the linear prediction, and the larger of both sides is quoted. The other parameters
//! follow to first order; any further compensation by them is neglected.

use nalgebra::{DMatrix, DVector};

use super::parameter::Parameter;
use super::problem::{LOOSE, Problem};
use super::result::{Fit, Fitted};
use crate::analysis::measurement::DataSet;
use crate::error::InputError;
use crate::model::Model;
use crate::numeric::least_squares::Span;
use crate::numeric::parallel;

/// Increase of chi2 for one standard error, and the tolerance on it.
const ONE_ERROR: f64 = 1.0;
const NEAR: f64 = 0.1;

/// Number of steps towards it, the maximum growth per step, and the maximum distance, in errors of linear theory.
const STEPS: usize = 4;
const STRETCH: f64 = 3.0;
const FARTHEST: f64 = 30.0;

/// The fitted parameters of a model with errors as large as required by the larger side.
///
/// # Errors
/// As [`super::fit`].
pub(crate) fn widened(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<Fitted>, InputError> {
    let keys: Vec<String> = fit.parameters.iter().map(|fitted| fitted.key.clone()).collect();
    let problem = Problem::new(model, data, &keys, progress, |_| true)?;
    let widen = |(index, fitted): (usize, &Fitted)| {
        let sides = |sigma: f64| [1.0, -1.0].map(|sign| side(&problem, fit, index, sign * sigma));
        let moment = problem.parameters[index].is_event_epoch;
        let sigma =
            fitted.sigma.map(|sigma| if moment { sigma } else { sides(sigma).into_iter().fold(sigma, f64::max) });
        Fitted { sigma, ..fitted.clone() }
    };
    Ok(parallel::map(fit.parameters.iter().enumerate(), widen))
}

/// Distance by which a parameter can be moved to one side.
fn side(problem: &Problem, fit: &Fit, index: usize, sigma: f64) -> f64 {
    let at: Vec<f64> = fit.parameters.iter().map(|fitted| fitted.value).collect();
    let others = fit.jacobian.clone().remove_column(index);
    let span = Span::of(&others, LOOSE);
    let along = fit.jacobian.column(index).into_owned();
    let follow = -span.solve(&along).insert_row(index, -1.0);
    let rise = |step: f64| -> Option<f64> {
        let moved: Vec<f64> = at.iter().zip(follow.iter()).map(|(value, follow)| value + step * follow).collect();
        let inside = |(parameter, value): (&Parameter, &f64)| *value > parameter.low && *value <= parameter.high;
        problem.parameters.iter().zip(&moved).all(inside).then_some(())?;
        let residuals = DVector::from_vec(problem.residuals(&moved).ok()?);
        Some(beyond(span.directions(), &residuals).norm_squared() - fit.chi2)
    };
    let (mut step, mut farthest) = (sigma, 0.0_f64);
    for _ in 0..STEPS {
        let Some(rise) = rise(step) else { break };
        // Not beyond one error.
        let share = (ONE_ERROR / rise.max(1e-9)).sqrt();
        farthest = farthest.max(step.abs() * share.min(1.0));
        if rise > ONE_ERROR - NEAR || step.abs() >= FARTHEST * sigma.abs() {
            break;
        }
        step *= share.min(STRETCH);
    }
    farthest
}

fn beyond(directions: &DMatrix<f64>, vector: &DVector<f64>) -> DVector<f64> {
    vector - directions * (directions.transpose() * vector)
}
