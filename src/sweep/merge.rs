//! Parts → one table.

use serde::Serialize;

use super::grid::Grid;
use super::output::Undefined;
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

/// Distribution of a recorded quantity over the points that have a result. A quantile is None if it falls among the points
/// without a value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The quantity, by the name of its column.
    pub name: String,
    /// Points with a result, but without a value of this quantity.
    pub points_without_value: u64,
    /// Where these stand among the others.
    pub without_value: Undefined,
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
    let kind = ColumnKind::of(&parts.result)?;
    let mut summary = Summary::new(grid);
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
    outputs: Vec<(String, Undefined)>,
    first: usize,
    /// Values of each output at the points that have a result.
    values: Vec<Vec<Option<f64>>>,
    problems: (u64, Option<(u64, String)>),
    warnings: (u64, Option<String>),
}

impl Summary {
    fn new(grid: &Grid) -> Summary {
        let columns = grid.columns();
        let outputs = grid.outputs();
        let first = columns.len() - 2 - outputs.len();
        let names = columns.into_iter().skip(first).map(|(name, _)| name);
        let outputs: Vec<_> = names.zip(outputs.iter().map(|(output, _)| output.undefined())).collect();
        Summary { first, values: vec![Vec::new(); outputs.len()], outputs, problems: (0, None), warnings: (0, None) }
    }

    fn add(&mut self, row: &[Cell]) {
        let [.., warnings, problem] = row else { return };
        if let Cell::Text(said) = warnings {
            self.warnings.0 += 1;
            self.warnings.1.get_or_insert_with(|| said.clone());
        }
        if let (Cell::Text(said), Cell::Integer(point)) = (problem, &row[1]) {
            self.problems.0 += 1;
            self.problems.1.get_or_insert_with(|| (*point as u64, said.clone()));
            return;
        }
        for (cell, values) in row[self.first..].iter().zip(&mut self.values) {
            values.push(match cell {
                Cell::Number(number) => Some(*number),
                _ => None,
            });
        }
    }

    fn done(self, points: u64) -> Merged {
        let spreads = self
            .outputs
            .into_iter()
            .zip(self.values)
            .map(|((name, undefined), values)| spread(name, undefined, values));
        Merged { points, problems: self.problems, warnings: self.warnings, spreads: spreads.collect() }
    }
}

fn spread(name: String, without_value: Undefined, mut values: Vec<Option<f64>>) -> Spread {
    let points_without_value = values.iter().filter(|value| value.is_none()).count() as u64;
    if without_value == Undefined::Apart {
        values.retain(Option::is_some);
    }
    let place = |value: &Option<f64>| match (value, without_value) {
        (Some(value), _) => *value,
        (None, Undefined::Below) => f64::NEG_INFINITY,
        (None, _) => f64::INFINITY,
    };
    values.sort_by(|a, b| place(a).total_cmp(&place(b)));
    let last = values.len().saturating_sub(1);
    let quantile = |share: f64| values.get((share * last as f64).round() as usize).copied().flatten();
    Spread {
        points_without_value,
        without_value,
        least: quantile(0.0),
        quantile_16: quantile(0.16),
        median: quantile(0.5),
        quantile_84: quantile(0.84),
        largest: quantile(1.0),
        name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::output::Output;

    /// A quantile is the number that half (or another share) of all points do not exceed, wherever the undefined ones stand.
    #[test]
    fn quantiles_of_every_output_count_the_points_without_a_value() {
        for output in Output::ALL {
            for undefined in 0..=25_usize {
                // 2 j, and none in an order that is not theirs.
                let values: Vec<Option<f64>> =
                    (0..25).map(|j| (j * 7) % 25).map(|j| (j >= undefined).then_some(2.0 * j as f64)).collect();
                let found = spread(output.name().into(), output.undefined(), values.clone());
                assert_eq!(found.points_without_value as usize, undefined);
                let defined: Vec<f64> = (undefined..25).map(|j| 2.0 * j as f64).collect();
                for (share, quantile) in [0.0, 0.16, 0.5, 0.84, 1.0].into_iter().zip(found.values()) {
                    let place = (share * 24.0_f64).round() as usize;
                    let expected = match output.undefined() {
                        Undefined::Later | Undefined::Above => defined.get(place).copied(),
                        Undefined::Below => place.checked_sub(undefined).map(|place| defined[place]),
                        Undefined::Apart => {
                            let last = defined.len().saturating_sub(1);
                            defined.get((share * last as f64).round() as usize).copied()
                        }
                    };
                    assert_eq!(quantile, expected, "{} {undefined} {share}", output.name());
                }
            }
        }
    }
}
