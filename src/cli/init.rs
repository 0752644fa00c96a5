//! `ctiplan init`.

use std::io::Write;

use clap::Args;

use super::{Failure, Outcome, say};
use crate::file_argument::OutputFile;
use crate::sweep::quoted;
use crate::{mission, output};

#[derive(Debug, Args)]
pub(super) struct Init {
    /// The new mission file
    #[arg(value_name = "FILE", default_value = "mission.toml")]
    path: OutputFile,
    /// Replace FILE where it exists
    #[arg(long, visible_alias = "force")]
    overwrite: bool,
}

impl Init {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let template = mission::template();
        if !self.overwrite {
            output::refuse_existing(&self.path)?;
        }
        output::write_by(&self.path, self.overwrite, |file| {
            file.write_all(template.as_bytes()).map_err(output::refusal(&self.path))
        })?;
        let path = quoted(&self.path);
        say(&format!("wrote {path}: a mission to start from\nnext: ctiplan evaluate {path}\n"))?;
        Ok(Outcome::Done)
    }
}
