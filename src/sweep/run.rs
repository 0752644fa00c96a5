//! Computation of the missing points.

use super::parts::Parts;
use super::point::Points;
use super::slurm::{self, Shard};
use crate::error::InputError;
use crate::io::table::Cell;
use crate::numeric::parallel;

/// Results of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Done {
    /// Points of the run: those of its shard.
    pub points: u64,
    /// Points already present.
    pub found: u64,
    /// Points computed.
    pub computed: u64,
    /// Computed points without a result; their rows state why.
    pub problems: u64,
}

/// Computes the missing points of a sweep, or of one shard of it, and writes them as parts.
///
/// `plan` is called once with the number of points to compute, `progress` after every point.
///
/// # Errors
/// If parts cannot be read or written, or are from another sweep, or another process is already computing the whole sweep.
pub fn run(
    parts: &Parts,
    shard: Option<Shard>,
    plan: impl FnOnce(u64),
    progress: impl Fn() + Sync,
) -> Result<Done, InputError> {
    let grid = parts.grid;
    if let Some(shard) = shard {
        slurm::check(grid, shard.of)?;
    }
    let chunks: Vec<u64> = (0..grid.chunks()).filter(|chunk| shard.is_none_or(|shard| shard.has(*chunk))).collect();
    let size = |chunks: &[u64]| -> u64 {
        chunks.iter().map(|&chunk| grid.chunk(chunk)).map(|range| range.end - range.start).sum()
    };
    let points = size(&chunks);
    let complete = Done { points, found: points, computed: 0, problems: 0 };
    if parts.merged() {
        parts.remove();
        return Ok(complete);
    }
    parts.prepare()?;
    // Shards may run twice, and one that hangs must not stop another: they need no lock, only parts.
    let _lock = if shard.is_none() { parts.lock()? } else { None };
    if parts.merged() {
        parts.remove();
        return Ok(complete);
    }
    let present = parts.present()?;
    let to_do: Vec<u64> = chunks.into_iter().filter(|&chunk| !present[chunk as usize]).collect();
    let computed = size(&to_do);
    plan(computed);
    let all = Points::of(grid);
    let problems: Vec<u64> = parallel::try_map(to_do, |chunk| {
        let row = |point| {
            let row = all.row(point);
            progress();
            row
        };
        let rows: Vec<Vec<Cell>> = parallel::map(grid.chunk(chunk), row);
        // Another process may have computed the same, and merged the result meanwhile.
        parts.write(chunk, &rows).or_else(|error| if parts.merged() { Ok(()) } else { Err(error) })?;
        Ok(rows.iter().filter(|row| *row.last().expect("a column of problems") != Cell::Missing).count() as u64)
    })?;
    Ok(Done { points, found: points - computed, computed, problems: problems.iter().sum() })
}
