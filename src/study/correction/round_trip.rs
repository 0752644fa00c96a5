//! A galaxy read out through the true detector, and corrected with the assumed detector.

use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson};

use super::Knowledge;
use crate::error::InputError;
use crate::image::iterated;
use crate::model::{Above, Beside, Device, Model, Scene, downstream};
use crate::numeric::estimate::with_errors;
use crate::numeric::parallel;
use crate::physics::galaxy::{Profile, snr};
use crate::physics::shape::{Moments, ShapeChange};
use crate::readout::Downstream;
use crate::study::Estimate;

/// Share of a difference that is added to a galaxy: small enough for a linear response of its shape.
const FIRST_ORDER: f64 = 1e-3;

/// Random streams of the noise, separate from those of the draws.
const NOISE: u64 = 1 << 32;

/// An image (e-, with background) before the transfers, from the observed image and an assumed detector.
pub fn corrected(
    believed: &Device,
    observed_e: &Array2<f64>,
    downstream: Downstream,
    beside: Beside,
    iterations: u32,
) -> Result<Array2<f64>, InputError> {
    iterated(observed_e, iterations, |image| believed.read(image, downstream, beside))
}

/// A galaxy on its way through a detector and back.
pub struct RoundTrip<'a> {
    model: &'a Model,
    t_yr: f64,
    scene: &'a Scene,
    truth: Device,
    downstream: Downstream,
    iterations: u32,
    /// Change of shape without correction.
    pub uncorrected: ShapeChange,
}

impl<'a> RoundTrip<'a> {
    /// The judged galaxy at a time (years since launch). None if no shape is left to correct.
    ///
    /// # Errors
    /// If a formula has no value, here and below.
    pub fn new(model: &'a Model, t_yr: f64, iterations: u32) -> Result<Option<RoundTrip<'a>>, InputError> {
        let truth = model.device_at(t_yr)?;
        let (Some(scene), Some(uncorrected)) = (model.scene(0), model.change_by(0, &truth)?) else {
            return Ok(None);
        };
        let downstream = downstream(truth.at.transfers, scene.half_px(), truth.at.background_e);
        Ok(Some(RoundTrip { model, t_yr, scene, truth, downstream, iterations, uncorrected }))
    }

    /// Residual change of shape after correction with an assumed detector. None if no shape is left.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn left(&self, believed: &Device) -> Result<Option<ShapeChange>, InputError> {
        let (truth, believed) = (self.truth.expected(), believed.expected());
        let beside = Beside::Stamp(self.scene.half_px());
        let background_e = truth.at.background_e;
        let back = |charge_e: &Array2<f64>| {
            let observed = truth.read(charge_e, self.downstream, beside)?;
            corrected(&believed, &observed, self.downstream, beside, self.iterations)
        };
        let width_px = self.scene.width_px();
        let columns = truth.columns_of_background(width_px).max(believed.columns_of_background(width_px));
        let alone = (columns > 1).then(|| back(&Array2::from_elem((width_px, columns), background_e))).transpose()?;
        let above = Above::new(background_e, alone, back);
        let symmetric = truth.is_mirror_symmetric() && believed.is_mirror_symmetric();
        self.scene.mean(symmetric, |charge_e| above.read(charge_e))
    }

    /// The same with deviations (in σ) of the known parameters. Positive parameters stay positive: errors apply to the logarithm.
    pub fn left_with(&self, knowledge: &Knowledge, deviations: &[f64]) -> Result<Option<ShapeChange>, InputError> {
        let mut settings = Vec::new();
        for ((key, sigma), deviation) in knowledge.parameters.iter().zip(deviations).filter(|(_, z)| **z != 0.0) {
            let value = self.model.mission.number(key).unwrap_or(0.0);
            let believed =
                if value > 0.0 { value * (sigma / value * deviation).exp() } else { value + sigma * deviation };
            settings.push((key.clone(), believed.into()));
        }
        let mission =
            if settings.is_empty() { self.model.mission.clone() } else { self.model.mission.with(&settings)? };
        self.left(&self.model.like(&mission).device_at(self.t_yr)?)
    }

    /// Root mean square residual |Δe| over draws of the parameters, with its standard error. None if a draw leaves no shape.
    pub fn drawn(
        &self,
        knowledge: &Knowledge,
        draws: u32,
        seed: u64,
        advance: &(dyn Fn() + Sync),
    ) -> Result<Option<Estimate>, InputError> {
        let one = |draw: u32| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(u64::from(draw));
            advance();
            self.left_with(knowledge, &knowledge.draw(&mut random))
        };
        let left = parallel::try_map(0..draws, one)?;
        let squares: Option<Vec<f64>> = left.iter().map(|change| Some(change.as_ref()?.magnitude().powi(2))).collect();
        let Some(squares) = squares else { return Ok(None) };
        let rms = |places: &[usize]| {
            vec![(places.iter().map(|place| squares[*place]).sum::<f64>() / places.len() as f64).sqrt()]
        };
        let (value, error) = with_errors(squares.len(), None, seed, rms)[0];
        Ok(error.map(|error| Estimate { value, error }))
    }

    /// Residual with the true model for galaxies with photon noise (before the transfers) and read noise (after them): mean, and
    /// its standard error. None without realisations.
    ///
    /// The difference between the corrected image and the one before the transfers, with the same read noise, is added to the
    /// galaxy without noise, to first order: the result for a stack of many galaxies. (The mean ellipticity of single faint
    /// galaxies is ill-defined: noise brings their size close to 0.)
    pub fn noisy(
        &self,
        read_noise_e: f64,
        realisations: u32,
        seed: u64,
        advance: &(dyn Fn() + Sync),
    ) -> Result<Option<(ShapeChange, ShapeChange)>, InputError> {
        let mission = &self.model.mission;
        let galaxy = mission.judged_galaxy();
        let profile = Profile::of(galaxy, &mission.psf);
        let flux_e = snr::flux_e(mission, galaxy);
        let background_e = self.truth.at.background_e;
        let beside = Beside::Stamp(self.scene.half_px());
        let law = Normal::new(0.0, read_noise_e).expect("a read noise is not negative");
        let believed = self.truth.expected();
        let one = |realisation: u32| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(NOISE + u64::from(realisation));
            let offset_px = [random.random::<f64>() - 0.5, random.random::<f64>() - 0.5];
            let expected = flux_e * profile.stamp(self.scene.half_px(), offset_px[0], offset_px[1]);
            let photons =
                (&expected + background_e).mapv(|mean| Poisson::new(mean).map_or(0.0, |law| law.sample(&mut random)));
            let noise = Array2::from_shape_simple_fn(photons.dim(), || law.sample(&mut random));
            let trailed = self.truth.read(&photons, self.downstream, beside)?;
            // With the same read noise of both signs: terms linear in it have no mean, and cancel.
            let difference = |noise: Array2<f64>| {
                let back = corrected(&believed, &(&trailed + &noise), self.downstream, beside, self.iterations)?;
                Ok::<_, InputError>(back - &photons - noise)
            };
            let difference = 0.5 * (difference(-noise.clone())? + difference(noise)?);
            advance();
            let before = Moments::of(&expected, galaxy.weight_px);
            let after = Moments::of(&(expected + FIRST_ORDER * difference), galaxy.weight_px);
            let change = before.zip(after).map(|(before, after)| ShapeChange::between(&before, &after));
            Ok(change.map(|change| ShapeChange::default().plus(&change, 1.0 / FIRST_ORDER)))
        };
        let changes = parallel::try_map(0..realisations, one)?;
        let changes: Option<Vec<ShapeChange>> = changes.into_iter().collect();
        Ok(changes.filter(|changes| changes.len() > 1).map(|changes| ShapeChange::mean_and_error(&changes)))
    }
}
