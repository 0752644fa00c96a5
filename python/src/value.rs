//! Values of Python → values of a mission's keys.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyInt, PyString};
use toml::Value;

/// A value of a key: truth, number, text, date, list or table of these. Numbers of numpy and dates of astropy and pandas are taken as
/// what they say.
pub fn value(given: &Bound<'_, PyAny>) -> PyResult<Value> {
    if let Ok(truth) = given.cast::<PyBool>() {
        return Ok(truth.is_true().into());
    }
    if let Ok(text) = given.cast::<PyString>() {
        // A day as text is a day, as on the command line.
        let text: String = text.extract()?;
        return Ok(text.parse().map_or_else(|_| text.into(), Value::Datetime));
    }
    if let Ok(table) = given.cast::<PyDict>() {
        let pair = |(key, of): (Bound<'_, PyAny>, Bound<'_, PyAny>)| Ok((key.extract::<String>()?, value(&of)?));
        return Ok(Value::Table(table.iter().map(pair).collect::<PyResult<_>>()?));
    }
    if given.hasattr("isoformat")? {
        let day: String = given.call_method0("isoformat")?.extract()?;
        let day = day.split_once("T00:00:00").map_or(day.as_str(), |(day, _)| day);
        return day.parse().map(Value::Datetime).map_err(|_| unknown(given));
    }
    if given.is_instance_of::<PyInt>() || given.hasattr("__index__")? && !given.hasattr("__len__")? {
        return given.extract::<i64>().map(Value::Integer);
    }
    if !given.hasattr("__len__")? || given.len().is_err() {
        return given.extract::<f64>().map(Value::Float).map_err(|_| unknown(given));
    }
    let each = given.try_iter()?.map(|item| value(&item?));
    Ok(Value::Array(each.collect::<PyResult<_>>()?))
}

fn unknown(given: &Bound<'_, PyAny>) -> PyErr {
    let kind = given.get_type().name().map_or_else(|_| "object".to_string(), |name| name.to_string());
    PyTypeError::new_err(format!(
        "a key of a mission takes a number, a text, a truth value, a date, or a list or dict of these; found {kind}"
    ))
}

/// Keys with their values, in order.
pub fn settings(given: &Bound<'_, PyDict>) -> PyResult<Vec<(String, Value)>> {
    given.iter().map(|(key, of)| Ok((key.extract()?, value(&of)?))).collect()
}
