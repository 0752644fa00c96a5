//! Files that are written whole or not at all, and never in place of one that is read.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf, absolute};

use tempfile::{Builder, NamedTempFile};

use crate::error::InputError;

/// Writes a file by way of a temporary one beside it, so that a partial file is never visible.
///
/// # Errors
/// If the folder is not there, or cannot be written to.
pub fn write(path: impl AsRef<Path>, content: impl AsRef<[u8]>) -> Result<(), InputError> {
    let path = path.as_ref();
    write_by_way_of(folder_of(path), path, |file| file.write_all(content.as_ref()))
}

/// The same for a file that is written bit by bit, and perhaps must not replace another.
///
/// # Errors
/// Those of `content`; where the folder is not there, or cannot be written to; where there is such a file already, and it
/// must not be overwritten.
pub fn write_by(
    path: &Path,
    overwrite: bool,
    content: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), InputError>,
) -> Result<(), InputError> {
    let mut file =
        Builder::new().prefix(&before_part(path)).suffix(PART).tempfile_in(folder_of(path)).map_err(refusal(path))?;
    let mut buffered = BufWriter::new(file.as_file_mut());
    content(&mut buffered)?;
    buffered.flush().map_err(refusal(path))?;
    drop(buffered);
    keep(file, path, overwrite)
}

/// Writes a file by way of a temporary one in a folder of the same file system, in which leftovers of a killed process do no harm.
///
/// # Errors
/// If a folder is not there, or cannot be written to; what `content` says.
pub(crate) fn write_by_way_of(
    folder: &Path,
    path: &Path,
    content: impl FnOnce(&mut File) -> std::io::Result<()>,
) -> Result<(), InputError> {
    let mut file = NamedTempFile::with_suffix_in(PART, folder).map_err(refusal(path))?;
    // Not the temporary file's own path in the message: it is gone by then.
    content(file.as_file_mut()).map_err(refusal(path))?;
    keep(file, path, true)
}

/// The end of the name of a file that is not complete.
const PART: &str = ".part";

/// The beginning of the name of what becomes a file: `.a.fits.`
fn before_part(path: &Path) -> OsString {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".");
    name
}

/// Removes what an interruption has left of a file that [`write_by`] began.
///
/// # Errors
/// If it is there and cannot be removed.
pub(crate) fn remove_parts(path: &Path) -> Result<(), InputError> {
    let before = before_part(path);
    let is_part = |name: &OsStr| {
        let bytes = name.as_encoded_bytes();
        bytes.starts_with(before.as_encoded_bytes()) && bytes.ends_with(PART.as_bytes())
    };
    let entries = fs::read_dir(folder_of(path)).into_iter().flatten().flatten();
    for part in entries.filter(|entry| is_part(&entry.file_name())) {
        fs::remove_file(part.path()).map_err(refusal(&part.path()))?;
    }
    Ok(())
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Refuses a path that could not be written to, before there is anything to write: work of hours is not to be lost at its end.
///
/// # Errors
/// If the folder is not there or cannot be written to, or the path is that of something that is no file.
pub fn refuse_unwritable(path: &Path) -> Result<(), InputError> {
    refuse_other_than_file(path)?;
    NamedTempFile::new_in(folder_of(path)).map_err(refusal(path))?;
    Ok(())
}

/// Refuses folders and devices: a file that takes their place would be the last that is seen of them.
fn refuse_other_than_file(path: &Path) -> Result<(), InputError> {
    let problem = match fs::metadata(path) {
        Ok(there) if there.is_dir() => "this is a folder, not a file",
        Ok(there) if !there.is_file() => "this is a device or a pipe, not a file",
        _ => return Ok(()),
    };
    Err(InputError::new(format!("cannot write `{}`", path.display()), problem))
}

/// Gives a temporary file its name, once it is safe on the disk.
fn keep(file: NamedTempFile, path: &Path, overwrite: bool) -> Result<(), InputError> {
    refuse_other_than_file(path)?;
    file.as_file().sync_all().map_err(refusal(path))?;
    // Temporary files are private; results are as public as any new file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = fs::metadata(path).map_or(0o644, |known| known.permissions().mode());
        file.as_file().set_permissions(fs::Permissions::from_mode(mode)).map_err(refusal(path))?;
    }
    if overwrite {
        file.persist(path).map_err(|error| refusal(path)(error.error))?;
    } else {
        // The file may have come into being meanwhile.
        file.persist_noclobber(path).map_err(|error| refusal(path)(error.error))?;
    }
    Ok(())
}

/// What is to be written.
#[derive(Clone, Copy, Debug)]
pub enum Written<'a> {
    /// A file.
    File(&'a Path),
    /// Files in a folder, of names that satisfy a condition.
    Into(&'a Path, fn(&OsStr) -> bool),
}

/// Refuses outputs that would replace a file that is read, or one another, by any name or link.
///
/// # Errors
/// The first such output.
pub fn refuse_clashes(outputs: &[Written], inputs: &[&Path]) -> Result<(), InputError> {
    let clash = |path: &Path, problem: String| {
        Err(InputError::new(format!("cannot write `{}`", path.display()), problem).with_help("give another name"))
    };
    for (index, output) in outputs.iter().enumerate() {
        for path in output.there() {
            if let Some(input) = inputs.iter().find(|input| same_file(&path, input)) {
                let read = if path == **input { String::new() } else { format!(", `{}`", input.display()) };
                return clash(&path, format!("it is one of the files that are read{read}"));
            }
        }
        for earlier in &outputs[..index] {
            let path = output.path();
            if earlier.clashes_with(output) {
                let other =
                    if path == earlier.path() { String::new() } else { format!(", `{}`", earlier.path().display()) };
                return clash(path, format!("two outputs of the command are written there{other}"));
            }
        }
    }
    Ok(())
}

impl Written<'_> {
    fn path(&self) -> &Path {
        match self {
            Written::File(path) | Written::Into(path, _) => path,
        }
    }

    /// The file, or files that are there already and may be replaced.
    fn there(&self) -> Vec<PathBuf> {
        match self {
            Written::File(path) => vec![path.to_path_buf()],
            Written::Into(folder, writes) => {
                let entries = fs::read_dir(folder).into_iter().flatten().flatten();
                entries.filter(|entry| writes(&entry.file_name())).map(|entry| entry.path()).collect()
            }
        }
    }

    fn clashes_with(&self, other: &Written) -> bool {
        match (self, other) {
            (Written::File(one), Written::File(other)) => same_file(one, other),
            (Written::File(file), Written::Into(folder, writes))
            | (Written::Into(folder, writes), Written::File(file)) => {
                same_file(folder_of(file), folder) && file.file_name().is_some_and(writes)
            }
            // Names of figures, of tables and of manual pages have different endings.
            (Written::Into(..), Written::Into(..)) => false,
        }
    }
}

/// Whether two paths lead to the same file or folder, which need not be there yet.
fn same_file(one: &Path, other: &Path) -> bool {
    match (fs::metadata(one), fs::metadata(other)) {
        #[cfg(unix)]
        (Ok(one), Ok(other)) => {
            use std::os::unix::fs::MetadataExt;
            // Links of both kinds, too.
            (one.dev(), one.ino()) == (other.dev(), other.ino())
        }
        _ => location(one) == location(other),
    }
}

/// A path without links and detours, as far as it is there.
fn location(path: &Path) -> Option<PathBuf> {
    let whole = |path: &Path| fs::canonicalize(path).or_else(|_| absolute(path)).ok();
    match path.file_name() {
        Some(name) if !path.exists() => Some(whole(folder_of(path))?.join(name)),
        _ => whole(path),
    }
}

/// Refuses a path at which there is something already.
///
/// # Errors
/// If there is.
pub fn refuse_existing(path: &Path) -> Result<(), InputError> {
    match path.symlink_metadata() {
        Ok(_) => Err(InputError::new(format!("cannot write `{}`", path.display()), "the file exists already")
            .with_help("give another name, or --overwrite")),
        Err(_) => Ok(()),
    }
}

/// Why a file cannot be written.
pub fn refusal(path: &Path) -> impl Fn(std::io::Error) -> InputError {
    let refused = format!("cannot write `{}`", path.display());
    move |error| {
        let problem = match error.kind() {
            std::io::ErrorKind::NotFound => "the folder is not there".to_string(),
            std::io::ErrorKind::AlreadyExists => "the file exists already".to_string(),
            _ => error.to_string(),
        };
        InputError::new(&refused, problem)
    }
}

/// Makes a folder if there is none.
///
/// # Errors
/// If it cannot be made.
pub fn folder(path: impl AsRef<Path>) -> Result<(), InputError> {
    fs::create_dir_all(&path).map_err(|error| {
        InputError::new(format!("cannot make the folder `{}`", path.as_ref().display()), error.to_string())
    })
}
