//! Plainer values of the same model, such as a cycle's maximum in the period nearest to the mission.

use super::result::{Fit, is_same};
use super::solve::{Options, fit_rows};
use crate::analysis::measurement::{DataSet, questions};
use crate::effect::{self, AfterFit};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;

/// A fit, or an equally good one with plainer values of the free parameters of effects.
pub(super) fn plainer(
    model: &Model,
    data: &[DataSet],
    fit: Fit,
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Fit {
    let values = values(&fit, &model.mission, &epochs_yr(data));
    if values.is_empty() { fit } else { refitted(model, data, &fit, &values, options, progress).unwrap_or(fit) }
}

/// Plainer values, by dotted key.
fn values(fit: &Fit, given: &Mission, epochs_yr: &[f64]) -> Vec<(String, f64)> {
    let after = AfterFit { fitted: &fit.mission, given, free: &[], epochs_yr };
    let is_free = |key: &String| fit.parameters.iter().any(|parameter| parameter.key == *key);
    let mut tables: Vec<&str> =
        fit.parameters.iter().filter_map(|parameter| Some(parameter.key.rsplit_once('.')?.0)).collect();
    tables.dedup();
    let of = |table: &str| {
        let kind = table.strip_prefix("effects.")?.split('.').next()?;
        Some((effect::find(kind)?.plainer)(&after, table))
    };
    tables.into_iter().filter_map(of).flatten().filter(|(key, _)| is_free(key)).collect()
}

/// Distinct epochs of some data, years since launch, ascending.
pub(crate) fn epochs_yr(data: &[DataSet]) -> Vec<f64> {
    let mut all: Vec<f64> = questions(data).iter().map(|question| question.at.t_yr).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// The fit from other values of its parameters; None if it ends at another chi2, or if the values make no sense.
pub(super) fn refitted(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    values: &[(String, f64)],
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Option<Fit> {
    let keys: Vec<String> = fit.parameters.iter().map(|parameter| parameter.key.clone()).collect();
    let values: Vec<_> = values.iter().map(|(key, value)| (key.clone(), (*value).into())).collect();
    let start = fit.mission.with(&values).ok()?;
    let options = Options { starts: 1, scan: false, ..options.clone() };
    let other: Result<Fit, InputError> = fit_rows(&model.like(&start), data, &keys, &options, progress, |_| true);
    Some(fit.clone().replaced_by(other.ok().filter(|other| is_same(other.chi2, fit.chi2))?))
}
