//! How accurately a readout is computed, by what it is for. Accuracy is not physics: what it is traded for is time, and the
//! whole trade stands here.
//!
//! A mission asks for `accuracy.relative` (see [`crate::mission::Accuracy`]). A purpose that needs less says how much less, and
//! one that needs more how much more. `tests/suite/readout.rs` compares shapes with every transfer computed, and
//! `ctiplan diagnose` checks its own numerics against [`FINEST`] before it judges.

use crate::mission::Mission;

/// What a readout is computed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A change of shape. Errors of single packets average out in it.
    Shape,
    /// A change of shape that is compared with a measurement: right to a few millionths at the usual 1e-4 of the packets, far
    /// below what any shape is measured to.
    Measurement,
    /// Very many changes of shape: sweeps and trade studies.
    ManyShapes,
    /// A change of shape with noise, which puts packets out of order at every step and has a far larger error of its own.
    Noise,
    /// Draws of inputs that are uncertain by per cents.
    Draws,
    /// The date on which a budget is exceeded, as an aside of a diagnosis.
    Dates,
    /// A galaxy behind a line of injected charge. Accuracy is relative to what the brightest packet loses, and a line is far
    /// brighter than a galaxy.
    BehindLine,
}

impl Purpose {
    /// Accuracy of the readout for this purpose if a mission asks for `relative`. A mission that asks for a coarse
    /// readout gets it.
    pub fn relative(self, relative: f64) -> f64 {
        let coarser = |times: f64, coarsest: f64| relative.max((times * relative).min(coarsest));
        match self {
            Purpose::Shape => coarser(3.0, 1e-2),
            Purpose::Measurement => coarser(10.0, 1e-3),
            Purpose::ManyShapes => coarser(30.0, 1e-3),
            // What noise adds to the change of SNAP's galaxies is the same within 1e-3 at 1e-4 and at 1e-2.
            Purpose::Noise => relative.max(1e-2),
            Purpose::Dates => relative.max(1e-4),
            Purpose::Draws => relative.max(1e-3),
            Purpose::BehindLine => 0.1 * relative,
        }
    }

    /// Sub-pixel positions in x and in y for this purpose if a mission asks for so many.
    pub fn grid(self, positions: u32) -> u32 {
        match self {
            // A quarter of the positions, 4e-4 off, show per cents as well (docs/why.md).
            Purpose::Draws => positions.min(2),
            _ => positions,
        }
    }

    /// The mission with the accuracy of this purpose.
    pub fn of(self, mission: &Mission) -> Mission {
        let mut mission = mission.clone();
        mission.accuracy.relative = self.relative(mission.accuracy.relative);
        mission.accuracy.subpixel_grid = self.grid(mission.accuracy.subpixel_grid);
        mission
    }
}

/// Default accuracy of whole frames: they have thousands of columns, and noise in each.
pub const OF_FRAMES: f64 = 1e-3;

/// Coarser than this, the accuracy of a mission may show in its shapes.
pub const SHOWS_IN_SHAPES: f64 = 1e-3;

/// Accuracy and grid of sub-pixel positions that others are compared with.
pub const FINEST: (f64, u32) = (1e-8, 12);

/// Accuracies and grids that a diagnosis may choose, the cheapest first.
pub const LADDER: [(f64, u32); 13] = [
    (1e-1, 2),
    (3e-2, 2),
    (1e-2, 2),
    (1e-3, 2),
    (1e-4, 2),
    (1e-4, 3),
    (1e-4, 4),
    (1e-5, 4),
    (1e-4, 6),
    (1e-5, 6),
    (1e-5, 8),
    (1e-6, 8),
    (1e-7, 12),
];
