//! `ctiplan schema`.

use clap::Args;

use super::{Failure, Outcome, say};
use crate::mission_file;

#[derive(Debug, Args)]
pub(super) struct Schema {}

impl Schema {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        say(&format!("{:#}\n", mission_file::schema()))?;
        Ok(Outcome::Done)
    }
}
