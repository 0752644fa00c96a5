//! Whether the readout is computed finely enough to judge by.
//!
//! Coarse numerics fake an effect. The predictions are compared with those of a much finer readout; a shift of a few
//! hundredths of a sigma in any row is too much. A readout that steps over many transfers at a time may choose other steps
//! where parameters have moved, so that for it a third of that is: derivatives must not feel it.

use super::fitted_model::Case;
use super::result::Note;
use crate::error::InputError;
use crate::mission::{Mission, ReadoutMethod};
use crate::model::Model;
use crate::physics::accuracy::{FINEST, LADDER};

/// Largest shift allowed, sigma.
const SHIFT_SIGMA: f64 = 0.03;

/// The same where the accuracy asked for is coarser than this.
const COARSE: f64 = 1e-3;
const COARSE_SHIFT_SIGMA: f64 = 0.01;

/// The mission with the cheapest readout that is fine enough, and what is to be said of its own.
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
