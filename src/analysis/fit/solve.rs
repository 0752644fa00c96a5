//! Optima of the problem, from all its starts, and the best of them with errors.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::advice;
use super::errors::Errors;
use super::problem::{Optimum, Problem, chi2};
use super::result::{Fit, Fitted, Minimum, is_same};
use crate::analysis::independence::Independence;
use crate::analysis::measurement::{DataSet, questions};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::predict;

/// Distance from a minimum, in errors of a parameter, at which another one that is as low counts as another.
const ELSEWHERE: f64 = 10.0;

/// Options of a fit.
#[derive(Clone, Debug)]
pub struct Options {
    /// Starting points: the mission's values, and random ones around them.
    pub starts: usize,
    /// Whether each parameter is scanned for other minima, from which the fit starts once more.
    pub scan: bool,
    /// Seed of the random starting points.
    pub seed: u64,
    /// Whether every interval between epochs is tried for the epoch of an event; otherwise only that of the start.
    pub moments: bool,
    /// Whether the start is already an optimum: then only errors are computed.
    pub settled: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options { starts: 1, scan: true, seed: 1, moments: true, settled: false }
    }
}

/// Adjusts the values of `keys` to the wanted rows only (by their indices among all); predictions are made for all rows.
pub(crate) fn fit_rows(
    model: &Model,
    data: &[DataSet],
    keys: &[String],
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
    wanted: impl Fn(usize) -> bool,
) -> Result<Fit, InputError> {
    let problem = Problem::new(model, data, keys, progress, wanted)?;
    let all = questions(data);
    let here: Vec<f64> = problem.parameters.iter().map(|parameter| parameter.start).collect();
    let before = problem.residuals(&here)?;
    let chi2_before = chi2(&before);
    if keys.is_empty() {
        return Ok(nothing_free(&model.mission, predict(model, &all)?, chi2_before, problem.values.len()));
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
    let mut errors = Errors::of(&jacobian);
    problem.add_event_epochs(&best, &mut errors);
    let sigmas = errors.sigmas();
    let parameters = problem.fitted(&best.at, &sigmas);
    let advice = advice::on(&problem.parameters, &parameters, &errors);
    Ok(Fit {
        values: predict(&problem.base.like(&fitted), &all)?,
        mission: fitted,
        parameters,
        correlation: errors.correlation(),
        chi2_before,
        chi2: best.chi2,
        n: problem.values.len(),
        advice,
        minima: problem.minima(&optima, &sigmas),
        starts: optima.iter().map(|optimum| optimum.chi2).collect(),
        chi2_from_mission,
        warnings: Vec::new(),
        independence: Independence::default(),
        jacobian: problem.without_idle(jacobian, &best.at),
    })
}

/// A mission without free parameters, unchanged.
fn nothing_free(mission: &Mission, values: Vec<f64>, chi2: f64, n: usize) -> Fit {
    Fit {
        mission: mission.clone(),
        parameters: Vec::new(),
        correlation: Vec::new(),
        chi2_before: chi2,
        chi2,
        n,
        values,
        advice: Vec::new(),
        starts: vec![chi2],
        chi2_from_mission: chi2,
        minima: Vec::new(),
        warnings: Vec::new(),
        independence: Independence::default(),
        jacobian: DMatrix::zeros(n, 0),
    }
}

impl Problem<'_> {
    /// The optima reached from all starts, that of the mission's own values first.
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
            optima.push(if options.moments { self.with_event_epochs(&at) } else { self.minimise(&at) });
        }
        if options.scan {
            let best = optima.iter().min_by(|a, b| a.chi2.total_cmp(&b.chi2)).expect("a start").clone();
            optima.extend(self.scanned(&best));
        }
        optima
    }

    /// Minima other than the first of some optima, which are sorted by chi2: of another chi2, or as low and far away.
    fn minima(&self, optima: &[Optimum], sigmas: &[Option<f64>]) -> Vec<Minimum> {
        let is_elsewhere = |one: &[f64], other: &[f64]| {
            let far = |index: usize| {
                let sigma = sigmas[index].filter(|sigma| *sigma > 0.0 && sigma.is_finite());
                let parameter = &self.parameters[index];
                let moved = (one[index] - other[index]).abs();
                !parameter.is_event_epoch && sigma.is_some_and(|sigma| moved > ELSEWHERE * sigma)
            };
            (0..one.len()).any(far)
        };
        let mut others: Vec<Minimum> = Vec::new();
        for optimum in optima.iter().skip(1).filter(|optimum| optimum.chi2.is_finite()) {
            let is_lowest = is_same(optimum.chi2, optima[0].chi2);
            let is_known = |chi2: f64, values: &[f64]| {
                is_same(optimum.chi2, chi2) && !(is_lowest && is_elsewhere(&optimum.at, values))
            };
            let known = others.iter().any(|known| is_known(known.chi2, &known.values));
            if !known && !is_known(optima[0].chi2, &optima[0].at) {
                others.push(Minimum { chi2: optimum.chi2, values: optimum.at.clone() });
            }
        }
        others
    }

    /// Parameters with their values and errors.
    fn fitted(&self, values: &[f64], sigmas: &[Option<f64>]) -> Vec<Fitted> {
        self.parameters
            .iter()
            .zip(values)
            .zip(sigmas)
            .map(|((parameter, value), sigma)| Fitted {
                key: parameter.key.clone(),
                unit: parameter.unit,
                before: parameter.start,
                value: *value,
                sigma: *sigma,
            })
            .collect()
    }
}
