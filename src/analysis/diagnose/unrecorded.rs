//! The temperature, which differs from epoch to epoch in flight although no column may say so.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::fitted_model::{Case, FLAT, Node};
use super::result::Note;
use crate::model::Model;
use crate::numeric::least_squares::Span;

/// The condition, and a step of it for derivatives, K.
const TEMPERATURE: &str = "temperature_k";
const STEP_K: f64 = 0.1;

/// Largest difference from the temperature assumed, K.
const FARTHEST_K: f64 = 20.0;

/// Steps of the fit of one temperature per epoch.
const ITERATIONS: usize = 8;

/// Rows of an epoch, on average, below which a temperature of its own would explain anything.
const ROWS_OF_AN_EPOCH: usize = 4;

/// Probability of a larger chi2 above which temperatures explain the data.
const EXPLAINED: f64 = 1e-3;

/// Whether a temperature of its own for every epoch, with the free parameters, explains what no effect does.
pub(super) fn temperatures(case: &Case, node: &Node) -> Option<Note> {
    let (epochs, epoch_of) = epochs(case);
    let freedom = case.n().checked_sub(epochs.len() + node.basis.ncols()).filter(|freedom| *freedom > 0)?;
    let explained = |chi2: f64, freedom: f64| ChiSquared::new(freedom).expect("above 0").sf(chi2) > EXPLAINED;
    if are_too_many(&epochs, case) || explained(node.chi2(), node.freedom()) {
        return None;
    }
    let off_sigma = |values: &[f64]| -> DVector<f64> {
        let off =
            case.values.iter().zip(values).zip(&case.sigmas).map(|((value, model), sigma)| (value - model) / sigma);
        DVector::from_vec(case.whitening.linear(&off.collect::<Vec<_>>()))
    };
    let mut kelvin = vec![0.0; epochs.len()];
    let mut chi2 = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let here = with_temperatures(case, &node.model, &|row| kelvin[epoch_of[row]])?;
        let warmer = with_temperatures(case, &node.model, &|row| kelvin[epoch_of[row]] + STEP_K)?;
        let residuals = off_sigma(&here);
        let of_epoch = |epoch: usize| {
            let at = |row: usize| if epoch_of[row] == epoch { warmer[row] } else { here[row] };
            (&residuals - off_sigma(&(0..case.n()).map(at).collect::<Vec<_>>())) / STEP_K
        };
        let columns: Vec<DVector<f64>> =
            (0..epochs.len()).map(of_epoch).chain(node.basis.column_iter().map(|column| column.into_owned())).collect();
        let columns = DMatrix::from_columns(&columns);
        let steps = Span::of(&columns, FLAT).solve(&residuals);
        chi2 = (&residuals - columns * &steps).norm_squared();
        for (kelvin, step) in kelvin.iter_mut().zip(steps.iter()) {
            *kelvin = (*kelvin + step).clamp(-FARTHEST_K, FARTHEST_K);
        }
    }
    let range_k = [f64::min, f64::max].map(|end| kelvin.iter().copied().reduce(end).expect("two epochs"));
    let chi2 = [node.chi2(), chi2];
    let note = Note::EpochTemperatures { epochs: epochs.len(), range_k, chi2, n: case.n() };
    explained(chi2[1], freedom as f64).then_some(note)
}

/// Changes of all values with the temperature of each epoch, per kelvin; None if that changes nothing, or epochs have too few rows.
pub(super) fn per_kelvin(case: &Case, model: &Model, here: &[f64]) -> Option<Vec<Vec<f64>>> {
    let (epochs, epoch_of) = epochs(case);
    if are_too_many(&epochs, case) {
        return None;
    }
    let warmer = with_temperatures(case, model, &|_| STEP_K)?;
    let change = |row: usize| (warmer[row] - here[row]) / STEP_K;
    let of_epoch = |epoch: usize| -> Vec<f64> {
        (0..case.n()).map(|row| if epoch_of[row] == epoch { change(row) } else { 0.0 }).collect()
    };
    let all: Vec<Vec<f64>> =
        (0..epochs.len()).map(of_epoch).filter(|of| of.iter().any(|change| *change != 0.0)).collect();
    (all.len() > 1).then_some(all)
}

/// Whether a temperature of their own would explain anything.
fn are_too_many(epochs: &[f64], case: &Case) -> bool {
    epochs.len() < 2 || epochs.len() * ROWS_OF_AN_EPOCH > case.n()
}

/// Epochs, ascending, and the place of each row's among them.
fn epochs(case: &Case) -> (Vec<f64>, Vec<usize>) {
    let epochs = case.epochs_yr();
    let place = |t_yr: f64| epochs.partition_point(|known| *known < t_yr);
    let places = case.questions.iter().map(|question| place(question.at.t_yr)).collect();
    (epochs, places)
}

/// Values with the temperature of rows changed, in files that do not record it; None if the model has no value.
fn with_temperatures(case: &Case, model: &Model, kelvin: &dyn Fn(usize) -> f64) -> Option<Vec<f64>> {
    case.predict_at(model, &|row, at| {
        if !case.data[case.set_of[row]].varies_in(TEMPERATURE) {
            at.temperature_k += kelvin(row);
        }
        true
    })
}
