//! A sweep as a Slurm job array: division into tasks, the script, and the tasks to resubmit.

use std::fmt::Write;
use std::path::Path;
use std::str::FromStr;

use super::grid::Grid;
use super::parts::Parts;
use crate::error::InputError;

/// One of the equal parts into which a sweep is divided: number K, from 1, of N.
///
/// It has every N-th chunk: neighbouring chunks take about equal times, and so do shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// K, from 1.
    pub number: u64,
    /// N.
    pub of: u64,
}

impl Shard {
    /// Whether a chunk belongs to it.
    pub fn has(&self, chunk: u64) -> bool {
        chunk % self.of == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let whole = |text: &str| text.trim().parse::<u64>().ok();
        text.split_once('/')
            .and_then(|(number, of)| Some(Shard { number: whole(number)?, of: whole(of)? }))
            .filter(|shard| (1..=shard.of).contains(&shard.number))
            .ok_or_else(|| "a shard is K/N with K from 1 to N, such as 3/16".into())
    }
}

/// Rejects more shards than chunks: some would have nothing to do.
///
/// # Errors
/// If there are more.
pub(super) fn check(grid: &Grid, shards: u64) -> Result<(), InputError> {
    if shards <= grid.chunks() {
        return Ok(());
    }
    let problem = format!(
        "{shards} shards for {} chunks of {} points: some would have nothing to do",
        grid.chunks(),
        grid.chunk_points
    );
    Err(InputError::new(format!("cannot cut the sweep of `{}`", grid.name), problem)
        .with_help("take fewer shards, or set chunk_points in the grid file to less"))
}

/// Numbers, from 1, of the shards with missing points, out of `shards`. Empty if the result exists.
///
/// # Errors
/// If parts are from another sweep, or there are more shards than chunks.
pub fn missing(parts: &Parts, shards: u64) -> Result<Vec<u64>, InputError> {
    check(parts.grid, shards)?;
    if parts.merged() {
        return Ok(Vec::new());
    }
    let present = parts.present()?;
    let lacks = |number: &u64| {
        let shard = Shard { number: *number, of: shards };
        present.iter().enumerate().any(|(chunk, present)| !present && shard.has(chunk as u64))
    };
    Ok((1..=shards).filter(lacks).collect())
}

/// Ascending numbers in the notation of `sbatch --array`: `3,7-9`.
pub fn indices(numbers: &[u64]) -> String {
    let mut out = String::new();
    let mut rest = numbers;
    while let Some(&first) = rest.first() {
        let run = rest.iter().zip(first..).take_while(|(number, expected)| *number == expected).count();
        let comma = if out.is_empty() { "" } else { "," };
        match run {
            1 => write!(out, "{comma}{first}"),
            _ => write!(out, "{comma}{first}-{}", rest[run - 1]),
        }
        .expect("text can be written to");
        rest = &rest[run..];
    }
    out
}

/// A script for `sbatch` that computes a sweep as an array of `tasks` tasks, each `program ... --shard K/N`.
///
/// # Errors
/// If there are more tasks than chunks, or a path does not exist.
pub fn script(parts: &Parts, program: &Path, tasks: u64) -> Result<String, InputError> {
    check(parts.grid, tasks)?;
    let absolute = |path: &Path| std::path::absolute(path).map_or_else(|_| quoted(path), |path| quoted(&path));
    let command = format!(
        "{} sweep {} --output {}",
        absolute(program),
        absolute(Path::new(&parts.grid.name)),
        absolute(&parts.result)
    );
    let points = parts.grid.points();
    Ok(format!(
        "#!/bin/bash
# {points} points in {tasks} tasks of a Slurm job array. To submit, with this script as sweep.sbatch:
#
#   job=$(sbatch --parsable sweep.sbatch)
#   sbatch --dependency=afterany:$job --wrap \"{escaped} --collect\"
#
# afterany and not afterok: the files say what is missing, and --collect refuses to go on without. What is missing then is
# submitted again, and only that is computed:
#
#   sbatch --array=$({command} --missing {tasks}) sweep.sbatch
#
# Many clusters allow indices up to 1000 only (scontrol show config | grep MaxArraySize). Account, partition, time and
# memory are yours to add, here or on the command line of sbatch.
#SBATCH --job-name=ctiplan-sweep
#SBATCH --array=1-{tasks}
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=ctiplan-sweep-%A_%a.log
set -euo pipefail
export RAYON_NUM_THREADS=\"${{SLURM_CPUS_PER_TASK:-1}}\"
exec {command} --shard \"$SLURM_ARRAY_TASK_ID/{tasks}\"
",
        escaped = command.replace('\\', "\\\\").replace('"', "\\\"").replace('$', "\\$").replace('`', "\\`"),
    ))
}

/// A path as one word of a shell.
pub(crate) fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_those_of_sbatch() {
        assert_eq!(indices(&[3, 7, 8, 9]), "3,7-9");
        assert_eq!(indices(&[1, 2, 5]), "1-2,5");
        assert_eq!(indices(&[]), "");
    }

    #[test]
    fn shards_are_k_of_n() {
        assert_eq!("3/16".parse(), Ok(Shard { number: 3, of: 16 }));
        for text in ["0/4", "5/4", "3", "a/4", "1/0", "-1/4"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
        let has = |number| (0..10).filter(move |chunk| Shard { number, of: 3 }.has(*chunk)).count();
        assert_eq!((1..=3).map(has).sum::<usize>(), 10);
    }

    #[test]
    fn paths_survive_a_shell() {
        assert_eq!(quoted(Path::new("/a/b.toml")), "/a/b.toml");
        assert_eq!(quoted(Path::new("/it's a/b")), "'/it'\\''s a/b'");
    }
}
