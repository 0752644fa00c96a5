//! Photon and read noise of one exposure: their contribution to the change of a galaxy's shape.
//!
//! Photon noise is part of the charge before the transfers. It decides which of two rows is the brighter one, fills traps that a
//! faint galaxy would otherwise meet, and is itself trailed. Read noise is added after the transfers. Both spread the moments of
//! single galaxies, of which an ellipticity is a ratio.
//!
//! **Estimator.** The bounded ellipticity of [`bounded`], with the centroid fixed to that of the image without noise, before and
//! after the readout: a survey knows positions from many exposures. (A centroid fitted to each noisy image gives the same to within
//! 0.2 % for SNAP's bright galaxy and 2 % for its faint one: see docs/population.md.)
//!
//! **Method.** A, C and T, the sums that define the ellipticity, are normal to good accuracy. The mean ellipticity follows from
//! their means Q and covariances Σ, as an integral without random numbers ([`bounded::mean_ellipticity`]):
//!
//! ```text
//! mean Δe = ē(Q + ΔQ, Σ + ΔΣ) − ē(Q, Σ)
//! ```
//!
//! Q and Σ before the readout are known exactly. Their changes by trailing are estimated from realisations: the same photons before
//! and after the readout, each with its antithetic twin (all deviates with the opposite sign). The ΔQ of the same noise without the
//! galaxy is subtracted as a control variate; its mean is 0, since the trailed sky is even. The variance is then a thousandth of
//! that of single ellipticities. ΔΣ sums the covariances of each column's noise before and after, since columns are independent.
//!
//! Neglected: the noise of rows farther downstream than `LEAD_ROWS` (they fill slow traps: 1 % of the change of the faintest
//! galaxies), the weight beyond `STAMP_WEIGHTS` in the noise term, and small deviations of A, C and T from normality. Read noise
//! enters Σ alone: it meets no traps.

use ndarray::{Array2, ArrayView2, Zip, s};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ContinuousCDF, Normal};

use super::device::{Beside, Device};
use super::scene::{Scene, downstream};
use crate::error::InputError;
use crate::numeric::parallel;
use crate::physics::accuracy::Purpose;
use crate::physics::shape::bounded::{self, Covariance, Quadrupoles};
use crate::physics::shape::{Moments, ShapeChange};
use crate::readout::{Downstream, Method};

/// Half-width of the stamp on which noise is realised, in units of the weight's σ: there the weight has fallen to 2e-3.
const STAMP_WEIGHTS: f64 = 3.5;

/// Largest number of rows of noisy sky that are clocked out ahead of a stamp: they fill slow traps as the sky does. With 200 rows
/// instead of 100, SNAP's faint galaxy changes by 1.2 % less, the bright one by 0.1 %.
const LEAD_ROWS: usize = 100;

/// Rows of noisy sky ahead, in units of the longest release time.
const LEAD_RELEASES: f64 = 3.0;

/// Sub-pixel positions in x and in y over which noise is averaged.
pub(super) const GRID: u32 = 2;

/// Streams of random numbers, apart from those of other uses of a seed.
const STREAMS: u64 = 1 << 41;

/// Contribution of noise to the mean change of a galaxy's shape.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseTerm {
    /// Mean Δe1 and Δe2 with noise, less those without.
    pub added: [f64; 2],
    /// Mean e1 and e2 before the readout with noise.
    pub before: [f64; 2],
    /// Standard errors from the finite number of realisations.
    pub error: [f64; 2],
}

/// Number and seed of the realisations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Realisations {
    /// Realisations of each galaxy; rounded up to pairs at each sub-pixel position.
    pub count: u32,
    /// The same seed gives the same bits with any number of threads.
    pub seed: u64,
}

impl NoiseTerm {
    /// The same for `factor` times as many traps: to first order in their density.
    pub fn times(self, factor: f64) -> NoiseTerm {
        let [added, error] = [self.added.map(|e| factor * e), self.error.map(|e| factor.abs() * e)];
        NoiseTerm { added, error, ..self }
    }
}

impl Scene {
    /// Contribution of photon noise, and of read noise (e- per pixel), to the mean change of shape. None if the image without noise
    /// has no centroid, before or after the readout.
    ///
    /// # Errors
    /// If an effect has no value.
    pub(super) fn noise_term(
        &self,
        device: &Device,
        read_noise_e: f64,
        realisations: Realisations,
    ) -> Result<Option<NoiseTerm>, InputError> {
        let exposure = Exposure::new(device, self.weight_px(), self.half_px())?;
        let positions = self.positions_read(device.is_mirror_symmetric());
        // At least two pairs, to estimate an error.
        let pairs = (realisations.count as usize).div_ceil(2 * positions.len()).max(2);
        let mut term = NoiseTerm::default();
        let mut variance = [0.0; 2];
        for (place, (charge_e, weight)) in positions.iter().enumerate() {
            let Some(noiseless) = Noiseless::of(&exposure, charge_e, read_noise_e)? else { return Ok(None) };
            let stream = |pair: usize| STREAMS + (pair * positions.len() + place) as u64;
            let added: Vec<[f64; 2]> =
                parallel::try_map(0..pairs, |pair| noiseless.added(&exposure, realisations.seed, stream(pair)))?;
            for member in [0, 1] {
                term.before[member] += weight * noiseless.mean_before[member];
                let values: Vec<f64> = added.iter().map(|added| added[member]).collect();
                let mean = values.iter().sum::<f64>() / pairs as f64;
                let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
                term.added[member] += weight * mean;
                variance[member] += weight * weight * squares / (pairs * (pairs - 1)) as f64;
            }
        }
        term.error = variance.map(f64::sqrt);
        Ok(Some(term))
    }
}

/// A stamp behind some rows of sky, and how it is read out.
struct Exposure {
    device: Device,
    downstream: Downstream,
    half_px: usize,
    /// Rows of sky before the stamp.
    lead: usize,
    weight_px: f64,
    /// Sky without noise as it is read, e-: one column, or all of them.
    trailed_sky_e: Array2<f64>,
}

impl Exposure {
    /// Uses the fast readout if there is one: the noise term is a small difference of images that are read alike.
    fn new(device: &Device, weight_px: f64, largest_px: usize) -> Result<Exposure, InputError> {
        let background_e = device.at.background_e;
        let half_px = ((STAMP_WEIGHTS * weight_px).ceil() as usize).min(largest_px);
        let below = downstream(device.at.transfers, half_px, background_e);
        let device = match device.method {
            Method::CarriedTraps => device.clone(),
            Method::Fast { .. } | Method::Exact | Method::Fractional { .. } | Method::MonteCarlo { .. } => {
                device.by(Method::Fast { relative: Purpose::Noise.relative(0.0) })
            }
        };
        let longest = device.longest_release_transfers();
        let lead = (LEAD_RELEASES * longest).ceil().min(LEAD_ROWS as f64).min(below.rows.max(0) as f64) as usize;
        let below = Downstream { rows: below.rows - lead as i64, ..below };
        let width = 2 * half_px + 1;
        let flat = Array2::from_elem((lead + width, device.columns_of_background(width)), background_e);
        let trailed_sky_e = device.read(&flat, below, Beside::Stamp(half_px))?;
        Ok(Exposure { device, downstream: below, half_px, lead, weight_px, trailed_sky_e })
    }

    /// Charge above the sky in the rows of the stamp as read, e-.
    fn read(&self, charge_e: &Array2<f64>) -> Result<Array2<f64>, InputError> {
        let read = self.device.read(charge_e, self.downstream, Beside::Stamp(self.half_px))? - &self.trailed_sky_e;
        Ok(self.stamp(&read).to_owned())
    }

    /// The rows of the stamp.
    fn stamp<'a>(&self, image: &'a Array2<f64>) -> ArrayView2<'a, f64> {
        image.slice(s![self.lead.., ..])
    }

    fn background_e(&self) -> f64 {
        self.device.at.background_e
    }

    /// A, C and T of each independent part: each column, or the whole image if a serial register couples the columns.
    fn quadrupoles(&self, image: ArrayView2<f64>, centroid_px: [f64; 2]) -> Vec<Quadrupoles> {
        let columns = bounded::quadrupoles_of_columns(image, self.weight_px, centroid_px);
        if self.device.has_serial_traps() { vec![total(&columns)] } else { columns }
    }
}

/// A galaxy at one sub-pixel position before and after a readout without noise.
struct Noiseless {
    /// Galaxy and sky, with the sky before the stamp, e-.
    expected_e: Array2<f64>,
    /// Centroids before and after, px.
    centroids_px: [[f64; 2]; 2],
    /// A, C and T before, of each column.
    columns: Vec<Quadrupoles>,
    before: Quadrupoles,
    /// Change of A, C and T.
    change: Quadrupoles,
    covariance: Covariance,
    /// Mean ellipticity with noise before the readout.
    mean_before: [f64; 2],
    /// Change of shape.
    delta: ShapeChange,
}

impl Noiseless {
    fn of(exposure: &Exposure, charge_e: &Array2<f64>, read_noise_e: f64) -> Result<Option<Noiseless>, InputError> {
        let edge = charge_e.nrows() / 2 - exposure.half_px;
        let inner = edge..charge_e.nrows() - edge;
        let charge_e = charge_e.slice(s![inner.clone(), inner]).to_owned();
        let mut expected_e =
            Array2::from_elem((exposure.lead + charge_e.nrows(), charge_e.ncols()), exposure.background_e());
        let mut rows = expected_e.slice_mut(s![exposure.lead.., ..]);
        rows += &charge_e;
        let read_e = exposure.read(&expected_e)?;
        let moments = [&charge_e, &read_e].map(|image| Moments::of(image, exposure.weight_px));
        let [Some(before), Some(after)] = moments else { return Ok(None) };
        let centroids_px = [before, after].map(|moments| [moments.x_px, moments.y_px]);
        let columns = exposure.quadrupoles(charge_e.view(), centroids_px[0]);
        let change = minus(total(&exposure.quadrupoles(read_e.view(), centroids_px[1])), total(&columns));
        let variance_e2 = exposure.stamp(&expected_e).mapv(|charge_e| charge_e + read_noise_e * read_noise_e);
        let covariance = bounded::covariance(variance_e2.view(), exposure.weight_px, centroids_px[0]);
        let before_q = total(&columns);
        Ok(Some(Noiseless {
            mean_before: bounded::mean_ellipticity(&before_q, &covariance),
            delta: ShapeChange::between(&before, &after),
            before: before_q,
            expected_e,
            centroids_px,
            columns,
            change,
            covariance,
        }))
    }

    /// Mean Δe1 and Δe2 with noise, less those without, estimated from two antithetic realisations.
    fn added(&self, exposure: &Exposure, seed: u64, stream: u64) -> Result<[f64; 2], InputError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        let deviates = Array2::from_shape_simple_fn(self.expected_e.dim(), || StandardNormal.sample(&mut random));
        let mut after = plus(self.before, self.change);
        let mut covariance = self.covariance;
        for sign in [1.0, -1.0] {
            let change = self.change_of_columns(exposure, &deviates, sign)?;
            after = plus(after, minus(change.mean, self.change).map(|q| 0.5 * q));
            for (a, row) in covariance.iter_mut().enumerate() {
                for (b, covariance) in row.iter_mut().enumerate() {
                    *covariance += 0.5 * (change.with_noise[a][b] + change.with_noise[b][a]);
                }
            }
        }
        let noisy = bounded::mean_ellipticity(&after, &covariance);
        let observed = |delta_e: [f64; 2]| -> Result<[f64; 2], InputError> {
            let change = ShapeChange { delta_e1: delta_e[0], delta_e2: delta_e[1], ..self.delta };
            let change = exposure.device.observed_change(change)?;
            Ok([change.delta_e1, change.delta_e2])
        };
        let with = observed([0, 1].map(|member| noisy[member] - self.mean_before[member]))?;
        let without = observed([self.delta.delta_e1, self.delta.delta_e2])?;
        Ok([0, 1].map(|member| with[member] - without[member]))
    }

    /// Change of A, C and T of one realisation by trailing, the deviates times `sign`.
    fn change_of_columns(
        &self,
        exposure: &Exposure,
        deviates: &Array2<f64>,
        sign: f64,
    ) -> Result<TrailedNoise, InputError> {
        let sky_e = exposure.background_e();
        let photons_e =
            Zip::from(&self.expected_e).and(deviates).map_collect(|mean_e, deviate| photons(*mean_e, sign * deviate));
        let sky_photons_e = deviates.mapv(|deviate| photons(sky_e, sign * deviate));
        let of = |image: &Array2<f64>, centroid: usize| exposure.quadrupoles(image.view(), self.centroids_px[centroid]);
        let above = |photons_e: &Array2<f64>| exposure.stamp(photons_e).mapv(|photons_e| photons_e - sky_e);
        let (before, after) = (of(&above(&photons_e), 0), of(&exposure.read(&photons_e)?, 1));
        let of_sky = of(&(exposure.read(&sky_photons_e)? - above(&sky_photons_e)), 1);
        let mut found = TrailedNoise::default();
        for (((before, after), of_sky), expected) in before.into_iter().zip(after).zip(of_sky).zip(&self.columns) {
            let (change, noise) = (minus(after, before), minus(before, *expected));
            found.mean = plus(found.mean, minus(change, of_sky));
            for (row, change) in found.with_noise.iter_mut().zip(change) {
                for (sum, noise) in row.iter_mut().zip(noise) {
                    *sum += change * noise;
                }
            }
        }
        Ok(found)
    }
}

/// Change of A, C and T of a noisy image by trailing.
#[derive(Default)]
struct TrailedNoise {
    /// Change, less that of the same noise without the galaxy.
    mean: Quadrupoles,
    /// Product of the change (first index) with the noise before (second), summed over the independent parts.
    with_noise: Covariance,
}

fn plus(a: Quadrupoles, b: Quadrupoles) -> Quadrupoles {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn minus(a: Quadrupoles, b: Quadrupoles) -> Quadrupoles {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn total(columns: &[Quadrupoles]) -> Quadrupoles {
    columns.iter().copied().fold([0.0; 3], plus)
}

/// Mean (e-) from which the Poisson distribution is approximated by the Cornish-Fisher expansion.
const EXPANDED_E: f64 = 30.0;

/// Number of photons for a mean and a normal deviate: the same quantile of the Poisson distribution. From [`EXPANDED_E`] on it is
/// that of the Cornish-Fisher expansion to the fourth cumulant (Abramowitz & Stegun 1964, 26.2.49), not rounded.
fn photons(mean_e: f64, deviate: f64) -> f64 {
    if mean_e >= EXPANDED_E {
        let root = mean_e.sqrt();
        let (z, z2) = (deviate, deviate * deviate);
        return (mean_e + root * z + (z2 - 1.0) / 6.0 + z * (1.0 - z2) / (72.0 * root)).max(0.0);
    }
    if mean_e <= 0.0 {
        return 0.0;
    }
    let quantile = Normal::standard().cdf(deviate);
    let (mut number, mut share) = (0.0, (-mean_e).exp());
    let mut below = share;
    while below < quantile && share > f64::MIN_POSITIVE {
        number += 1.0;
        share *= mean_e / number;
        below += share;
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_have_the_cumulants_of_poisson() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for mean in [0.3, 4.0, 29.0, 31.0, 1e4] {
            let draws: Vec<f64> = (0..200_000).map(|_| photons(mean, StandardNormal.sample(&mut random))).collect();
            let n = draws.len() as f64;
            let average = draws.iter().sum::<f64>() / n;
            let moment = |power: i32| draws.iter().map(|draw| (draw - average).powi(power)).sum::<f64>() / n;
            let sigma = mean.sqrt();
            assert!((average - mean).abs() < 4.0 * sigma / n.sqrt(), "{mean}: {average}");
            assert!((moment(2) / mean - 1.0).abs() < 5.0 * ((2.0 + 1.0 / mean) / n).sqrt(), "{mean}: {}", moment(2));
            assert!((moment(3) / sigma.powi(3) - 1.0 / sigma).abs() < 0.05 + 0.02 / sigma, "{mean}: {}", moment(3));
        }
    }
}
