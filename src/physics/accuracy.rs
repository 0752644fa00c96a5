//! Accuracy of a readout, by its purpose. Accuracy is not physics: it is traded for computing time, and the whole trade-off is
//! here.
//!
//! A mission requests `accuracy.relative` (see [`crate::mission::Accuracy`]). Each purpose states how much less or more it needs.
//! `tests/suite/readout.rs` compares shapes with every transfer computed, and `ctiplan diagnose` checks its own numerics against
//! [`FINEST`] before its verdict.

use crate::mission::Mission;

/// Purpose of a readout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A change of shape, in which errors of single packets average out.
    Shape,
    /// A change of shape that is compared with a measurement: accurate to a few millionths at the usual 1e-4 of the packets, far
    /// below any measurement error.
    Measurement,
    /// Very many changes of shape: sweeps and trade studies.
    ManyShapes,
    /// A change of shape with noise, whose own error is far larger; noise makes the packets unequal at every step.
    Noise,
    /// Draws of inputs with uncertainties of per cents.
    Draws,
    /// The date on which a budget is exceeded, as a by-product of a diagnosis.
    Dates,
    /// A galaxy behind a line of injected charge. Accuracy is relative to the loss of the brightest packet, and a line is far
    /// brighter than a galaxy.
    BehindLine,
}

impl Purpose {
    /// Accuracy of the readout for this purpose if a mission requests `relative`. A mission that requests a coarse readout gets it.
    pub fn relative(self, relative: f64) -> f64 {
        let coarser = |times: f64, coarsest: f64| relative.max((times * relative).min(coarsest));
        match self {
            Purpose::Shape => coarser(3.0, 1e-2),
            Purpose::Measurement => coarser(10.0, 1e-3),
            Purpose::ManyShapes => coarser(30.0, 1e-3),
            // The effect of noise on the change of SNAP's galaxies agrees within 1e-3 between 1e-4 and 1e-2.
            Purpose::Noise => relative.max(1e-2),
            Purpose::Dates => relative.max(1e-4),
            Purpose::Draws => relative.max(1e-3),
            Purpose::BehindLine => 0.1 * relative,
        }
    }

    /// Sub-pixel positions in x and in y for this purpose if a mission requests `positions`.
    pub fn grid(self, positions: u32) -> u32 {
        match self {
            // A quarter of the positions, with an error of 4e-4, is enough for effects of per cents (docs/why.md).
            Purpose::Draws => positions.min(2),
            _ => positions,
        }
    }

    /// The mission with the accuracy for this purpose.
    pub fn of(self, mission: &Mission) -> Mission {
        let mut mission = mission.clone();
        mission.accuracy.relative = self.relative(mission.accuracy.relative);
        mission.accuracy.subpixel_grid = self.grid(mission.accuracy.subpixel_grid);
        mission
    }
}

/// Default accuracy of whole frames: they have thousands of columns, each with noise.
pub const OF_FRAMES: f64 = 1e-3;

/// If coarser than this, the accuracy of a mission may affect its shapes.
pub const SHOWS_IN_SHAPES: f64 = 1e-3;

/// Reference accuracy and grid of sub-pixel positions.
pub const FINEST: (f64, u32) = (1e-8, 12);

/// Accuracies and grids available to a diagnosis, the cheapest first.
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
