//! Whether the readout is computed accurately enough for a verdict.
//!
//! Coarse numerics can imitate an effect. The predictions are compared with those of a much finer readout; a shift of a few
//! hundredths of a sigma in any row is too large. A multirevolution readout may choose other steps when parameters change, so its
//! limit is a third of that: derivatives must not be affected.

use super::fitted_model::Case;
use super::result::Note;
use crate::error::InputError;
use crate::mission::{Mission, ReadoutMethod};
use crate::model::Model;
use crate::physics::accuracy::{FINEST, LADDER};

/// Largest shift allowed, sigma.
const SHIFT_SIGMA: f64 = 0.03;

/// The same if the accuracy requested is coarser than this.
const COARSE: f64 = 1e-3;
const COARSE_SHIFT_SIGMA: f64 = 0.01;

/// The mission with the cheapest readout that is accurate enough, and notes on its own readout.
pub(super) fn accurate(case: &Case, mission: &Mission) -> Result<(Mission, Vec<Note>), InputError> {
    let with = |(relative, subpixel_grid): (f64, u32)| {
        let mut other = mission.clone();
        other.accuracy.readout = ReadoutMethod::Fast;
        other.accuracy.relative = relative;
        other.accuracy.subpixel_grid = subpixel_grid;
        other
    };
    let model = Model::new(mission);
    let predicted = |mission: &Mission| case.predict_sigma(&model.like(mission));
    let fine = predicted(&with(FINEST))?;
    let mut notes = Vec::new();
    let shift = (predicted(mission)? - &fine).amax();
    if shift > SHIFT_SIGMA {
        notes.push(Note::CoarseReadout { shift_sigma: shift });
    }
    for accuracy in LADDER {
        let candidate = with(accuracy);
        let allowed = if accuracy.0 > COARSE { COARSE_SHIFT_SIGMA } else { SHIFT_SIGMA };
        if (predicted(&candidate)? - &fine).amax() < allowed {
            return Ok((candidate, notes));
        }
    }
    Ok((with(FINEST), notes))
}
