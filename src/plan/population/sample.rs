//! The galaxies of a population that are evaluated: from a table, or drawn from the law.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::mission::{Distances, Mission, Population, PopulationGalaxy};
use crate::model::shear::SurveyGalaxy;
use crate::physics::galaxy::population_law::DrawnGalaxy;
use crate::physics::galaxy::snr;

/// Galaxies with their weights.
pub(super) struct SurveySample {
    /// The evaluated galaxies.
    pub galaxies: Vec<Member>,
    /// Number of available galaxies.
    pub available: usize,
    /// Whether draws are evenly spread over the distances from the readout.
    pub evenly_spread: bool,
}

/// A galaxy of a sample.
pub(super) struct Member {
    pub galaxy: SurveyGalaxy,
    /// Weight in the survey.
    pub weight: f64,
    /// Index of its draw: a pair of galaxies of the law is one draw.
    pub draw: usize,
}

/// Random streams of the law's galaxies, separate from those of other uses of a seed.
const STREAMS: u64 = 1 << 42;

/// Smallest and largest half-light radius, px.
const SIZES_PX: [f64; 2] = [0.05, 100.0];

/// The galaxies of a mission's population.
pub(super) fn of(mission: &Mission, population: &Population, seed: u64) -> SurveySample {
    let most = population.galaxies as usize;
    let table = &mission.imported.galaxies;
    if table.is_empty() {
        let galaxies = (0..most).map(|index| drawn(mission, population, seed, index)).collect();
        let evenly_spread = population.transfers.unwrap_or(Distances::Uniform) == Distances::Uniform;
        return SurveySample { galaxies, available: most, evenly_spread };
    }
    let weighty: Vec<&PopulationGalaxy> = table.iter().filter(|galaxy| galaxy.weight > 0.0).collect();
    let judged = Completed::of(mission, population);
    let evaluated = weighty.len().min(most);
    let galaxy = |index: usize| {
        let galaxy = weighty[chosen(index, evaluated, weighty.len())];
        Member { galaxy: judged.with(galaxy, distance(index, evaluated)), weight: galaxy.weight, draw: index }
    };
    let evenly_spread =
        judged.distances == Distances::Uniform && weighty.iter().all(|galaxy| galaxy.transfers.is_none());
    SurveySample { galaxies: (0..evaluated).map(galaxy).collect(), available: weighty.len(), evenly_spread }
}

/// Row of a table for the galaxy `index` of those evaluated: every row if all are evaluated, otherwise evenly spread ones.
fn chosen(index: usize, evaluated: usize, rows: usize) -> usize {
    (2 * index + 1) * rows / (2 * evaluated)
}

/// Position on the detector of the galaxy `index`, 0 to 1: evenly spread, without order.
fn distance(index: usize, galaxies: usize) -> f64 {
    if galaxies == 1 { 0.5 } else { spread(index) }
}

/// Multiples of the golden ratio, which are evenly spread from 0 to 1 for any number of draws.
pub(super) fn spread(draw: usize) -> f64 {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    ((draw as f64 + 0.5) * golden).fract()
}

/// Galaxy properties that a table does not contain.
struct Completed<'a> {
    mission: &'a Mission,
    flux_e: f64,
    distances: Distances,
}

impl Completed<'_> {
    fn of<'a>(mission: &'a Mission, population: &Population) -> Completed<'a> {
        let flux_e = snr::flux_e(mission, mission.judged_galaxy());
        Completed { mission, flux_e, distances: population.transfers.unwrap_or(Distances::Evaluated) }
    }

    fn with(&self, galaxy: &PopulationGalaxy, place: f64) -> SurveyGalaxy {
        let galaxy = PopulationGalaxy { flux_e: galaxy.flux_e.or(Some(self.flux_e)), ..*galaxy };
        let place = || transfers(self.mission, self.distances, place);
        SurveyGalaxy { transfers: galaxy.transfers.unwrap_or_else(place), ..SurveyGalaxy::of(self.mission, &galaxy) }
    }
}

/// Transfers of a galaxy at a position, 0 to 1.
fn transfers(mission: &Mission, distances: Distances, place: f64) -> u32 {
    let all = mission.readout.transfers;
    match distances {
        Distances::Evaluated => all,
        Distances::Uniform => ((place * f64::from(all)).ceil() as u32).clamp(1, all),
    }
}

/// Conversion of magnitudes and arcsec to electrons and pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Magnitude of a source that gives one electron in an exposure.
    pub one_electron_mag: f64,
    /// Width of a pixel, arcsec.
    pub pixel_arcsec: f64,
}

/// Default width of a pixel, arcsec: that of SNAP and of Euclid's VIS.
const PIXEL_ARCSEC: f64 = 0.1;

impl Camera {
    /// As specified by the population; by default the faintest galaxies have the flux of the judged one.
    pub fn of(mission: &Mission, population: &Population) -> Camera {
        let faintest = || population.magnitude_range[1] + 2.5 * snr::flux_e(mission, mission.judged_galaxy()).log10();
        Camera {
            one_electron_mag: population.one_electron_mag.unwrap_or_else(faintest),
            pixel_arcsec: population.pixel_arcsec.unwrap_or(PIXEL_ARCSEC),
        }
    }
}

/// A galaxy of the law; its magnitude range was checked when the mission was read.
///
/// Galaxies come in pairs: the second is the first rotated by 90 degrees, so that the ellipticities of a pair average to zero
/// (Nakajima & Bernstein 2007, AJ 133, 1763) and the multiplicative bias does not add to the scatter of the additive one.
fn drawn(mission: &Mission, population: &Population, seed: u64, index: usize) -> Member {
    let draw = index / 2;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(STREAMS + draw as u64);
    let range = [population.magnitude_range[0], population.magnitude_range[1]];
    let drawn = DrawnGalaxy::draw(range, &mut random);
    let Camera { one_electron_mag, pixel_arcsec } = Camera::of(mission, population);
    let judged = mission.judged_galaxy();
    let place = distance(draw, population.galaxies.div_ceil(2) as usize);
    let sign = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
    let galaxy = SurveyGalaxy {
        flux_e: 10_f64.powf(-0.4 * (drawn.magnitude - one_electron_mag)),
        half_light_px: (drawn.half_light_arcsec / pixel_arcsec).clamp(SIZES_PX[0], SIZES_PX[1]),
        sersic_index: drawn.sersic_index,
        ellipticity: drawn.ellipticity.map(|e| sign * e),
        weight_px: judged.weight_px,
        transfers: transfers(mission, population.transfers.unwrap_or(Distances::Uniform), place),
        read_noise_e: mission.read_noise_e(judged),
    };
    Member { galaxy, weight: 1.0, draw }
}
