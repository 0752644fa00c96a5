//! Missions and their detectors' measurements, as objects.

use std::path::PathBuf;

use ctiplan::analysis::measurement;
use ctiplan::io::table::Table;
use ctiplan::mission;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::value::settings;
use crate::work;

/// A mission, which does not change.
#[pyclass(frozen, from_py_object, module = "ctiplan._ctiplan")]
#[derive(Clone)]
pub struct Mission(pub mission::Mission);

#[pymethods]
impl Mission {
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Mission> {
        work::run(py, None, |_| mission::Mission::read(path)).map(Mission)
    }

    #[staticmethod]
    fn parse(py: Python<'_>, text: &str) -> PyResult<Mission> {
        work::run(py, None, |_| mission::Mission::parse(text)).map(Mission)
    }

    fn set(&self, py: Python<'_>, values: &Bound<'_, PyDict>) -> PyResult<Mission> {
        let values = settings(values)?;
        work::run(py, None, |_| self.0.with(&values)).map(Mission)
    }

    /// The mission as JSON.
    fn json(&self) -> String {
        self.0.to_json().to_string()
    }

    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    fn __eq__(&self, other: &Mission) -> bool {
        self.0 == other.0
    }

    /// Missions travel between processes as text.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<(Py<PyAny>, (String,))> {
        Ok((slf.get_type().getattr("parse")?.unbind(), (slf.get().0.to_toml(),)))
    }
}

/// Measurements for a mission.
#[pyclass(frozen, from_py_object, module = "ctiplan._ctiplan")]
#[derive(Clone)]
pub struct DataSet(pub measurement::DataSet);

#[pymethods]
impl DataSet {
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, mission: &Mission) -> PyResult<DataSet> {
        work::run(py, None, |_| measurement::DataSet::read(path, &mission.0)).map(DataSet)
    }

    #[staticmethod]
    fn parse(py: Python<'_>, name: &str, text: &str, mission: &Mission) -> PyResult<DataSet> {
        let read = || measurement::DataSet::of(Table::parse(name, text)?, &mission.0);
        work::run(py, None, |_| read()).map(DataSet)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.0.file
    }

    #[getter]
    fn observable(&self) -> &'static str {
        self.0.observable.name()
    }

    #[getter]
    fn varying(&self) -> Vec<String> {
        self.0.varying.clone()
    }

    fn __len__(&self) -> usize {
        self.0.rows.len()
    }

    /// Values and errors of all rows.
    fn values(&self) -> (Vec<f64>, Vec<f64>) {
        self.0.rows.iter().map(|row| (row.value, row.sigma)).unzip()
    }

    fn to_ecsv(&self) -> String {
        self.0.table.to_ecsv()
    }
}
