//! Files in a command line: every path among its arguments is an input or an output.
//!
//! The types of the arguments give all inputs and outputs of any command. Before any computation, one function
//! ([`refuse_clashes`]) checks that no output replaces an input or another output.

use std::ffi::{OsStr, OsString};
use std::ops::Deref;
use std::path::{Path, PathBuf};

use clap::ArgMatches;
use clap::builder::{OsStringValueParser, TypedValueParser};

use crate::error::InputError;
use crate::io::atomic_file::{self, Written};
use crate::report::plot::Format;

/// An input file.
#[derive(Clone, Debug)]
pub struct InputFile(PathBuf);

/// An output file.
#[derive(Clone, Debug)]
pub struct OutputFile(PathBuf);

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

paths!(InputFile.0, OutputFile.0, OutputFolder.path);

impl From<OsString> for InputFile {
    fn from(path: OsString) -> InputFile {
        InputFile(path.into())
    }
}

impl From<PathBuf> for InputFile {
    fn from(path: PathBuf) -> InputFile {
        InputFile(path)
    }
}

impl From<OsString> for OutputFile {
    fn from(path: OsString) -> OutputFile {
        OutputFile(path.into())
    }
}

/// Rejects a command line with an output that would replace one of its inputs or another of its outputs.
///
/// # Errors
/// The first such output.
pub fn refuse_clashes(arguments: &ArgMatches) -> Result<(), InputError> {
    let mut matches = arguments;
    let (mut inputs, mut outputs) = (Vec::<&Path>::new(), Vec::new());
    loop {
        for id in matches.ids() {
            // An argument has one of these types or none: for the others there are no values.
            inputs.extend(values::<InputFile>(matches, id.as_str()).map(Deref::deref));
            outputs.extend(values::<OutputFile>(matches, id.as_str()).map(|file| Written::File(file)));
            let folders = values::<OutputFolder>(matches, id.as_str());
            outputs.extend(folders.map(|folder| Written::Into(folder, folder.writes)));
        }
        match matches.subcommand() {
            Some((_, below)) => matches = below,
            None => return atomic_file::refuse_clashes(&outputs, &inputs),
        }
    }
}

fn values<'a, T: Clone + Send + Sync + 'static>(matches: &'a ArgMatches, id: &str) -> impl Iterator<Item = &'a T> {
    matches.try_get_many::<T>(id).ok().flatten().into_iter().flatten()
}
