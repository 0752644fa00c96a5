//! Galaxy, background and readout → change of shape.
//!
//! The galaxy stands on a flat background, `transfers` from the register, at every point of a grid of sub-pixel
//! positions. Galaxy plus background are trailed, the trailed background alone is subtracted, and the weighted moments
//! of the difference are compared with those before.

use ndarray::Array2;
use rayon::prelude::*;

use crate::galaxy::{Profile, snr};
use crate::mission::{Galaxy, Mission};
use crate::readout::{Downstream, Readout};
use crate::shape::{Moments, ShapeChange};

/// Half-width of a stamp in units of the weight's σ: the weight has fallen to 4e-6.
const STAMP_WEIGHTS: f64 = 5.0;

/// One galaxy, ready to be trailed.
#[derive(Clone, Debug)]
pub struct Scene {
    background_e: f64,
    weight_px: f64,
    half_px: usize,
    positions: Vec<Position>,
}

/// The galaxy at one sub-pixel position.
#[derive(Clone, Debug)]
struct Position {
    /// Charge above the background, e-.
    charge_e: Array2<f64>,
    before: Moments,
    /// How many positions of the grid this one stands for.
    stands_for: f64,
}

impl Scene {
    /// A mission's galaxy on its grid of sub-pixel positions; None as for [`Scene::new`].
    pub fn of(mission: &Mission, galaxy: &Galaxy) -> Option<Scene> {
        Scene::new(
            &Profile::of(galaxy, &mission.psf),
            snr::flux_e(mission, galaxy),
            mission.sky.background_e,
            galaxy.weight_px,
            mission.accuracy.subpixel_grid,
        )
    }

    /// A galaxy of `flux_e` on a background (e- per pixel), at `grid` × `grid` sub-pixel positions, to be measured with
    /// a weight of `weight_px` (σ).
    ///
    /// None where the weight finds no centroid, which needs a galaxy far larger than its weight.
    pub fn new(profile: &Profile, flux_e: f64, background_e: f64, weight_px: f64, grid: u32) -> Option<Scene> {
        let half_px = half_px(weight_px);
        // The galaxy is symmetric in x, and columns do not know of one another: the position −dx is the mirror image of
        // dx, with the same change of everything but e2 and x, which cancel.
        let positions = (0..grid)
            .flat_map(|i| (0..grid).map(move |j| (offset_px(i, grid), offset_px(j, grid))))
            .filter(|(dx_px, _)| *dx_px >= 0.0)
            .map(|(dx_px, dy_px)| {
                let charge_e = flux_e * profile.stamp(half_px, dx_px, dy_px);
                let before = Moments::of(&charge_e, weight_px)?;
                Some(Position { charge_e, before, stands_for: if dx_px > 0.0 { 2.0 } else { 1.0 } })
            })
            .collect::<Option<Vec<_>>>()?;
        Some(Scene { background_e, weight_px, half_px, positions })
    }

    /// Mean change of shape over the sub-pixel positions, read out from `transfers` away.
    ///
    /// None where the trailed galaxy has no centroid any more.
    pub fn change(&self, readout: &Readout, transfers: u32) -> Option<ShapeChange> {
        let downstream = self.downstream(transfers);
        let background = Array2::from_elem((2 * self.half_px + 1, 1), self.background_e);
        let background = readout.parallel(&background, downstream);
        let changes: Vec<ShapeChange> = self
            .positions
            .par_iter()
            .map(|position| {
                let trailed = readout.parallel(&(&position.charge_e + self.background_e), downstream) - &background;
                let after = Moments::of(&trailed, self.weight_px)?;
                Some(ShapeChange::between(&position.before, &after))
            })
            .collect::<Option<_>>()?;
        let weights = self.positions.iter().map(|position| position.stands_for);
        let total: f64 = weights.clone().sum();
        let mean = |value: fn(&ShapeChange) -> f64| -> f64 {
            weights.clone().zip(&changes).map(|(weight, change)| weight * value(change)).sum::<f64>() / total
        };
        Some(ShapeChange {
            delta_e1: mean(|change| change.delta_e1),
            delta_e2: 0.0,
            delta_x_px: 0.0,
            delta_y_px: mean(|change| change.delta_y_px),
            delta_size: mean(|change| change.delta_size),
            delta_flux: mean(|change| change.delta_flux),
        })
    }

    /// Size, ellipticity and weighted flux before the readout, at the first position of the grid.
    pub fn before(&self) -> &Moments {
        &self.positions[0].before
    }

    /// The central row makes `transfers` transfers; what lies downstream of the stamp is background.
    fn downstream(&self, transfers: u32) -> Downstream {
        downstream(transfers, self.half_px, self.background_e)
    }
}

/// What lies downstream of a stamp of 2 `half_px` + 1 rows whose central row makes `transfers` transfers.
pub(crate) fn downstream(transfers: u32, half_px: usize, background_e: f64) -> Downstream {
    Downstream { rows: i64::from(transfers) - 1 - half_px as i64, charge_e: background_e }
}

/// Half-width of a stamp for a weight, px.
pub(crate) fn half_px(weight_px: f64) -> usize {
    (STAMP_WEIGHTS * weight_px).ceil() as usize
}

/// Position `index` of `grid` evenly spaced ones within a pixel, from its centre, px.
fn offset_px(index: u32, grid: u32) -> f64 {
    (f64::from(index) + 0.5) / f64::from(grid) - 0.5
}
