//! What a Rust program says of bad input and of its own faults, as Python exceptions.

use std::sync::Mutex;

use ctiplan::error::InputError;
use pyo3::prelude::*;

/// Options of the command line whose keywords in Python have other names, besides the underscores.
const KEYWORDS: [(&str, &str); 5] = [
    ("at", "t_yr"),
    ("bias-dn", "bias"),
    ("gain-e-per-dn", "gain"),
    ("overscan-columns", "overscan"),
    ("prescan-px", "prescan"),
];

/// The exception for bad input, with its four parts.
pub fn bad_input(py: Python<'_>, error: &InputError) -> PyErr {
    let InputError { refused, place, problem, help } = error;
    let parts = (with_keywords(refused), place.clone(), with_keywords(problem), help.as_deref().map(with_keywords));
    raised(py, "InputError", parts)
}

/// A text that names keywords, `line_time_ms`, where it names options, `--line-time-ms`. Commands, quoted by `, are kept.
fn with_keywords(text: &str) -> String {
    let outside_quotes = |part: &str| {
        let mut pieces = part.split("--");
        let mut said = pieces.next().unwrap_or_default().to_string();
        for piece in pieces {
            let end = piece.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(piece.len());
            let (option, rest) = piece.split_at(end);
            let known = KEYWORDS.iter().find(|(name, _)| *name == option);
            said += &known.map_or_else(|| option.replace('-', "_"), |(_, keyword)| (*keyword).to_string());
            said += rest;
        }
        said
    };
    let parts = text.split('`').enumerate();
    let parts = parts.map(|(place, part)| if place % 2 == 0 { outside_quotes(part) } else { part.to_string() });
    parts.collect::<Vec<_>>().join("`")
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
