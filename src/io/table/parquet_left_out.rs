//! In place of `parquet.rs` without the feature `parquet`: such tables are refused.

use super::Table;
use crate::error::InputError;

/// A message about a Parquet file with what it lacks, and what to try.
pub(crate) fn left_out(refused: InputError) -> InputError {
    InputError {
        problem: "it is a Parquet file, and this ctiplan was built without its feature `parquet`".into(),
        ..refused
    }
    .with_help("build it with that feature, which is on by default, or use ECSV or CSV")
}

impl Table {
    /// Refuses the file.
    pub(super) fn read_parquet(&mut self, _bytes: Vec<u8>) -> Result<(), InputError> {
        Err(left_out(self.refuse("")))
    }

    /// Refused: a table becomes a Parquet file with the feature `parquet` alone.
    ///
    /// # Errors
    /// Always.
    pub fn to_parquet(&self) -> Result<Vec<u8>, InputError> {
        Err(left_out(self.refuse("")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parquet_table_is_refused_by_the_name_of_the_feature() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"PAR1 and so on").unwrap();
        let table = Table::parse("galaxies.csv", "a\n1\n").unwrap();
        for error in [Table::read(file.path()).unwrap_err(), table.to_parquet().unwrap_err()] {
            assert!(error.problem.contains("feature `parquet`"), "{error}");
            assert!(error.help.is_some_and(|help| help.contains("CSV")));
        }
    }
}
