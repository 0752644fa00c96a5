//! Model against measurements: size and location of the deviations, and the conditions with which the residuals trend.
//!
//! Nothing is adjusted here. A residual is (value − model)/sigma.

mod findings;
mod json;
pub mod residual_trend;
mod result;
mod scatter;

use nalgebra::DMatrix;

use crate::analysis::independence::Independence;
use crate::analysis::likelihood::Likelihood;
use crate::analysis::measurement::{DataSet, questions, some_rows};
use crate::analysis::noise;
use crate::analysis::whitening::Whitening;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::predict;
use crate::numeric::parallel;
use residual_trend::Trial;
pub use result::{Claim, Finding, Likeliest, SetResult, Validation};
pub(crate) use result::{SPOKEN, chi2_chances, file_stem, plain_name};

/// Compares a mission with data, with the errors as quoted and with those that are likeliest if the mission is right. The seed is for the
/// simulated noise with which residual trends are compared.
///
/// # Errors
/// If there are no rows, or the model has no value for one.
pub fn validate(mission: &Mission, data: &[DataSet], seed: u64) -> Result<Validation, InputError> {
    let quoted = compared(mission, data, seed)?;
    let model: Vec<f64> = quoted.sets.iter().flat_map(|set| set.model.iter().copied()).collect();
    let likelihood = Likelihood::of(data);
    let off = likelihood.off(&model);
    let errors = likelihood.errors(&off, None);
    let noise = noise::of(&likelihood, data, &errors, &off);
    let allowed = noise::allowed_for(data, &noise, &likelihood, Some(&errors));
    let off_sigma: Vec<f64> =
        allowed.iter().flat_map(|set| &set.rows).zip(&off).map(|(row, off)| off / row.sigma).collect();
    let chi2 = Whitening::of(&allowed, |_| true).linear(&off_sigma).iter().map(|residual| residual * residual).sum();
    Ok(Validation { likeliest: Some(Likeliest { noise, chi2 }), ..quoted })
}

/// The same with the errors as quoted alone.
pub(crate) fn compared(mission: &Mission, data: &[DataSet], seed: u64) -> Result<Validation, InputError> {
    some_rows(data, "cannot compare the model with measurements")?;
    let model = Model::new(mission);
    let values = predict(&model, &questions(data))?;
    let mut sets = Vec::new();
    let mut rest = values.as_slice();
    for set in data {
        let (values, after) = rest.split_at(set.rows.len());
        rest = after;
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            let fault = set.table.fault(Some(row), None, format!("the model has no {} here", set.observable));
            return Err(fault.with_help("the galaxy has lost its shape: so large a change cannot be measured"));
        }
        sets.push(SetResult::new(set, values.to_vec()));
    }
    let chi2 = sets.iter().map(|set| set.chi2).sum();
    let n = sets.iter().map(|set| set.data.rows.len()).sum();
    let conditions = sets
        .iter()
        .enumerate()
        .flat_map(|(index, set)| set.data.varying.iter().map(move |name| (index, &set.data, name)));
    let trials: Vec<Trial> =
        parallel::map(conditions, |(index, data, name)| Trial::of(index, data, name)).into_iter().flatten().collect();
    let residuals: Vec<Vec<f64>> = sets.iter().map(SetResult::residuals).collect();
    let scatter: Vec<f64> = sets.iter().map(SetResult::noise_sigma).collect();
    let trends = residual_trend::all(&trials, &residuals, &scatter, seed);
    let independence = Independence::of(data, &values, &DMatrix::zeros(n, 0));
    let findings = findings::of(&sets, &trends, &independence);
    Ok(Validation { mission: mission.clone(), sets, chi2, n, trends, independence, findings, likeliest: None })
}
