//! The minimum of the sum of squares, from a start, with event epochs fixed.

use std::cell::RefCell;

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};

use super::parameter::Parameter;
use super::problem::{Optimum, Problem, chi2};
use crate::numeric::parallel;

/// Maximum number of restarts of a minimisation.
const AGAIN: usize = 20;

/// Relative change of chi2 and of parameters at which a rough optimum is sufficient.
const SKETCHED: f64 = 1e-3;

/// Maximum number of restarts of a rough optimum, and the decrease of chi2 that justifies one.
const FRESH: usize = 3;
const HELPED: f64 = 2.0;

/// The decrease of chi2 from this value that justifies another minimisation.
pub(crate) fn helped(chi2: f64) -> f64 {
    HELPED.max(HELPED * 1e-3 * chi2)
}

/// Residuals have the accuracy of the readout: smaller tolerances are useless.
fn solver() -> LevenbergMarquardt<f64> {
    LevenbergMarquardt::new().with_ftol(1e-6).with_xtol(1e-6)
}

/// Whether another minimisation did not help.
fn is_settled(found: f64, best: f64) -> bool {
    found > best - 1e-3 - 1e-5 * best
}

fn rough_solver() -> LevenbergMarquardt<f64> {
    LevenbergMarquardt::new().with_ftol(SKETCHED).with_xtol(SKETCHED)
}

impl Problem<'_> {
    fn state(&self, at: &[f64]) -> Optimum {
        let chi2 = self.residuals(at).map_or(f64::INFINITY, |residuals| chi2(&residuals));
        Optimum { at: at.to_vec(), chi2 }
    }

    /// chi2 near the optimum reached from the mission's own values, with fresh derivatives while they help: updated ones become wrong
    /// over long distances.
    pub(crate) fn sketched_chi2(&self) -> f64 {
        let mut found = self.roughly(&self.here());
        for _ in 0..FRESH {
            let again = self.roughly(&found.at);
            let settled = again.chi2 > found.chi2 - helped(found.chi2);
            if again.chi2 < found.chi2 {
                found = again;
            }
            if settled {
                break;
            }
        }
        found.chi2
    }

    /// A point near the minimum reached from a start, with event epochs fixed.
    ///
    /// Parameters that start at a bound are held there first: their derivatives nearly vanish, and the solver takes the steps that
    /// they would need for an end of the search.
    pub(super) fn roughly(&self, start: &[f64]) -> Optimum {
        let at_bound = |index: usize| self.parameters[index].at_bound(start[index]).is_some();
        let is_mixed = (0..start.len()).any(at_bound) && !(0..start.len()).all(at_bound);
        let within = |index: usize| !at_bound(index);
        let some = || self.minimise_some(start, rough_solver(), &self.nothing_known(), &self.parameters, within);
        let near = is_mixed.then(some);
        let from = near.as_ref().map_or(start, |near| &near.at);
        self.minimise_once(from, rough_solver(), &self.nothing_known())
    }

    fn here(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.start).collect()
    }

    /// Derivatives with respect to no parameter.
    pub(crate) fn nothing_known(&self) -> DMatrix<f64> {
        DMatrix::zeros(self.values.len(), 0)
    }

    /// Minimises from a start with event epochs fixed, repeated with fresh derivatives until it no longer helps: if the model has a
    /// kink (a packet that sinks into a notch) the solver stops early.
    pub(super) fn minimise(&self, start: &[f64]) -> Optimum {
        let mut best = self.roughly(start);
        for _ in 0..AGAIN {
            let found = self.minimise_once(&best.at, solver(), &self.nothing_known());
            let settled = is_settled(found.chi2, best.chi2);
            if found.chi2 < best.chi2 {
                best = found;
            }
            if settled {
                break;
            }
        }
        best
    }

    /// The same from an optimum, with each event epoch free between the epochs of the data around it; the optimum itself if that
    /// does not help.
    pub(super) fn within_intervals(&self, optimum: Optimum) -> Optimum {
        let mut best = optimum;
        for _ in 0..AGAIN {
            let within = |(parameter, at): (&Parameter, &f64)| match self.interval_of(*at) {
                Some([low, high]) if parameter.is_event_epoch => parameter.between(low, high),
                _ => parameter.clone(),
            };
            let parameters: Vec<Parameter> = self.parameters.iter().zip(&best.at).map(within).collect();
            let found = self.minimise_some(&best.at, solver(), &self.nothing_known(), &parameters, |_| true);
            if is_settled(found.chi2, best.chi2) {
                break;
            }
            best = found;
        }
        best
    }

    /// One minimisation, with derivatives from Broyden's update (1965, Mathematics of Computation 19, 577) of those at the start;
    /// those of the first parameters may be `known`.
    fn minimise_once(&self, start: &[f64], solver: LevenbergMarquardt<f64>, known: &DMatrix<f64>) -> Optimum {
        self.minimise_some(start, solver, known, &self.parameters, |_| true)
    }

    /// The same with some of the parameters, and their bounds.
    fn minimise_some(
        &self,
        start: &[f64],
        solver: LevenbergMarquardt<f64>,
        known: &DMatrix<f64>,
        parameters: &[Parameter],
        moves: impl Fn(usize) -> bool,
    ) -> Optimum {
        let moving: Vec<usize> =
            (0..start.len()).filter(|&index| moves(index) && !parameters[index].is_event_epoch).collect();
        if moving.is_empty() {
            return self.state(start);
        }
        let (known, last) = (known.clone(), RefCell::new(None));
        let mut run = Run { problem: self, parameters, moving, at: start.to_vec(), residuals: None, known, last };
        let inner = run.inner();
        run.set_params(&inner);
        if run.residuals.is_none() {
            return Optimum { at: start.to_vec(), chi2: f64::INFINITY };
        }
        let (run, _) = solver.with_gtol(0.0).with_patience(25).minimize(run);
        match &run.residuals {
            Some(residuals) => Optimum { chi2: chi2(residuals), at: run.at },
            None => self.state(start),
        }
    }
}

/// A minimisation in progress, in inner coordinates.
struct Run<'a> {
    problem: &'a Problem<'a>,
    /// With their bounds and coordinates.
    parameters: &'a [Parameter],
    /// Parameters that move, by their indices.
    moving: Vec<usize>,
    at: Vec<f64>,
    residuals: Option<Vec<f64>>,
    /// Derivatives with respect to the first parameters at the start.
    known: DMatrix<f64>,
    /// The last point.
    last: RefCell<Option<Point>>,
}

/// A point of the path, in inner coordinates.
struct Point {
    at: DVector<f64>,
    residuals: DVector<f64>,
    jacobian: DMatrix<f64>,
}

impl Run<'_> {
    fn inner(&self) -> DVector<f64> {
        let inner = |&index: &usize| self.parameters[index].inner(self.at[index]);
        DVector::from_iterator(self.moving.len(), self.moving.iter().map(inner))
    }

    /// The prior of each parameter at its starting value.
    fn priors(&self) -> Vec<f64> {
        let prior = |&index: &usize| {
            let parameter = &self.parameters[index];
            parameter.prior() * (parameter.inner(self.at[index]) - parameter.inner(parameter.start))
        };
        self.moving.iter().map(prior).collect()
    }

    /// Derivatives of the residuals of the data with respect to the inner coordinates.
    fn jacobian_of_data(&self) -> Option<DMatrix<f64>> {
        let residuals = DVector::from_vec(self.residuals.clone()?);
        let here = self.inner();
        let mut last = self.last.borrow_mut();
        let jacobian = match last.take() {
            None => self.derivatives(&residuals)?,
            Some(Point { at, residuals: before, mut jacobian }) => {
                let step = &here - at;
                let length = step.norm_squared();
                if length > 0.0 {
                    let missed = &residuals - before - &jacobian * &step;
                    jacobian += missed * step.transpose() / length;
                }
                jacobian
            }
        };
        *last = Some(Point { at: here, residuals, jacobian: jacobian.clone() });
        Some(jacobian)
    }

    /// Derivatives with respect to the inner coordinates, by a forward difference if they are not known.
    fn derivatives(&self, centre: &DVector<f64>) -> Option<DMatrix<f64>> {
        let (problem, parameters, at, known) = (self.problem, self.parameters, &self.at, &self.known);
        let derivative = |&index: &usize| -> Option<DVector<f64>> {
            let parameter = &parameters[index];
            let inner = parameter.inner(at[index]);
            let step = parameter.inner_step(inner);
            let moved = parameter.outer(inner + step);
            if index < known.ncols() {
                return Some(known.column(index) * ((moved - at[index]) / step));
            }
            let mut at = at.clone();
            at[index] = moved;
            Some((DVector::from_vec(problem.residuals(&at).ok()?) - centre) / step)
        };
        // All of them, even if one has no value: the number of evaluations must not depend on which came first.
        let columns: Vec<Option<DVector<f64>>> = parallel::map(&self.moving, derivative);
        Some(DMatrix::from_columns(&columns.into_iter().collect::<Option<Vec<_>>>()?))
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Run<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, inner: &DVector<f64>) {
        for (&index, inner) in self.moving.iter().zip(inner.iter()) {
            self.at[index] = self.parameters[index].outer(*inner);
        }
        self.residuals = self.problem.residuals(&self.at).ok();
    }

    fn params(&self) -> DVector<f64> {
        self.inner()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let priors = self.priors();
        let residuals = self.residuals.as_ref()?;
        Some(DVector::from_iterator(residuals.len() + priors.len(), residuals.iter().copied().chain(priors)))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let (of_data, rows) = (self.jacobian_of_data()?, self.problem.values.len());
        let mut jacobian = of_data.resize_vertically(rows + self.moving.len(), 0.0);
        for (column, &index) in self.moving.iter().enumerate() {
            jacobian[(rows + column, column)] = self.parameters[index].prior();
        }
        Some(jacobian)
    }
}
