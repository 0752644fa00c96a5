//! Errors in the input, reported once and clearly.

use std::fmt;
use std::io;

/// An error in the user's input: what could not be done, where, what is wrong, and what to try.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputError {
    /// What could not be done, such as ``cannot use mission `a.toml` ``.
    pub refused: String,
    /// Where, such as `line 17: detector.temperature_k = -120.0`.
    pub place: Option<String>,
    /// What is wrong there and what is allowed, with units.
    pub problem: String,
    /// What to try.
    pub help: Option<String>,
}

impl InputError {
    /// An error without a place in a file.
    pub fn new(refused: impl Into<String>, problem: impl Into<String>) -> InputError {
        InputError { refused: refused.into(), place: None, problem: problem.into(), help: None }
    }

    /// The same with advice.
    pub fn with_help(self, help: impl Into<String>) -> InputError {
        InputError { help: Some(help.into()), ..self }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.refused)?;
        if let Some(place) = &self.place {
            write!(out, "\n  {place}")?;
        }
        write!(out, "\n  {}", self.problem)?;
        if let Some(help) = &self.help {
            write!(out, "\n  help: {help}")?;
        }
        Ok(())
    }
}

impl std::error::Error for InputError {}

/// The message for a file that does not exist.
pub(crate) const NO_SUCH_FILE: &str = "there is no such file";

/// The reason why a text file cannot be read.
pub(crate) fn unreadable(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => NO_SUCH_FILE.to_string(),
        io::ErrorKind::IsADirectory => "this is a folder, not a file".to_string(),
        io::ErrorKind::InvalidData => "the file is not text in UTF-8".to_string(),
        _ => error.to_string(),
    }
}

/// The text, or its beginning if it is long.
pub(crate) fn shortened(text: &str) -> String {
    if text.chars().count() > 60 { text.chars().take(57).chain("...".chars()).collect() } else { text.to_string() }
}

/// The nearest of the known names, if it is near enough to be what was meant.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    known
        .into_iter()
        .map(|candidate| (strsim::normalized_damerau_levenshtein(name, candidate), candidate))
        .filter(|(likeness, _)| *likeness > 0.5)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}
