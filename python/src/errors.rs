//! What a Rust program says of bad input and of its own faults, as Python exceptions.

use std::sync::Mutex;

use ctiplan::error::InputError;
use pyo3::prelude::*;

/// The exception for bad input, with its four parts.
pub fn bad_input(py: Python<'_>, error: &InputError) -> PyErr {
    let InputError { refused, place, problem, help } = error;
    raised(py, "InputError", (refused.clone(), place.clone(), problem.clone(), help.clone()))
}

/// The exception for a fault of ctiplan itself.
pub fn internal(py: Python<'_>) -> PyErr {
    let said = LAST_FAULT.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
    raised(py, "InternalError", (said.unwrap_or_else(|| "no message".into()),))
}

fn raised<'py, A>(py: Python<'py>, name: &str, arguments: A) -> PyErr
where
    A: pyo3::call::PyCallArgs<'py>,
{
    let made =
        py.import("ctiplan._errors").and_then(|errors| errors.getattr(name)).and_then(|kind| kind.call1(arguments));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// What the last panic said, for [`internal`].
static LAST_FAULT: Mutex<Option<String>> = Mutex::new(None);

/// From now on, a panic says nothing on standard error: it becomes an exception that says it.
pub fn keep_panics_quiet() {
    std::panic::set_hook(Box::new(|fault| {
        *LAST_FAULT.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(fault.to_string());
    }));
}
