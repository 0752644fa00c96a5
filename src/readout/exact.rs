//! Every transfer, one by one: the meaning of all the other methods.

use std::ops::Range;

use super::Downstream;
use super::pixel::{Block, Passage, Workspace};

/// Clocks one column out, from the pixel farthest from the register to the nearest.
pub(super) fn column<P: Passage>(
    pixel: &P,
    charge_e: &mut [f64],
    downstream: Downstream,
    work: &mut Workspace<P::Levels>,
) {
    work.stages[0].resize(charge_e.len());
    through(pixel, charge_e, 0..charge_e.len() as i64 + downstream.rows, downstream, work);
}

/// Clocks a column through some pixels (0 is nearest to the register), the farthest first.
pub(super) fn through<P: Passage>(
    pixel: &P,
    charge_e: &mut [f64],
    pixels: Range<i64>,
    downstream: Downstream,
    work: &mut Workspace<P::Levels>,
) {
    let found = &mut work.stages[0];
    for nearest in pixels.rev() {
        pixel.pass(charge_e, None, Block { nearest, pixels: 1 }, downstream, &mut work.levels, found);
        for (charge, change) in charge_e.iter_mut().zip(&found.change_e) {
            *charge += change;
        }
    }
}
