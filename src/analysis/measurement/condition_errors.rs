//! Errors of conditions, as errors of the value.
//!
//! A value m(c) whose condition c has the error σ_c has, besides its own error, one of |∂m/∂c| σ_c (Taylor 1997, An Introduction to
//! Error Analysis, section 3.11); independent errors add in quadrature. The derivative is that of a mission, over one σ_c to either
//! side.

use super::Row;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::model::predict::{Question, predict};
use crate::physics::conditions::{Conditions, Stated};
use crate::physics::observable::Observable;

/// Sets the errors of the rows to those of their values and, at a mission, of their conditions.
///
/// # Errors
/// If the model has no value.
pub(super) fn add(rows: &mut [Row], observable: Observable, mission: &Mission) -> Result<(), InputError> {
    let moved: Vec<(usize, f64, [Stated; 2])> = rows
        .iter()
        .enumerate()
        .flat_map(|(place, row)| row.condition_sigmas.iter().filter_map(move |one| around(row, one, place)))
        .collect();
    if moved.is_empty() {
        return Ok(());
    }
    let model = Model::new(mission);
    let [low, high] = [0, 1].map(|side| {
        let side_of = moved.iter().map(|(place, _, sides)| (&rows[*place], &sides[side]));
        let questions = side_of.map(|(row, at)| Question { at, ..row.question(observable) });
        predict(&model, &questions.collect::<Vec<_>>())
    });
    let (low, high) = (low?, high?);
    for row in rows.iter_mut() {
        row.sigma = row.value_sigma;
    }
    for (index, (place, share, _)) in moved.iter().enumerate() {
        let off = share * (high[index] - low[index]);
        if off.is_finite() {
            rows[*place].sigma = rows[*place].sigma.hypot(off);
        }
    }
    Ok(())
}

/// A row's conditions with one of them lower and higher by a standard error, and the fraction of their difference that is the error
/// of the value; None if the condition is exact, or missing in the row.
fn around(row: &Row, (name, sigma): &(&'static str, f64), place: usize) -> Option<(usize, f64, [Stated; 2])> {
    let here = row.at.get(name).filter(|_| *sigma > 0.0)?;
    // Integers move by at least one.
    let step = if Conditions::is_whole(name) { sigma.round().max(1.0) } else { *sigma };
    let least = if Conditions::is_whole(name) { 1.0 } else { 0.0 };
    let (low, high) = ((here - step).max(least), here + step);
    let sides = [row.at.with(name, low)?, row.at.with(name, high)?];
    Some((place, sigma / (high - low), sides))
}
