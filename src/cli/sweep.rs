//! `ctiplan sweep`.

use std::env;

use clap::Args;

use super::number_argument::whole;
use super::{Failure, Outcome, Output, interrupted, print, progress, say};
use crate::cli::file_argument::{InputFile, ResumedFile};
use crate::report::SweepReport;
use crate::sweep::{self, Grid, Parts, Shard, quoted};

#[derive(Debug, Args)]
pub(super) struct Sweep {
    /// Grid file (TOML): missions, keys with lists, ranges and distributions, and outputs
    grid: InputFile,
    /// Result; its parts are in FILE.parts until all exist
    #[arg(long, value_name = "FILE.parquet|FILE.csv")]
    output: ResumedFile,
    /// Compute one of N equal parts of the sweep, for a job array; --collect makes one file of them
    #[arg(long, value_name = "K/N", group = "what")]
    shard: Option<Shard>,
    /// Combine the parts into the result; refused if some are missing
    #[arg(long, group = "what")]
    collect: bool,
    /// Print which of N shards lack points, in the format of `sbatch --array`: 3,7-9
    #[arg(long, value_name = "N", group = "what", value_parser = whole(1_u64..))]
    missing: Option<u64>,
    /// Print a script for sbatch that runs the sweep as a job array of N tasks
    #[arg(long, value_name = "N", group = "what", value_parser = whole(1_u64..))]
    slurm: Option<u64>,
    #[command(flatten)]
    report: Output,
}

impl Sweep {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let grid = Grid::read(&self.grid)?;
        let parts = Parts::of(&grid, &*self.output)?;
        if let Some(tasks) = self.slurm {
            let program = env::current_exe().map_err(Failure::Output)?;
            say(&sweep::script(&parts, &program, tasks)?)?;
            return Ok(Outcome::Done);
        }
        if let Some(shards) = self.missing {
            let missing = sweep::indices(&sweep::missing(&parts, shards)?);
            if !missing.is_empty() {
                say(&format!("{missing}\n"))?;
            }
            return Ok(Outcome::Done);
        }
        let done = if self.collect { None } else { Some(self.compute(&parts)?) };
        let merged = match self.shard {
            None if !parts.merged() => match sweep::collect(&parts) {
                Ok(merged) => Some(merged),
                // Another process was first, and has removed the parts.
                Err(_) if parts.merged() => None,
                Err(error) => return Err(error.into()),
            },
            _ => None,
        };
        print(&SweepReport { grid: &grid, parts: &parts, shard: self.shard, done, merged }, &self.report)?;
        Ok(Outcome::Done)
    }

    fn how_to_go_on(&self) -> String {
        let (grid, output) = (quoted(&self.grid), quoted(&self.output));
        let shard = self.shard.map_or(String::new(), |shard| format!(" --shard {}/{}", shard.number, shard.of));
        format!(
            "interrupted: finished points are kept beside the output; the same command goes on from there:\n  ctiplan sweep {grid} \
             --output {output}{shard}"
        )
    }

    fn compute(&self, parts: &Parts) -> Result<sweep::Done, Failure> {
        let bar = progress(0, "points");
        let plan = |points| {
            bar.set_length(points);
            bar.reset_eta();
        };
        interrupted::say_then(Some(self.how_to_go_on()));
        let done = sweep::run(parts, self.shard, plan, || bar.inc(1));
        interrupted::say_then(None);
        bar.finish_and_clear();
        Ok(done?)
    }
}
