//! Shear biases of a survey's galaxies, over a mission.
//!
//! ```text
//! c = Σ w (Δe − S Δe*) / Σ w R        m = Σ w (R_after − R) / Σ w R
//! ```
//!
//! with each galaxy's weight w, its responses R to shear and S to the PSF (see [`crate::model::shear`]), and the trailing of the
//! stars of the PSF model, Δe*, averaged over the dithered exposures. Errors are those of the finite sample: of a ratio of two
//! sums, by the jackknife to first order, with draws in the order of their distances if they are evenly spread over these. If a survey
//! rotates its detector, c and m are averaged over the orientations.
//!
//! Each galaxy is read out at the end of the mission and at half the traps. In between a parabola through 0 is used if only the
//! number of traps changes. Otherwise galaxies are read out in each year and at each turn of the dose (at 16 times at most), with
//! linear interpolation of the biases in between.

mod sample;

use std::collections::BTreeMap;

use crate::error::InputError;
use crate::mission::{Mission, PopulationNoise};
use crate::model::noise::Realisations;
use crate::model::shear::{ShearResponse, SurveyMeasurement, TrailedResponse, of_many};
use crate::model::{Device, Model};
use crate::numeric::parallel;
use crate::plan::curve::{Crossing, Point, crossings, year_ends};
pub use sample::Camera;
use sample::{Member, spread};

/// Noise realisations for each galaxy of a population: their errors average out.
const REALISATIONS: u32 = 8;

/// Shear biases of a population over a mission.
#[derive(Clone, Debug)]
pub struct PopulationBias {
    /// Galaxies of the table that have a weight; or the number drawn.
    pub galaxies: usize,
    /// Galaxies that were evaluated.
    pub evaluated: usize,
    /// Evaluated galaxies without a measurable shape, before or after the readout; they are omitted.
    pub lost: usize,
    /// Mean response of the ellipticities to shear before the readout.
    pub response: [f64; 2],
    /// Biases at the end of each year, and of the mission.
    pub years: Vec<(f64, ShearBias)>,
    /// Biases at the end of the mission, and the contribution of each draw of galaxies to their errors.
    pub at_end: EndBias,
    /// Biases against the number of traps, if only that changes.
    pub by_traps: Option<ByTraps>,
    /// `requirement.c`: when it is exceeded.
    pub c: Option<BiasVerdict>,
    /// `requirement.m`: when it is exceeded.
    pub m: Option<BiasVerdict>,
}

/// Additive and multiplicative shear bias; components 1 and 2 of each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShearBias {
    /// Additive bias.
    pub c: [Estimated; 2],
    /// Multiplicative bias.
    pub m: [Estimated; 2],
}

/// Biases at the end of a mission, and the contribution of each draw of galaxies to their errors. Errors of differences and ratios of
/// biases that are means over the same galaxies follow from these.
#[derive(Clone, Debug, PartialEq)]
pub struct EndBias {
    /// The biases.
    pub bias: ShearBias,
    /// Contributions to the error of c, components 1 and 2.
    pub influence_c: [Influence; 2],
    /// Contributions to the error of m.
    pub influence_m: [Influence; 2],
}

/// A value and its standard error from the finite sample; None for one galaxy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimated {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub error: Option<f64>,
}

/// Contributions of draws of galaxies to the error of a mean over them: jackknife values, to first order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Influence {
    /// By the index of the draw.
    of_draws: BTreeMap<usize, f64>,
    /// Whether draws are evenly spread over the distances from the readout.
    evenly_spread: bool,
}

impl Influence {
    /// Adds a multiple of another one, of the same galaxies.
    pub(crate) fn add(&mut self, weight: f64, other: &Influence) {
        self.evenly_spread |= other.evenly_spread;
        for (draw, influence) in &other.of_draws {
            *self.of_draws.entry(*draw).or_default() += weight * influence;
        }
    }

    /// Standard error of the mean; None for less than two draws.
    ///
    /// Biases depend most on the distance from the readout. If draws are evenly spread over it, the variance is half the sum of
    /// squared differences between neighbours in distance, which for independent draws is that of their sum.
    pub(crate) fn error(&self) -> Option<f64> {
        let n = self.of_draws.len() as f64;
        let squares = if self.evenly_spread { self.squares_in_order() } else { self.squares() };
        (n > 1.0).then(|| (n / (n - 1.0) * squares).sqrt())
    }

    fn squares(&self) -> f64 {
        self.of_draws.values().map(|one| one * one).sum()
    }

    fn squares_in_order(&self) -> f64 {
        let mut draws: Vec<(f64, f64)> = self.of_draws.iter().map(|(draw, one)| (spread(*draw), *one)).collect();
        draws.sort_by(|a, b| a.0.total_cmp(&b.0));
        0.5 * draws.windows(2).map(|pair| (pair[1].1 - pair[0].1).powi(2)).sum::<f64>()
    }
}

/// Biases of a population against the number of traps relative to that at the end of the mission: a parabola through 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByTraps {
    half: f64,
    at_half: ShearBias,
    at_end: ShearBias,
}

impl ByTraps {
    /// Smallest number of traps, relative to the end, at which a component of a bias reaches a limit; infinite if none does.
    ///
    /// ```text
    /// bias = α f² + β f        α f² + β f = ± limit
    /// ```
    fn reached(&self, of: fn(&ShearBias) -> [Estimated; 2], limit: f64) -> f64 {
        let apart = self.half * (1.0 - self.half);
        let factors = [0, 1].into_iter().flat_map(|member| {
            let (end, half) = (of(&self.at_end)[member].value, of(&self.at_half)[member].value);
            let alpha = (self.half * end - half) / apart;
            let beta = (half - self.half * self.half * end) / apart;
            [limit, -limit].into_iter().flat_map(move |value| roots(alpha, beta, value))
        });
        factors.filter(|factor| *factor > 0.0).fold(f64::INFINITY, f64::min)
    }
}

/// Real roots of α f² + β f = `value`, without cancellation; infinite or NaN if there is only one.
fn roots(alpha: f64, beta: f64, value: f64) -> [f64; 2] {
    let q = -0.5 * (beta + (beta * beta + 4.0 * alpha * value).sqrt().copysign(beta));
    [q / alpha, -value / q]
}

/// Weights of the values at 1 and at `half` in the parabola through 0, at a factor.
fn parabola(factor: f64, half: f64) -> [f64; 2] {
    [factor * (factor - half) / (1.0 - half), factor * (factor - 1.0) / (half * (half - 1.0))]
}

/// When a limit on a bias is exceeded: by the larger of the two components.
#[derive(Clone, Debug, PartialEq)]
pub struct BiasVerdict {
    /// The limit.
    pub limit: f64,
    /// Without software correction.
    pub uncorrected: Crossing,
    /// With it: the bias is divided by the same factor as the change of a galaxy.
    pub corrected: Crossing,
}

/// A galaxy with its weight and its responses, at the times of [`ReadoutTimes`].
struct Weighted {
    weight: f64,
    /// Galaxies of one draw are not independent.
    draw: usize,
    response: ShearResponse,
}

/// Numbers of traps, relative to that at the end of the mission, at which c and m exceed their limits, without and with correction;
/// infinite if they do not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrapLimits {
    /// For the additive bias.
    pub c: [f64; 2],
    /// For the multiplicative bias.
    pub m: [f64; 2],
}

impl PopulationBias {
    /// Numbers of traps that exceed the limits; None if biases do not depend on that number alone.
    pub fn trap_limits(&self) -> Option<TrapLimits> {
        let by_traps = self.by_traps?;
        let of = |verdict: &Option<BiasVerdict>, bias: fn(&ShearBias) -> [Estimated; 2]| match verdict {
            None => [f64::INFINITY; 2],
            Some(verdict) => {
                [&verdict.uncorrected, &verdict.corrected].map(|limit| by_traps.reached(bias, limit.limit))
            }
        };
        Some(TrapLimits { c: of(&self.c, |bias| bias.c), m: of(&self.m, |bias| bias.m) })
    }

    /// Shear biases of a model's population. None if the mission has none.
    ///
    /// # Errors
    /// If a formula has no value, or no galaxy of the population can be measured.
    pub fn of(model: &Model, seed: u64) -> Result<Option<PopulationBias>, InputError> {
        let Some(population) = &model.mission.population else { return Ok(None) };
        let sample = sample::of(&model.mission, population, seed);
        let noise =
            (population.noise == PopulationNoise::Included).then_some(Realisations { count: REALISATIONS, seed });
        let how = SurveyMeasurement { dithers: population.dithers(), psf_stars_e: population.psf_stars_e, noise };
        let times = ReadoutTimes::of(model)?;
        let model = &Model::new(&of_many(&model.mission, sample.galaxies.len()));
        let of = |member: &Member| {
            let response = model.shear_response(&member.galaxy, &times.times_yr, &how)?;
            Ok(response.map(|response| Weighted { weight: member.weight, draw: member.draw, response }))
        };
        let responses: Vec<Option<Weighted>> = parallel::try_map(&sample.galaxies, of)?;
        let evaluated = responses.len();
        let galaxies: Vec<Weighted> = responses.into_iter().flatten().collect();
        if galaxies.is_empty() {
            return Err(unmeasurable(&model.mission));
        }
        let rotations = Rotations::of(&population.orientations_deg);
        let biases = Biases { model, times, galaxies, rotations, evenly_spread: sample.evenly_spread };
        let years = year_ends(model.mission.mission.duration_yr).into_iter();
        let years = years.map(|t_yr| Ok((t_yr, biases.at(t_yr)?))).collect::<Result<Vec<_>, InputError>>()?;
        let requirement = &model.mission.requirement;
        let judged = |limit: Option<f64>, of: fn(&ShearBias) -> f64| {
            limit.map(|limit| biases.verdict(limit, &years, of)).transpose()
        };
        Ok(Some(PopulationBias {
            galaxies: sample.available,
            evaluated,
            lost: evaluated - biases.galaxies.len(),
            response: biases.mean_response(),
            c: judged(requirement.c, |bias| largest(&bias.c))?,
            m: judged(requirement.m, |bias| largest(&bias.m))?,
            by_traps: biases.times.half.map(|half| ByTraps {
                half,
                at_end: biases.weighted(&[1.0, 0.0]).bias,
                at_half: biases.weighted(&[0.0, 1.0]).bias,
            }),
            at_end: biases.weighted(&biases.weights(model.mission.mission.duration_yr)?),
            years,
        }))
    }
}

/// The larger absolute value of the components.
fn largest(members: &[Estimated; 2]) -> f64 {
    members[0].value.abs().max(members[1].value.abs())
}

fn unmeasurable(mission: &Mission) -> InputError {
    InputError::new(
        format!("cannot evaluate the population of mission \"{}\"", mission.mission.name),
        "none of its galaxies has weighted moments: their weights find no centroid",
    )
    .with_help("choose weight_px closer to the sizes of the galaxies")
}

/// Times at which galaxies are read out.
struct ReadoutTimes {
    times_yr: Vec<f64>,
    /// If only the number of traps changes: the first time is the end of the mission; the second has this share of its traps.
    half: Option<f64>,
}

/// Maximum number of times at which galaxies are read out.
const MOST_TIMES: usize = 16;

/// At most [`MOST_TIMES`] of the times, evenly chosen, with both ends.
fn thinned(times_yr: Vec<f64>) -> Vec<f64> {
    if times_yr.len() <= MOST_TIMES {
        return times_yr;
    }
    let chosen = |index: usize| times_yr[index * (times_yr.len() - 1) / (MOST_TIMES - 1)];
    (0..MOST_TIMES).map(chosen).collect()
}

/// Range of the traps, relative to those at the end, within which a time is accepted as having half of them.
const HALF: [f64; 2] = [0.2, 0.8];

impl ReadoutTimes {
    fn of(model: &Model) -> Result<ReadoutTimes, InputError> {
        let end_yr = model.mission.mission.duration_yr;
        let end = model.device_at(end_yr)?;
        let mut closest: Option<(f64, f64)> = None;
        let mut proportional = model.depends_on().is_empty();
        for t_yr in model.times_yr(end_yr).into_iter().chain(year_ends(end_yr)).chain([0.5 * end_yr]) {
            match model.device_at(t_yr)?.traps_over(&end) {
                None => proportional = false,
                Some(factor) => {
                    let off = |factor: f64| (factor - 0.5).abs();
                    let within = (HALF[0]..HALF[1]).contains(&factor);
                    if within && closest.is_none_or(|(_, known)| off(factor) < off(known)) {
                        closest = Some((t_yr, factor));
                    }
                }
            }
        }
        Ok(match closest.filter(|_| proportional) {
            Some((t_yr, factor)) => ReadoutTimes { times_yr: vec![end_yr, t_yr], half: Some(factor) },
            None => {
                let mut times_yr = model.times_yr(end_yr);
                times_yr.extend(year_ends(end_yr));
                times_yr.sort_by(f64::total_cmp);
                times_yr.dedup();
                ReadoutTimes { times_yr: thinned(times_yr), half: None }
            }
        })
    }

    /// Weights of the readout times at a time (years since launch), given the device at the end.
    fn weights(&self, t_yr: f64, device: &Device, end: &Device) -> Vec<f64> {
        let Some(half) = self.half else {
            let after = self.times_yr.partition_point(|known| *known <= t_yr).clamp(1, self.times_yr.len() - 1);
            let (from, to) = (self.times_yr[after - 1], self.times_yr[after]);
            let share = ((t_yr - from) / (to - from)).clamp(0.0, 1.0);
            let mut weights = vec![0.0; self.times_yr.len()];
            (weights[after - 1], weights[after]) = (1.0 - share, share);
            return weights;
        };
        parabola(device.traps_over(end).unwrap_or(0.0), half).to_vec()
    }
}

/// Orientations of the detector: means of exp(2iθ) and of cos 4θ over them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rotations {
    cos2: f64,
    sin2: f64,
    cos4: f64,
}

impl Rotations {
    fn of(orientations_deg: &[f64]) -> Rotations {
        let mean = |of: fn(f64) -> f64| {
            orientations_deg.iter().map(|degrees| of(degrees.to_radians())).sum::<f64>() / orientations_deg.len() as f64
        };
        Rotations {
            cos2: mean(|angle| (2.0 * angle).cos()),
            sin2: mean(|angle| (2.0 * angle).sin()),
            cos4: mean(|angle| (4.0 * angle).cos()),
        }
    }

    /// c on the sky from c in the detector frame: spin 2.
    fn additive(&self, [c1, c2]: [f64; 2]) -> [f64; 2] {
        [self.cos2 * c1 - self.sin2 * c2, self.sin2 * c1 + self.cos2 * c2]
    }

    /// Response to shear on the sky: the components mix.
    fn response(&self, [m1, m2]: [f64; 2]) -> [f64; 2] {
        let (mean, half) = (0.5 * (m1 + m2), 0.5 * (m1 - m2) * self.cos4);
        [mean + half, mean - half]
    }
}

/// A population with the data needed for its biases at any time.
struct Biases<'a> {
    model: &'a Model,
    times: ReadoutTimes,
    galaxies: Vec<Weighted>,
    rotations: Rotations,
    /// Whether draws are evenly spread over the distances from the readout.
    evenly_spread: bool,
}

impl Biases<'_> {
    fn at(&self, t_yr: f64) -> Result<ShearBias, InputError> {
        Ok(self.weighted(&self.weights(t_yr)?).bias)
    }

    /// Weights of the readout times, at a time.
    fn weights(&self, t_yr: f64) -> Result<Vec<f64>, InputError> {
        let end = self.model.device_at(self.model.mission.mission.duration_yr)?;
        Ok(self.times.weights(t_yr, &self.model.device_at(t_yr)?, &end))
    }

    /// Biases for these weights of the readout times.
    fn weighted(&self, weights: &[f64]) -> EndBias {
        let trailed: Vec<TrailedResponse> =
            self.galaxies.iter().map(|galaxy| combined(&galaxy.response.trailed, weights)).collect();
        let ratio = |numerators: Vec<[f64; 2]>, rotate: fn(&Rotations, [f64; 2]) -> [f64; 2]| {
            let rotated: Vec<[f64; 2]> =
                numerators.into_iter().map(|members| rotate(&self.rotations, members)).collect();
            [0, 1].map(|member| self.over_response(member, |galaxy| rotated[galaxy][member]))
        };
        let net = |(galaxy, trailed): (&Weighted, &TrailedResponse)| {
            [0, 1].map(|member| trailed.change[member] - galaxy.response.leakage[member] * trailed.star[member])
        };
        let c = ratio(self.galaxies.iter().zip(&trailed).map(net).collect(), Rotations::additive);
        let m = ratio(trailed.iter().map(|trailed| trailed.response).collect(), Rotations::response);
        let ([c1, c2], [m1, m2]) = (c, m);
        let estimated = |(value, influence): &(f64, Influence)| Estimated { value: *value, error: influence.error() };
        let bias = ShearBias { c: [estimated(&c1), estimated(&c2)], m: [estimated(&m1), estimated(&m2)] };
        EndBias { bias, influence_c: [c1.1, c2.1], influence_m: [m1.1, m2.1] }
    }

    /// Σ w x / Σ w R, and the contribution of each draw to its error.
    fn over_response(&self, member: usize, x: impl Fn(usize) -> f64) -> (f64, Influence) {
        let response = |galaxy: &Weighted| galaxy.weight * self.response(galaxy)[member];
        let total: f64 = self.galaxies.iter().map(response).sum();
        let value =
            self.galaxies.iter().enumerate().map(|(index, galaxy)| galaxy.weight * x(index)).sum::<f64>() / total;
        let mut of_draws: BTreeMap<usize, f64> = BTreeMap::new();
        for (index, galaxy) in self.galaxies.iter().enumerate() {
            *of_draws.entry(galaxy.draw).or_default() += (galaxy.weight * x(index) - value * response(galaxy)) / total;
        }
        (value, Influence { of_draws, evenly_spread: self.evenly_spread })
    }

    fn mean_response(&self) -> [f64; 2] {
        let weights: f64 = self.galaxies.iter().map(|galaxy| galaxy.weight).sum();
        [0, 1].map(|member| {
            let sum: f64 = self.galaxies.iter().map(|galaxy| galaxy.weight * self.response(galaxy)[member]).sum();
            sum / weights
        })
    }

    /// Response before the readout, on the sky.
    fn response(&self, galaxy: &Weighted) -> [f64; 2] {
        self.rotations.response(galaxy.response.before)
    }

    fn verdict(
        &self,
        limit: f64,
        years: &[(f64, ShearBias)],
        of: fn(&ShearBias) -> f64,
    ) -> Result<BiasVerdict, InputError> {
        let known: Vec<Point> = years.iter().map(|(t_yr, bias)| (*t_yr, Some(of(bias)))).collect();
        let limits = [limit, limit * self.model.mission.requirement.correction_factor];
        let magnitude = |t_yr: f64| Ok(Some(of(&self.at(t_yr)?)));
        let [uncorrected, corrected] = crossings(self.model, limits, &known, magnitude)?;
        Ok(BiasVerdict { limit, uncorrected, corrected })
    }
}

/// A weighted sum of changes.
fn combined(trailed: &[TrailedResponse], weights: &[f64]) -> TrailedResponse {
    let add = |sum: [f64; 2], weight: f64, more: [f64; 2]| [sum[0] + weight * more[0], sum[1] + weight * more[1]];
    trailed.iter().zip(weights).fold(TrailedResponse::default(), |sum, (trailed, weight)| TrailedResponse {
        change: add(sum.change, *weight, trailed.change),
        response: add(sum.response, *weight, trailed.response),
        star: add(sum.star, *weight, trailed.star),
    })
}
