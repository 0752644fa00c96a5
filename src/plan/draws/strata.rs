//! Draws in the order of an input in which they are evenly spread.
//!
//! Each draw has its own part of the distribution of the Sun's total (its rank) and of each input of `[uncertainty]` (Sobol's
//! points). Numbers estimated from such draws scatter less than those from independent ones: an input to which they are due
//! contributes nothing, as its neighbours in this order differ by all other inputs alone.

use super::Fates;

/// Places of the draws in the order of the input by which ln |Δe| at the end differs least between neighbours: `coordinates`, each
/// with its value in every draw. None if there is no such input, or too few draws.
pub(super) fn order(found: &Fates, coordinates: &[Vec<f64>]) -> Option<Vec<usize>> {
    let count = found.fates.len();
    let least =
        found.fates.iter().filter_map(|fate| fate.delta_e).filter(|one| *one > 0.0).fold(f64::INFINITY, f64::min);
    let log = |place: usize| found.fates[place].delta_e.map_or(f64::INFINITY, |delta_e| delta_e.max(least).ln());
    let logs: Vec<f64> = (0..count).map(log).collect();
    let most = logs.iter().copied().filter(|log| log.is_finite()).fold(f64::NEG_INFINITY, f64::max);
    // A lost shape is as a large change.
    let logs: Vec<f64> = logs.into_iter().map(|log| log.min(most)).collect();
    let apart = |order: &Vec<usize>| order.windows(2).map(|pair| (logs[pair[0]] - logs[pair[1]]).powi(2)).sum::<f64>();
    let sorted = |values: &Vec<f64>| {
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
        order
    };
    let orders = coordinates.iter().map(sorted).map(|order| (apart(&order), order));
    orders.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, order)| order).filter(|_| count > 2)
}
