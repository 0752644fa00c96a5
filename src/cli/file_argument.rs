//! Files in a command line: every path among its arguments is an input or an output.
//!
//! The types of the arguments give all inputs and outputs of any command. Before any computation, one function
//! ([`check_outputs`]) checks that no output replaces an input or another output, nor, without `--overwrite`, any file.

use std::ffi::{OsStr, OsString};
use std::ops::Deref;
use std::path::{Path, PathBuf};

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{ArgMatches, Args};

use crate::error::InputError;
use crate::io::atomic_file::{self, Written};
use crate::report::plot::Format;

/// An input file.
#[derive(Clone, Debug)]
pub struct InputFile(PathBuf);

/// A mission file that is read.
#[derive(Clone, Debug)]
pub struct MissionFile(PathBuf);

/// An output file.
#[derive(Clone, Debug)]
pub struct OutputFile(PathBuf);

/// An output that is the mission read with other values: with `--overwrite` it may replace that mission.
#[derive(Clone, Debug)]
pub struct RevisedMission(PathBuf);

/// An output that, if it exists, is gone on with.
#[derive(Clone, Debug)]
pub struct ResumedFile(PathBuf);

/// A folder for output files.
#[derive(Clone, Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// Whether a file with this name may be written.
    writes: fn(&OsStr) -> bool,
}

impl OutputFolder {
    /// A folder for figures, `*.svg`, `*.pdf` or `*.png`.
    pub fn of_figures() -> impl TypedValueParser<Value = OutputFolder> {
        OutputFolder::of(|name| Format::ALL.iter().any(|format| has_ending(name, format.ending())))
    }

    /// A folder for tables of residuals, `1-NAME.ecsv`.
    pub fn of_tables() -> impl TypedValueParser<Value = OutputFolder> {
        OutputFolder::of(|name| has_ending(name, "ecsv") && name.as_encoded_bytes()[0].is_ascii_digit())
    }

    /// A folder for manual pages, `*.1`.
    pub fn of_manual_pages() -> impl TypedValueParser<Value = OutputFolder> {
        OutputFolder::of(|name| has_ending(name, "1"))
    }

    fn of(writes: fn(&OsStr) -> bool) -> impl TypedValueParser<Value = OutputFolder> {
        OsStringValueParser::new().map(move |path| OutputFolder { path: path.into(), writes })
    }
}

fn has_ending(name: &OsStr, ending: &str) -> bool {
    Path::new(name).extension().is_some_and(|known| known == ending)
}

macro_rules! paths {
    ($($type:ident . $path:tt),+) => {$(
        impl Deref for $type {
            type Target = Path;

            fn deref(&self) -> &Path {
                &self.$path
            }
        }

        impl AsRef<Path> for $type {
            fn as_ref(&self) -> &Path {
                &self.$path
            }
        }
    )+};
}

paths!(InputFile.0, MissionFile.0, OutputFile.0, RevisedMission.0, ResumedFile.0, OutputFolder.path);

macro_rules! from_argument {
    ($($type:ident),+) => {$(
        impl From<OsString> for $type {
            fn from(path: OsString) -> $type {
                $type(path.into())
            }
        }
    )+};
}

from_argument!(InputFile, MissionFile, OutputFile, RevisedMission, ResumedFile);

impl From<PathBuf> for InputFile {
    fn from(path: PathBuf) -> InputFile {
        InputFile(path)
    }
}

/// Whether existing outputs may be replaced.
#[derive(Clone, Copy, Debug, Args)]
pub struct Overwrite {
    /// Replace files to write if they exist
    #[arg(long, visible_alias = "force")]
    pub overwrite: bool,
}

/// The files of a command line.
#[derive(Default)]
struct Files<'a> {
    inputs: Vec<&'a Path>,
    missions: Vec<&'a Path>,
    outputs: Vec<Written<'a>>,
    revised: Vec<Written<'a>>,
    resumed: Vec<Written<'a>>,
    formats: Vec<Format>,
    overwrite: bool,
}

/// Rejects a command line with an output that would replace one of its inputs, another of its outputs, or, without `--overwrite`,
/// any file.
///
/// # Errors
/// The first such output.
pub fn check_outputs(arguments: &ArgMatches) -> Result<(), InputError> {
    let files = Files::of(arguments);
    files.refuse_clashes()?;
    if files.overwrite { Ok(()) } else { files.refuse_existing() }
}

impl<'a> Files<'a> {
    fn of(arguments: &'a ArgMatches) -> Files<'a> {
        let mut files = Files::default();
        let mut matches = arguments;
        loop {
            for id in matches.ids().map(|id| id.as_str()) {
                // An argument has one of these types or none: for the others there are no values.
                files.inputs.extend(values::<InputFile>(matches, id).map(Deref::deref));
                files.missions.extend(values::<MissionFile>(matches, id).map(Deref::deref));
                files.outputs.extend(values::<OutputFile>(matches, id).map(|file| Written::File(file)));
                files.revised.extend(values::<RevisedMission>(matches, id).map(|file| Written::File(file)));
                files.resumed.extend(values::<ResumedFile>(matches, id).map(|file| Written::File(file)));
                let folders = values::<OutputFolder>(matches, id);
                files.outputs.extend(folders.map(|folder| Written::Into(folder, folder.writes)));
                files.formats.extend(values::<Format>(matches, id));
            }
            files.overwrite |= matches.try_get_one("overwrite").ok().flatten().copied().unwrap_or(false);
            match matches.subcommand() {
                Some((_, below)) => matches = below,
                None => return files,
            }
        }
    }

    fn refuse_clashes(&self) -> Result<(), InputError> {
        let all = |parts: &[&[Written<'a>]]| parts.concat();
        let inputs = [&self.inputs[..], &self.missions].concat();
        let outputs = all(&[&self.outputs, &self.resumed]);
        atomic_file::refuse_clashes(&outputs, &inputs)?;
        let kept = if self.overwrite { &self.inputs } else { &inputs };
        atomic_file::refuse_clashes(&self.revised, kept)
            .map_err(|error| error.with_help("give another name, or --overwrite"))?;
        // Among each other.
        atomic_file::refuse_clashes(&all(&[&outputs, &self.revised]), &[])
    }

    fn refuse_existing(&self) -> Result<(), InputError> {
        let figures = |path: &Path, formats: &[Format]| {
            path.extension().is_some_and(|ending| formats.iter().any(|format| ending == format.ending()))
        };
        for output in self.outputs.iter().chain(&self.revised) {
            let replaced = |path: &PathBuf| match output {
                Written::File(_) => true,
                // Figures of other formats stay.
                Written::Into(..) => !figures(path, Format::ALL) || figures(path, &self.formats),
            };
            let remedy = |error: InputError| match output {
                Written::Into(..) if error.help.is_some() => {
                    error.with_help("give another folder, or --overwrite: it replaces files of the same names alone")
                }
                _ => error,
            };
            let mut there = output.there();
            there.retain(replaced);
            there.iter().try_for_each(|path| atomic_file::refuse_existing(path)).map_err(remedy)?;
        }
        Ok(())
    }
}

fn values<'a, T: Clone + Send + Sync + 'static>(matches: &'a ArgMatches, id: &str) -> impl Iterator<Item = &'a T> {
    matches.try_get_many::<T>(id).ok().flatten().into_iter().flatten()
}
