//! Mission, measurements and free keys → values with errors.
//!
//! Weighted least squares by the Levenberg-Marquardt method (the crate's port of MINPACK), in coordinates without bounds
//! (`problem`, `parameter`, `minimise`), from one start or several (`solve`, `elsewhere`). Errors are those of linear theory at the
//! optimum, from derivatives with respect to the parameters themselves (`errors`), larger if the model is curved
//! (`profile_errors`); parameters that the data do not limit on one side are reported (`open_sides`). Species exchanged by a fit
//! get their own values back (`species_order`), and a cycle its maximum nearest to the mission (`plainer`). With the epoch of
//! an event (a flare, a bakeout) chi2 jumps at the epochs of the data, so the intervals between these are tried one after another;
//! the result is the centre of all times that fit equally well, and errors and correlations include those times
//! (`event_epochs`).

mod advice;
mod elsewhere;
mod errors;
mod event_epochs;
pub mod holdout;
mod minimise;
pub(crate) mod open_sides;
pub mod parameter;
mod plainer;
pub mod posterior;
mod problem;
pub mod profile;
pub(crate) mod profile_errors;
mod result;
mod shield_and_nuclei;
mod solve;
pub(crate) mod species_order;

use crate::analysis::independence::Independence;
use crate::analysis::measurement::{self, DataSet};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
pub(crate) use plainer::epochs_yr;
use result::is_same;
pub use result::{Advice, Combination, Fit, Fitted, Minimum, Term};
pub use solve::Options;
pub(crate) use solve::fit_rows;

/// Fits at most, each with the errors of conditions derived at the result of the one before.
const FITS: usize = 8;

/// Adjusts the values of `keys` in a mission to data. `progress` is called with chi2 after every evaluation of the model.
///
/// Errors of conditions (`sigma_CONDITION`) are those at the result: see [`measurement::with_errors_at`].
///
/// # Errors
/// If a key is not a number of the mission, or is duplicate, there are fewer rows than keys, or the model has no value for a row.
pub fn fit(
    mission: &Mission,
    data: &[DataSet],
    keys: &[String],
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Fit, InputError> {
    let mut fit = with_errors_as_given(mission, data, keys, options, progress)?;
    if keys.is_empty() || !data.iter().any(DataSet::has_condition_errors) {
        return Ok(fit);
    }
    for fits in 2..=FITS {
        let data = measurement::with_errors_at(data.to_vec(), &fit.mission)?;
        let again = with_errors_as_given(&fit.mission, &data, keys, options, progress)?;
        let change = again.chi2 - fit.chi2;
        let settled = is_same(again.chi2, fit.chi2) && is_same(fit.chi2, again.chi2);
        fit = fit.replaced_by(again);
        if settled {
            break;
        }
        if fits == FITS {
            fit.advice.push(Advice::Unsettled { fits, change });
        }
    }
    Ok(fit)
}

/// The same with the errors of the rows as they are.
fn with_errors_as_given(
    mission: &Mission,
    data: &[DataSet],
    keys: &[String],
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Fit, InputError> {
    let model = Model::new(mission);
    let fit = fit_rows(&model, data, keys, options, progress, |_| true)?;
    let fit = species_order::kept(&model, data, fit, options, progress);
    let fit = plainer::plainer(&model, data, fit, options, progress);
    let model = model.like(&fit.mission);
    let parameters = profile_errors::widened(&model, data, &fit, progress)?;
    let mut advice = open_sides::with_open_sides(&model, data, &fit, &parameters, progress)?;
    advice.extend(shield_and_nuclei::with_shield_and_nuclei(&model, data, &fit, options, progress)?);
    let independence = Independence::of(data, &fit.values, &fit.jacobian);
    let warnings = data.iter().filter_map(|set| set.warning.clone()).collect();
    Ok(Fit { parameters, advice, independence, warnings, ..fit })
}
