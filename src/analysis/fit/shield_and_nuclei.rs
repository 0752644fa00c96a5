//! Shield and weight of cosmic-ray nuclei, which a dose over time hardly tells apart: a thicker shield stops more of the solar protons,
//! and so does more weight of the nuclei for their share. If one of them is fitted and the other held, the fit is repeated with the
//! other changed by [`CHANGE`], and both results are told.

use super::result::{Advice, Fit};
use super::solve::{Options, fit_rows};
use crate::analysis::measurement::DataSet;
use crate::error::InputError;
use crate::model::Model;

/// The keys of the two.
const NUCLEI: &str = "environment.nuclei_over_protons";
const SHIELD: [&str; 2] = ["shielding.thickness_mm", "shielding.areal_density_g_cm2"];

/// Relative change of the one that is held: shields are known to about a tenth.
const CHANGE: f64 = 0.1;

/// Increase of chi2 above which the data tell the two apart.
const TOLD_APART: f64 = 9.0;

/// The advice of a fit, with what the one that is fitted owes to the one that is held.
///
/// # Errors
/// As [`super::fit`].
pub(super) fn with_shield_and_nuclei(
    model: &Model,
    data: &[DataSet],
    fit: &Fit,
    options: &Options,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Option<Advice>, InputError> {
    let has = |name: &str| model.history().sources.iter().any(|source| source.name == name);
    if fit.mission.observed_sun().is_none() || !has("cosmic-ray-nuclei") || !has("solar-protons") {
        return Ok(None);
    }
    let keys: Vec<String> = fit.parameters.iter().map(|parameter| parameter.key.clone()).collect();
    let is_free = |key: &str| keys.iter().any(|free| free == key);
    let shield = SHIELD.into_iter().find(|key| fit.mission.number(key).is_some());
    let (Some(shield), true) = (shield, fit.mission.number(NUCLEI).is_some()) else { return Ok(None) };
    let (fitted, held) = match (is_free(NUCLEI), is_free(shield)) {
        (true, false) => (NUCLEI, shield),
        (false, true) => (shield, NUCLEI),
        _ => return Ok(None),
    };
    let value = fit.mission.number(held).expect("a number of the mission");
    let changed = (1.0 + CHANGE) * value;
    let mission = fit.mission.with(&[(held.to_string(), changed.into())])?;
    let other = fit_rows(&model.like(&mission), data, &keys, options, progress, |_| true)?;
    let found = |fit: &Fit| fit.mission.number(fitted).expect("a fitted number");
    let rise = other.chi2 - fit.chi2;
    Ok((rise < TOLD_APART).then(|| Advice::DependsOn {
        key: fitted.into(),
        held: held.into(),
        values: [value, changed],
        found: [found(fit), found(&other)],
        rise,
    }))
}
