//! Files in the place of others: a table in place of a mission, a mission in place of a table or of a command.

use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::error::InputError;
use crate::sweep::quoted;

/// Bytes at the beginning of a file that show what it is.
const BEGINNING: u64 = 4096;

/// What a file is, as far as its name and its beginning tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    Mission,
    Measurements,
    Other,
}

impl Content {
    fn of(path: &Path) -> Content {
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        let beginning = beginning(path);
        let table = ["ecsv", "csv", "parquet"].into_iter().any(|known| ending.as_ref().is_some_and(|e| e == known));
        let says = |text: &str| beginning.lines().any(|line| line.trim_start().starts_with(text));
        if table || says("# %ECSV") || says("# observable:") {
            Content::Measurements
        } else if ending.is_some_and(|ending| ending == "toml") || says("[mission]") {
            Content::Mission
        } else {
            Content::Other
        }
    }
}

/// Empty if it cannot be read.
fn beginning(path: &Path) -> String {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(BEGINNING).read_to_end(&mut bytes));
    read.map_or(String::new(), |_| String::from_utf8_lossy(&bytes).into_owned())
}

/// The error of a mission that could not be read; says so if the file is a table.
pub(super) fn hint(error: InputError, path: &Path) -> InputError {
    match path.is_file() && Content::of(path) == Content::Measurements {
        true => InputError::new(error.refused, "this is a table of measurements, not a mission file").with_help(
            format!("the mission comes first, then the data: ctiplan validate MISSION.toml {}", quoted(path)),
        ),
        false => error,
    }
}

/// The error of measurements that could not be read; says so if the file is a mission.
pub(super) fn hint_of_data(error: InputError, path: &Path) -> InputError {
    match path.is_file() && Content::of(path) == Content::Mission {
        true => InputError::new(error.refused, "this is a mission file, not a table of measurements")
            .with_help(format!("one mission comes first, then the data: ctiplan validate {} DATA.ecsv", quoted(path))),
        false => error,
    }
}

/// The error of a command line whose command is a file; None for others.
pub(super) fn in_place_of_a_command(error: &clap::Error, arguments: &[OsString]) -> Option<InputError> {
    if error.kind() != ErrorKind::InvalidSubcommand {
        return None;
    }
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return None };
    let place = arguments.iter().position(|argument| argument == word.as_str())?;
    let path = Path::new(word);
    let above = arguments[1..place].iter().filter_map(|argument| argument.to_str()).find(|word| !word.starts_with('-'));
    let file = quoted(path);
    let (what, help) = match (Content::of(path), above) {
        (Content::Mission, None) => ("a mission file", format!("ctiplan evaluate {file}")),
        (Content::Mission, Some(above)) => {
            ("a mission file", format!("ctiplan {above} KIND {file}; for the kinds: ctiplan {above} --help"))
        }
        (Content::Measurements, _) => ("a table of measurements", format!("ctiplan validate MISSION.toml {file}")),
        (Content::Other, _) if path.is_file() => {
            ("a file", "ctiplan --help lists the commands, which come first".to_string())
        }
        (Content::Other, _) => return None,
    };
    let refused = format!("`{word}` is not a command");
    Some(InputError::new(refused, format!("it is {what}, and a command comes first")).with_help(help))
}
