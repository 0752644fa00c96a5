//! A set of effects, fitted to the data: its likeliest parameters, its errors, and its evidence.
//!
//! ```text
//! −2 ln Z = −2 ln L + Σ ((θ − mean)/width)² + ln det(1 + Π A'A Π) + Σ 2 ln(choices)
//! ```
//!
//! with the derivatives A of the whitened predictions and the priors' widths Π (the determinant as a whole: a sum over its diagonal
//! would charge parameters twice for what they share). `choices` is the number of effects over their prior probability, times the
//! number of intervals in which an event may lie. The minimum is found by Gauss-Newton steps with Levenberg's damping in the
//! whitened problem, accepted by the likelihood with all errors estimated anew.

use nalgebra::{DMatrix, DVector};

use super::fitted_model::{Added, Case};
use super::prior::Prior;
use crate::analysis::fit::parameter::Parameter;
use crate::analysis::likelihood::{Errors, Likelihood, minus_2_ln_l};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::predict;
use crate::numeric::parallel;

/// Decrease of −2 ln L, as predicted, that ends a fit: far below the 6.6 that decide.
const SETTLED: f64 = 0.01;

/// The same for a rough fit, which only chooses between starts: the best two of them are followed to their end.
const ROUGHLY: f64 = 0.3;

/// Steps of a fit at most.
const STEPS: usize = 40;

/// Steps of a rough fit: at most 1.5 in a logarithm each (`Prior::longest`), six reach a factor of e⁹ = 8000.
const FEW_STEPS: usize = 6;

/// Share of the predicted decrease below which derivatives are computed anew.
const POOR: f64 = 0.5;

/// Damping of the first step after a failure (Levenberg 1944, Quart. Appl. Math. 2, 164): a hundredth of the curvature.
const DAMPED: f64 = 1e-2;

/// Factor of the damping at each further failure: the tenth root of 1e9, rounded, so that ten evaluations lead from [`DAMPED`] to
/// [`MOST_DAMPED`] and end a fit that cannot move.
const MORE_DAMPED: f64 = 8.0;

/// Damping at which a step is 1e-7 of an undamped one, nothing to single precision.
const MOST_DAMPED: f64 = 1e7;

/// A free parameter, and its prior; an event's epoch has none, and stays where it is.
#[derive(Clone, Debug)]
pub(super) struct Unknown {
    pub parameter: Parameter,
    pub prior: Option<Prior>,
}

/// A set of effects at its best parameters.
#[derive(Clone)]
pub(super) struct Explanation {
    pub added: Vec<Added>,
    pub mission: Mission,
    pub unknowns: Vec<Unknown>,
    /// Predictions, in the observables' units.
    pub model: Vec<f64>,
    /// Derivatives of the predictions with respect to the priors' coordinates, `[(row, unknown)]`.
    pub derivatives: DMatrix<f64>,
    pub errors: Vec<Errors>,
    /// −2 ln L, and the priors' part.
    pub minus_2_ln_l: f64,
    pub prior: f64,
    /// The determinant and the choices.
    pub price: f64,
}

impl Explanation {
    /// −2 ln Z.
    pub fn minus_2_ln_z(&self) -> f64 {
        self.objective() + self.price
    }

    /// What a fit minimises.
    pub fn objective(&self) -> f64 {
        self.minus_2_ln_l + self.prior
    }

    /// The effects, ascending.
    pub fn set(&self) -> Vec<usize> {
        let mut set: Vec<usize> = self.added.iter().map(|added| added.hypothesis).collect();
        set.sort_unstable();
        set
    }
}

/// Where a fit starts.
pub(super) struct Start {
    pub added: Vec<Added>,
    pub mission: Mission,
    pub unknowns: Vec<Unknown>,
    /// 2 ln of the choices among effects and intervals.
    pub choices: f64,
    /// Derivatives with respect to the first unknowns, from a similar model.
    pub known: DMatrix<f64>,
}

/// Fits explanations to some data.
pub(super) struct Fitter<'a> {
    pub case: &'a Case<'a>,
    pub likelihood: &'a Likelihood,
    pub model: Model,
}

/// A point on the way.
struct Point {
    at: Vec<f64>,
    mission: Mission,
    model: Vec<f64>,
    errors: Vec<Errors>,
    minus_2_ln_l: f64,
    prior: f64,
}

impl Point {
    fn objective(&self) -> f64 {
        self.minus_2_ln_l + self.prior
    }
}

impl Fitter<'_> {
    /// Predictions of a mission for all rows; None if a row has none.
    pub fn predicted(&self, mission: &Mission) -> Option<Vec<f64>> {
        self.case.work.count();
        let values = predict(&self.model.like(mission), &self.case.questions).ok()?;
        values.iter().all(|value| value.is_finite()).then_some(values)
    }

    /// The minimum from a start.
    ///
    /// # Errors
    /// If the model has no value there.
    pub fn fit(&self, start: &Start, near: Option<&[Errors]>, is_rough: bool) -> Result<Explanation, InputError> {
        let at: Vec<f64> = start.unknowns.iter().map(|unknown| unknown.parameter.start).collect();
        let Some(mut here) = self.point(start, &start.mission, &at, near) else {
            return Err(InputError::new(
                "cannot diagnose",
                "the model has no value for a row; `ctiplan validate` shows which",
            ));
        };
        let (steps, settled) = if is_rough { (FEW_STEPS, ROUGHLY) } else { (STEPS, SETTLED) };
        let mut derivatives = self.derivatives(start, &here, &start.known);
        let (mut is_fresh, mut damping) = (start.known.ncols() == 0, 0.0);
        let mut left = steps;
        let none = DMatrix::zeros(self.case.n(), 0);
        while left > 0 && derivatives.ncols() > 0 {
            left -= 1;
            let (step, promised) = self.step(start, &here, &derivatives, damping);
            if promised < settled {
                if is_fresh || is_rough {
                    break;
                }
                (derivatives, is_fresh, damping) = (self.derivatives(start, &here, &none), true, 0.0);
                continue;
            }
            let moved = self.moved(start, &here, &step);
            let there = self.point(start, &here.mission, &moved, Some(&here.errors));
            match there.filter(|there| there.objective() < here.objective()) {
                Some(there) => {
                    let gained = here.objective() - there.objective();
                    self.update(start, &mut derivatives, &here, &there);
                    here = there;
                    damping = if damping > DAMPED / MORE_DAMPED { damping / MORE_DAMPED } else { 0.0 };
                    is_fresh = false;
                    if gained < POOR * promised && left > 0 && !is_rough {
                        (derivatives, is_fresh) = (self.derivatives(start, &here, &none), true);
                    }
                }
                None if !is_fresh => (derivatives, is_fresh) = (self.derivatives(start, &here, &none), true),
                None => {
                    damping = if damping == 0.0 { DAMPED } else { damping * MORE_DAMPED };
                    if damping > MOST_DAMPED {
                        break;
                    }
                }
            }
        }
        if !is_fresh && !is_rough {
            derivatives = self.derivatives(start, &here, &none);
        }
        Ok(self.explanation(start, here, derivatives))
    }

    fn explanation(&self, start: &Start, here: Point, derivatives: DMatrix<f64>) -> Explanation {
        let unknowns = start
            .unknowns
            .iter()
            .zip(&here.at)
            .map(|(unknown, &value)| Unknown { parameter: unknown.parameter.starting_at(value), prior: unknown.prior });
        let widths: Vec<f64> =
            start.unknowns.iter().map(|unknown| unknown.prior.map_or(0.0, |prior| prior.width)).collect();
        let price = start.choices + volume(&self.whitened(&here.errors, &derivatives), &widths);
        Explanation {
            added: start.added.clone(),
            unknowns: unknowns.collect(),
            mission: here.mission,
            model: here.model,
            errors: here.errors,
            minus_2_ln_l: here.minus_2_ln_l,
            prior: here.prior,
            derivatives,
            price,
        }
    }

    fn point(&self, start: &Start, like: &Mission, at: &[f64], near: Option<&[Errors]>) -> Option<Point> {
        let mission = with_values(like, &start.unknowns, at)?;
        let model = self.predicted(&mission)?;
        let errors = self.likelihood.errors(&self.likelihood.off(&model), near);
        let minus_2_ln_l = minus_2_ln_l(&errors);
        let prior = start
            .unknowns
            .iter()
            .zip(at)
            .map(|(unknown, &value)| unknown.prior.map_or(0.0, |prior| prior.cost(prior.coordinate(value))));
        let prior = prior.sum();
        minus_2_ln_l.is_finite().then_some(Point { at: at.to_vec(), mission, model, errors, minus_2_ln_l, prior })
    }

    /// Derivatives of the predictions with respect to the coordinates, by forward differences; 0 where the model has no value, and
    /// for what stays where it is.
    fn derivatives(&self, start: &Start, here: &Point, known: &DMatrix<f64>) -> DMatrix<f64> {
        let column = |(index, unknown): (usize, &Unknown)| {
            if index < known.ncols() {
                return known.column(index).into_owned();
            }
            let none = DVector::zeros(here.model.len());
            let Some(prior) = unknown.prior else { return none };
            let coordinate = prior.coordinate(here.at[index]);
            let step = prior.step(coordinate);
            let mut at = here.at.clone();
            at[index] = prior.value(coordinate + step);
            let moved = with_values(&here.mission, &start.unknowns, &at).and_then(|mission| self.predicted(&mission));
            moved.map_or(none, |moved| (DVector::from_vec(moved) - DVector::from_column_slice(&here.model)) / step)
        };
        let columns = parallel::map(start.unknowns.iter().enumerate(), column);
        if columns.is_empty() { DMatrix::zeros(here.model.len(), 0) } else { DMatrix::from_columns(&columns) }
    }

    /// Broyden's update (1965, Mathematics of Computation 19, 577) in units of the priors' widths.
    fn update(&self, start: &Start, derivatives: &mut DMatrix<f64>, from: &Point, to: &Point) {
        let change = |(index, unknown): (usize, &Unknown)| {
            unknown.prior.map_or((0.0, 1.0), |prior| {
                (prior.coordinate(to.at[index]) - prior.coordinate(from.at[index]), prior.width)
            })
        };
        let (step, width): (Vec<f64>, Vec<f64>) = start.unknowns.iter().enumerate().map(change).unzip();
        let step = DVector::from_vec(step);
        let scaled = DVector::from_fn(step.len(), |index, _| step[index] / (width[index] * width[index]));
        let length = step.dot(&scaled);
        if length > 0.0 {
            let missed =
                DVector::from_fn(to.model.len(), |row, _| to.model[row] - from.model[row]) - &*derivatives * &step;
            *derivatives += missed * scaled.transpose() / length;
        }
    }

    /// Columns in units of the errors.
    pub fn whitened(&self, errors: &[Errors], columns: &DMatrix<f64>) -> DMatrix<f64> {
        let whitener = self.likelihood.whitener(errors);
        let columns: Vec<DVector<f64>> =
            columns.column_iter().map(|column| whitener.apply(column.as_slice())).collect();
        if columns.is_empty() { DMatrix::zeros(self.case.n(), 0) } else { DMatrix::from_columns(&columns) }
    }

    /// The step of all coordinates, and the decrease of the objective that it promises.
    fn step(&self, start: &Start, here: &Point, derivatives: &DMatrix<f64>, damping: f64) -> (Vec<f64>, f64) {
        let whitener = self.likelihood.whitener(&here.errors);
        let residuals = whitener.apply(&self.likelihood.off(&here.model));
        let white = self.whitened(&here.errors, derivatives);
        let normal = white.tr_mul(&white);
        let along = white.tr_mul(&residuals);
        let coordinates: Vec<f64> = start
            .unknowns
            .iter()
            .zip(&here.at)
            .map(|(unknown, &value)| unknown.prior.map_or(0.0, |prior| prior.coordinate(value)))
            .collect();
        let mut moving: Vec<usize> =
            (0..start.unknowns.len()).filter(|&index| start.unknowns[index].prior.is_some()).collect();
        let prior = |index: usize| start.unknowns[index].prior.expect("it moves");
        loop {
            let matrix = DMatrix::from_fn(moving.len(), moving.len(), |row, column| {
                let (i, j) = (moving[row], moving[column]);
                let own = if i == j { prior(i).width.powi(-2) } else { 0.0 };
                let all = normal[(i, j)] + own;
                if i == j { all * (1.0 + damping) } else { all }
            });
            let pull = |index: usize| prior(index).pull(coordinates[index]) / prior(index).width.powi(2);
            let right = DVector::from_fn(moving.len(), |row, _| along[moving[row]] + pull(moving[row]));
            let found = matrix.cholesky().map(|factor| factor.solve(&right));
            let mut step = vec![0.0; start.unknowns.len()];
            let Some(found) = found else { return (step, 0.0) };
            // Parameters at their bounds stay there while they would leave them.
            let stopped = moving
                .iter()
                .zip(found.iter())
                .position(|(&index, &step)| prior(index).is_stopped(coordinates[index], step));
            if let Some(place) = stopped {
                moving.remove(place);
                continue;
            }
            let longest = moving.iter().zip(found.iter()).map(|(&index, step)| step.abs() / prior(index).longest());
            let share = longest.fold(1.0_f64, f64::max);
            for (&index, found) in moving.iter().zip(found.iter()) {
                step[index] = found / share;
            }
            let promised: f64 = found.dot(&right) / share;
            return (step, promised);
        }
    }

    /// Values after a step, within bounds.
    fn moved(&self, start: &Start, here: &Point, step: &[f64]) -> Vec<f64> {
        let one = |(index, unknown): (usize, &Unknown)| {
            unknown.prior.map_or(here.at[index], |prior| {
                prior.value(prior.clamp(prior.coordinate(here.at[index]) + step[index]))
            })
        };
        start.unknowns.iter().enumerate().map(one).collect()
    }
}

/// ln det(1 + Π A'A Π) for whitened derivatives.
pub(super) fn volume(white: &DMatrix<f64>, widths: &[f64]) -> f64 {
    let normal = white.tr_mul(white);
    let matrix =
        DMatrix::from_fn(widths.len(), widths.len(), |i, j| widths[i] * widths[j] * normal[(i, j)] + f64::from(i == j));
    matrix.cholesky().map_or(0.0, |factor| 2.0 * factor.l().diagonal().iter().map(|x| x.ln()).sum::<f64>())
}

/// A mission with other values of some parameters; None if they make no sense.
pub(super) fn with_values(mission: &Mission, unknowns: &[Unknown], at: &[f64]) -> Option<Mission> {
    let numbers = unknowns.iter().zip(at).map(|(unknown, value)| Some((unknown.parameter.handle.as_ref()?, *value)));
    if let Some(numbers) = numbers.collect::<Option<Vec<_>>>() {
        return mission.with_handles(numbers.into_iter());
    }
    let settings: Vec<_> =
        unknowns.iter().zip(at).map(|(unknown, value)| (unknown.parameter.key.clone(), (*value).into())).collect();
    mission.with(&settings).ok()
}
