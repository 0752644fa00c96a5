//! Parameters that the data do not limit on one side.
//!
//! An error is the distance at which chi2 has increased by 1. Beyond that chi2 may hardly increase further: no trail distinguishes
//! a release time of a hundred transfers from one of ten thousand. Such a parameter has a limit on one side only, and its error
//! must not be interpreted as that of a normal distribution. So a parameter with an error above a few tenths of its value is fixed
//! far away on either side, all others are fitted, and chi2 is compared.

use super::parameter::Parameter;
use super::problem::Problem;
use super::result::{Advice, Fit, Fitted};
use crate::analysis::measurement::DataSet;
use crate::error::InputError;
use crate::model::Model;
use crate::numeric::parallel;

/// Error over value above which the sides are tested.
const POORLY_KNOWN: f64 = 0.3;

/// Factor by which a value is moved to either side.
const FAR: f64 = 100.0;

/// Increase of chi2 above which a value is excluded, at three sigma.
const EXCLUDED: f64 = 9.0;

/// The open sides of all parameters of a fit that must be above 0; `fitted` contains these with their errors.
///
/// # Errors
/// As [`super::fit`].
pub(crate) fn open_sides(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    fitted: &[Fitted],
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<Advice>, InputError> {
    let doubtful = fitted.iter().filter(|fitted| fitted.sigma.is_some_and(|sigma| sigma > POORLY_KNOWN * fitted.value));
    let parameters = doubtful.map(|fitted| Parameter::of(&fit.mission, &fitted.key)).collect::<Result<Vec<_>, _>>()?;
    let inside = |parameter: &&Parameter| parameter.is_log() && parameter.at_bound(parameter.start).is_none();
    let sides = parameters.iter().filter(inside).flat_map(|parameter| [(parameter, true), (parameter, false)]);
    let open = |(parameter, above): (&Parameter, bool)| -> Option<Advice> {
        let (low, high) = parameter.coordinates();
        let factor = if above { FAR } else { FAR.recip() };
        let coordinate = parameter.coordinate(parameter.start * factor).clamp(low, high);
        let value = parameter.at_coordinate(coordinate);
        // A value that is invalid in the mission (a full well below the notch) is also excluded.
        let chi2 = chi2_held_at(model, data, fit, &parameter.key, value, progress).ok()?;
        let rise = chi2 - fit.chi2;
        let advice = Advice::Open { key: parameter.key.clone(), above, value, unit: parameter.unit, rise };
        (rise < EXCLUDED).then_some(advice)
    };
    Ok(parallel::map(sides, open).into_iter().flatten().collect())
}

/// chi2 with a parameter fixed at a value and all others refitted.
fn chi2_held_at(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    key: &str,
    value: f64,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<f64, InputError> {
    let held = model.like(&fit.mission.with(&[(key.to_string(), value.into())])?);
    let others: Vec<String> =
        fit.parameters.iter().map(|fitted| fitted.key.clone()).filter(|other| other != key).collect();
    Ok(Problem::new(&held, data, &others, progress, |_| true)?.sketch()?.1)
}
