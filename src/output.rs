//! Files that are written whole or not at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::error::InputError;

/// Writes a file by way of a temporary one beside it, so that nobody ever sees half of it.
///
/// # Errors
/// Where the folder is not there, or cannot be written to.
pub fn write(path: impl AsRef<Path>, text: &str) -> Result<(), InputError> {
    let path = path.as_ref();
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    write_by_way_of(folder, path, |file| file.write_all(text.as_bytes()))
}

/// Writes a file by way of a temporary one in a folder of the same file system, in which what a kill leaves is in nobody's
/// way.
///
/// # Errors
/// Where a folder is not there, or cannot be written to; what `write` says.
pub(crate) fn write_by_way_of(
    folder: &Path,
    path: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<(), InputError> {
    let refusal = |error: io::Error| {
        let problem = match error.kind() {
            io::ErrorKind::NotFound => "the folder is not there".to_string(),
            _ => error.to_string(),
        };
        InputError::new(format!("cannot write `{}`", path.display()), problem)
    };
    let mut file = NamedTempFile::with_suffix_in(".part", folder).map_err(refusal)?;
    // Not the temporary file's own path in the message: it is gone by then.
    write(file.as_file_mut()).map_err(refusal)?;
    file.as_file().sync_all().map_err(refusal)?;
    // Temporary files are private; results are as public as any new file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = fs::metadata(path).map_or(0o644, |known| known.permissions().mode());
        file.as_file().set_permissions(fs::Permissions::from_mode(mode)).map_err(refusal)?;
    }
    file.persist(path).map_err(|error| refusal(error.error))?;
    Ok(())
}

/// Makes a folder where there is none.
///
/// # Errors
/// Where it cannot be made.
pub fn folder(path: impl AsRef<Path>) -> Result<(), InputError> {
    fs::create_dir_all(&path).map_err(|error| {
        InputError::new(format!("cannot make the folder `{}`", path.as_ref().display()), error.to_string())
    })
}
