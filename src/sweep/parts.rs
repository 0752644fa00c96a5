//! Chunks of points as files beside the result, until all are complete.
//!
//! `results.parquet` has its parts in `results.parquet.parts`, `part-000042.FINGERPRINT.csv`. A part is written under another name
//! and then renamed, so that it is written completely or not at all. Its name and its content follow from the grid alone: two
//! processes that compute the same chunk write the same file, and the second replaces the first.

use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::grid::{Grid, Holds};
use super::write::{ColumnKind, written};
use crate::error::InputError;
use crate::io::atomic_file::{self, Written};
use crate::io::table::Cell;

/// Parts of one sweep, and the file into which they are merged.
#[derive(Clone, Debug)]
pub struct Parts<'a> {
    /// The sweep.
    pub grid: &'a Grid,
    /// The file into which the parts are merged.
    pub result: PathBuf,
    /// The folder of the parts.
    pub folder: PathBuf,
}

impl<'a> Parts<'a> {
    /// The parts of a sweep whose result is a file, `.parquet` or `.csv`.
    ///
    /// # Errors
    /// If the file has another suffix, or exists and is not the result of this sweep, or the result or its parts would replace a
    /// file that the sweep reads.
    pub fn of(grid: &'a Grid, result: impl Into<PathBuf>) -> Result<Parts<'a>, InputError> {
        let result = result.into();
        let kind = ColumnKind::of(&result)?;
        let parts = Parts { grid, folder: with_suffix(&result, ".parts"), result };
        let read = grid.files();
        // The folder of the parts is removed at the end, with all its contents.
        let outputs = [Written::File(&parts.result), Written::Into(&parts.folder, |_| true)];
        atomic_file::refuse_clashes(&outputs, &read.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
        if let Some(fingerprint) = kind.fingerprint(&parts.result)?
            && fingerprint != grid.fingerprint
        {
            let found =
                if fingerprint.is_empty() { "no result of a sweep".into() } else { format!("sweep {fingerprint}") };
            let problem = format!("it is there and holds {found}; this is sweep {}", grid.fingerprint);
            return Err(InputError::new(format!("cannot write `{}`", parts.result.display()), problem)
                .with_help(changed("choose another --output, or delete the file")));
        }
        Ok(parts)
    }

    /// Whether the result exists: it is only written when all parts are complete.
    pub fn merged(&self) -> bool {
        self.result.exists()
    }

    /// Creates the folder of the parts.
    ///
    /// # Errors
    /// If it cannot be created, or is not writable.
    pub fn prepare(&self) -> Result<(), InputError> {
        let parent = self.result.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !parent.is_dir() {
            return Err(InputError::new(
                format!("cannot write `{}`", self.result.display()),
                "the folder is not there",
            ));
        }
        atomic_file::folder(&self.folder)
    }

    /// Which chunks are present.
    ///
    /// # Errors
    /// If the folder cannot be read, or contains parts of another sweep.
    pub fn present(&self) -> Result<Vec<bool>, InputError> {
        let mut present = vec![false; self.grid.chunks() as usize];
        let refused = || format!("cannot use the parts in `{}`", self.folder.display());
        let entries = match fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(present),
            Err(error) => return Err(InputError::new(refused(), error.to_string())),
        };
        for entry in entries {
            let name = entry.map_err(|error| InputError::new(refused(), error.to_string()))?.file_name();
            let Some((chunk, fingerprint)) = name.to_str().and_then(parsed) else { continue };
            if fingerprint != self.grid.fingerprint {
                let problem = format!("they are of sweep {fingerprint}; this is sweep {}", self.grid.fingerprint);
                return Err(InputError::new(refused(), problem)
                    .with_help(changed("choose another --output, or delete the folder to begin again")));
            }
            if let Some(present) = present.get_mut(chunk) {
                *present = true;
            }
        }
        Ok(present)
    }

    /// Writes the rows of a chunk.
    ///
    /// # Errors
    /// If writing fails.
    pub(super) fn write(&self, chunk: u64, rows: &[Vec<Cell>]) -> Result<(), InputError> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let header: Vec<String> = self.grid.columns().into_iter().map(|(name, _)| name).collect();
        let records = std::iter::once(header).chain(rows.iter().map(|row| row.iter().map(written).collect()));
        for record in records {
            writer.write_record(&record).expect("rows of equal length");
        }
        let text = writer.into_inner().expect("a buffer takes all");
        atomic_file::write_by_way_of(&self.folder, &self.path(chunk), |file| file.write_all(&text))
    }

    /// Reads the rows of a chunk.
    ///
    /// # Errors
    /// If the file does not exist, or was modified.
    pub(super) fn read(&self, chunk: u64) -> Result<Vec<Vec<Cell>>, InputError> {
        let path = self.path(chunk);
        let refuse = |problem: String| {
            InputError::new(format!("cannot use the part `{}`", path.display()), problem)
                .with_help("delete it and run the sweep again: only what is missing is computed")
        };
        let mut reader = csv::Reader::from_path(&path).map_err(|error| refuse(error.to_string()))?;
        let columns = self.grid.columns();
        let header = reader.headers().map_err(|error| refuse(error.to_string()))?;
        if !header.iter().eq(columns.iter().map(|(name, _)| name.as_str())) {
            return Err(refuse("its columns are not those of this sweep".into()));
        }
        let mut rows = Vec::new();
        for (record, point) in reader.records().zip(self.grid.chunk(chunk)) {
            let record = record.map_err(|error| refuse(error.to_string()))?;
            let cells = record.iter().zip(&columns).map(|(text, (name, holds))| {
                read(text, *holds)
                    .ok_or_else(|| refuse(format!("`{text}` in column {name} of point {point} is damaged")))
            });
            let cells = cells.collect::<Result<Vec<_>, _>>()?;
            if cells[0] != Cell::Text(self.grid.fingerprint.clone()) || cells[1] != Cell::Integer(point as i64) {
                return Err(refuse(format!("where point {point} of this sweep should be there is another")));
            }
            rows.push(cells);
        }
        let expected = self.grid.chunk(chunk);
        if rows.len() as u64 != expected.end - expected.start || reader.records().next().is_some() {
            return Err(refuse(format!(
                "it does not hold the {} points that it should",
                expected.end - expected.start
            )));
        }
        Ok(rows)
    }

    /// Locks the parts against another process with the same task, for the lifetime of the file.
    ///
    /// None if the file system does not support locks: two processes then do the work twice, with the same result.
    ///
    /// # Errors
    /// If another process holds the lock.
    pub(super) fn lock(&self) -> Result<Option<File>, InputError> {
        let path = self.folder.join("lock");
        let refused = || format!("cannot sweep into `{}`", self.result.display());
        let file =
            File::create(&path).map_err(|error| InputError::new(refused(), format!("{}: {error}", path.display())))?;
        match file.try_lock() {
            Ok(()) => Ok(Some(file)),
            Err(TryLockError::WouldBlock) => Err(InputError::new(refused(), "another ctiplan is at work on it")
                .with_help("wait for it, or share the work: --shard 1/2 here and --shard 2/2 there")),
            Err(TryLockError::Error(_)) => Ok(None),
        }
    }

    /// Removes the parts after the merger.
    pub(super) fn remove(&self) {
        // Leftover files do no harm, and the result is already written.
        let _ = fs::remove_dir_all(&self.folder);
    }

    fn path(&self, chunk: u64) -> PathBuf {
        self.folder.join(format!("part-{chunk:06}.{}.csv", self.grid.fingerprint))
    }
}

fn changed(what_to_do: &str) -> String {
    format!("the grid file, a mission or the version of ctiplan is not the same: {what_to_do}")
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// Number and fingerprint of a part, by its name.
fn parsed(name: &str) -> Option<(usize, &str)> {
    let (chunk, fingerprint) = name.strip_prefix("part-")?.strip_suffix(".csv")?.split_once('.')?;
    Some((chunk.parse().ok()?, fingerprint))
}

fn read(text: &str, holds: Holds) -> Option<Cell> {
    match holds {
        _ if text.is_empty() => Some(Cell::Missing),
        Holds::Numbers => text.parse().ok().map(Cell::Number),
        Holds::Integers => text.parse().ok().map(Cell::Integer),
        Holds::Words | Holds::Days => Some(Cell::Text(text.to_string())),
    }
}
