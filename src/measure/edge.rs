//! The edge behind a flat block of rows: the level of the block, its first row, and the charge in the rows behind it, averaged over
//! columns.

use std::ops::Range;

use ndarray::{Array2, s};

use super::exposure::Exposure;
use super::statistic::{Mean, clipped, inliers, mean, median};

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
        Some(Edge { signal: together(&of_rows)?, first: above_level(self.rows.start)?, trail })
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
