//! Files that are written completely or not at all, and never in place of an input.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf, absolute};
use std::sync::Mutex;

use tempfile::{Builder, NamedTempFile};

use crate::error::InputError;

/// Writes a file through a temporary one beside it, so that a partial file is never visible.
///
/// # Errors
/// If the folder does not exist, or is not writable.
pub fn write(path: impl AsRef<Path>, content: impl AsRef<[u8]>) -> Result<(), InputError> {
    let path = path.as_ref();
    write_by_way_of(folder_of(path), path, |file| file.write_all(content.as_ref()))
}

/// The same for a file that is written piece by piece, and optionally must not replace another.
///
/// # Errors
/// Those of `content`; if the folder does not exist or is not writable; if the file already exists and must not be overwritten.
pub fn write_by(
    path: &Path,
    overwrite: bool,
    content: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), InputError>,
) -> Result<(), InputError> {
    let mut file =
        Builder::new().prefix(&before_part(path)).suffix(PART).tempfile_in(folder_of(path)).map_err(refusal(path))?;
    let _unfinished = Unfinished::new(file.path());
    let mut buffered = BufWriter::new(file.as_file_mut());
    content(&mut buffered)?;
    buffered.flush().map_err(refusal(path))?;
    drop(buffered);
    keep(file, path, overwrite)
}

/// Writes a file through a temporary one in a folder of the same file system, where leftovers of a killed process do no harm.
///
/// # Errors
/// If a folder does not exist, or is not writable; errors of `content`.
pub(crate) fn write_by_way_of(
    folder: &Path,
    path: &Path,
    content: impl FnOnce(&mut File) -> std::io::Result<()>,
) -> Result<(), InputError> {
    let mut file = NamedTempFile::with_suffix_in(PART, folder).map_err(refusal(path))?;
    let _unfinished = Unfinished::new(file.path());
    // The message does not name the temporary file, which no longer exists by then.
    content(file.as_file_mut()).map_err(refusal(path))?;
    keep(file, path, true)
}

/// Suffix of an incomplete file.
const PART: &str = ".part";

/// Incomplete files of this process: a signal that ends it runs no destructor.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// An incomplete file, until it is complete or removed.
struct Unfinished(PathBuf);

impl Unfinished {
    fn new(path: &Path) -> Unfinished {
        UNFINISHED.lock().expect("nobody panics").push(path.to_path_buf());
        Unfinished(path.to_path_buf())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        UNFINISHED.lock().expect("nobody panics").retain(|path| *path != self.0);
    }
}

/// Removes the incomplete files of this process, which is about to end.
pub fn remove_unfinished() {
    for path in UNFINISHED.lock().expect("nobody panics").iter() {
        // It may have been completed, or removed, since.
        let _ = fs::remove_file(path);
    }
}

/// Prefix of the name of a temporary file: `.a.fits.`
fn before_part(path: &Path) -> OsString {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".");
    name
}

/// Removes leftovers of an interrupted [`write_by`].
///
/// # Errors
/// If they exist and cannot be removed.
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

/// Rejects a path that is not writable before there is anything to write, so that hours of work are not lost at their end.
///
/// # Errors
/// If the folder does not exist or is not writable, or the path is not that of a file.
pub fn refuse_unwritable(path: &Path) -> Result<(), InputError> {
    refuse_other_than_file(path)?;
    NamedTempFile::new_in(folder_of(path)).map_err(refusal(path))?;
    Ok(())
}

/// Rejects folders and devices, which a new file would replace.
fn refuse_other_than_file(path: &Path) -> Result<(), InputError> {
    let problem = match fs::metadata(path) {
        Ok(there) if there.is_dir() => "this is a folder, not a file",
        Ok(there) if !there.is_file() => "this is a device or a pipe, not a file",
        _ => return Ok(()),
    };
    Err(InputError::new(format!("cannot write `{}`", path.display()), problem))
}

/// Gives a temporary file its final name, once it is safely on disk.
fn keep(file: NamedTempFile, path: &Path, overwrite: bool) -> Result<(), InputError> {
    refuse_other_than_file(path)?;
    file.as_file().sync_all().map_err(refusal(path))?;
    // Temporary files are private; results have the permissions of any new file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = fs::metadata(path).map_or(0o644, |known| known.permissions().mode());
        file.as_file().set_permissions(fs::Permissions::from_mode(mode)).map_err(refusal(path))?;
    }
    if overwrite {
        file.persist(path).map_err(|error| refusal(path)(error.error))?;
    } else {
        // The file may have been created meanwhile.
        file.persist_noclobber(path).map_err(|error| refusal(path)(error.error))?;
    }
    Ok(())
}

/// An output.
#[derive(Clone, Copy, Debug)]
pub enum Written<'a> {
    /// A file.
    File(&'a Path),
    /// Files in a folder, with names that satisfy a condition.
    Into(&'a Path, fn(&OsStr) -> bool),
}

/// Rejects outputs that would replace an input, or each other, by any name or link.
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

    /// The file, or existing files that may be replaced.
    pub fn there(&self) -> Vec<PathBuf> {
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
            // Names of figures, tables and manual pages have different suffixes.
            (Written::Into(..), Written::Into(..)) => false,
        }
    }
}

/// Whether two paths lead to the same file or folder, which need not exist yet.
fn same_file(one: &Path, other: &Path) -> bool {
    match (fs::metadata(one), fs::metadata(other)) {
        #[cfg(unix)]
        (Ok(one), Ok(other)) => {
            use std::os::unix::fs::MetadataExt;
            // Including hard and symbolic links.
            (one.dev(), one.ino()) == (other.dev(), other.ino())
        }
        _ => location(one) == location(other),
    }
}

/// A path without links and detours, as far as it exists.
fn location(path: &Path) -> Option<PathBuf> {
    let whole = |path: &Path| fs::canonicalize(path).or_else(|_| absolute(path)).ok();
    match path.file_name() {
        Some(name) if !path.exists() => Some(whole(folder_of(path))?.join(name)),
        _ => whole(path),
    }
}

/// Rejects a path that already exists.
///
/// # Errors
/// If it exists.
pub fn refuse_existing(path: &Path) -> Result<(), InputError> {
    refuse_other_than_file(path)?;
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

/// Creates a folder if there is none.
///
/// # Errors
/// If it cannot be created.
pub fn folder(path: impl AsRef<Path>) -> Result<(), InputError> {
    fs::create_dir_all(&path).map_err(|error| {
        let is_file = path.as_ref().is_file();
        let problem = if is_file { "this is a file, not a folder".into() } else { error.to_string() };
        InputError::new(format!("cannot make the folder `{}`", path.as_ref().display()), problem)
    })
}
