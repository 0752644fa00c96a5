//! Galaxy, background and readout → change of shape.
//!
//! The galaxy is placed on a flat background, `transfers` from the register, at every point of a grid of sub-pixel positions.
//! Galaxy plus background are trailed, the trailed background alone is subtracted, and the weighted moments of the difference are
//! compared with those before.
//!
//! The galaxy at x and at −x are mirror images, since its ellipticity has no e2. A detector with identical, independent columns
//! ([`Device::is_mirror_symmetric`]) reads mirror images as mirror images: Δe2 and Δx of the two cancel, everything else is equal,
//! and only one of them is read out. Any other detector reads both.

use std::num::NonZeroUsize;

use gauss_quad::GaussLegendre;
use ndarray::{Array2, s};

use super::device::{Beside, Device};
use crate::error::InputError;
use crate::mission::{Galaxy, Mission};
use crate::numeric::parallel;
use crate::physics::galaxy::{LensedGalaxy, Profile, snr};
use crate::physics::shape::{Moments, ShapeChange};
use crate::readout::Downstream;

/// Half-width of a stamp in units of the weight's σ: there the weight has fallen to 4e-6.
const STAMP_WEIGHTS: f64 = 5.0;

/// Share of the flux below which components of a galaxy are omitted for shear biases: these are ratios of images with the same
/// omissions.
const OF_POPULATIONS: f64 = 1e-6;

/// One galaxy, ready to be trailed.
#[derive(Clone, Debug)]
pub struct Scene {
    background_e: f64,
    weight_px: f64,
    half_px: usize,
    positions: Vec<Position>,
    /// Whether the galaxy equals its mirror image in x: its e2 is 0.
    is_even: bool,
}

/// The galaxy at one sub-pixel position, and at its mirror image in x.
#[derive(Clone, Debug)]
struct Position {
    /// Charge above the background, e-.
    charge_e: Array2<f64>,
    before: Moments,
    /// Weight of both together.
    weight: f64,
    /// At the centre of a column: it is its own mirror image.
    centred: bool,
}

impl Scene {
    /// A mission's galaxy at the given numbers of sub-pixel positions in x and in y; None as for [`Scene::new`].
    pub(super) fn of(mission: &Mission, galaxy: &Galaxy, positions: [u32; 2]) -> Option<Scene> {
        Scene::new(
            &Profile::of(galaxy, &mission.psf),
            snr::flux_e(mission, galaxy),
            mission.sky.background_e,
            galaxy.weight_px,
            positions,
        )
    }

    /// A galaxy of `flux_e` on a background (e- per pixel), at the given numbers of sub-pixel positions in x and in y, to be
    /// measured with a weight of `weight_px` (σ).
    ///
    /// None if the weight finds no centroid, as for a galaxy far larger than its weight.
    pub(super) fn new(
        profile: &Profile,
        flux_e: f64,
        background_e: f64,
        weight_px: f64,
        [in_x, in_y]: [u32; 2],
    ) -> Option<Scene> {
        Scene::at(profile, flux_e, background_e, weight_px, &across(in_x), &along(in_y))
    }

    /// The same at given positions (px from the centre of the central pixel) in x and in y with their weights. Each position in x
    /// also represents its mirror image: its weight is that of both.
    pub(super) fn at(
        profile: &Profile,
        flux_e: f64,
        background_e: f64,
        weight_px: f64,
        across: &[(f64, f64)],
        along: &[(f64, f64)],
    ) -> Option<Scene> {
        let half_px = half_px(weight_px);
        let places = |nodes: &[(f64, f64)]| -> Vec<f64> { nodes.iter().map(|(place, _)| *place).collect() };
        let stamps = profile.stamps(half_px, &places(across), &places(along));
        let nodes =
            across.iter().flat_map(|(x_px, in_x)| along.iter().map(move |(_, in_y)| (*x_px == 0.0, in_x * in_y)));
        let positions = stamps
            .into_iter()
            .zip(nodes)
            .map(|(stamp, (centred, weight))| {
                let charge_e = flux_e * stamp;
                let before = Moments::of(&charge_e, weight_px)?;
                Some(Position { charge_e, before, weight, centred })
            })
            .collect::<Option<Vec<_>>>()?;
        Some(Scene { background_e, weight_px, half_px, positions, is_even: true })
    }

    /// A galaxy that need not be its own mirror image in x, through a PSF: as [`Scene::new`], at positions in the whole pixel.
    pub(super) fn lensed(
        galaxy: &LensedGalaxy,
        flux_e: f64,
        weight_px: f64,
        mission: &Mission,
        [in_x, in_y]: [u32; 2],
    ) -> Option<Scene> {
        let background_e = mission.sky.background_e;
        let profile = Profile::lensed(galaxy, &mission.psf, OF_POPULATIONS);
        if [galaxy.ellipticity[1], galaxy.shear[1], galaxy.psf_shear[1]] == [0.0; 3] {
            return Scene::new(&profile, flux_e, background_e, weight_px, [in_x, in_y]);
        }
        let both_sides = |(x_px, weight): (f64, f64)| match x_px {
            0.0 => vec![(0.0, weight)],
            _ => vec![(x_px, 0.5 * weight), (-x_px, 0.5 * weight)],
        };
        let across: Vec<(f64, f64)> = across(in_x).into_iter().flat_map(both_sides).collect();
        let scene = Scene::at(&profile, flux_e, background_e, weight_px, &across, &along(in_y))?;
        Some(Scene { is_even: false, ..scene })
    }

    /// Mean e1 and e2 before the readout over the sub-pixel positions.
    pub(super) fn ellipticity_before(&self) -> [f64; 2] {
        let total: f64 = self.positions.iter().map(|position| position.weight).sum();
        let mean = |of: fn(&Moments) -> f64| {
            self.positions.iter().map(|position| position.weight * of(&position.before)).sum::<f64>() / total
        };
        [mean(|moments| moments.e1), if self.is_even { 0.0 } else { mean(|moments| moments.e2) }]
    }

    /// Mean change of shape over the sub-pixel positions, read out by a device under its conditions.
    ///
    /// None if the trailed galaxy has no centroid.
    ///
    /// # Errors
    /// If an effect has no value.
    pub(super) fn change_by(&self, device: &Device) -> Result<Option<ShapeChange>, InputError> {
        let downstream = downstream(device.at.transfers, self.half_px, device.at.background_e);
        let beside = Beside::Stamp(self.half_px);
        let columns = device.columns_of_background(self.width_px());
        let alone = match columns > 1 || device.method.is_random() {
            true => {
                let flat = Array2::from_elem((self.width_px(), columns), device.at.background_e);
                Some(device.expected().read(&flat, downstream, beside)?)
            }
            false => None,
        };
        let above = Above::new(device.at.background_e, alone, |image| device.read(image, downstream, beside));
        self.mean(device.is_mirror_symmetric(), |charge_e| above.read(charge_e))
    }

    /// Mean change of shape over the sub-pixel positions. `observed` turns charges above the background (e-) into measured ones,
    /// also above the background; `symmetric` if it maps mirror images in x to mirror images. None if the shape is lost.
    ///
    /// # Errors
    /// Those of `observed`.
    pub(crate) fn mean(
        &self,
        symmetric: bool,
        observed: impl Fn(&Array2<f64>) -> Result<Array2<f64>, InputError> + Sync,
    ) -> Result<Option<ShapeChange>, InputError> {
        let seen = |before: &Moments, charge_e: &Array2<f64>| -> Result<Option<ShapeChange>, InputError> {
            let read_e = observed(charge_e)?;
            if read_e == *charge_e {
                // Nothing changed; a new centroid would only show rounding.
                return Ok(Some(ShapeChange::default()));
            }
            let after = Moments::near(&read_e, self.weight_px, [before.x_px, before.y_px]);
            Ok(after.map(|after| ShapeChange::between(before, &after)))
        };
        let both = |position: &Position| -> Result<Option<ShapeChange>, InputError> {
            let Some(change) = seen(&position.before, &position.charge_e)? else { return Ok(None) };
            if symmetric && self.is_even {
                return Ok(Some(ShapeChange { delta_e2: 0.0, delta_x_px: 0.0, ..change }));
            }
            if position.centred || !self.is_even {
                return Ok(Some(change));
            }
            let mirrored = position.charge_e.slice(s![.., ..;-1]).to_owned();
            let mirrored = seen(&position.before.mirrored(), &mirrored)?;
            Ok(mirrored.map(|mirrored| ShapeChange::default().plus(&change, 0.5).plus(&mirrored, 0.5)))
        };
        let changes: Option<Vec<ShapeChange>> = parallel::try_map(&self.positions, both)?.into_iter().collect();
        let total: f64 = self.positions.iter().map(|position| position.weight).sum();
        let mean = |changes: Vec<ShapeChange>| {
            let sum = changes.iter().zip(&self.positions);
            let sum = sum.fold(ShapeChange::default(), |sum, (change, position)| sum.plus(change, position.weight));
            ShapeChange::default().plus(&sum, 1.0 / total)
        };
        Ok(changes.map(mean))
    }

    /// Charge above the background (e-) at each sub-pixel position that is read out, with its weight; the weights sum to 1. Mirror
    /// images are omitted if they are read alike.
    pub(super) fn positions_read(&self, symmetric: bool) -> Vec<(Array2<f64>, f64)> {
        let total: f64 = self.positions.iter().map(|position| position.weight).sum();
        let mut read = Vec::new();
        for Position { charge_e, weight, centred, .. } in &self.positions {
            let weight = weight / total;
            if symmetric || *centred || !self.is_even {
                read.push((charge_e.clone(), weight));
            } else {
                let mirrored = charge_e.slice(s![.., ..;-1]).to_owned();
                read.extend([(charge_e.clone(), 0.5 * weight), (mirrored, 0.5 * weight)]);
            }
        }
        read
    }

    /// σ of the weight, px.
    pub(super) fn weight_px(&self) -> f64 {
        self.weight_px
    }

    /// Rows, and columns, on each side of the central one.
    pub(crate) fn half_px(&self) -> usize {
        self.half_px
    }

    /// Rows, and columns, of the stamp.
    pub(crate) fn width_px(&self) -> usize {
        2 * self.half_px + 1
    }

    /// Size, ellipticity and weighted flux before the readout, at the first position of the grid.
    pub fn before(&self) -> &Moments {
        &self.positions[0].before
    }

    /// Charge of the brightest pixel with its background, e-.
    pub fn peak_e(&self) -> f64 {
        let brightest = self.positions.iter().flat_map(|position| &position.charge_e).copied().fold(0.0, f64::max);
        self.background_e + brightest
    }
}

/// Objects on a flat background as read out, less the background as read out alone.
///
/// One column of background is read beside each image. It hardly changes, and the error that matters is relative to the
/// displacement of the object; read out by itself it would get an accuracy of its own, which takes longer than all the rest.
pub(crate) struct Above<R> {
    background_e: f64,
    /// The background as it is read alone, if it cannot stand beside the images: in one column, or in all of them.
    alone: Option<Array2<f64>>,
    read: R,
}

impl<R: Fn(&Array2<f64>) -> Result<Array2<f64>, InputError>> Above<R> {
    /// `read` reads images, their background included.
    pub fn new(background_e: f64, alone: Option<Array2<f64>>, read: R) -> Above<R> {
        Above { background_e, alone, read }
    }

    /// What is read above the background of the charge above the background, e-.
    ///
    /// # Errors
    /// If an effect has no value.
    pub fn read(&self, charge_e: &Array2<f64>) -> Result<Array2<f64>, InputError> {
        let (rows, width) = charge_e.dim();
        let beside = usize::from(self.alone.is_none());
        let mut image = Array2::from_elem((rows, width + beside), self.background_e);
        for (mut row, charge_e) in image.rows_mut().into_iter().zip(charge_e.rows()) {
            row.iter_mut().zip(charge_e).for_each(|(pixel_e, charge_e)| *pixel_e += charge_e);
        }
        let read = (self.read)(&image)?;
        let alone = self.alone.as_ref().map_or_else(|| read.slice(s![.., width..]), |alone| alone.view());
        if read == image && alone.iter().all(|charge_e| *charge_e == self.background_e) {
            // Nothing happened; differences would only show rounding.
            return Ok(charge_e.clone());
        }
        let mut above = Array2::zeros((rows, width));
        for ((mut above, read), alone) in above.rows_mut().into_iter().zip(read.rows()).zip(alone.rows()) {
            let both = above.iter_mut().zip(read);
            match alone.len() {
                // One column of background stands for all.
                1 => both.for_each(|(above, read)| *above = read - alone[0]),
                _ => both.zip(alone).for_each(|((above, read), alone)| *above = read - alone),
            }
        }
        Ok(above)
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

/// Number of positions in x that are as good as `in_y` positions in y, if columns are independent. The change of shape is then a smooth
/// function of x with the period of a pixel. The error is the part of it that has the frequency of the positions, and a PSF passes little
/// of that. `few_positions_across_are_as_good_as_many` in `scene_golden.rs` prints the errors of both directions.
pub(super) fn positions_across(in_y: u32) -> u32 {
    in_y.min(if in_y > 8 { 4 } else { 2 })
}

/// Positions in x and their weights: evenly spaced, the best rule for a smooth periodic function; one of each pair of
/// mirror images.
fn across(grid: u32) -> Vec<(f64, f64)> {
    let weight = 1.0 / f64::from(grid);
    (0..grid)
        .map(|index| (f64::from(index) + 0.5) * weight - 0.5)
        .filter(|x_px| *x_px > -1e-9)
        .map(|x_px| if x_px > 1e-9 { (x_px, 2.0 * weight) } else { (0.0, weight) })
        .collect()
}

/// Positions in y and their weights: Gauss and Legendre's. The change of shape has a cusp where two rows are equally
/// bright, at the edges of the pixel, and is smooth in between; evenly spaced positions would converge as 1/grid² only.
fn along(grid: u32) -> Vec<(f64, f64)> {
    match NonZeroUsize::new(grid as usize) {
        Some(nodes) if grid > 1 => {
            GaussLegendre::new(nodes).iter().map(|(y, weight)| (y / 2.0, weight / 2.0)).collect()
        }
        _ => vec![(0.0, 1.0)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_fill_the_pixel() {
        for grid in 1..=9 {
            for nodes in [across(grid), along(grid)] {
                assert!((nodes.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(nodes.iter().all(|(place, _)| place.abs() < 0.5));
            }
        }
    }
}
