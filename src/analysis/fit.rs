//! Mission, measurements and free keys → values with errors.
//!
//! Weighted least squares by Levenberg and Marquardt's method (the crate's port of MINPACK), in coordinates in which bounds
//! are out of reach (`parameter`, `minimise`). Errors are those of the linear theory at the optimum, from derivatives with
//! respect to the parameters themselves (`errors`), larger where the model is curved (`sides`). The moment of an event (a flare,
//! a bakeout) has no derivative: data only tell between which two of their epochs it lies, so that these are tried one after
//! another; what is given is the middle of all that do as well (`moments`).

mod advice;
mod elsewhere;
mod errors;
pub mod holdout;
mod minimise;
mod moments;
pub mod parameter;
pub(crate) mod sides;

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;
use toml::Value;

use crate::analysis::measurement::{DataSet, questions};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::{Question, predict};
pub use advice::Advice;
use errors::Errors;
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
    /// chi2 that the mission's own values came to: that of a local minimum, if it is larger than [`Fit::chi2`].
    pub chi2_from_mission: f64,
    /// Other minima of chi2, the lowest first.
    pub minima: Vec<Minimum>,
    /// Derivatives of (value − model)/sigma with respect to the parameters at the optimum, `[(row, parameter)]`; 0 for those
    /// that move nothing in reach.
    pub(crate) jacobian: DMatrix<f64>,
}

/// Another minimum of chi2.
#[derive(Clone, Debug, Serialize)]
pub struct Minimum {
    /// chi2.
    pub chi2: f64,
    /// Values of the parameters, in their order.
    pub values: Vec<f64>,
}

/// One fitted parameter.
#[derive(Clone, Debug, Serialize)]
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

    /// Whether a value of chi2 is that of the optimum, as exactly as a fit ends.
    pub fn is_optimum(&self, chi2: f64) -> bool {
        is_same(chi2, self.chi2)
    }
}

/// How to fit.
#[derive(Clone, Debug)]
pub struct Options {
    /// Starting points: the mission's values, and random ones around them.
    pub starts: usize,
    /// Whether each parameter is scanned for other minima, from which the fit starts once more.
    pub scan: bool,
    /// Seed of the random starting points.
    pub seed: u64,
    /// Whether every interval between epochs is tried for the moment of an event; only that of the start otherwise.
    pub moments: bool,
    /// Whether the start is an optimum already: then only errors are computed.
    pub settled: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options { starts: 1, scan: true, seed: 1, moments: true, settled: false }
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
        let values = predict(model, &all)?;
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
            chi2_from_mission: chi2_before,
            minima: Vec::new(),
            jacobian: DMatrix::zeros(n, 0),
        });
    }
    let mut optima = match options.settled {
        true => vec![Optimum { at: here, chi2: chi2_before }],
        false => problem.optima(&here, options),
    };
    let chi2_from_mission = optima[0].chi2;
    optima.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let best = if options.settled { optima[0].clone() } else { problem.centred(optima[0].clone())? };
    let fitted = problem.mission(&best.at)?;
    let jacobian = problem.jacobian(&best.at)?;
    let errors = Errors::of(&jacobian);
    let mut sigmas = errors.sigmas.clone();
    problem.add_moments(&best, &mut sigmas);
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
        values: predict(&problem.base.like(&fitted), &all)?,
        mission: fitted,
        parameters,
        correlation: errors.correlation,
        chi2_before,
        chi2: best.chi2,
        n,
        advice,
        minima: minima(&optima),
        starts: optima.iter().map(|optimum| optimum.chi2).collect(),
        chi2_from_mission,
        jacobian: problem.without_idle(jacobian, &best.at),
    })
}

/// Minima other than the first of some optima, which come in the order of their chi2.
fn minima(optima: &[Optimum]) -> Vec<Minimum> {
    let mut others: Vec<Minimum> = Vec::new();
    for pair in optima.windows(2).filter(|pair| pair[1].chi2.is_finite() && !is_same(pair[1].chi2, pair[0].chi2)) {
        others.push(Minimum { chi2: pair[1].chi2, values: pair[1].at.clone() });
    }
    others
}

/// Whether two values of chi2 are those of one minimum, as exactly as a fit ends.
fn is_same(chi2: f64, best: f64) -> bool {
    chi2 < best + elsewhere::SAME * (1.0 + best)
}

/// Sum of squares.
pub(crate) fn chi2(residuals: &[f64]) -> f64 {
    residuals.iter().map(|residual| residual * residual).sum()
}

/// Part of a parameter's signature that others leave, below which it does not follow.
const LOOSE: f64 = 1e-9;

/// Sigma by which a factor e must move all rows together for a parameter to be one of the model's freedoms.
const IDLE: f64 = 0.1;

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

    /// The optima that all starts come to, that of the mission's own values first.
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
        if options.scan {
            let best = optima.iter().min_by(|a, b| a.chi2.total_cmp(&b.chi2)).expect("a start").clone();
            optima.extend(self.scanned(&best));
        }
        optima
    }
}
