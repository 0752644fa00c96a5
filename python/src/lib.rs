//! The private module `ctiplan._ctiplan`: what the facade in `ctiplan/` stands on.
//!
//! ```text
//! ctiplan/*.py (names, types, tables) ─▶ [mission, questions, outcome, detector, arctic] ─▶ the crate `ctiplan`
//!                                             through [work]: threads, Ctrl-C, progress; [errors]: exceptions
//! ```

mod arctic;
mod detector;
mod errors;
mod measure;
mod mission;
mod outcome;
mod questions;
mod value;
mod work;

use std::ffi::OsString;
use std::panic::catch_unwind;

use pyo3::prelude::*;

/// The command line: gives the exit status.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
    py.detach(|| catch_unwind(|| ctiplan::cli::run(arguments))).map_err(|_| errors::internal(py))
}

#[pymodule]
fn _ctiplan(module: &Bound<'_, PyModule>) -> PyResult<()> {
    errors::keep_panics_quiet();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<mission::Mission>()?;
    module.add_class::<mission::DataSet>()?;
    module.add_class::<outcome::Outcome>()?;
    module.add_class::<detector::Detector>()?;
    module.add_function(wrap_pyfunction!(questions::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(questions::compare, module)?)?;
    module.add_function(wrap_pyfunction!(questions::validate, module)?)?;
    module.add_function(wrap_pyfunction!(questions::fit, module)?)?;
    module.add_function(wrap_pyfunction!(questions::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(measure::measure, module)?)?;
    module.add_function(wrap_pyfunction!(arctic::arctic_readout, module)?)?;
    module.add_function(wrap_pyfunction!(command, module)?)?;
    module.add_function(wrap_pyfunction!(work::set_threads, module)?)?;
    module.add_function(wrap_pyfunction!(work::threads, module)?)?;
    Ok(())
}
