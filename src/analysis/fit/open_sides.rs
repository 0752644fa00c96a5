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

/// The advice of a fit with the open sides of all parameters that must be above 0; `fitted` contains the parameters with their
/// errors.
///
/// # Errors
/// As [`super::fit`].
pub(crate) fn with_open_sides(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    fitted: &[Fitted],
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<Advice>, InputError> {
    let doubtful = fitted.iter().filter(|fitted| fitted.sigma.is_some_and(|sigma| sigma > POORLY_KNOWN * fitted.value));
    let parameters = doubtful.map(|fitted| Parameter::of(&fit.mission, &fitted.key)).collect::<Result<Vec<_>, _>>()?;
    let inside = |parameter: &&Parameter| parameter.is_log() && parameter.at_bound(parameter.start).is_none();
    let parameters: Vec<&Parameter> = parameters.iter().filter(inside).collect();
    let sides = parameters.iter().flat_map(|&parameter| [(parameter, true), (parameter, false)]);
    let open = |(parameter, above): (&Parameter, bool)| -> Option<Side> {
        let (low, high) = parameter.coordinates();
        let factor = if above { FAR } else { FAR.recip() };
        let coordinate = parameter.coordinate(parameter.start * factor).clamp(low, high);
        let value = parameter.at_coordinate(coordinate);
        // A value that is invalid in the mission (a full well below the notch) is also excluded.
        let chi2 = chi2_held_at(model, data, fit, &parameter.key, value, progress).ok()?;
        let rise = (chi2 - fit.chi2).max(0.0);
        (rise < EXCLUDED).then_some(Side { value, rise })
    };
    let found = parallel::map(sides, open);
    let sides: Vec<Advice> =
        parameters.iter().zip(found.chunks(2)).filter_map(|(parameter, sides)| advice(parameter, sides)).collect();
    // A limit says more than a large error.
    let limited = |key: &str| sides.iter().any(|side| side.limited() == Some(key));
    let said_better = |advice: &&Advice| matches!(advice, Advice::PoorlyConstrained { key, .. } if limited(key));
    let kept: Vec<Advice> = fit.advice.iter().filter(|advice| !said_better(advice)).cloned().collect();
    Ok([kept, sides].concat())
}

/// A value far away that is not excluded.
struct Side {
    value: f64,
    /// Increase of chi2 there, all others refitted.
    rise: f64,
}

/// What the sides of larger and smaller values say of a parameter.
fn advice(parameter: &Parameter, sides: &[Option<Side>]) -> Option<Advice> {
    let (key, unit) = (parameter.key.clone(), parameter.unit);
    let open = |above, side: &Side| Advice::Open { key: key.clone(), above, value: side.value, unit, rise: side.rise };
    match sides {
        [Some(above), Some(below)] => {
            let rise = above.rise.max(below.rise);
            Some(Advice::Undetermined { key, between: [below.value, above.value], unit, rise })
        }
        [Some(above), _] => Some(open(true, above)),
        [_, Some(below)] => Some(open(false, below)),
        _ => None,
    }
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
    Ok(Problem::new(&held, data, &others, progress, |_| true)?.sketched_chi2())
}
