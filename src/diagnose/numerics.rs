//! Whether the readout is computed finely enough to judge by.
//!
//! Coarse numerics fake an effect. The predictions are compared with those of a readout a hundred times finer; a shift of a
//! twentieth of a sigma in any row is too much.

use super::case::Case;
use crate::error::InputError;
use crate::mission::{Mission, ReadoutMethod};
use crate::model::Model;

/// Largest shift allowed, sigma.
const SHIFT_SIGMA: f64 = 0.05;

/// Accuracies that are tried, the cheapest first.
const ACCURACIES: [f64; 3] = [1e-5, 1e-6, 1e-7];

/// The mission with the cheapest readout that is fine enough, and what is to be said of its own.
pub(super) fn accurate(case: &Case, mission: &Mission) -> Result<(Mission, Vec<String>), InputError> {
    let with = |relative: f64| {
        let mut other = mission.clone();
        other.accuracy.readout = ReadoutMethod::Fast;
        other.accuracy.relative = relative;
        other
    };
    let model = Model::new(mission);
    let predicted = |mission: &Mission| case.predict_sigma(&model.like(mission));
    let fine = predicted(&with(1e-8))?;
    let mut notes = Vec::new();
    let shift = (predicted(mission)? - &fine).amax();
    if shift > SHIFT_SIGMA {
        notes.push(format!(
            "the mission's own readout ([accuracy]) is off by up to {shift:.1} sigma from a finer one, which is used here"
        ));
    }
    for relative in ACCURACIES {
        let candidate = with(relative);
        if (predicted(&candidate)? - &fine).amax() < SHIFT_SIGMA {
            return Ok((candidate, notes));
        }
    }
    Ok((with(1e-8), notes))
}
