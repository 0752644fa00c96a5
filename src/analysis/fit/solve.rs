//! Optima of the problem, from all its starts, and the best of them with errors.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::advice;
use super::errors::Errors;
use super::problem::{Optimum, Problem, chi2};
use super::result::{Fit, Fitted, Minimum, is_same};
use crate::analysis::measurement::{DataSet, questions};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::predict;

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
    let errors = Errors::of(&jacobian);
    let mut sigmas = errors.sigmas.clone();
    problem.add_event_epochs(&best, &mut sigmas);
    let parameters = problem.fitted(&best.at, &sigmas);
    let advice = advice::on(&problem.parameters, &parameters, &errors.correlation, &errors.flat);
    Ok(Fit {
        values: predict(&problem.base.like(&fitted), &all)?,
        mission: fitted,
        parameters,
        correlation: errors.correlation,
        chi2_before,
        chi2: best.chi2,
        n: problem.values.len(),
        advice,
        minima: minima(&optima),
        starts: optima.iter().map(|optimum| optimum.chi2).collect(),
        chi2_from_mission,
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
        jacobian: DMatrix::zeros(n, 0),
    }
}

/// Minima other than the first of some optima, which are sorted by chi2.
fn minima(optima: &[Optimum]) -> Vec<Minimum> {
    let mut others: Vec<Minimum> = Vec::new();
    for pair in optima.windows(2).filter(|pair| pair[1].chi2.is_finite() && !is_same(pair[1].chi2, pair[0].chi2)) {
        others.push(Minimum { chi2: pair[1].chi2, values: pair[1].at.clone() });
    }
    others
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
