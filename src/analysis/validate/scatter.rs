//! Row-to-row scatter of residuals.

use crate::analysis::measurement::DataSet;

/// Scatter about smooth misfits: the median second difference of neighbouring residuals, converted to the standard deviation of
/// normal noise. Neighbours are those in the condition along which it is smallest.
pub(super) fn scatter(data: &DataSet, residuals: &[f64]) -> f64 {
    along_neighbours(data, residuals, second_differences)
}

/// The smallest value of a measure of roughness when rows are sorted by one condition after another.
pub(crate) fn along_neighbours(data: &DataSet, residuals: &[f64], roughness: fn(&[f64]) -> f64) -> f64 {
    let along = |first: &String| {
        // Sorted by all other conditions, then by this one.
        let others = data.varying.iter().filter(|name| *name != first).chain([first]);
        let columns: Vec<Vec<f64>> = others.map(|name| data.against(name)).collect();
        let mut rows: Vec<usize> = (0..residuals.len()).collect();
        rows.sort_by(|a, b| {
            let differs = columns.iter().map(|column| column[*a].total_cmp(&column[*b])).find(|order| order.is_ne());
            differs.unwrap_or(a.cmp(b))
        });
        roughness(&rows.into_iter().map(|row| residuals[row]).collect::<Vec<_>>())
    };
    data.varying.iter().map(along).fold(roughness(residuals), f64::min)
}

/// Minimum number of rows for an estimate of the scatter.
const FEW: usize = 8;

/// Median second difference, 1 for normal noise of standard deviation 1.
pub(crate) fn second_differences(residuals: &[f64]) -> f64 {
    if residuals.len() < FEW {
        return 1.0;
    }
    let mut differences: Vec<f64> =
        residuals.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs()).collect();
    differences.sort_by(f64::total_cmp);
    // The median of |a − 2b + c| of three normal deviates is 0.6745 √6.
    differences[differences.len() / 2] / (0.674_489_750_196 * 6.0_f64.sqrt())
}
