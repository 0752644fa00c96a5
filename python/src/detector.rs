//! A mission's detector at one moment: frames in, frames out.

use ctiplan::error::InputError;
use ctiplan::image::{Corner, Geometry, Job, Split, Stop, Task, Transfers, TrapMap};
use ctiplan::model::Model;
use ctiplan::physics::conditions::Conditions;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;
use crate::mission::Mission;
use crate::work;

/// A mission's detector under the conditions of an exposure.
#[pyclass(frozen, module = "ctiplan._ctiplan")]
pub struct Detector {
    model: Model,
    at: Conditions,
    dose_mev_g: f64,
    traps: Vec<(String, f64, f64)>,
}

/// How a frame lies on the detector, as Python says it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Layout {
    axis: String,
    corner: String,
    split: Option<String>,
    prescan: usize,
    overscan: usize,
    overscan_rows: usize,
    transfers_before: u32,
    charge_before_e: f64,
    serial_transfers_before: u32,
}

#[pymethods]
impl Detector {
    #[new]
    #[pyo3(signature = (mission, *, t_yr, dose_mev_g))]
    fn new(py: Python<'_>, mission: &Mission, t_yr: Option<f64>, dose_mev_g: Option<f64>) -> PyResult<Detector> {
        work::run(py, None, |_| {
            let t_yr = at(t_yr, dose_mev_g)?;
            let model = Model::new(&mission.0);
            let at = Conditions { dose_mev_g, ..Conditions::of(&mission.0, t_yr) };
            let device = model.device(&at)?;
            let species =
                |trap: &ctiplan::physics::SpeciesState| (trap.name.clone(), trap.density_per_px, trap.release_ms);
            let (dose_mev_g, traps) = (device.dose_mev_g()?, device.traps.iter().map(species).collect());
            Ok(Detector { model, at, dose_mev_g, traps })
        })
    }

    #[getter]
    fn t_yr(&self) -> f64 {
        self.at.t_yr
    }

    #[getter]
    fn dose_mev_g(&self) -> f64 {
        self.dose_mev_g
    }

    /// Name, traps per pixel and release time (ms) of each species.
    #[getter]
    fn traps(&self) -> Vec<(String, f64, f64)> {
        self.traps.clone()
    }

    fn readout<'py>(
        &self,
        py: Python<'py>,
        frame_e: PyReadonlyArray2<'py, f64>,
        layout: Layout,
        trap_map: Option<PyReadonlyArray2<'py, f64>>,
        relative: f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (frame_e, trap_map) = (frame_e.as_array().to_owned(), owned(trap_map));
        let read = work::run(py, None, |_| {
            let job = Job::new(Task::Readout, &self.model, &self.at, accuracy(relative)?, layout.geometry()?)?;
            Job { trap_map: map(trap_map)?, ..job }.array(&frame_e)
        })?;
        Ok(read.0.into_pyarray(py))
    }

    fn correct<'py>(
        &self,
        py: Python<'py>,
        frame_e: PyReadonlyArray2<'py, f64>,
        layout: Layout,
        trap_map: Option<PyReadonlyArray2<'py, f64>>,
        options: Correction,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (frame_e, trap_map) = (frame_e.as_array().to_owned(), owned(trap_map));
        let (image, done) = work::run(py, None, |_| {
            let Correction { relative, read_noise_e, .. } = options;
            let task = Task::Correct { stop: options.stop()?, noise: None };
            let job = Job::new(task, &self.model, &self.at, accuracy(relative)?, layout.geometry()?)?;
            let separate_noise = read_noise_e.is_some();
            Job { read_noise_e, separate_noise, trap_map: map(trap_map)?, ..job }.array(&frame_e)
        })?;
        let uncertain = done.uncertain.ok_or_else(|| errors::internal(py))?;
        let found = PyDict::new(py);
        found.set_item("image", image.into_pyarray(py))?;
        found.set_item("uncertain", uncertain.pixels.into_pyarray(py))?;
        found.set_item("error_e", uncertain.error_e)?;
        found.set_item("converged", done.converged)?;
        let residuals: Vec<(f64, f64)> = done.residuals.iter().map(|left| (left.rms_e, left.max_e)).collect();
        found.set_item("residuals", residuals)?;
        found.set_item("saturated_px", done.saturated_px)?;
        found.set_item("missing_px", done.missing_px)?;
        Ok(found)
    }
}

/// How a frame is corrected.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Correction {
    tolerance: f64,
    tolerance_e: Option<f64>,
    iterations: usize,
    relative: f64,
    read_noise_e: Option<f64>,
}

impl Correction {
    fn stop(&self) -> Result<Stop, InputError> {
        let refused = |what: &str, value: f64, allowed: &str| {
            Err(InputError::new(format!("cannot use {what} = {value}"), format!("allowed: {allowed}")))
        };
        if !(1..=1000).contains(&self.iterations) {
            return refused("iterations", self.iterations as f64, "1 to 1000");
        }
        if let Some(noise_e) = self.read_noise_e.filter(|noise_e| !(*noise_e > 0.0 && noise_e.is_finite())) {
            return refused("read_noise_e", noise_e, "a noise above 0 e-");
        }
        match self.tolerance_e {
            Some(error_e) if error_e > 0.0 && error_e.is_finite() => Ok(Stop::at_error(error_e, self.iterations)),
            Some(error_e) => refused("tolerance_e", error_e, "an error above 0 e-"),
            None if (1e-12..1.0).contains(&self.tolerance) => Ok(Stop::at_residual(self.tolerance, self.iterations)),
            None => refused("tolerance", self.tolerance, "a fraction from 1e-12 to below 1"),
        }
    }
}

/// The numbers of a map of traps, if there is one.
fn owned(trap_map: Option<PyReadonlyArray2<'_, f64>>) -> Option<Array2<f64>> {
    trap_map.map(|map| map.as_array().to_owned())
}

/// A map of traps for the frame.
fn map(factors: Option<Array2<f64>>) -> Result<Option<TrapMap>, InputError> {
    factors.map(|factors| TrapMap::of_all("trap_map", factors)).transpose()
}

/// The accuracy of a readout, which is a fraction.
fn accuracy(relative: f64) -> Result<f64, InputError> {
    if (1e-12..1.0).contains(&relative) {
        return Ok(relative);
    }
    Err(InputError::new(format!("cannot use relative = {relative}"), "allowed: a fraction from 1e-12 to below 1"))
}

/// Time of an exposure; of a dose given in a laboratory it may be left out.
fn at(t_yr: Option<f64>, dose_mev_g: Option<f64>) -> Result<f64, InputError> {
    let refused = |problem: &str| InputError::new("cannot make a detector", problem);
    if dose_mev_g.is_some_and(|dose_mev_g| !(dose_mev_g >= 0.0 && dose_mev_g.is_finite())) {
        return Err(refused("dose_mev_g is a dose of 0 MeV/g or more"));
    }
    match t_yr {
        None if dose_mev_g.is_none() => Err(refused("neither t_yr nor dose_mev_g is given")
            .with_help("give t_yr, the time of the exposure in years since launch")),
        Some(t_yr) if !(0.0..=1000.0).contains(&t_yr) => {
            Err(refused(&format!("t_yr = {t_yr}: a time of 0 to 1000 yr since launch is needed")))
        }
        t_yr => Ok(t_yr.unwrap_or_default()),
    }
}

impl Layout {
    /// The geometry that it says.
    pub fn geometry(&self) -> Result<Geometry, InputError> {
        let said = |word: &str, value: &str, allowed: &str| {
            InputError::new(format!("cannot use {word} = \"{value}\""), format!("allowed: {allowed}"))
        };
        let transfers = match self.axis.as_str() {
            "parallel" => Transfers::Parallel,
            "serial" => Transfers::Serial,
            "both" => Transfers::Both,
            other => return Err(said("axis", other, "parallel, serial, both")),
        };
        let corner = match self.corner.as_str() {
            "ll" | "lower-left" => Corner::LowerLeft,
            "lr" | "lower-right" => Corner::LowerRight,
            "ul" | "upper-left" => Corner::UpperLeft,
            "ur" | "upper-right" => Corner::UpperRight,
            other => {
                return Err(said("corner", other, "ll, lr, ul, ur (lower left, lower right, upper left, upper right)"));
            }
        };
        let split = match self.split.as_deref() {
            None => None,
            Some("columns") => Some(Split::Columns),
            Some("rows") => Some(Split::Rows),
            Some("both") => Some(Split::Both),
            Some(other) => return Err(said("split", other, "columns, rows, both, or None")),
        };
        if !(self.charge_before_e >= 0.0 && self.charge_before_e.is_finite()) {
            let value = self.charge_before_e.to_string();
            return Err(said("charge_before_e", &value, "0 e- per pixel or more"));
        }
        Ok(Geometry {
            transfers,
            corner,
            split,
            prescan_columns: self.prescan,
            overscan_columns: self.overscan,
            overscan_rows: self.overscan_rows,
            rows_before: self.transfers_before,
            charge_before_e: self.charge_before_e,
            columns_before: self.serial_transfers_before,
        })
    }
}
