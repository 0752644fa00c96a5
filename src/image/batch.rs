//! Many files, one after another: a failure affects only its own file, and existing outputs can be kept.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

use super::{Done, FrameDone, Job};
use crate::error::InputError;
use crate::io::atomic_file;

/// Treatment of existing outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Nothing is done until they are removed.
    Refused,
    /// They are replaced.
    Replaced,
    /// They are kept: they are complete, since files are written as a whole or not at all. Remains of interrupted ones are removed.
    Kept,
}

/// Results for several files.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Batch {
    /// Each, in the order given.
    pub files: Vec<FileDone>,
}

/// The result for one of several files.
#[derive(Clone, Debug)]
pub struct FileDone {
    /// The file that was read.
    pub input: PathBuf,
    /// The file that was written.
    pub output: PathBuf,
    /// The outcome.
    pub outcome: Outcome,
}

/// The outcome for a file.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// It already existed.
    Kept,
    /// It was written.
    Done(Summary),
    /// It failed.
    Failed(InputError),
}

/// Summary of the results for a file, without the masks of its frames.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Frames that were processed.
    pub frames: usize,
    /// Largest change of a pixel, e-.
    pub largest_change_e: f64,
    /// For a correction: the largest remaining residual, e-.
    pub max_after_e: Option<f64>,
    /// For a correction: number of uncertain pixels.
    pub uncertain_px: Option<usize>,
    /// Number of warnings.
    pub warnings: usize,
    /// The report of the file, as JSON.
    pub document: Value,
}

impl Batch {
    /// Processes files and writes each under its own name into a folder. `progress` is given the number of files done and the
    /// current step.
    ///
    /// # Errors
    /// Before any processing: if two files have the same name, a file is in the folder itself, the folder cannot be created, or an
    /// output exists and must not. Failures of single files are in the result.
    pub fn run(
        job: &Job,
        inputs: &[&Path],
        folder: &Path,
        existing: Existing,
        progress: &dyn Fn(usize, &str),
    ) -> Result<Batch, InputError> {
        let outputs = outputs(inputs, folder)?;
        if existing == Existing::Refused {
            outputs.iter().try_for_each(|output| {
                atomic_file::refuse_existing(output).map_err(|error| {
                    error.with_help("give another folder, --overwrite, or --resume to keep what is there")
                })
            })?;
        }
        let mut files = Vec::new();
        for (done, (input, output)) in inputs.iter().zip(outputs).enumerate() {
            let outcome = if existing == Existing::Kept && output.exists() {
                job.refuse_others(&output).map_or_else(Outcome::Failed, |()| Outcome::Kept)
            } else {
                if existing == Existing::Kept {
                    atomic_file::remove_parts(&output)?;
                }
                let status = |_, _, what: &str| progress(done, &format!("{}, {what}", input.display()));
                match job.run(input, &output, existing == Existing::Replaced, &status) {
                    Ok(done) => Outcome::Done(Summary::of(&done)),
                    Err(error) => Outcome::Failed(error),
                }
            };
            files.push(FileDone { input: input.to_path_buf(), output, outcome });
        }
        Ok(Batch { files })
    }

    /// One error that names all failed files. None if there are none.
    pub fn failure(&self) -> Option<InputError> {
        let failed = self.files.iter().filter_map(|file| match &file.outcome {
            Outcome::Failed(error) => Some(error),
            _ => None,
        });
        let failed: Vec<String> = failed.map(|error| error.to_string().replace('\n', "\n  ")).collect();
        let refused = format!("{} of {} files failed; the others are complete", failed.len(), self.files.len());
        (!failed.is_empty()).then(|| InputError::new(refused, failed.join("\n  ")))
    }
}

/// The output files.
fn outputs(inputs: &[&Path], folder: &Path) -> Result<Vec<PathBuf>, InputError> {
    let refusal = |path: &Path, problem: String, help: &str| {
        Err(InputError::new(format!("cannot write `{}`", path.display()), problem).with_help(help))
    };
    let mut names: HashMap<&OsStr, &Path> = HashMap::new();
    let there = folder.canonicalize().ok();
    let mut outputs = Vec::new();
    for input in inputs {
        let Some(name) = input.file_name() else {
            return Err(InputError::new(format!("cannot read `{}`", input.display()), "this is not a file"));
        };
        let output = folder.join(name);
        let of = |path: &Path| {
            path.parent()
                .map(|folder| if folder == Path::new("") { Path::new(".") } else { folder }.canonicalize().ok())
        };
        if there.is_some() && of(input) == Some(there.clone()) {
            return refusal(&output, "it is one of the files that are read".into(), "give another folder");
        }
        if let Some(other) = names.insert(name, input) {
            let problem = format!("two files have this name, `{}` and `{}`", other.display(), input.display());
            return refusal(&output, problem, "give each its own folder");
        }
        outputs.push(output);
    }
    if there.is_some_and(|folder| !folder.is_dir()) {
        return refusal(folder, "this is a file, not a folder".into(), "give the name of a folder");
    }
    atomic_file::folder(folder)?;
    Ok(outputs)
}

impl Summary {
    fn of(done: &Done) -> Summary {
        let frames: Vec<&FrameDone> = done.hdus.iter().filter_map(|hdu| hdu.frame.as_ref()).collect();
        let uncertain = || frames.iter().filter_map(|frame| frame.uncertain.as_ref());
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let corrected = uncertain().next().is_some();
        Summary {
            frames: frames.len(),
            largest_change_e: largest(&mut frames.iter().map(|frame| frame.largest_change_e)),
            max_after_e: corrected.then(|| largest(&mut uncertain().map(|uncertain| uncertain.left.max_e))),
            uncertain_px: corrected.then(|| uncertain().map(super::Uncertain::count).sum()),
            warnings: done.warnings.len(),
            document: serde_json::to_value(done).expect("keys are text, and a value takes all"),
        }
    }
}

impl Serialize for FileDone {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(None)?;
        map.serialize_entry("file", &self.input)?;
        map.serialize_entry("output", &self.output)?;
        map.serialize_entry("status", self.outcome.word())?;
        match &self.outcome {
            Outcome::Kept => {}
            Outcome::Done(summary) => map.serialize_entry("result", &summary.document)?,
            Outcome::Failed(error) => map.serialize_entry("error", &error.to_string())?,
        }
        map.end()
    }
}

impl Outcome {
    /// The report's word for it.
    pub fn word(&self) -> &'static str {
        match self {
            Outcome::Kept => "kept",
            Outcome::Done(_) => "done",
            Outcome::Failed(_) => "failed",
        }
    }
}
