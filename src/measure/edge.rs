//! The edge behind a flat block of rows: the level of the block, its first row, and the charge in the rows behind it, averaged over
//! columns.

use std::ops::Range;

use ndarray::{Array2, s};

use super::exposure::Exposure;
use super::statistic::{Mean, clipped, inliers, mean, median};

/// Rows of a block from which a slope along the columns is looked for, and the part of them, from the first on, in which capture may not be
/// in balance with release: one in so many.
const LONG: usize = 40;
const UNBALANCED: usize = 4;

/// Significance of a slope, in its errors.
const CLEAR: f64 = 5.0;

/// A flat block of rows, and the range of rows used around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Its rows, in the order of readout.
    pub rows: Range<usize>,
    /// Number of its last rows averaged for the level.
    pub level_rows: usize,
    /// Rows behind it.
    pub trail_px: usize,
}

/// Mean results for the columns of a block.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Charge per pixel in the last rows of the block, e-.
    pub signal: Mean,
    /// Charge in its first row, e-.
    pub first: Mean,
    /// Charge per pixel that its first row would have without traps, e-: the level, or, if the block clearly brightens or darkens along
    /// the columns, what a straight line through its rows gives there.
    pub first_signal: Mean,
    /// Whether it is from a straight line.
    pub is_sloped: bool,
    /// Charge in the rows behind it, e-; None if too few pixels have one.
    pub trail: Vec<Option<Mean>>,
}

impl Block {
    /// The columns of an image in groups of equal size, by their level: trails depend nonlinearly on the level. Columns with an
    /// outlying level (dead ones, hot ones) or an outlying pixel in the rows of the level (a cosmic ray, which leaves its own
    /// trail) are excluded.
    pub fn groups(&self, exposure: &Exposure, groups: usize) -> Vec<Vec<usize>> {
        let charge_e = &exposure.charge_e;
        let quantum_e = exposure.about.quantum_e;
        let rows = self.rows.end - self.level_rows..self.rows.end;
        let level = |column: usize| median(charge_e.slice(s![rows.clone(), column]).to_vec());
        let lit: Vec<(usize, f64)> = exposure.columns.clone().filter_map(|c| Some((c, level(c)?))).collect();
        let from_level = |(column, level): &(usize, f64)| -> Vec<f64> {
            rows.clone().map(|row| charge_e[[row, *column]] - level).collect()
        };
        let within = inliers(&lit.iter().flat_map(from_level).collect::<Vec<f64>>(), quantum_e);
        let levels: Vec<f64> = lit.iter().map(|(_, level)| *level).collect();
        let kept = inliers(&levels, quantum_e);
        let good =
            kept.iter().zip(within.chunks(self.level_rows)).map(|(kept, pixels)| *kept && pixels.iter().all(|p| *p));
        let mut columns: Vec<(usize, f64)> =
            lit.into_iter().zip(good).filter(|(_, good)| *good).map(|(it, _)| it).collect();
        if groups > 1 {
            columns.sort_by(|a, b| a.1.total_cmp(&b.1));
        }
        let share = |group: usize| group * columns.len() / groups;
        (0..groups)
            .map(|group| columns[share(group)..share(group + 1)].iter().map(|(column, _)| *column).collect())
            .collect()
    }

    /// The edge of these columns, with a zero level (e-) subtracted; None if too few pixels have a value.
    ///
    /// Differences in level between columns are not an error of its mean over the same columns. So errors come from differences
    /// along the columns: for the level from the scatter of its rows, for the first row from its difference to the level.
    pub fn edge(&self, exposure: &Exposure, columns: &[usize], baseline_e: f64) -> Option<Edge> {
        let charge_e = &exposure.charge_e;
        let quantum_e = exposure.about.quantum_e;
        let rows = self.rows.end - self.level_rows..self.rows.end;
        let level = |column: usize| mean_of(charge_e, rows.clone(), column);
        let levels: Vec<f64> = columns.iter().map(|column| level(*column)).collect();
        let mean_level = mean(&levels, quantum_e)?.value;
        let of_all = |row: usize, less: &dyn Fn(usize) -> f64| {
            clipped(columns.iter().enumerate().map(|(place, column)| charge_e[[row, *column]] - less(place)), quantum_e)
        };
        let above_level = |row: usize| of_all(row, &|place| levels[place] - mean_level + baseline_e);
        let of_rows: Vec<Mean> = rows.clone().filter_map(above_level).collect();
        let trail = (self.rows.end..self.rows.end + self.trail_px).map(|row| of_all(row, &|_| baseline_e)).collect();
        let signal = together(&of_rows)?;
        let sloped = self.level_at_first_row(|row| above_level(row).map(|mean| mean.value));
        let first_signal = sloped.map_or(signal, |[value, sigma]| Mean { value, sigma, ..signal });
        let (first, is_sloped) = (above_level(self.rows.start)?, sloped.is_some());
        Some(Edge { signal, first, first_signal, is_sloped, trail })
    }

    /// Level at the first row of a long block and its error, by a straight line through the rows in which capture and release are in
    /// balance. None if the block is short or its level does not clearly change.
    fn level_at_first_row(&self, level: impl Fn(usize) -> Option<f64>) -> Option<[f64; 2]> {
        if self.rows.len() < LONG {
            return None;
        }
        let balanced = self.rows.start + self.rows.len() / UNBALANCED..self.rows.end;
        let points: Vec<(f64, f64)> = balanced.filter_map(|row| Some((row as f64, level(row)?))).collect();
        let n = points.len() as f64;
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(&|point| point.0), mean(&|point| point.1));
        let spread = mean(&|point| (point.0 - x).powi(2));
        let slope = mean(&|point| (point.0 - x) * (point.1 - y)) / spread;
        let scatter = mean(&|point| (point.1 - y - slope * (point.0 - x)).powi(2)) * n / (n - 2.0);
        let at = self.rows.start as f64 - x;
        let sigma = (scatter / n * (1.0 + at * at / spread)).sqrt();
        (slope.abs() > CLEAR * (scatter / (n * spread)).sqrt()).then_some([y + slope * at, sigma])
    }
}

/// The mean of the means of several rows.
fn together(rows: &[Mean]) -> Option<Mean> {
    let sum = |value: fn(&Mean) -> f64| rows.iter().map(value).sum::<f64>();
    let count = rows.len() as f64;
    (count > 0.0).then(|| Mean {
        value: sum(|row| row.value) / count,
        sigma: sum(|row| row.sigma * row.sigma).sqrt() / count,
        scatter: (sum(|row| row.scatter * row.scatter) / count).sqrt(),
        used: rows.iter().map(|row| row.used).sum(),
        rejected: rows.iter().map(|row| row.rejected).sum(),
    })
}

/// The mean of the finite charges of a column in some rows; NaN if there are none.
fn mean_of(charge_e: &Array2<f64>, rows: Range<usize>, column: usize) -> f64 {
    let charges = charge_e.slice(s![rows, column]);
    let finite = charges.iter().filter(|charge| charge.is_finite());
    let (sum, count) = finite.fold((0.0, 0), |(sum, count), charge| (sum + charge, count + 1));
    sum / f64::from(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels that change by 0.05 e- a row, with alternating noise of 1 e-: 1000.5 e- at row 10. Without the change there is no straight line.
    #[test]
    fn a_level_that_clearly_changes_is_extrapolated_to_the_first_row() {
        let block = Block { rows: 10..210, level_rows: 20, trail_px: 5 };
        let found = |slope: f64| {
            block.level_at_first_row(|row| Some(1000.0 + slope * row as f64 + if row % 2 == 0 { 1.0 } else { -1.0 }))
        };
        let [value, sigma] = found(0.05).unwrap();
        assert!((value - 1000.5).abs() < 2.0 * sigma && sigma < 0.3, "{value} +- {sigma}");
        assert_eq!(found(0.0), None);
        let short = Block { rows: 0..30, ..block };
        assert_eq!(short.level_at_first_row(|row| Some(row as f64)), None);
    }
}
