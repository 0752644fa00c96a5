//! Wrong rows of data that no model explains, by least trimmed squares.
//!
//! A wrong row with much leverage bends the model that is nearest to the data, and right rows are marked in its place. So this model
//! is fitted anew without the rows that are farthest from it, as many as may be wrong in each file, regardless of what was marked
//! before; then without those farthest from that fit, until they are the same (concentration steps: Rousseeuw & Van Driessen 2006,
//! Data Mining and Knowledge Discovery 12, 29, section 2). If all rows but a few far ones are then at their noise, these are wrong.

use super::data_quality::{AS_NOISE, are_neighbours_alike};
use super::evidence::Evidence;
use super::fitted_model::{Case, Node};
use super::noise::{self, SetNoise, wrong_rows};
use crate::analysis::fit;
use crate::analysis::measurement::DataSet;
use crate::error::InputError;

/// Fits, each without the rows farthest from the previous one.
const STEPS: usize = 8;

/// The errors with the wrong rows of a fit of the nearest model to most rows; None if that leaves more than noise in the others, or
/// if there are too few.
///
/// # Errors
/// If the model has no value for a row.
pub(super) fn wrong_rows(
    evidence: &Evidence,
    quoted: &[DataSet],
    noise: &[SetNoise],
    nearest: &Node,
) -> Result<Option<Vec<SetNoise>>, InputError> {
    let unmarked = noise::unmarked(noise);
    let data = noise::allowed_for(quoted, &unmarked);
    let case = Case { work: evidence.case().work.clone(), ..Case::of(&data) };
    let keys: Vec<String> = nearest.fit.parameters.iter().map(|fitted| fitted.key.clone()).collect();
    let options = fit::Options { scan: false, moments: false, seed: evidence.options.seed, ..fit::Options::default() };
    let (mut model, mut residuals) = (nearest.model.clone(), case.residuals(&nearest.fit.values));
    let mut out = Vec::new();
    for _ in 0..STEPS {
        let farthest = farthest(&case, residuals.as_slice());
        if farthest == out {
            break;
        }
        out = farthest;
        if case.n() - out.len() <= keys.len() {
            return Ok(None);
        }
        let fit = fit::fit_rows(&model, &data, &keys, &options, &|_| case.work.count(), |row| !out.contains(&row))?;
        (model, residuals) = (model.like(&fit.mission), case.residuals(&fit.values));
    }
    let (far, near): (Vec<usize>, Vec<usize>) =
        (0..case.n()).partition(|row| out.contains(row) && residuals[*row].abs() > wrong_rows::FAR);
    let chi2: f64 = near.iter().map(|row| residuals[*row].powi(2)).sum();
    let freedom = (near.len() as f64 - keys.len() as f64).max(1.0);
    let far: Vec<(usize, f64)> = far.into_iter().map(|row| (row, residuals[row])).collect();
    let are_accidents = !are_neighbours_alike(&far) && !noise::share_a_condition(&case, &far);
    let explained = chi2 < freedom + AS_NOISE * (2.0 * freedom).sqrt() && are_accidents;
    let better = explained.then(|| noise::with_wrong(quoted, &unmarked, &far));
    Ok(better.filter(|better| !noise::is_same(better, noise)))
}

/// The rows of each file with the largest residuals, as many as may be wrong; ascending.
pub(super) fn farthest(case: &Case, residuals: &[f64]) -> Vec<usize> {
    let of_set = |set: usize| {
        let mut rows: Vec<usize> = case.rows(set).collect();
        let most = wrong_rows::most(rows.len());
        rows.sort_by(|a, b| residuals[*b].abs().total_cmp(&residuals[*a].abs()));
        rows.truncate(most);
        rows
    };
    let mut rows: Vec<usize> = (0..case.data.len()).flat_map(of_set).collect();
    rows.sort_unstable();
    rows
}
