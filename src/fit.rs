//! Mission, measurements and free keys → values with errors.
//!
//! Weighted least squares by Levenberg and Marquardt's method (the crate's port of MINPACK), in coordinates in which bounds
//! are out of reach (see [`parameter`]). Errors are those of the linear theory at the optimum, from derivatives with respect
//! to the parameters themselves, larger where the model is curved (`sides`). The moment of an event (a flare, a bakeout) has no derivative: data only tell between which
//! two of their epochs it lies, so that these are tried one after another; what is given is the middle of all that do as well.

mod advice;
pub mod holdout;
pub mod parameter;
pub(crate) mod sides;

use std::cell::RefCell;

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use toml::Value;

use crate::error::InputError;
use crate::least_squares::Span;
use crate::measurement::{DataSet, questions};
use crate::mission::Mission;
use crate::model::Model;
use crate::predict::{Question, predict};
pub use advice::Advice;
use parameter::Parameter;

/// What a fit found.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The mission with the fitted values.
    pub mission: Mission,
    /// Free parameters, in the order asked for.
    pub parameters: Vec<Fitted>,
    /// Correlation of two parameters, `[[i, j]]`; 0 with one that the data do not move.
    pub correlation: Vec<Vec<f64>>,
    /// chi2 of the mission as it was.
    pub chi2_before: f64,
    /// chi2 at the optimum.
    pub chi2: f64,
    /// Rows.
    pub n: usize,
    /// Model at the optimum, for each row of each data set, in order.
    pub values: Vec<f64>,
    /// What the data do not determine, in words.
    pub advice: Vec<Advice>,
    /// chi2 that each start came to, best first.
    pub starts: Vec<f64>,
    /// Derivatives of (value − model)/sigma with respect to the parameters at the optimum, `[(row, parameter)]`; 0 for those
    /// that move nothing in reach.
    pub(crate) jacobian: DMatrix<f64>,
}

/// One fitted parameter.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Dotted key.
    pub key: String,
    /// Unit of the value; empty for pure numbers.
    pub unit: &'static str,
    /// Value in the mission as it was.
    pub before: f64,
    /// Value at the optimum.
    pub value: f64,
    /// 1-sigma error, of the larger side where chi2 is no parabola; None where the data do not tell.
    pub sigma: Option<f64>,
}

impl Fit {
    /// Degrees of freedom.
    pub fn degrees_of_freedom(&self) -> usize {
        self.n.saturating_sub(self.parameters.len())
    }

    /// By how many of its standard deviations chi2 is more than noise makes.
    pub fn excess(&self) -> f64 {
        let freedom = self.degrees_of_freedom().max(1) as f64;
        (self.chi2 - freedom) / (2.0 * freedom).sqrt()
    }

    /// rms of (value − model)/sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.n as f64).sqrt()
    }
}

/// How to fit.
#[derive(Clone, Debug)]
pub struct Options {
    /// Starting points: the mission's values, and random ones around them.
    pub starts: usize,
    /// Seed of the random starting points.
    pub seed: u64,
    /// Whether every interval between epochs is tried for the moment of an event; only that of the start otherwise.
    pub moments: bool,
    /// Whether the start is an optimum already: then only errors are computed.
    pub settled: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options { starts: 1, seed: 1, moments: true, settled: false }
    }
}

/// A least-squares problem: all that stays the same while parameters change.
pub(crate) struct Problem<'a> {
    base: &'a Model,
    parameters: Vec<Parameter>,
    questions: Vec<Question<'a>>,
    values: Vec<f64>,
    sigmas: Vec<f64>,
    progress: &'a (dyn Fn(f64) + Sync),
}

/// A point in a problem's parameters.
#[derive(Clone, Debug)]
pub(crate) struct Optimum {
    pub at: Vec<f64>,
    pub chi2: f64,
}

/// Adjusts the values of `keys` in a mission to data. `progress` is called with chi2 after every evaluation of the model.
///
/// # Errors
/// Where a key is none of the mission's or no number, stands twice, there are fewer rows than keys, or the model has no
/// value for a row.
pub fn fit(
    mission: &Mission,
    data: &[DataSet],
    keys: &[String],
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Fit, InputError> {
    let model = Model::new(mission);
    let fit = fit_rows(&model, data, keys, options, progress, |_| true)?;
    Ok(Fit { parameters: sides::widened(&model.like(&fit.mission), data, &fit)?, ..fit })
}

/// The same with those rows alone (by their place among all) that are wanted; predictions are made for all of them.
pub(crate) fn fit_rows(
    model: &Model,
    data: &[DataSet],
    keys: &[String],
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
    wanted: impl Fn(usize) -> bool,
) -> Result<Fit, InputError> {
    let problem = Problem::new(model, data, keys, progress, wanted)?;
    let (mission, n, all) = (&model.mission, problem.values.len(), questions(data));
    let here: Vec<f64> = problem.parameters.iter().map(|parameter| parameter.start).collect();
    let before = problem.residuals(&here)?;
    let chi2_before = chi2(&before);
    if keys.is_empty() {
        let values = predict(model, &all);
        return Ok(Fit {
            mission: mission.clone(),
            parameters: Vec::new(),
            correlation: Vec::new(),
            chi2_before,
            chi2: chi2_before,
            n,
            values,
            advice: Vec::new(),
            starts: vec![chi2_before],
            jacobian: DMatrix::zeros(n, 0),
        });
    }
    let mut optima = match options.settled {
        true => vec![Optimum { at: here, chi2: chi2_before }],
        false => problem.optima(&here, options),
    };
    optima.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let best = if options.settled { optima[0].clone() } else { problem.centred(optima[0].clone())? };
    let fitted = problem.mission(&best.at)?;
    let jacobian = problem.jacobian(&best.at)?;
    let errors = Errors::of(&jacobian);
    let mut sigmas = errors.sigmas.clone();
    problem.add_moments(&best, &jacobian, &mut sigmas);
    let parameters: Vec<Fitted> = problem
        .parameters
        .iter()
        .zip(&best.at)
        .zip(&sigmas)
        .map(|((parameter, value), sigma)| Fitted {
            key: parameter.key.clone(),
            unit: parameter.unit,
            before: parameter.start,
            value: *value,
            sigma: *sigma,
        })
        .collect();
    let advice = advice::on(&problem.parameters, &parameters, &errors.correlation, &errors.flat);
    Ok(Fit {
        values: predict(&problem.base.like(&fitted), &all),
        mission: fitted,
        parameters,
        correlation: errors.correlation,
        chi2_before,
        chi2: best.chi2,
        n,
        advice,
        starts: optima.iter().map(|optimum| optimum.chi2).collect(),
        jacobian: problem.without_idle(jacobian, &best.at),
    })
}

/// Sum of squares.
pub(crate) fn chi2(residuals: &[f64]) -> f64 {
    residuals.iter().map(|residual| residual * residual).sum()
}

/// Times that a minimisation is taken up again at most.
const AGAIN: usize = 20;

/// Relative change of chi2 and of parameters at which a sketch of an optimum is good enough.
const SKETCHED: f64 = 1e-3;

/// Times that a sketch is taken up again at most, and the fall of chi2 from which on that is worth it.
const FRESH: usize = 3;
const HELPED: f64 = 2.0;

/// Rise of chi2 up to which a moment is as good elsewhere: one standard error.
const AS_GOOD: f64 = 1.0;

/// Rise of chi2 beyond which no moment is looked for.
const UNLIKELY: f64 = 25.0;

/// Part of a parameter's signature that others leave, below which it does not follow.
const LOOSE: f64 = 1e-9;

/// Sigma by which a factor e must move all rows together for a parameter to be one of the model's freedoms.
const IDLE: f64 = 0.1;

/// Intervals between epochs of which one is tried first for a moment.
const EVERY: usize = 4;

impl<'a> Problem<'a> {
    /// The problem of some rows (by their place among all).
    ///
    /// # Errors
    /// As [`fit`].
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
                return Err(InputError::new("cannot fit", format!("the key `{key}` stands twice")));
            }
        }
        let rows = || data.iter().flat_map(|set| &set.rows).enumerate().filter(|(index, _)| wanted(*index));
        let questions = questions(data).into_iter().enumerate();
        let problem = Problem {
            base: model,
            questions: questions.filter(|(index, _)| wanted(*index)).map(|(_, question)| question).collect(),
            values: rows().map(|(_, row)| row.value).collect(),
            sigmas: rows().map(|(_, row)| row.sigma).collect(),
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

    /// Missions near optima other than one of so much chi2, from random starting points.
    pub(crate) fn elsewhere(&self, starts: usize, seed: u64, chi2: f64) -> Vec<Mission> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sketches = (0..starts).filter_map(|_| {
            let start: Vec<f64> =
                self.parameters.iter().map(|parameter| parameter.elsewhere(random.random())).collect();
            let none = DMatrix::zeros(self.values.len(), 0);
            let solver = LevenbergMarquardt::new().with_ftol(SKETCHED).with_xtol(SKETCHED);
            let found = self.minimise_once(&start, solver, Some(&none));
            (found.chi2 < chi2 - 1.0).then(|| self.mission(&found.at).ok()).flatten()
        });
        sketches.collect()
    }

    /// A mission near the optimum, and its chi2: one short minimisation from the mission's own values, moments held, with
    /// derivatives that follow from those at the start by Broyden's update (1965, Mathematics of Computation 19, 577). Those
    /// of the first parameters may be known from a fit without the others.
    pub(crate) fn sketch(&self, known: &DMatrix<f64>) -> Result<(Mission, f64), InputError> {
        let here: Vec<f64> = self.parameters.iter().map(|parameter| parameter.start).collect();
        let solver = || LevenbergMarquardt::new().with_ftol(SKETCHED).with_xtol(SKETCHED);
        let mut found = self.minimise_once(&here, solver(), Some(known));
        // Derivatives that have followed far lead astray: once more with fresh ones, while that helps.
        for _ in 0..FRESH {
            let again = self.minimise_once(&found.at, solver(), Some(&DMatrix::zeros(self.values.len(), 0)));
            let settled = again.chi2 > found.chi2 - HELPED.max(HELPED * 1e-3 * found.chi2);
            if again.chi2 < found.chi2 {
                found = again;
            }
            if settled {
                break;
            }
        }
        Ok((self.mission(&found.at)?, found.chi2))
    }

    /// The mission with other values.
    ///
    /// # Errors
    /// Where the values make no sense together.
    fn mission(&self, at: &[f64]) -> Result<Mission, InputError> {
        let setting = |(parameter, value): (&Parameter, &f64)| (parameter.key.clone(), Value::Float(*value));
        self.base.mission.with(&self.parameters.iter().zip(at).map(setting).collect::<Vec<_>>())
    }

    /// (value − model)/sigma of every row.
    ///
    /// # Errors
    /// Where the model has no value.
    fn residuals(&self, at: &[f64]) -> Result<Vec<f64>, InputError> {
        let mission = self.mission(at)?;
        let model = self.base.like(&mission);
        let found = predict(&model, &self.questions);
        model.check()?;
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
        (self.progress)(chi2(&residuals));
        Ok(residuals)
    }

    /// Derivatives of the residuals with respect to the parameters, `[(row, parameter)]`, from one step to either side; 0 for
    /// moments, which have none.
    fn jacobian(&self, at: &[f64]) -> Result<DMatrix<f64>, InputError> {
        let derivative = |(index, parameter): (usize, &Parameter)| -> Result<DVector<f64>, InputError> {
            if parameter.is_moment {
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
        let columns: Vec<Result<DVector<f64>, InputError>> =
            self.parameters.par_iter().enumerate().map(derivative).collect();
        // The first of several errors, whichever came first.
        Ok(DMatrix::from_columns(&columns.into_iter().collect::<Result<Vec<_>, _>>()?))
    }

    /// Derivatives without those of parameters that would have to change by many factors e to move anything: in so far away
    /// a place they are others.
    fn without_idle(&self, mut jacobian: DMatrix<f64>, at: &[f64]) -> DMatrix<f64> {
        for (index, mut column) in jacobian.column_iter_mut().enumerate() {
            if self.parameters[index].is_log() && column.norm() * at[index] < IDLE {
                column.fill(0.0);
            }
        }
        jacobian
    }

    /// The optima that all starts come to.
    fn optima(&self, here: &[f64], options: &Options) -> Vec<Optimum> {
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        let mut optima = Vec::new();
        for start in 0..options.starts.max(1) {
            let at: Vec<f64> = self
                .parameters
                .iter()
                .zip(here)
                .map(|(parameter, value)| if start == 0 { *value } else { parameter.elsewhere(random.random()) })
                .collect();
            optima.push(if options.moments { self.with_moments(&at) } else { self.minimise(&at) });
        }
        optima
    }

    /// Minimises from a start, trying every interval between epochs for each moment.
    fn with_moments(&self, start: &[f64]) -> Optimum {
        let moments: Vec<usize> = (0..start.len()).filter(|&index| self.parameters[index].is_moment).collect();
        let mut best = self.minimise(start);
        if moments.is_empty() {
            return best;
        }
        let candidates: Vec<f64> = self.epochs().windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        // Moments may depend on one another: once more after all have been tried.
        for _ in 0..if moments.len() > 1 { 2 } else { 1 } {
            for &index in &moments {
                let from = best.at.clone();
                let attempt = |place: usize| {
                    let mut at = from.clone();
                    at[index] = candidates[place];
                    self.minimise(&at)
                };
                // Every few intervals first, then all around the best of them.
                let coarse: Vec<(usize, Optimum)> =
                    (0..candidates.len()).step_by(EVERY).map(|place| (place, attempt(place))).collect();
                let least = coarse.iter().min_by(|a, b| a.1.chi2.total_cmp(&b.1.chi2)).map_or(0, |(place, _)| *place);
                let around = least.saturating_sub(EVERY - 1)..(least + EVERY).min(candidates.len());
                let fine = around.filter(|place| place % EVERY != 0).map(attempt);
                for found in coarse.iter().map(|(_, found)| found.clone()).chain(fine.collect::<Vec<_>>()) {
                    if found.chi2 < best.chi2 - 1e-9 * best.chi2.abs() {
                        best = found;
                    }
                }
            }
        }
        best
    }

    /// Launch and the epochs of the data, years since launch, rising.
    fn epochs(&self) -> Vec<f64> {
        let mut epochs: Vec<f64> = self.questions.iter().map(|question| question.at.t_yr).collect();
        epochs.push(0.0);
        epochs.sort_by(f64::total_cmp);
        epochs.dedup();
        epochs
    }

    /// An optimum with each moment in the middle of where chi2 is as good: its mean, where the data do not tell more.
    fn centred(&self, optimum: Optimum) -> Result<Optimum, InputError> {
        let (mut found, most) = (optimum.clone(), optimum.chi2 + AS_GOOD);
        for index in (0..found.at.len()).filter(|&index| self.parameters[index].is_moment) {
            let jacobian = self.jacobian(&found.at)?;
            let around = self.around(&found, &jacobian, index, AS_GOOD);
            let moment = found.at[index];
            let from_yr = around.iter().map(|one| one.from_yr).fold(moment, f64::min);
            let to_yr = around.iter().map(|one| one.to_yr).fold(moment, f64::max);
            let mut at = found.at.clone();
            at[index] = 0.5 * (from_yr + to_yr);
            if at[index] == moment {
                continue;
            }
            let moved = self.minimise(&at);
            if moved.chi2 < most {
                found = moved;
            }
        }
        Ok(found)
    }

    /// Intervals between epochs where a moment may lie, from that of an optimum outwards as long as chi2, the other
    /// parameters following to first order, does not rise by more.
    fn around(&self, optimum: &Optimum, jacobian: &DMatrix<f64>, index: usize, rise: f64) -> Vec<Interval> {
        let span = Span::of(jacobian, LOOSE);
        let epochs = self.epochs();
        let interval = |ends: &[f64]| -> Option<Interval> {
            let mut at = optimum.at.clone();
            at[index] = 0.5 * (ends[0] + ends[1]);
            let residuals = DVector::from_vec(self.residuals(&at).ok()?);
            let follow = -span.solve(&residuals);
            let rise = (residuals + jacobian * &follow).norm_squared() - optimum.chi2;
            Some(Interval { from_yr: ends[0], to_yr: ends[1], rise, follow })
        };
        let near = |one: &Interval| one.rise < rise;
        let moment = optimum.at[index];
        let Some(here) = epochs.windows(2).position(|pair| (pair[0]..=pair[1]).contains(&moment)) else {
            return Vec::new();
        };
        let before = epochs[..=here + 1].windows(2).rev().map_while(|ends| interval(ends).filter(near));
        let after = epochs[here + 1..].windows(2).map_while(|ends| interval(ends).filter(near));
        before.chain(after).collect()
    }

    /// Errors of moments, and what they add to those of all others: every interval between epochs is as likely as it is
    /// long, times exp(−chi2/2).
    fn add_moments(&self, optimum: &Optimum, jacobian: &DMatrix<f64>, sigmas: &mut [Option<f64>]) {
        for index in (0..optimum.at.len()).filter(|&index| self.parameters[index].is_moment) {
            let around = self.around(optimum, jacobian, index, UNLIKELY);
            let likely = |one: &Interval| (one.to_yr - one.from_yr) * (-0.5 * one.rise).exp();
            let all: f64 = around.iter().map(likely).sum();
            if all == 0.0 {
                continue;
            }
            let mean =
                |of: &dyn Fn(&Interval) -> f64| around.iter().map(|one| likely(one) * of(one)).sum::<f64>() / all;
            // Of (t − moment)^2 over an interval.
            let square = |one: &Interval| {
                let [from, to] = [one.from_yr, one.to_yr].map(|t_yr| t_yr - optimum.at[index]);
                (from * from + from * to + to * to) / 3.0
            };
            for (other, sigma) in sigmas.iter_mut().enumerate() {
                *sigma = match sigma {
                    _ if other == index => Some(mean(&square).sqrt()),
                    Some(sigma) => Some(sigma.hypot(mean(&|one| one.follow[other].powi(2)).sqrt())),
                    None => None,
                };
            }
        }
    }

    /// Minimises from a start with moments held where they are, again and again until that helps no more: where the model
    /// has a kink (a packet that sinks into a notch) the solver stops early.
    fn minimise(&self, start: &[f64]) -> Optimum {
        // Residuals are good to the accuracy of the readout: no use in asking for more.
        let solver = || LevenbergMarquardt::new().with_ftol(1e-8).with_xtol(1e-7);
        let mut best = self.minimise_once(start, solver(), None);
        for _ in 0..AGAIN {
            let found = self.minimise_once(&best.at, solver(), None);
            let settled = found.chi2 > best.chi2 - 1e-3 - 1e-5 * best.chi2;
            if found.chi2 < best.chi2 {
                best = found;
            }
            if settled {
                break;
            }
        }
        best
    }

    /// One minimisation; with derivatives by Broyden's update where some `known` ones are given.
    fn minimise_once(&self, start: &[f64], solver: LevenbergMarquardt<f64>, known: Option<&DMatrix<f64>>) -> Optimum {
        let moving: Vec<usize> = (0..start.len()).filter(|&index| !self.parameters[index].is_moment).collect();
        let state = |at: &[f64]| -> Optimum {
            let chi2 = self.residuals(at).map_or(f64::INFINITY, |residuals| chi2(&residuals));
            Optimum { at: at.to_vec(), chi2 }
        };
        if moving.is_empty() {
            return state(start);
        }
        let secant = known.map(|known| Secant { known: known.clone(), last: RefCell::new(None) });
        let mut run = Run { problem: self, moving, at: start.to_vec(), residuals: None, secant };
        let inner = run.inner();
        run.set_params(&inner);
        if run.residuals.is_none() {
            return Optimum { at: start.to_vec(), chi2: f64::INFINITY };
        }
        let (run, _) = solver.with_gtol(0.0).with_patience(25).minimize(run);
        match &run.residuals {
            Some(residuals) => Optimum { chi2: chi2(residuals), at: run.at },
            None => state(start),
        }
    }
}

/// An interval between epochs, with a moment in it.
struct Interval {
    from_yr: f64,
    to_yr: f64,
    /// By how much chi2 is above that of the optimum.
    rise: f64,
    /// How the other parameters follow.
    follow: DVector<f64>,
}

/// A minimisation under way, in inner coordinates.
struct Run<'a> {
    problem: &'a Problem<'a>,
    /// Parameters that move, by their places.
    moving: Vec<usize>,
    at: Vec<f64>,
    residuals: Option<Vec<f64>>,
    secant: Option<Secant>,
}

/// A point on the way, in inner coordinates.
struct Point {
    at: DVector<f64>,
    residuals: DVector<f64>,
    jacobian: DMatrix<f64>,
}

/// Derivatives that follow from those before.
struct Secant {
    /// Those of the first parameters at the start, with respect to the parameters themselves.
    known: DMatrix<f64>,
    /// The last point.
    last: RefCell<Option<Point>>,
}

impl Run<'_> {
    fn inner(&self) -> DVector<f64> {
        let inner = |&index: &usize| self.problem.parameters[index].inner(self.at[index]);
        DVector::from_iterator(self.moving.len(), self.moving.iter().map(inner))
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Run<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, inner: &DVector<f64>) {
        for (&index, inner) in self.moving.iter().zip(inner.iter()) {
            self.at[index] = self.problem.parameters[index].outer(*inner);
        }
        self.residuals = self.problem.residuals(&self.at).ok();
    }

    fn params(&self) -> DVector<f64> {
        self.inner()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let pulls = self.pulls();
        let residuals = self.residuals.as_ref()?;
        Some(DVector::from_iterator(residuals.len() + pulls.len(), residuals.iter().copied().chain(pulls)))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let (of_data, rows) = (self.jacobian_of_data()?, self.problem.values.len());
        let mut jacobian = of_data.resize_vertically(rows + self.moving.len(), 0.0);
        for (column, &index) in self.moving.iter().enumerate() {
            jacobian[(rows + column, column)] = self.problem.parameters[index].pull();
        }
        Some(jacobian)
    }
}

impl Run<'_> {
    /// By how much each parameter is drawn to where it came from.
    fn pulls(&self) -> Vec<f64> {
        let pull = |&index: &usize| {
            let parameter = &self.problem.parameters[index];
            parameter.pull() * (parameter.inner(self.at[index]) - parameter.inner(parameter.start))
        };
        self.moving.iter().map(pull).collect()
    }

    /// Derivatives of the residuals of the data with respect to the inner coordinates.
    fn jacobian_of_data(&self) -> Option<DMatrix<f64>> {
        let residuals = DVector::from_vec(self.residuals.clone()?);
        let Some(secant) = &self.secant else { return self.derivatives(&residuals, None) };
        let here = self.inner();
        let mut last = secant.last.borrow_mut();
        let jacobian = match last.take() {
            None => self.derivatives(&residuals, Some(&secant.known))?,
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

    /// Derivatives with respect to the inner coordinates, by a step forward where they are not known.
    fn derivatives(&self, centre: &DVector<f64>, known: Option<&DMatrix<f64>>) -> Option<DMatrix<f64>> {
        let (problem, at) = (self.problem, &self.at);
        let derivative = |&index: &usize| -> Option<DVector<f64>> {
            let parameter = &problem.parameters[index];
            let inner = parameter.inner(at[index]);
            let step = parameter.inner_step(inner);
            let moved = parameter.outer(inner + step);
            if let Some(known) = known.filter(|known| index < known.ncols()) {
                return Some(known.column(index) * ((moved - at[index]) / step));
            }
            let mut at = at.clone();
            at[index] = moved;
            Some((DVector::from_vec(problem.residuals(&at).ok()?) - centre) / step)
        };
        let columns = self.moving.par_iter().map(derivative).collect::<Option<Vec<_>>>()?;
        Some(DMatrix::from_columns(&columns))
    }
}

/// Errors of the linear theory.
struct Errors {
    sigmas: Vec<Option<f64>>,
    correlation: Vec<Vec<f64>>,
    /// Directions (in units of each parameter's own error were it alone) along which chi2 does not change.
    flat: Vec<Vec<f64>>,
}

/// Eigenvalue of the scaled normal matrix, of trace n, below which a direction counts as flat: a combination known ten
/// thousand times worse than its members would be alone.
const FLAT: f64 = 1e-8;

impl Errors {
    fn of(jacobian: &DMatrix<f64>) -> Errors {
        let n = jacobian.ncols();
        let norms: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
        let alive: Vec<usize> = (0..n).filter(|&index| norms[index] > 0.0).collect();
        let mut sigmas = vec![None; n];
        let mut correlation = vec![vec![0.0; n]; n];
        for (index, row) in correlation.iter_mut().enumerate() {
            row[index] = 1.0;
        }
        if alive.is_empty() {
            return Errors { sigmas, correlation, flat: Vec::new() };
        }
        let scaled = DMatrix::from_fn(jacobian.nrows(), alive.len(), |row, column| {
            jacobian[(row, alive[column])] / norms[alive[column]]
        });
        let eigen = (scaled.transpose() * &scaled).symmetric_eigen();
        let mut covariance = DMatrix::zeros(alive.len(), alive.len());
        let mut flat = Vec::new();
        let mut loose = vec![false; alive.len()];
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > FLAT {
                covariance += vector * vector.transpose() / *value;
                continue;
            }
            let mut direction = vec![0.0; n];
            for (place, &index) in alive.iter().enumerate() {
                direction[index] = vector[place];
                loose[place] |= vector[place].abs() > 0.01;
            }
            flat.push(direction);
        }
        for (a, &index) in alive.iter().enumerate() {
            let sigma = covariance[(a, a)].sqrt();
            sigmas[index] = (!loose[a] && sigma > 0.0).then(|| sigma / norms[index]);
            for (b, &other) in alive.iter().enumerate() {
                let both = (covariance[(a, a)] * covariance[(b, b)]).sqrt();
                if both > 0.0 {
                    correlation[index][other] = (covariance[(a, b)] / both).clamp(-1.0, 1.0);
                }
            }
        }
        Errors { sigmas, correlation, flat }
    }
}
