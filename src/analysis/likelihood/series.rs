//! Rows whose errors may be correlated: neighbours in a trail, or in a time series under equal conditions.

use statrs::statistics::{Data, Median};

use crate::analysis::measurement::DataSet;
use crate::analysis::whitening::trails;
use crate::physics::conditions::NAMES;

/// Conditions that may differ between rows of one series: what changes from epoch to epoch, and the pixel of a trail. All others are equal.
const MAY_DIFFER: [&str; 4] = ["t_yr", "dose_mev_g", "temperature_k", "trail_px"];

/// For each row the one before it, among the wanted ones, in the same trail, or, in a file without trails, in the same time series; and
/// their distance in usual distances: pixels, or the median interval.
pub(crate) fn neighbours(set: &DataSet, wanted: impl Fn(usize) -> bool) -> Vec<Option<(usize, f64)>> {
    if set.varies_in("trail_px") {
        let links = trails(set, wanted).into_iter();
        return links.map(|link| link.map(|(row, apart)| (row, f64::from(apart)))).collect();
    }
    if set.varies_in("t_yr") { in_time(set, wanted) } else { vec![None; set.rows.len()] }
}

fn in_time(set: &DataSet, wanted: impl Fn(usize) -> bool) -> Vec<Option<(usize, f64)>> {
    let conditions: Vec<Vec<f64>> = NAMES
        .iter()
        .filter(|name| !MAY_DIFFER.contains(name) && set.varies_in(name))
        .map(|name| set.against(name))
        .collect();
    let t_yr = set.against("t_yr");
    let series = |a: usize, b: usize| {
        let (row, other) = (&set.rows[a], &set.rows[b]);
        let words = (row.galaxy, row.species, &row.words).cmp(&(other.galaxy, other.species, &other.words));
        let numbers = conditions.iter().map(|column| column[a].total_cmp(&column[b]));
        numbers.fold(words, |known, next| known.then(next))
    };
    let mut order: Vec<usize> = (0..set.rows.len()).filter(|row| wanted(*row)).collect();
    order.sort_by(|&a, &b| series(a, b).then(t_yr[a].total_cmp(&t_yr[b])).then(a.cmp(&b)));
    let mut before = vec![None; set.rows.len()];
    for pair in order.windows(2) {
        let apart_yr = t_yr[pair[1]] - t_yr[pair[0]];
        if series(pair[0], pair[1]).is_eq() && apart_yr > 0.0 {
            before[pair[1]] = Some((pair[0], apart_yr));
        }
    }
    let intervals: Vec<f64> = before.iter().flatten().map(|(_, apart_yr)| *apart_yr).collect();
    if intervals.is_empty() {
        return before;
    }
    let usual_yr = Data::new(intervals).median();
    before.into_iter().map(|link| link.map(|(row, apart_yr)| (row, apart_yr / usual_yr))).collect()
}
