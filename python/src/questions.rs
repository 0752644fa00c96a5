//! The five questions.

use std::path::PathBuf;
use std::sync::Mutex;

use ctiplan::analysis::fit::{posterior, profile};
use ctiplan::analysis::{diagnose as search, fit as fitting, measurement, validate as comparison};
use ctiplan::error::InputError;
use ctiplan::model::Model;
use ctiplan::physics::observable::Observable;
use ctiplan::plan::assessment::{self, assess};
use ctiplan::plan::date_distribution::Confidence;
use ctiplan::plan::mission_sample::MissionSample;
use ctiplan::plan::scenario::{self, Axis, Candidate};
use ctiplan::report::FitReport;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::mission::{DataSet, Mission};
use crate::outcome::Outcome;
use crate::value::settings;
use crate::work::{self, Watch};

/// Dose, traps and shapes over a mission, and when its budgets are exceeded.
#[pyfunction]
#[pyo3(signature = (mission, *, samples, seed, monte_carlo, confidence, posterior, progress))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn evaluate(
    py: Python<'_>,
    mission: &Mission,
    samples: u32,
    seed: Option<u64>,
    monte_carlo: Option<u32>,
    confidence: Option<f64>,
    posterior: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    work::run(py, progress, |watch| {
        let posterior = posterior.map(|path| MissionSample::read(&path, &mission.0)).transpose()?;
        let options = assessment::Options { seed, monte_carlo, samples, posterior, confidence, time_series: true };
        let telling =
            assessment::Progress { stage: &|name, steps| watch.stage(name, steps), advance: &|| watch.advance() };
        Ok(Outcome::of(assess(&mission.0, &options, &telling)?, vec![mission.0.clone()]))
    })
}

/// Missions side by side at every combination of values.
#[pyfunction]
#[pyo3(signature = (missions, values, *, confidence, samples, progress))]
pub fn compare(
    py: Python<'_>,
    missions: Vec<(String, Mission)>,
    values: &Bound<'_, PyDict>,
    confidence: Option<f64>,
    samples: u32,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    let axis = |(key, values): (String, toml::Value)| Axis {
        key,
        values: if let toml::Value::Array(values) = values { values } else { vec![values] },
    };
    let axes: Vec<Axis> = settings(values)?.into_iter().map(axis).collect();
    let candidate = |(file, mission): (String, Mission)| Candidate { file, mission: mission.0 };
    let candidates: Vec<Candidate> = missions.into_iter().map(candidate).collect();
    let confidence = confidence.map(|probability| Confidence { probability, samples });
    work::run(py, progress, |watch| {
        let count = candidates.len() * axes.iter().map(|axis| axis.values.len()).product::<usize>();
        if candidates.len() < 2 && axes.is_empty() || count == 0 {
            return Err(InputError::new("cannot compare", "there is one mission and nothing that differs")
                .with_help("give values of keys, such as {\"readout.line_time_ms\": [5, 25]}, or several missions"));
        }
        watch.stage("scenarios", count as u64);
        let comparison = scenario::compare(&candidates, &axes, confidence, || watch.advance())?;
        Ok(Outcome::of(comparison, candidates.into_iter().map(|candidate| candidate.mission).collect()))
    })
}

/// A mission's model against measurements.
#[pyfunction]
#[pyo3(signature = (mission, data, *, seed))]
pub fn validate(py: Python<'_>, mission: &Mission, data: Vec<DataSet>, seed: Option<u64>) -> PyResult<Outcome> {
    work::run(py, None, |_| {
        let data = rows(data, &mission.0)?;
        let validation = comparison::validate(&mission.0, &data, seed.unwrap_or(mission.0.accuracy.seed))?;
        Ok(Outcome::of(validation, vec![mission.0.clone()]))
    })
}

/// Values of free keys, with errors.
#[pyfunction]
#[pyo3(signature = (mission, data, *, free, starts, seed, profiles, samples, holdout, progress))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn fit(
    py: Python<'_>,
    mission: &Mission,
    data: Vec<DataSet>,
    free: Option<Vec<String>>,
    starts: usize,
    seed: Option<u64>,
    profiles: Vec<String>,
    samples: Option<usize>,
    holdout: Option<String>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    let mission = &mission.0;
    let keys = free.unwrap_or_else(|| mission.fit.free.clone());
    work::run(py, progress, |watch| {
        if keys.is_empty() {
            return Err(InputError::new("cannot fit", "no key is free")
                .with_help("name some: free=[\"detector.traps.VV.density_per_px\"], or in [fit] free of the mission"));
        }
        let data = rows(data, mission)?;
        let best = Mutex::new(f64::INFINITY);
        let report_best = |chi2: f64| tell(watch, &best, chi2);
        let seed = seed.unwrap_or(mission.accuracy.seed);
        let options = fitting::Options { starts, seed, ..fitting::Options::default() };
        let fitted = fitting::fit(mission, &data, &keys, &options, &report_best)?;
        let data = measurement::with_errors_at(data.clone(), &fitted.mission)?;
        let model = Model::new(&fitted.mission);
        let held_out =
            |column: String| fitting::holdout::holdout(&model, &data, &keys, &column, &options, &|_| watch.advance());
        let holdout = holdout.map(held_out).transpose()?;
        let curve = |key: &String| profile::profile(&model, &data, &fitted, key, &|_| watch.advance());
        let profiles = profiles.iter().map(curve).collect::<Result<_, _>>()?;
        let drawn = |samples| {
            let options = posterior::Options { samples, seed, evaluations: None };
            posterior::posterior(&model, &data, &fitted, &options, &|_| watch.advance())
        };
        let posterior = samples.map(drawn).transpose()?;
        let found = fitted.mission.clone();
        let has_common_errors = data.iter().any(measurement::DataSet::has_common_errors);
        let report = FitReport { fit: fitted, holdout, profiles, posterior, has_common_errors };
        Ok(Outcome::of(report, vec![found.clone()]).with(found))
    })
}

/// Tells an evaluation, and the best chi2 so far.
fn tell(watch: &Watch, best: &Mutex<f64>, chi2: f64) {
    let mut best = best.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    if chi2 < *best {
        *best = chi2;
        watch.rename(&format!("chi2 {chi2:.2}"));
    }
    watch.advance();
}

/// The effect that a mission's model lacks.
#[pyfunction]
#[pyo3(signature = (mission, data, *, free, level, seed, candidates, can, evaluations, stability, progress))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn diagnose(
    py: Python<'_>,
    mission: &Mission,
    data: Vec<DataSet>,
    free: Option<Vec<String>>,
    level: f64,
    seed: Option<u64>,
    candidates: Option<&Bound<'_, PyDict>>,
    can: Vec<String>,
    evaluations: Option<u64>,
    stability: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    let mission = &mission.0;
    let candidates = candidates.map(settings).transpose()?.map(|tables| tables.into_iter().collect::<toml::Table>());
    work::run(py, progress, |watch| {
        if !(level > 0.0 && level <= 0.5) {
            let problem = "a fraction above 0 and up to 0.5 is needed, such as 0.01";
            return Err(InputError::new(format!("cannot diagnose at level {level}"), problem));
        }
        let data = rows(data, mission)?;
        let options = search::Options {
            level,
            seed: seed.unwrap_or(mission.accuracy.seed),
            free: free.unwrap_or_else(|| mission.fit.free.clone()),
            candidates,
            can: can.iter().map(|name| observable(name)).collect::<Result<_, _>>()?,
            evaluations: evaluations.unwrap_or(search::EVALUATIONS),
            stability,
        };
        let telling = search::Progress { stage: &|name, steps| watch.stage(name, steps), advance: &|| watch.advance() };
        let found = search::diagnose(mission, &data, &options, &telling)?;
        let improved = found.improved.clone();
        Ok(Outcome::of(found, vec![mission.clone()]).with(improved))
    })
}

fn observable(name: &str) -> Result<Observable, InputError> {
    let names: Vec<&str> = Observable::ALL.iter().map(|observable| observable.name()).collect();
    Observable::named(name).ok_or_else(|| {
        InputError::new(format!("no observable is called \"{name}\""), format!("there are: {}", names.join(", ")))
    })
}

/// The measurements as this mission reads them: they may have been read with another one.
fn rows(data: Vec<DataSet>, mission: &ctiplan::mission::Mission) -> Result<Vec<measurement::DataSet>, InputError> {
    data.into_iter().map(|set| measurement::DataSet::of(set.0.table, mission)).collect()
}
