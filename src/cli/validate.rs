//! `ctiplan validate`.

use clap::Args;

use super::drawn::Drawn;
use super::inputs::Measured;
use super::{Failure, Outcome, Output, print_and_suggest};
use crate::analysis::validate::validate;
use crate::cli::file_argument::OutputFolder;
use crate::io::atomic_file;

#[derive(Debug, Args)]
pub(super) struct Validate {
    #[command(flatten)]
    measured: Measured,
    #[command(flatten)]
    drawn: Drawn,
    /// Write each measurement file with columns `model` and `residual_sigma` into this folder, as ECSV
    #[arg(long, value_name = "DIR", value_parser = OutputFolder::of_tables())]
    residuals: Option<OutputFolder>,
    /// Seed of the simulated noise with which residual trends are compared, instead of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    #[command(flatten)]
    output: Output,
}

impl Validate {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let (mission, data) = self.measured.read()?;
        self.drawn.check()?;
        let validation = validate(&mission, &data, self.seed.unwrap_or(mission.accuracy.seed))?;
        self.drawn.write(&validation, &[mission])?;
        if let Some(folder) = &self.residuals {
            atomic_file::folder(folder)?;
            for (name, table) in validation.tables() {
                atomic_file::write(folder.join(name), table.to_ecsv())?;
            }
        }
        let fails = !validation.within_noise() && !validation.falls_short_of_noise();
        let next = fails.then(|| self.measured.command("diagnose"));
        print_and_suggest(&validation, &self.output, next)?;
        Ok(Outcome::Done)
    }
}
