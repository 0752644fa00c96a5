//! Every transfer, one by one: the meaning of all the other methods.

use super::Downstream;
use super::pixel::{Block, Passage, Workspace};

/// Clocks one column out, from the pixel farthest from the register to the nearest.
pub(super) fn column<P: Passage>(
    pixel: &P,
    charge_e: &mut [f64],
    downstream: Downstream,
    work: &mut Workspace<P::Levels>,
) {
    let found = &mut work.stages[0];
    found.resize(charge_e.len());
    for nearest in (0..charge_e.len() as i64 + downstream.rows).rev() {
        pixel.pass(charge_e, None, Block { nearest, pixels: 1 }, downstream, &mut work.levels, found);
        for (charge, change) in charge_e.iter_mut().zip(&found.change_e) {
            *charge += change;
        }
    }
}
