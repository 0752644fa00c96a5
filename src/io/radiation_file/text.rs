//! Texts of other programs: reading, and errors.

use std::path::Path;

use crate::error::{InputError, shortened};
use crate::io::{foreign, input};

/// Maximum size of such a file, bytes: the longest known, of all nuclei from hydrogen to uranium, has one or two million.
const MOST: u64 = 100 << 20;

/// The text of a file, and its intended use.
pub(super) struct Source {
    /// `cannot use spectrum `protons.txt``
    refused: String,
    /// The path as given.
    pub name: String,
    /// Without a byte order mark.
    pub text: String,
}

impl Source {
    /// Reads a file to be used as `what`, such as "spectrum".
    pub fn read(path: &Path, what: &str) -> Result<Source, InputError> {
        let name = path.display().to_string();
        let refused = format!("cannot use {what} `{name}`");
        let bytes = input::bytes(path, MOST).map_err(|problem| InputError::new(&refused, problem))?;
        if let Some((problem, help)) = foreign::kind(&bytes) {
            return Err(InputError::new(refused, problem).with_help(help));
        }
        let text = decoded(bytes).map_err(|problem| InputError::new(&refused, problem))?;
        if text.trim().is_empty() {
            return Err(InputError::new(refused, "the file is empty"));
        }
        Ok(Source { refused, name, text })
    }

    /// A text with a name.
    pub fn of(name: &str, text: &str, what: &str) -> Source {
        Source { refused: format!("cannot use {what} `{name}`"), name: name.into(), text: text.into() }
    }

    /// An error without a location.
    pub fn refuse(&self, problem: impl Into<String>) -> InputError {
        InputError::new(&self.refused, problem)
    }

    /// An error in a line, from 1: `line 17: 'Energy','MeV'`.
    pub fn refuse_line(&self, line: usize, problem: impl Into<String>) -> InputError {
        let written = self.text.lines().nth(line.saturating_sub(1)).unwrap_or("").trim();
        InputError { place: Some(format!("line {line}: {}", shortened(written))), ..self.refuse(problem) }
    }

    /// An error in a value in a line and a column: `line 17: IFlux = -1`.
    pub fn refuse_value(&self, line: usize, column: &str, value: &str, problem: impl Into<String>) -> InputError {
        let place = Some(format!("line {line}: {column} = {}", shortened(value)));
        InputError { place, ..self.refuse(problem) }
    }

    /// Any error, as one of this file.
    pub fn refused(&self, error: InputError) -> InputError {
        InputError { refused: self.refused.clone(), ..error }
    }
}

/// UTF-8, or Latin-1, in which Windows programs write `°` and `Störmer`: everything that matters is ASCII in both.
fn decoded(bytes: Vec<u8>) -> Result<String, String> {
    if bytes.iter().any(|&byte| byte < b' ' && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x0c | 0x1a)) {
        let wide = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
        return Err(if wide { "the file is text in UTF-16: save it as UTF-8" } else { "the file is not text" }.into());
    }
    let mut text = match String::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => error.as_bytes().iter().map(|&byte| char::from(byte)).collect(),
    };
    if text.starts_with('\u{feff}') {
        text.remove(0);
    }
    Ok(text)
}

/// A number, also in Fortran notation: `1.0D+02`, and `1.0-102`, without the E of an exponent of three digits.
pub(super) fn number(text: &str) -> Option<f64> {
    if let Ok(number) = text.parse::<f64>() {
        return Some(number);
    }
    let with_e = text.replace(['D', 'd'], "E");
    with_e.parse().ok().or_else(|| {
        let sign = text.rfind(['+', '-']).filter(|&sign| sign > 0)?;
        let is_mantissa = text[..sign].ends_with(|last: char| last.is_ascii_digit() || last == '.');
        if is_mantissa { format!("{}E{}", &text[..sign], &text[sign..]).parse().ok() } else { None }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_fortran_writes_them() {
        assert_eq!(number("1.5D+02"), Some(150.0));
        assert_eq!(number("1.5-102"), Some(1.5e-102));
        assert_eq!(number("-1.5E-01"), Some(-0.15));
        for word in ["", "E", "1,5", "+-", "a-1", "days"] {
            assert_eq!(number(word), None, "{word}");
        }
    }

    #[test]
    fn text_is_utf_8_or_latin_1_and_nothing_else() {
        assert_eq!(decoded(b"\xef\xbb\xbf98\xc2\xb0".to_vec()).unwrap(), "98°");
        assert_eq!(decoded(b"98\xb0 St\xf6rmer\r\n".to_vec()).unwrap(), "98° Störmer\r\n");
        assert_eq!(decoded(b"\x89PNG\x00\x01".to_vec()).unwrap_err(), "the file is not text");
        assert!(decoded(b"\xff\xfea\x00".to_vec()).unwrap_err().contains("UTF-16"));
    }
}
