//! How well a fitted model predicts groups of rows that it has not seen.
//!
//! For a model that is linear in its parameters, the residuals of rows g left out of the fit are (1 − H_gg)⁻¹ r_g, with the
//! residuals r and the hat matrix H of the fit to all rows (Cook & Weisberg 1982, Residuals and Influence in Regression, section
//! 3.2). Near its optimum a model is nearly linear; a test compares this with fits without the rows.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

use serde::Serialize;

use super::fitted_model::{Case, Node};
use crate::analysis::fit::holdout::{groups, groups_among};

/// Eigenvalue of 1 − H_gg below which a group cannot be predicted from the others: it alone determines a parameter.
const UNSEEN: f64 = 1e-3;

/// The eigenvalue below which it cannot be distinguished from 0.
const NOT_SEEN: f64 = 1e-6;

/// Conditions whose values define the groups.
const CONDITIONS: [&str; 8] =
    ["t_yr", "signal_e", "transfers", "temperature_k", "dose_mev_g", "background_e", "line_time_ms", "galaxy"];

/// Pixels of a trail share their errors, and are left out only if nothing else varies.
const PIXELS: &str = "trail_px";

/// Groups of rows that are left out together, and the columns whose values define them. The first column is the one by which most
/// rows can be left out; for files in which it does not vary, another column is chosen, and so on. An effect that changes a single
/// file can only be tested with rows of that file. None if nothing varies.
pub(super) fn split(case: &Case) -> Option<(Vec<&'static str>, Vec<Vec<usize>>)> {
    let mut rest: Vec<usize> = (0..case.data.len()).collect();
    let (mut columns, mut all) = (Vec::new(), Vec::new());
    while let Some((column, groups)) = most_rows(case, &rest, &CONDITIONS) {
        rest.retain(|&file| !case.data[file].varies_in(column));
        columns.push(column);
        all.extend(groups);
    }
    if columns.is_empty() {
        return most_rows(case, &rest, &[PIXELS]).map(|(column, groups)| (vec![column], groups));
    }
    Some((columns, all))
}

/// The column by which most rows of some files can be left out in three or more groups, and the groups.
fn most_rows(case: &Case, files: &[usize], columns: &[&'static str]) -> Option<(&'static str, Vec<Vec<usize>>)> {
    let split = |column: &&'static str| {
        let groups: Vec<Vec<usize>> =
            groups_among(case.data, files, column).into_iter().map(|(_, members, _)| members).collect();
        (groups.len() > 2).then_some((*column, groups))
    };
    let all: Vec<(&'static str, Vec<Vec<usize>>)> = columns.iter().filter_map(split).collect();
    let most = all.iter().max_by_key(|(_, groups)| groups.iter().map(Vec::len).sum::<usize>())?;
    // A temperature recorded once for every epoch makes the same groups: they are those of the epochs.
    let sorted = |groups: &[Vec<usize>]| {
        let mut groups = groups.to_vec();
        groups.sort();
        groups
    };
    let wanted = sorted(&most.1);
    all.iter().find(|(_, groups)| sorted(groups) == wanted).cloned()
}

/// 1 − H_gg of a group, and the residuals of its rows.
fn seen(node: &Node, members: &[usize]) -> (SymmetricEigen<f64, Dyn>, DVector<f64>) {
    let basis = DMatrix::from_fn(members.len(), node.basis.ncols(), |row, column| node.basis[(members[row], column)]);
    let seen = DMatrix::identity(members.len(), members.len()) - &basis * basis.transpose();
    let residuals = DVector::from_iterator(members.len(), members.iter().map(|&row| node.residuals[row]));
    (seen.symmetric_eigen(), residuals)
}

/// Residuals of a group's rows if left out; None if the others do not predict them.
pub(super) fn left_out(node: &Node, members: &[usize]) -> Option<DVector<f64>> {
    let (eigen, residuals) = seen(node, members);
    if eigen.eigenvalues.iter().any(|value| *value < UNSEEN) {
        return None;
    }
    let along = eigen.eigenvectors.transpose() * residuals;
    Some(&eigen.eigenvectors * along.component_div(&eigen.eigenvalues))
}

/// How poorly a model predicts groups left out: −2 ln of the density that it assigns to the measured values, up to a constant.
///
/// From the other groups, a group is predicted with a covariance of (1 − H_gg)⁻¹. Squared errors alone would penalise an effect
/// that is determined by one group, although its strength cannot be known without that group.
pub(super) fn surprise(groups: &[Vec<usize>], node: &Node) -> f64 {
    let of = |members: &Vec<usize>| -> f64 {
        let (eigen, residuals) = seen(node, members);
        let along = eigen.eigenvectors.transpose() * residuals;
        along
            .iter()
            .zip(&eigen.eigenvalues)
            .map(|(along, seen)| along * along / seen.max(NOT_SEEN) - seen.max(NOT_SEEN).ln())
            .sum()
    };
    groups.iter().map(of).sum()
}

/// The same for all rows; those that are never left out (a trail at one brightness) count with their residuals.
pub(super) fn surprise_of_all(groups: &[Vec<usize>], node: &Node) -> f64 {
    let mut never = node.residuals.clone();
    groups.iter().flatten().for_each(|&row| never[row] = 0.0);
    surprise(groups, node) + never.norm_squared()
}

/// rms of (value − model)/sigma over groups left out in turn.
pub(super) fn rms_sigma(groups: &[Vec<usize>], node: &Node) -> Option<f64> {
    let (mut squares, mut rows) = (0.0, 0);
    for members in groups {
        if let Some(residuals) = left_out(node, members) {
            squares += residuals.norm_squared();
            rows += members.len();
        }
    }
    (rows > 0).then(|| (squares / rows as f64).sqrt())
}

/// How well a model predicts rows inside and at the ends of the range of a condition; each group is left out in turn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Carried {
    /// The condition.
    pub condition: String,
    /// Lowest and highest value of it in the data.
    pub range: [f64; 2],
    /// rms of (value − model)/sigma of groups in between; None if the others do not predict them.
    pub inside_rms_sigma: Option<f64>,
    /// The same of the first and the last group, to which the others are extrapolated.
    pub beyond_rms_sigma: Option<f64>,
}

/// For every condition by which groups can be left out.
pub(super) fn carried(case: &Case, node: &Node) -> Vec<Carried> {
    let of = |column: &&str| {
        let groups = groups(case.data, column).ok().filter(|groups| groups.len() > 3)?;
        let ranges = case.data.iter().filter(|set| !set.is_words(column)).flat_map(|set| set.against(column));
        let values: Vec<f64> = ranges.filter(|value| value.is_finite()).collect();
        let rms = |ends: bool| {
            let wanted = groups.iter().filter(|(_, _, at_end)| *at_end == ends);
            rms_sigma(&wanted.map(|(_, members, _)| members.clone()).collect::<Vec<_>>(), node)
        };
        // Words have no order, so no ends.
        (!values.is_empty()).then(|| Carried {
            condition: column.to_string(),
            range: [f64::INFINITY, f64::NEG_INFINITY]
                .map(|start| values.iter().copied().fold(start, if start > 0.0 { f64::min } else { f64::max })),
            inside_rms_sigma: rms(false),
            beyond_rms_sigma: rms(true),
        })
    };
    CONDITIONS.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fit::{self, Options};
    use crate::analysis::measurement::DataSet;
    use crate::mission::Mission;
    use crate::model::Model;

    /// A temperature recorded once for every epoch, and falling: the groups are named after the epochs.
    #[test]
    fn groups_by_the_temperatures_of_epochs_are_those_of_the_epochs() {
        let mission = Mission::read("tests/practice/prelaunch/mission.toml").unwrap();
        let mut data = DataSet::read("tests/practice/prelaunch/trails.ecsv", &mission).unwrap();
        data.rows.iter_mut().for_each(|row| {
            let temperature_k = 160.0 - row.at.t_yr;
            row.at.state("temperature_k", temperature_k);
        });
        data.varying.push("temperature_k".into());
        let (columns, groups) = split(&Case::of(&[data])).unwrap();
        assert_eq!((columns, groups.len()), (vec!["t_yr"], 8));
    }

    #[test]
    fn rows_left_out_are_predicted_as_by_fits_without_them() {
        let mission = Mission::read("tests/practice/prelaunch/mission.toml").unwrap();
        let data = ["trails", "dose"]
            .map(|name| DataSet::read(format!("tests/practice/prelaunch/{name}.ecsv"), &mission).unwrap());
        let (mission, _) = crate::mission_file::add_effect(
            &mission,
            "prelaunch-traps",
            toml::toml! { fast = 0.05
            mid = 0.1
            slow = 0.1 },
        )
        .unwrap();
        let keys = ["fast", "mid", "slow"].map(|name| format!("effects.prelaunch-traps.{name}"));
        let case = Case::of(&data);
        let node = Node::fit(&case, &Model::new(&mission), Vec::new(), &keys, &Options::default()).unwrap();
        let (columns, groups) = split(&case).unwrap();
        assert_eq!(columns, ["t_yr"]);
        for members in &groups {
            let without = |row: usize| !members.contains(&row);
            let fit = fit::fit_rows(&node.model, &data, &keys, &Options::default(), &|_| (), without).unwrap();
            let predicted = left_out(&node, members).unwrap();
            for (place, &row) in members.iter().enumerate() {
                let really = (case.values[row] - fit.values[row]) / case.sigmas[row];
                // Trails are not quite linear in the densities.
                assert!((predicted[place] - really).abs() < 0.02, "row {row}: {} {really}", predicted[place]);
            }
        }
    }
}
