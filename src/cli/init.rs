//! `ctiplan init`.

use std::io::Write;

use clap::Args;

use super::{Failure, Outcome, say};
use crate::cli::file_argument::{OutputFile, Overwrite};
use crate::io::atomic_file;
use crate::mission_file;
use crate::sweep::quoted;

#[derive(Debug, Args)]
pub(super) struct Init {
    /// New mission file
    #[arg(value_name = "FILE", default_value = "mission.toml")]
    path: OutputFile,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl Init {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let template = mission_file::template();
        atomic_file::write_by(&self.path, self.overwrite.overwrite, |file| {
            file.write_all(template.as_bytes()).map_err(atomic_file::refusal(&self.path))
        })?;
        let path = quoted(&self.path);
        say(&format!("wrote {path}: a mission to start from\nnext: ctiplan evaluate {path}\n"))?;
        Ok(Outcome::Done)
    }
}
