//! Parts → one table.

use serde::Serialize;

use super::grid::Holds;
use super::parts::Parts;
use super::slurm;
use super::write::{ColumnKind, TableWriter};
use crate::error::InputError;
use crate::io::atomic_file;
use crate::io::table::Cell;

/// Summary of a result.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// Points.
    pub points: u64,
    /// Points without a result, and the first of them with its error.
    pub problems: (u64, Option<(u64, String)>),
    /// Points with warnings, and the first warning.
    pub warnings: (u64, Option<String>),
    /// The distribution of each recorded quantity.
    pub spreads: Vec<Spread>,
}

/// Distribution of the values of a recorded quantity over the points that have one; None if no point has.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The quantity, by the name of its column.
    pub name: String,
    /// Points without a value.
    pub points_without_value: u64,
    /// Smallest.
    pub least: Option<f64>,
    /// Quantile 16 %.
    pub quantile_16: Option<f64>,
    /// Median.
    pub median: Option<f64>,
    /// Quantile 84 %.
    pub quantile_84: Option<f64>,
    /// Largest.
    pub largest: Option<f64>,
}

impl Spread {
    /// Smallest, quantile 16 %, median, quantile 84 % and largest.
    pub fn values(&self) -> [Option<f64>; 5] {
        [self.least, self.quantile_16, self.median, self.quantile_84, self.largest]
    }
}

/// Rows written together.
const ROWS: usize = 65_536;

/// Merges all parts into one table, and removes them.
///
/// # Errors
/// If parts are missing (the message states how many, and how to list them), damaged, or from another sweep, or the table cannot be
/// written. Nothing is removed then.
pub fn collect(parts: &Parts) -> Result<Merged, InputError> {
    let grid = parts.grid;
    let present = parts.present()?;
    let absent: Vec<u64> = (0..).zip(&present).filter(|(_, present)| !**present).map(|(chunk, _)| chunk).collect();
    if !absent.is_empty() {
        let points: u64 = absent.iter().map(|&chunk| grid.chunk(chunk)).map(|range| range.end - range.start).sum();
        let first = grid.chunk(absent[0]);
        let problem = format!(
            "{points} of {} points are missing: parts {} in `{}`, beginning with points {} to {}",
            grid.points(),
            shortened(slurm::indices(&absent)),
            parts.folder.display(),
            first.start,
            first.end - 1
        );
        return Err(InputError::new(format!("cannot collect `{}`", parts.result.display()), problem).with_help(
            "`--missing N` names the tasks of an array of N to submit again; without --collect the sweep computes what is missing",
        ));
    }
    let columns = grid.columns();
    let kind = ColumnKind::of(&parts.result)?;
    let mut summary = Summary::new(&columns, grid.outputs().len());
    // The fault in a part, while the error type is that of writing.
    let mut damaged = None;
    let written = atomic_file::write_by_way_of(&parts.folder, &parts.result, |file| {
        let mut table = TableWriter::new(kind, file, grid)?;
        let mut rows: Vec<Vec<Cell>> = Vec::new();
        for chunk in 0..grid.chunks() {
            let more = parts.read(chunk).map_err(|error| {
                damaged = Some(error);
                std::io::Error::other("damaged")
            })?;
            more.iter().for_each(|row| summary.add(row));
            rows.extend(more);
            if rows.len() >= ROWS {
                table.write(&rows)?;
                rows.clear();
            }
        }
        table.write(&rows)?;
        table.finish()
    });
    if let Some(damaged) = damaged {
        return Err(damaged);
    }
    written?;
    parts.remove();
    Ok(summary.done(grid.points()))
}

/// A list of part numbers, shortened if too long.
fn shortened(numbers: String) -> String {
    match numbers.char_indices().nth(60) {
        None => numbers,
        Some((end, _)) => format!("{}...", &numbers[..numbers[..end].rfind(',').unwrap_or(end)]),
    }
}

struct Summary {
    names: Vec<String>,
    first: usize,
    values: Vec<Vec<f64>>,
    problems: (u64, Option<(u64, String)>),
    warnings: (u64, Option<String>),
}

impl Summary {
    fn new(columns: &[(String, Holds)], outputs: usize) -> Summary {
        let first = columns.len() - 2 - outputs;
        let names: Vec<String> = columns[first..first + outputs].iter().map(|(name, _)| name.clone()).collect();
        Summary { first, values: vec![Vec::new(); names.len()], names, problems: (0, None), warnings: (0, None) }
    }

    fn add(&mut self, row: &[Cell]) {
        for (cell, values) in row[self.first..].iter().zip(&mut self.values) {
            if let Cell::Number(number) = cell {
                values.push(*number);
            }
        }
        let [.., warnings, problem] = row else { return };
        if let Cell::Text(said) = warnings {
            self.warnings.0 += 1;
            self.warnings.1.get_or_insert_with(|| said.clone());
        }
        if let (Cell::Text(said), Cell::Integer(point)) = (problem, &row[1]) {
            self.problems.0 += 1;
            self.problems.1.get_or_insert_with(|| (*point as u64, said.clone()));
        }
    }

    fn done(self, points: u64) -> Merged {
        let spreads = self.names.into_iter().zip(self.values).map(|(name, values)| spread(name, values, points));
        Merged { points, problems: self.problems, warnings: self.warnings, spreads: spreads.collect() }
    }
}

fn spread(name: String, mut values: Vec<f64>, points: u64) -> Spread {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    let quantile = |share: f64| values.get((share * last as f64).round() as usize).copied();
    Spread {
        points_without_value: points - values.len() as u64,
        least: quantile(0.0),
        quantile_16: quantile(0.16),
        median: quantile(0.5),
        quantile_84: quantile(0.84),
        largest: quantile(1.0),
        name,
    }
}
