//! A mission's detector at one moment: frames in, frames out.

use ctiplan::error::InputError;
use ctiplan::image::{Corner, Geometry, Job, Split, Task, Transfers, frame};
use ctiplan::model::Model;
use ctiplan::physics::conditions::Conditions;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

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
        relative: f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let frame_e = frame_e.as_array().to_owned();
        let read = work::run(py, None, move |_| {
            let geometry = layout.of(frame_e.dim())?;
            let job = Job::new(Task::Readout, &self.model, &self.at, relative, geometry)?;
            frame::read(&job.device, &geometry, &frame_e)
        })?;
        Ok(read.into_pyarray(py))
    }
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
    /// The geometry that it says, which a frame of so many rows and columns can have.
    pub fn of(&self, shape: (usize, usize)) -> Result<Geometry, InputError> {
        let geometry = self.geometry()?;
        geometry.check(shape)?;
        Ok(geometry)
    }

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
