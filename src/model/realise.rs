//! Single galaxies with noise: what `--monte-carlo` shows beside the means of [`super::noise`].
//!
//! Each realisation has a sub-pixel position of its own, photon noise of galaxy and sky before the readout, and read noise
//! after it. Its shape is compared with that of the same noisy image read out without traps. The centroid is fitted to each image,
//! within a weight's width of the galaxy, and the ellipticity is bounded ([`bounded::fitted`]).

use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson};

use crate::error::InputError;
use crate::mission::{Galaxy, Mission};
use crate::model::{Beside, Device, downstream, half_px};
use crate::numeric::parallel;
use crate::physics::accuracy::Purpose;
use crate::physics::galaxy::{Profile, snr};
use crate::physics::shape::{ShapeChange, bounded};
use crate::readout::Method;

/// Change of shape over noisy realisations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisyChange {
    /// Mean over the realisations.
    pub mean: ShapeChange,
    /// Its standard error, member by member.
    pub error: ShapeChange,
    /// Realisations that had a shape before and after.
    pub measured: usize,
    /// Realisations whose weighted flux is not positive, before or after.
    pub lost: usize,
}

/// Reads out `realisations` of a galaxy with noise. The same seed gives the same bits with any number of threads.
///
/// None if fewer than two of them can be measured.
///
/// # Errors
/// If a formula has no value.
pub fn realise(
    mission: &Mission,
    galaxy: &Galaxy,
    device: &Device,
    realisations: usize,
    seed: u64,
    progress: impl Fn() + Sync,
) -> Result<Option<NoisyChange>, InputError> {
    let profile = Profile::of(galaxy, &mission.psf);
    let flux_e = snr::flux_e(mission, galaxy);
    let background_e = device.at.background_e;
    let half_px = half_px(galaxy.weight_px);
    let downstream = downstream(device.at.transfers, half_px, background_e);
    let device = device.fit_for(Purpose::Noise);
    let beside = Beside::Stamp(half_px);
    let stamp_px = 2 * half_px + 1;
    let flat = Array2::from_elem((stamp_px, device.columns_of_background(stamp_px)), background_e);
    let trailed_background = device.expected().read(&flat, downstream, beside)?;
    let changes: Vec<Option<ShapeChange>> = parallel::try_map(0..realisations, |realisation| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(realisation as u64);
        let offset_px = [random.random::<f64>() - 0.5, random.random::<f64>() - 0.5];
        let expected = flux_e * profile.stamp(half_px, offset_px[0], offset_px[1]) + background_e;
        // Above 0 everywhere but far out in the wings without background, where nothing is what is drawn.
        let photons = expected.mapv(|mean| Poisson::new(mean).map_or(0.0, |law| law.sample(&mut random)));
        let read_noise = Normal::new(0.0, mission.read_noise_e(galaxy)).expect("a read noise is not negative");
        let noise = Array2::from_shape_simple_fn(photons.dim(), || read_noise.sample(&mut random));
        let device = match device.method {
            // Traps of its own for each realisation.
            Method::MonteCarlo { seed } => {
                device.by(Method::MonteCarlo { seed: seed.wrapping_add(realisation as u64) })
            }
            _ => device.clone(),
        };
        let trailed = device.read(&photons, downstream, beside)? + &noise - &trailed_background;
        let untrailed = photons + noise - background_e;
        progress();
        let measured = |image: &Array2<f64>| bounded::fitted(image, galaxy.weight_px, offset_px);
        let change = measured(&untrailed).zip(measured(&trailed));
        change.map(|(before, after)| device.observed_change(ShapeChange::between(&before, &after))).transpose()
    })?;
    let measured: Vec<ShapeChange> = changes.into_iter().flatten().collect();
    if measured.len() < 2 {
        return Ok(None);
    }
    let (mean, error) = ShapeChange::mean_and_error(&measured);
    Ok(Some(NoisyChange { mean, error, measured: measured.len(), lost: realisations - measured.len() }))
}
