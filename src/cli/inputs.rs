//! Inputs shared by several commands.

use std::convert::Infallible;
use std::fmt;
use std::path::Path;

use clap::Args;

use super::swapped;
use crate::analysis::measurement::DataSet;
use crate::cli::file_argument::{InputFile, MissionFile};
use crate::error::InputError;
use crate::io::atomic_file;
use crate::mission::Mission;
use crate::mission_file;
use crate::plan::scenario::Axis;
use crate::sweep::quoted;

/// A mission, with single values set.
#[derive(Debug, Args)]
pub(super) struct OneMission {
    /// Mission file (TOML)
    #[arg(value_name = "MISSION")]
    path: MissionFile,
    /// Value of a key, instead of the file's, such as detector.temperature_k=150; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl OneMission {
    /// The mission with its settings.
    pub fn read(&self) -> Result<Mission, InputError> {
        mission_with(&self.path, &self.set)
    }

    /// The keys that were set.
    pub fn keys_set(&self) -> Vec<&str> {
        self.set.iter().filter_map(|setting| Some(key_and_value(setting).ok()?.0)).collect()
    }

    /// The mission options, quoted for a shell.
    pub fn words(&self) -> String {
        let set = self.set.iter().map(|setting| format!(" --set {}", quoted(Path::new(setting))));
        format!("{}{}", quoted(&self.path), set.collect::<String>())
    }

    /// The mission file's text with the settings; comments and order are kept.
    pub fn text(&self) -> Result<String, InputError> {
        let mission = Mission::read(&self.path)?;
        Ok(mission_file::edit(&mission_file::read_text(&self.path)?, &mission, &settings(&self.set)?))
    }
}

/// The mission of a file, with single values changed.
pub(super) fn mission_with(path: &Path, set: &[String]) -> Result<Mission, InputError> {
    let mission = Mission::read(path).map_err(|error| swapped::hint(error, path))?;
    if set.is_empty() { Ok(mission) } else { mission.with(&settings(set)?) }
}

/// A file to be written after the computation, with the mission's initial text.
pub(super) struct NewMission<'a> {
    path: &'a Path,
    text: String,
}

impl<'a> NewMission<'a> {
    /// Checks that the path is writable.
    pub fn from(measured: &Measured, path: &'a Path) -> Result<NewMission<'a>, InputError> {
        atomic_file::refuse_unwritable(path)?;
        Ok(NewMission { path, text: measured.mission.text()? })
    }

    /// Writes the edited text.
    pub fn write(&self, edited: impl FnOnce(&str) -> String) -> Result<(), InputError> {
        atomic_file::write(self.path, edited(&self.text))
    }
}

/// A mission and what was measured.
#[derive(Debug, Args)]
pub(super) struct Measured {
    #[command(flatten)]
    pub mission: OneMission,
    /// Measurement files (ECSV or CSV)
    #[arg(required = true)]
    data: Vec<InputFile>,
}

impl Measured {
    /// The mission and its measurements.
    pub fn read(&self) -> Result<(Mission, Vec<DataSet>), InputError> {
        let mission = self.mission.read()?;
        let places: Vec<_> = self.data.iter().map(|path| path.canonicalize().ok()).collect();
        for (index, path) in self.data.iter().enumerate() {
            if places[index].is_some() && places[..index].contains(&places[index]) {
                let problem = format!("duplicate file `{}`: its rows would count twice", path.display());
                return Err(InputError::new("cannot use the measurements", problem).with_help("give each file once"));
            }
        }
        let read = |path: &InputFile| DataSet::read(path, &mission).map_err(|error| swapped::hint_of_data(error, path));
        let data = self.data.iter().map(read).collect::<Result<_, _>>()?;
        Ok((mission, data))
    }

    /// A command with this mission and its measurements.
    pub fn command(&self, verb: &str) -> String {
        self.command_with(verb, &self.mission.words())
    }

    /// A command with another mission file and the same measurements.
    pub fn command_with(&self, verb: &str, mission: &str) -> String {
        let data = self.data.iter().map(|path| format!(" {}", quoted(path)));
        format!("ctiplan {verb} {mission}{}", data.collect::<String>())
    }
}

#[derive(Debug, Args)]
pub(super) struct Adjust {
    /// Keys to fit, such as detector.traps.VV.release_ms, in addition to [fit] free; may be given several times
    #[arg(long, value_name = "KEYS", value_delimiter = ',', value_parser = trimmed)]
    free: Vec<String>,
    /// Fit only the keys given with --free, and not those of [fit] free
    #[arg(long, requires = "free")]
    only: bool,
}

/// A key of a list, which may have blanks behind its commas.
pub(super) fn trimmed(key: &str) -> Result<String, Infallible> {
    Ok(key.trim().to_string())
}

impl Adjust {
    /// Keys to be fitted: those of the mission's `[fit] free`, unless others are requested.
    pub fn keys(&self, mission: &Mission) -> Vec<String> {
        let mut keys = if self.only { Vec::new() } else { mission.fit.free.clone() };
        keys.extend(self.free.iter().filter(|key| self.only || !mission.fit.free.contains(key)).cloned());
        keys
    }
}

impl fmt::Display for Adjust {
    /// As options of a command, each preceded by a blank.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.free.iter().try_for_each(|key| write!(out, " --free {}", quoted(Path::new(key))))?;
        out.write_str(if self.only { " --only" } else { "" })
    }
}

/// Keys with one value each.
fn settings(settings: &[String]) -> Result<Vec<(String, toml::Value)>, InputError> {
    let mut values = Vec::new();
    for setting in settings {
        let (key, value) = key_and_value(setting)?;
        let axis = Axis::parse(key, value)?;
        let [single] = &axis.values[..] else {
            let listed = axis.values.iter().all(toml::Value::is_array);
            let help = match listed {
                true => format!("a list stands in brackets: --set {key}=[{value}]"),
                false => "`ctiplan compare` takes lists and ranges".into(),
            };
            return Err(InputError::new(format!("cannot set {setting}"), "one value is needed here").with_help(help));
        };
        values.push((axis.key, single.clone()));
    }
    Ok(values)
}

pub(super) fn key_and_value(setting: &str) -> Result<(&str, &str), InputError> {
    setting.split_once('=').map(|(key, value)| (key.trim(), value.trim())).ok_or_else(|| {
        InputError::new(format!("cannot set `{setting}`"), "a setting is a key, =, and a value")
            .with_help("such as --set detector.temperature_k=150")
    })
}
