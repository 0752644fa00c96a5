//! The judged galaxy at its sub-pixel positions, as charges: for studies that do more to an image than reading it out.

use std::num::NonZeroUsize;

use gauss_quad::GaussLegendre;
use ndarray::Array2;
use rayon::prelude::*;

use crate::error::InputError;
use crate::galaxy::{Profile, snr};
use crate::mission::Mission;
use crate::model::half_px;
use crate::shape::{Moments, ShapeChange};

/// A galaxy at the positions of its mission's grid: Gauss and Legendre's along the transfers, evenly spaced across them, of which
/// one of each pair of mirror images.
pub(super) struct Stamps {
    /// Rows and columns on each side of the central one.
    pub half_px: usize,
    pub weight_px: f64,
    /// Charge above the background (e-), moments and weight of each position.
    positions: Vec<(Array2<f64>, Moments, f64)>,
}

impl Stamps {
    /// Those of the galaxy that a mission judges; None where it has no measurable shape.
    pub fn of(mission: &Mission) -> Option<Stamps> {
        let galaxy = mission.judged_galaxy();
        let grid = mission.accuracy.subpixel_grid as usize;
        let across = (0..grid.div_ceil(2)).map(|index| {
            let mirrored = if 2 * index + 1 == grid { 1.0 } else { 2.0 };
            (0.5 - (index as f64 + 0.5) / grid as f64, mirrored / grid as f64)
        });
        let across: Vec<(f64, f64)> = across.collect();
        let along: Vec<(f64, f64)> = match NonZeroUsize::new(grid) {
            Some(nodes) if grid > 1 => {
                GaussLegendre::new(nodes).iter().map(|(y, weight)| (y / 2.0, weight / 2.0)).collect()
            }
            _ => vec![(0.0, 1.0)],
        };
        let half_px = half_px(galaxy.weight_px);
        let places = |nodes: &[(f64, f64)]| -> Vec<f64> { nodes.iter().map(|(place, _)| *place).collect() };
        let stamps = Profile::of(galaxy, &mission.psf).stamps(half_px, &places(&across), &places(&along));
        let weights = across.iter().flat_map(|(_, x)| along.iter().map(move |(_, y)| x * y));
        let flux_e = snr::flux_e(mission, galaxy);
        let positions = stamps.into_iter().zip(weights).map(|(stamp, weight)| {
            let charge_e = flux_e * stamp;
            let before = Moments::of(&charge_e, galaxy.weight_px)?;
            Some((charge_e, before, weight))
        });
        Some(Stamps { half_px, weight_px: galaxy.weight_px, positions: positions.collect::<Option<_>>()? })
    }

    /// Mean change of shape where `observed` makes of charges above the background (e-) what is measured of them, also above
    /// the background. None where no shape is left.
    ///
    /// # Errors
    /// Those of what is observed.
    pub fn change(
        &self,
        observed: impl Fn(&Array2<f64>) -> Result<Array2<f64>, InputError> + Sync,
    ) -> Result<Option<ShapeChange>, InputError> {
        let one = |(charge_e, before, weight): &(Array2<f64>, Moments, f64)| {
            let after = Moments::of(&observed(charge_e)?, self.weight_px);
            Ok(after.map(|after| (ShapeChange::between(before, &after), *weight)))
        };
        let changes: Vec<Result<Option<(ShapeChange, f64)>, InputError>> = self.positions.par_iter().map(one).collect();
        let changes: Option<Vec<(ShapeChange, f64)>> = changes.into_iter().collect::<Result<_, _>>()?;
        let Some(changes) = changes else { return Ok(None) };
        let sum = changes.iter().fold(ShapeChange::default(), |sum, (change, weight)| sum.plus(change, *weight));
        // Mirror images in x cancel.
        Ok(Some(ShapeChange { delta_e2: 0.0, delta_x_px: 0.0, ..sum }))
    }
}
