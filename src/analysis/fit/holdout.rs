//! Prediction error for held-out data: groups of rows are left out in turn.
//!
//! The pixels of a trail share their errors, so whole groups are left out: a signal level, an epoch, a distance. Groups at the ends
//! of a column's range are predicted by extrapolation, as in planning, and are reported separately from those in between.

use serde::Serialize;

use super::solve::{Options, fit_rows};
use crate::analysis::measurement::DataSet;
use crate::error::{InputError, nearest};
use crate::model::Model;

/// Maximum number of groups for a column of numbers.
const GROUPS: usize = 8;

/// Held-out errors.
#[derive(Clone, Debug, Serialize)]
pub struct Holdout {
    /// The column.
    pub column: String,
    /// rms of (value − model)/sigma over all groups.
    pub rms_sigma: f64,
    /// rms of (value − model)/sigma over groups in between.
    pub interpolated_rms_sigma: Option<f64>,
    /// The same over groups at the ends of the range; None for text columns.
    pub extrapolated_rms_sigma: Option<f64>,
    /// All groups, in the column's order.
    pub groups: Vec<Group>,
}

/// A group of rows left out.
#[derive(Clone, Debug, Serialize)]
pub struct Group {
    /// Their common value.
    pub name: String,
    /// Number of rows.
    pub n: usize,
    /// rms of (value − model)/sigma, with the model fitted to all other rows.
    pub rms_sigma: f64,
    /// Whether it is at an end of the column's range.
    pub at_end: bool,
}

/// Fits without each group of a column in turn, and predicts it.
///
/// # Errors
/// If no data set varies in that column, or a fit fails.
pub fn holdout(
    model: &Model,
    data: &[DataSet],
    keys: &[String],
    column: &str,
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Holdout, InputError> {
    let groups = groups(data, column)?;
    // The model is that of the fit to all rows.
    let options = &Options { scan: false, ..options.clone() };
    let rows: Vec<_> = data.iter().flat_map(|set| &set.rows).collect();
    let mut left_out = Vec::new();
    for (name, members, at_end) in groups {
        let fit = fit_rows(model, data, keys, options, progress, |row| !members.contains(&row))?;
        let squares: f64 =
            members.iter().map(|&row| ((rows[row].value - fit.values[row]) / rows[row].sigma).powi(2)).sum();
        let rms_sigma = (squares / members.len() as f64).sqrt();
        left_out.push(Group { name, n: members.len(), rms_sigma, at_end });
    }
    let rms = |wanted: &dyn Fn(&Group) -> bool| {
        let groups = left_out.iter().filter(|group| wanted(group));
        let (squares, n) = groups
            .fold((0.0, 0), |(squares, n), group| (squares + group.n as f64 * group.rms_sigma.powi(2), n + group.n));
        (n > 0).then(|| (squares / n as f64).sqrt())
    };
    Ok(Holdout {
        column: column.to_string(),
        interpolated_rms_sigma: rms(&|group| !group.at_end),
        extrapolated_rms_sigma: rms(&|group| group.at_end),
        rms_sigma: rms(&|_| true).expect("at least two groups"),
        groups: left_out,
    })
}

/// Groups of rows (by their indices among all): name, members, whether at an end.
pub(crate) fn groups(data: &[DataSet], column: &str) -> Result<Vec<(String, Vec<usize>, bool)>, InputError> {
    if !data.iter().any(|set| set.varies_in(column)) {
        let varying: Vec<&str> = data.iter().flat_map(|set| &set.varying).map(String::as_str).collect();
        let mut listed = varying.clone();
        listed.sort_unstable();
        listed.dedup();
        let problem = format!("no data set varies in `{column}`; they vary in: {}", listed.join(", "));
        let refusal = InputError::new("cannot hold out", problem);
        return Err(match nearest(column, varying) {
            Some(near) => refusal.with_help(format!("did you mean `{near}`?")),
            None => refusal,
        });
    }
    Ok(groups_among(data, &(0..data.len()).collect::<Vec<_>>(), column))
}

/// The same for some data sets, by their indices among all; those that do not vary in the column are never left out.
pub(crate) fn groups_among(data: &[DataSet], some: &[usize], column: &str) -> Vec<(String, Vec<usize>, bool)> {
    let varies = data.iter().enumerate().map(|(place, set)| (set, some.contains(&place) && set.varies_in(column)));
    let rows = varies.flat_map(|(set, varies)| set.rows.iter().map(move |row| (row, varies)));
    let rows = rows.enumerate().filter(|(_, (_, varies))| *varies).map(|(index, (row, _))| (index, row));
    if data.iter().any(|set| set.is_words(column)) {
        let mut groups: Vec<(String, Vec<usize>, bool)> = Vec::new();
        for (index, row) in rows {
            let Some(word) = row.word(column) else { continue };
            match groups.iter_mut().find(|(name, ..)| name == word) {
                Some((_, members, _)) => members.push(index),
                None => groups.push((word.to_string(), vec![index], false)),
            }
        }
        return groups;
    }
    let mut numbers: Vec<(f64, usize)> =
        rows.filter_map(|(index, row)| Some((row.at.get(column)?, index))).filter(|(at, _)| at.is_finite()).collect();
    numbers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut distinct: Vec<f64> = numbers.iter().map(|(at, _)| *at).collect();
    distinct.dedup();
    let count = distinct.len().min(GROUPS);
    let cut = |group: usize| distinct[group * distinct.len() / count];
    (0..count)
        .map(|group| {
            let (low, next) = (cut(group), (group + 1 < count).then(|| cut(group + 1)));
            let within = |at: f64| at >= low && next.is_none_or(|next| at < next);
            let high = distinct.iter().copied().filter(|at| within(*at)).fold(low, f64::max);
            let name = if high > low { format!("{low} to {high}") } else { format!("{low}") };
            let members = numbers.iter().filter(|(at, _)| within(*at)).map(|(_, index)| *index).collect();
            (name, members, group == 0 || group + 1 == count)
        })
        .collect()
}
