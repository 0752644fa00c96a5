//! Knowledge of a detector: its parameters, with their errors and correlations.

use std::path::Path;

use nalgebra::{Cholesky, DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

use crate::error::InputError;
use crate::io::input;
use crate::mission::Mission;

/// Knowledge of the detector: parameters by their keys in the mission, with errors (1 σ) and correlations.
#[derive(Clone, Debug)]
pub struct Knowledge {
    /// Key, and error in the key's unit.
    pub parameters: Vec<(String, f64)>,
    /// Correlation of the errors; none if they are independent.
    pub correlation: Option<Vec<Vec<f64>>>,
}

impl Knowledge {
    /// Independent relative errors of densities, release times and well fill power of the mission's detector.
    pub fn relative(
        mission: &Mission,
        density: &dyn Fn(&str) -> f64,
        release: &dyn Fn(&str) -> f64,
        well_fill: f64,
    ) -> Knowledge {
        let detector = &mission.detector;
        let mut parameters = Vec::new();
        for species in &detector.traps {
            let key = |field: &str| format!("detector.traps.{}.{field}", species.name);
            parameters.push((key("density_per_px"), density(&species.name) * species.density_per_px));
            parameters.push((key("release_ms"), release(&species.name) * species.release_ms));
        }
        parameters.push(("detector.well_fill_power".into(), well_fill * detector.well_fill_power));
        parameters.retain(|(_, sigma)| *sigma > 0.0);
        Knowledge { parameters, correlation: None }
    }

    /// From the JSON of `ctiplan fit`.
    ///
    /// # Errors
    /// If it cannot be read, or its parameters are not those of the mission.
    pub fn read(path: &Path, mission: &Mission) -> Result<Knowledge, InputError> {
        let refuse = |problem: String| {
            InputError::new(format!("cannot use the fit `{}`", path.display()), problem)
                .with_help("it must be what `ctiplan fit MISSION DATA... --json` prints")
        };
        let text = input::text(path).map_err(refuse)?;
        let fit: Value = serde_json::from_str(&text).map_err(|error| refuse(error.to_string()))?;
        let listed = fit["parameters"].as_array().ok_or_else(|| refuse("there are no `parameters`".into()))?;
        let mut parameters = Vec::new();
        for parameter in listed {
            let key = parameter["key"].as_str().ok_or_else(|| refuse("a parameter has no `key`".into()))?;
            if mission.number(key).is_none() {
                return Err(refuse(format!("`{key}` is not a number of the mission \"{}\"", mission.mission.name)));
            }
            let sigma = parameter["sigma"].as_f64();
            let sigma = sigma.ok_or_else(|| refuse(format!("`{key}` has no error: the data did not determine it")))?;
            parameters.push((key.to_string(), sigma));
        }
        let row = |row: &Value| row.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>();
        let correlation =
            fit["correlation"].as_array().and_then(|rows| rows.iter().map(row).collect::<Option<Vec<_>>>());
        let whole = |rows: &Vec<Vec<f64>>| {
            rows.len() == parameters.len() && rows.iter().all(|row| row.len() == parameters.len())
        };
        match correlation {
            Some(rows) if whole(&rows) => Ok(Knowledge { parameters, correlation: Some(rows) }),
            _ => Err(refuse("`correlation` is not a square of numbers, one row for each parameter".into())),
        }
    }

    /// Deviations (in σ) of one draw, with the correlations of the errors.
    pub fn draw(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let free: Vec<f64> = self.parameters.iter().map(|_| StandardNormal.sample(random)).collect();
        let Some(rows) = &self.correlation else { return free };
        // A tiny term on the diagonal: fully correlated parameters have no Cholesky factor otherwise.
        let matrix = DMatrix::from_fn(rows.len(), rows.len(), |row, column| {
            rows[row][column] + if row == column { 1e-9 } else { 0.0 }
        });
        match Cholesky::new(matrix) {
            Some(cholesky) => (cholesky.l() * DVector::from_vec(free)).iter().copied().collect(),
            None => free,
        }
    }
}
