//! Files read as a whole: no devices, and no more bytes than reasonable, so that reading always ends.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::unreadable;

/// Maximum size of a mission, a grid, or another file of keys and values, bytes.
const MOST_OF_A_TEXT: u64 = 64 << 20;

/// Maximum size of a table, bytes: about ten million rows.
pub(crate) const MOST_OF_A_TABLE: u64 = 1 << 30;

/// The text of a file; an error is the fault of the file, in words.
pub(crate) fn text(path: &Path) -> Result<String, String> {
    String::from_utf8(bytes(path, MOST_OF_A_TEXT)?).map_err(|_| "the file is not text in UTF-8".into())
}

/// The bytes of a file or a pipe, at most `most`.
pub(crate) fn bytes(path: &Path, most: u64) -> Result<Vec<u8>, String> {
    let read = || {
        let file = File::open(path)?;
        let mut bytes = Vec::new();
        if !is_device(&file.metadata()?) {
            file.take(most + 1).read_to_end(&mut bytes)?;
            return Ok(Some(bytes));
        }
        Ok(None)
    };
    match read().map_err(|error: std::io::Error| unreadable(&error))? {
        None => Err("this is a device, not a file".into()),
        Some(bytes) if bytes.len() as u64 > most => {
            Err(format!("the file is longer than {} MiB, the most that is read of its kind", most >> 20))
        }
        Some(bytes) => Ok(bytes),
    }
}

#[cfg(unix)]
fn is_device(about: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    about.file_type().is_char_device() || about.file_type().is_block_device()
}

#[cfg(not(unix))]
fn is_device(_: &std::fs::Metadata) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_a_length() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, "12345").unwrap();
        assert_eq!(bytes(file.path(), 5).unwrap(), b"12345");
        assert!(bytes(file.path(), 4).unwrap_err().contains("longer than"));
    }
}
