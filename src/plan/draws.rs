//! A mission with uncertain inputs → results of many draws.
//!
//! ```text
//! uncertainties, posterior, Sun → [`Draws`] → a mission for each draw → when it exceeds its budget ([`Fate`])
//! ```
//!
//! Inputs are multiplied by exp(σ z) with the relative uncertainties σ of `[uncertainty]` and standard normal z, from points of
//! Sobol's sequence. The Sun is drawn as events, with future maxima: see [`crate::environment::solar_events`]; the level of cosmic
//! rays and the damage curve are inputs if they apply (`draws/input.rs`). Keys in a posterior are taken from it instead of from
//! their own uncertainties.
//!
//! Doses and traps of each draw are those of its own model. Its changes of shape are emulated (`draws/emulator.rs`) from readouts
//! at some of the draws. Readouts are added until the emulator is accurate to [`ACCEPTED`] up to the limits. If it is not, some
//! draws are read out one by one, evenly chosen by the rank of their Sun, so that they hold its distribution as all draws do.

mod damage_curve;
mod emulator;
mod fate;
pub mod input;
mod shares;
mod strata;
mod sun;

use std::ops::Range;

use statrs::distribution::{ContinuousCDF, Normal};

use crate::environment::solar_cycle::{self, ACTIVE_YR};
use crate::error::InputError;
use crate::mission::{Accuracy, DoseModel, FitSettings, Mission, ReadoutMethod};
use crate::model::{Device, Model, predict};
use crate::numeric::calendar::decimal_year;
use crate::numeric::parallel;
use crate::numeric::sample_points::{MOST_SOBOL, Sample, Sampling};
use crate::physics::accuracy::Purpose;
use crate::physics::conditions::Conditions;
use crate::physics::galaxy::snr;
use crate::physics::shape::ShapeChange;
use crate::physics::solar_event_dose::SOLAR_PROTONS;
use crate::plan::evaluate::unmeasurable;
use crate::plan::mission_sample::MissionSample;
use crate::plan::population::TrapLimits;
use crate::plan::progress::Progress;

use emulator::{Emulator, Example, Place};
pub use fate::Fate;
use input::{Derived, Input, cycles, inputs};
use shares::Explained;
use sun::Suns;

/// Largest accepted error of the emulator: relative, of |Δe|, as root mean square over held-back draws near the limits.
pub const ACCEPTED: f64 = 0.01;

/// Maximum number of draws if each is read out.
pub const MOST_DIRECT: u32 = 200;

/// Maximum number of coefficients of an emulator: those of some twenty numbers.
const MOST_TERMS: usize = 320;

/// Readouts per coefficient in an emulator's fit.
const READOUTS_PER_TERM: f64 = 1.7;

/// Maximum number of readouts in an emulator's fit: about half of those of [`MOST_DIRECT`] draws, which take some ten each.
const MOST_READOUTS: usize = 1000;

/// Factor on the error below which twice the readouts are worth it: otherwise it is that of the polynomial.
const IMPROVED: f64 = 0.9;

/// Readouts held back from the fit.
const HELD_BACK: usize = 50;

/// |Δe| below this share of the smallest limit is replaced by it in relative errors, and |Δe| above this multiple of the largest
/// limit by that: errors there shift no date.
pub const COUNTED: [f64; 2] = [0.1, 2.0];

/// Draws of a mission.
pub struct Draws<'a> {
    /// The mission, followed to the horizon, with derived quantities replaced by numbers.
    model: Model,
    /// The same with the expected dose of the Sun, if draws have their own.
    expected: Mission,
    /// End of the mission, years since launch.
    end_yr: f64,
    posterior: Option<(&'a MissionSample, Vec<usize>)>,
    /// Uncertain inputs, from `[uncertainty]`.
    inputs: Vec<Input>,
    points: Sample,
    /// Realisations of the Sun, or why there are none.
    suns: Result<Suns, InputError>,
    /// Numbers of traps of all species (1/px) at which shear biases of the population exceed their limits.
    traps_per_px: TrapLimits,
    /// Number of draws.
    pub samples: u32,
}

/// How changes of shape were emulated.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Emulated {
    /// Readouts in the fit.
    pub readouts: usize,
    /// Readouts held back.
    pub held_back: usize,
    /// Relative error of |Δe| for these, as root mean square.
    pub relative_error: f64,
}

/// The results of all draws.
pub struct Fates {
    /// Result of each draw.
    pub fates: Vec<Fate>,
    /// Indices of the draws.
    pub numbers: Vec<u32>,
    /// Names of the uncertain inputs; then that of the posterior, and the Sun last, if they are drawn.
    pub names: Vec<String>,
    /// Deviations (in σ) of the inputs in each draw; for the posterior, those of all its keys; for the Sun, that of the logarithm of
    /// the dose at the end.
    pub deviations: Vec<Vec<f64>>,
    /// Those of the posterior among them.
    pub of_posterior: Range<usize>,
    /// How shapes were emulated; None if each was read out.
    pub emulated: Option<Emulated>,
    /// The draws in the order of an input in which they are evenly spread and which explains most, for errors; None if there is no
    /// such input.
    pub order: Option<Vec<usize>>,
}

/// One draw.
struct Draw {
    model: Model,
    deviations: Vec<f64>,
    /// Posterior values that the device does not depend on.
    others: Vec<f64>,
}

impl<'a> Draws<'a> {
    /// Draws a mission `samples` times, at most 65 536, with the keys of a posterior drawn from it.
    ///
    /// # Errors
    /// If its galaxy has no measurable shape before the readout.
    pub fn of(
        mission: &Mission,
        posterior: Option<&'a MissionSample>,
        samples: u32,
        seed: u64,
    ) -> Result<Draws<'a>, InputError> {
        Draws::followed_to(mission.mission.duration_yr, mission, posterior, samples, seed)
    }

    /// The same, with dates followed to a horizon (years since launch) at or beyond the end of the mission.
    ///
    /// # Errors
    /// As [`Draws::of`].
    pub fn followed_to(
        horizon_yr: f64,
        mission: &Mission,
        posterior: Option<&'a MissionSample>,
        samples: u32,
        seed: u64,
    ) -> Result<Draws<'a>, InputError> {
        let samples = samples.min(MOST_SOBOL.0 as u32);
        let coarse = Purpose::Draws.of(mission);
        let mut base =
            Mission { galaxies: vec![mission.judged_galaxy().clone()], fit: FitSettings::default(), ..coarse };
        // All methods of the readout have the same expectation.
        base.accuracy.readout = ReadoutMethod::Fast;
        let nominal = Model::new(&base);
        if nominal.scene(0).is_none() {
            return Err(unmeasurable(mission, mission.judged_galaxy()));
        }
        base.mission.duration_yr = horizon_yr;
        let suns = Suns::of(&nominal.like(&base), samples, seed);
        let mut expected = base.clone();
        // Few results, with the dates of an evaluation: as accurate as that.
        expected.accuracy = Accuracy { readout: ReadoutMethod::Fast, ..mission.accuracy.clone() };
        as_numbers(&mut expected, &nominal, false);
        as_numbers(&mut base, &nominal, suns.is_ok());
        let mut inputs = inputs(&base, Derived::of(mission));
        if suns.is_err() && !nominal.history().averages_the_cycle() {
            let last = decimal_year(base.mission.launch.0) + base.mission.duration_yr;
            let maxima = solar_cycle::maxima(&base.environment.solar_maximum, last + ACTIVE_YR);
            base.environment.solar_maximum = maxima.iter().map(|maximum| maximum.year).collect();
            expected.environment.solar_maximum = base.environment.solar_maximum.clone();
            inputs.extend(cycles(&maxima));
        }
        if let Some(sample) = posterior {
            inputs.retain(|input| !input.keys.iter().any(|key| sample.keys.contains(key)));
        }
        Ok(Draws {
            model: nominal.like(&base),
            expected,
            end_yr: mission.mission.duration_yr,
            posterior: posterior.map(|sample| (sample, sample.chosen(samples as usize))),
            points: Sample::new(Sampling::Sobol, seed, u64::from(samples), inputs.len()),
            inputs,
            suns,
            traps_per_px: TrapLimits { c: [f64::INFINITY; 2], m: [f64::INFINITY; 2] },
            samples,
        })
    }

    /// The same with limits on shear biases, as numbers of traps relative to the expected number at the end of the mission.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn with_limits_on_traps(self, over_expected: &TrapLimits) -> Result<Draws<'a>, InputError> {
        let traps = self.model.traps(self.end_yr)?;
        let expected_per_px: f64 = traps.iter().map(|species| species.density_per_px).sum();
        let per_px = |limits: [f64; 2]| limits.map(|factor| factor * expected_per_px);
        Ok(Draws { traps_per_px: TrapLimits { c: per_px(over_expected.c), m: per_px(over_expected.m) }, ..self })
    }

    /// Why the Sun is not drawn; None if it is.
    pub fn sun_not_drawn(&self) -> Option<&str> {
        self.suns.as_ref().err().map(|why| why.problem.as_str())
    }

    /// Uncertain inputs besides the Sun.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// Result for the mission with a single input off by the given number of standard deviations, or none, under the expected Sun.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn alone(&self, input: Option<(usize, f64)>) -> Result<Fate, InputError> {
        let mut mission = self.expected.clone();
        if let Some((place, deviation)) = input {
            self.inputs[place].deviate(&mut mission, deviation);
        }
        self.fate_of(&mission)
    }

    /// Result for the mission with the Sun of a draw, and all else as expected.
    ///
    /// # Errors
    /// If a formula has no value.
    ///
    /// # Panics
    /// If the Sun is not drawn.
    pub fn under_the_sun_of(&self, number: u32) -> Result<Fate, InputError> {
        let mut mission = self.model.mission.clone();
        mission.imported.sun = Some(self.suns.as_ref().expect("a Sun that is drawn").realisation(number as usize));
        self.fate_of(&mission)
    }

    /// Traps of all species relative to the number expected at the end, over time (years since launch): under the Sun of each draw
    /// with all else as expected, or under the expected Sun if it is not drawn.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn traps_over_expected(&self) -> Result<Vec<Vec<(f64, f64)>>, InputError> {
        let sum = |model: &Model, t_yr: f64| -> Result<f64, InputError> {
            Ok(model.traps(t_yr)?.iter().map(|species| species.density_per_px).sum())
        };
        let expected = self.model.like(&self.expected);
        let most = sum(&expected, self.end_yr)?.max(f64::MIN_POSITIVE);
        let traps = |model: &Model| -> Result<Vec<(f64, f64)>, InputError> {
            let mut times = model.times_yr(self.end_yr);
            times.extend([0.0, self.end_yr]);
            times.sort_by(f64::total_cmp);
            times.dedup();
            times.into_iter().map(|t_yr| Ok((t_yr, sum(model, t_yr)? / most))).collect()
        };
        let Ok(suns) = &self.suns else { return Ok(vec![traps(&expected)?]) };
        let under = |number: u32| {
            let mut mission = self.model.mission.clone();
            mission.imported.sun = Some(suns.realisation(number as usize));
            traps(&self.model.like(&mission))
        };
        parallel::try_map(0..self.samples, under)
    }

    fn fate_of(&self, mission: &Mission) -> Result<Fate, InputError> {
        let model = self.model.like(mission);
        Fate::of(&model, self.end_yr, &self.traps_per_px, |times| {
            let at: Vec<Conditions> = times.iter().map(|t_yr| model.conditions(*t_yr)).collect();
            predict::changes(&model, 0, &at)
        })
    }

    /// The results of all draws, or of [`MOST_DIRECT`] of them if shapes cannot be emulated.
    ///
    /// # Errors
    /// If a draw is not a valid mission, or a formula has no value for it; reports the first such draw.
    pub fn fates(&self, progress: &Progress) -> Result<Fates, InputError> {
        match self.emulator(progress)? {
            Some((emulator, emulated)) => {
                let all: Vec<u32> = (0..self.samples).collect();
                Ok(Fates { emulated: Some(emulated), ..self.followed(&all, Some(&emulator), progress)? })
            }
            None => self.read_out(MOST_DIRECT, progress),
        }
    }

    /// The results of `count` draws, evenly chosen by the rank of their Sun, with each change of shape read out.
    ///
    /// # Errors
    /// As [`Draws::fates`].
    pub fn read_out(&self, count: u32, progress: &Progress) -> Result<Fates, InputError> {
        let (order, count) = (self.by_rank(), count.min(self.samples) as usize);
        let middle = |place: usize| order[(2 * place + 1) * order.len() / (2 * count)] as u32;
        let mut chosen: Vec<u32> = (0..count).map(middle).collect();
        chosen.sort_unstable();
        self.followed(&chosen, None, progress)
    }

    /// All draws in the order of the rank of their Sun; of their indices if it is not drawn.
    pub fn by_rank(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.samples as usize).collect();
        if let Ok(suns) = &self.suns {
            order.sort_by(|a, b| suns.rank(*a).total_cmp(&suns.rank(*b)));
        }
        order
    }

    fn followed(&self, chosen: &[u32], emulator: Option<&Emulator>, progress: &Progress) -> Result<Fates, InputError> {
        (progress.stage)("draws", chosen.len() as u64);
        let found = parallel::try_map(chosen, |index| {
            let draw = self.draw(*index)?;
            let fate =
                Fate::of(&draw.model, self.end_yr, &self.traps_per_px, |times| self.changes(&draw, times, emulator));
            (progress.advance)();
            Ok((fate.map_err(|error| self.fault(*index, error))?, draw.deviations))
        })?;
        let (fates, deviations) = found.into_iter().unzip();
        let names: Vec<String> = self.inputs.iter().map(|input| input.name.clone()).collect();
        let of_posterior = names.len()..names.len();
        let mut found =
            Fates { fates, numbers: chosen.to_vec(), names, deviations, of_posterior, emulated: None, order: None };
        found.order = strata::order(&found, &self.coordinates(&found));
        if let Some((sample, rows)) = &self.posterior {
            let of_draw = |index: &u32| sample.values(rows[*index as usize % rows.len()]);
            found.add_posterior(chosen.iter().map(of_draw).collect());
        }
        if self.suns.is_ok() {
            found.add_sun();
        }
        Ok(found)
    }

    /// Values in which draws are evenly spread: the rank of their Sun and, of all draws, Sobol's points.
    fn coordinates(&self, found: &Fates) -> Vec<Vec<f64>> {
        let ranks = |suns: &Suns| found.numbers.iter().map(|number| suns.rank(*number as usize)).collect();
        let mut coordinates: Vec<Vec<f64>> = self.suns.iter().map(ranks).collect();
        if found.numbers.len() == self.samples as usize {
            let of = |input: usize| found.deviations.iter().map(|deviations| deviations[input]).collect();
            coordinates.extend((0..self.inputs.len()).map(of));
        }
        coordinates
    }

    /// A draw, by its index.
    fn draw(&self, index: u32) -> Result<Draw, InputError> {
        let mut mission = match &self.posterior {
            Some((sample, rows)) => sample.mission(&self.model.mission, rows[index as usize % rows.len()])?,
            None => self.model.mission.clone(),
        };
        let others = match &self.posterior {
            Some((sample, rows)) => sample.unseen(rows[index as usize % rows.len()]),
            None => Vec::new(),
        };
        let normal = Normal::standard();
        let places = self.points.places(u64::from(index));
        let deviations: Vec<f64> = places.into_iter().map(|place| normal.inverse_cdf(place)).collect();
        for (input, deviation) in self.inputs.iter().zip(&deviations) {
            input.deviate(&mut mission, *deviation);
        }
        mission.imported.sun = self.suns.as_ref().ok().map(|suns| suns.realisation(index as usize));
        Ok(Draw { model: self.model.like(&mission), deviations, others })
    }

    /// An error that names the row of the posterior.
    fn fault(&self, index: u32, error: InputError) -> InputError {
        match &self.posterior {
            Some((sample, rows)) => sample.fault(rows[index as usize % rows.len()], error),
            None => error,
        }
    }

    /// Changes of shape of a draw at some times (years since launch); None if no shape is left.
    fn changes(
        &self,
        draw: &Draw,
        times: &[f64],
        emulator: Option<&Emulator>,
    ) -> Result<Vec<Option<ShapeChange>>, InputError> {
        let Some(emulator) = emulator else {
            let at: Vec<Conditions> = times.iter().map(|t_yr| draw.model.conditions(*t_yr)).collect();
            return predict::changes(&draw.model, 0, &at);
        };
        let change = |t_yr: &f64| {
            let device = draw.model.device_at(*t_yr)?;
            let place = Place::of(&draw.model.mission, &device, &draw.others, emulator.general);
            let Some([delta_e1, delta_e2]) = emulator.at(&place) else { return Ok(None) };
            device.observed_change(ShapeChange { delta_e1, delta_e2, ..ShapeChange::default() }).map(Some)
        };
        times.iter().map(change).collect()
    }

    /// An emulator of the changes of shape of draws, if an accurate one is found: a general one if there are effects.
    fn emulator(&self, progress: &Progress) -> Result<Option<(Emulator, Emulated)>, InputError> {
        let found = self.emulator_that_is(false, progress)?;
        match found {
            None if !self.model.mission.effects.is_empty() => self.emulator_that_is(true, progress),
            found => Ok(found),
        }
    }

    fn emulator_that_is(&self, general: bool, progress: &Progress) -> Result<Option<(Emulator, Emulated)>, InputError> {
        let order = self.by_rank();
        let places: Vec<Place> =
            parallel::try_map(0..MOST_TERMS.min(order.len()), |number| Ok(self.place(&order, number, general)?.0))?;
        let terms = Emulator::coefficients(&places, general);
        let first = (READOUTS_PER_TERM * terms as f64).ceil() as usize;
        // Reading out a few draws one by one is faster.
        if terms > MOST_TERMS || 10 * self.samples as usize <= first + HELD_BACK {
            return Ok(None);
        }
        let examples = |numbers: Range<usize>| {
            (progress.stage)("readouts", numbers.len() as u64);
            parallel::try_map(numbers, |number| {
                let example = self.example(&order, number, general);
                (progress.advance)();
                example
            })
        };
        // Every few numbers are spread evenly over ranks and times, so that those held back are, too.
        let held = examples(0..HELD_BACK)?;
        let counted = self.counted();
        let (mut fitted, mut before): (Vec<Example>, f64) = (Vec::new(), f64::INFINITY);
        loop {
            let from = HELD_BACK + fitted.len();
            fitted.extend(examples(from..from + first.max(fitted.len()))?);
            let Some(emulator) = Emulator::fitted(&fitted, counted, general) else { return Ok(None) };
            let relative_error = emulator.error(&held, counted);
            let emulated = Emulated { readouts: fitted.len(), held_back: held.len(), relative_error };
            if relative_error <= ACCEPTED {
                return Ok(Some((emulator, emulated)));
            }
            if 2 * fitted.len() > MOST_READOUTS || relative_error > IMPROVED * before {
                return Ok(None);
            }
            before = relative_error;
        }
    }

    /// Range of |Δe| whose relative errors count.
    fn counted(&self) -> [f64; 2] {
        let limits = self.model.mission.requirement.limits();
        let [small, large] = COUNTED;
        [small * limits[0].min(limits[1]), large * limits[0].max(limits[1])]
    }

    /// Coordinates of a draw at some time of its mission (the end for every second one), with its model and device. Numbers are
    /// evenly spread over times, and over draws in an order: closer to each other towards the last ones, the most active Suns, as
    /// limits are exceeded by few of the draws. Of the last p of all draws are √p of the numbers.
    fn place(&self, order: &[usize], number: usize, general: bool) -> Result<(Place, Draw, Device), InputError> {
        let [of_order, of_time] = SPREAD.map(|step| (step * (number as f64 + 0.5)).fract());
        let rank = 1.0 - (1.0 - of_order).powi(2);
        let draw = self.draw(order[(rank * order.len() as f64) as usize] as u32)?;
        let share = if number.is_multiple_of(2) { 1.0 } else { of_time };
        let device = draw.model.device_at(share * self.model.mission.mission.duration_yr)?;
        Ok((Place::of(&draw.model.mission, &device, &draw.others, general), draw, device))
    }

    /// The same with its change of shape, read out.
    fn example(&self, order: &[usize], number: usize, general: bool) -> Result<Example, InputError> {
        let (place, draw, device) = self.place(order, number, general)?;
        let change = draw.model.trailed(0, &device.fit_for(Purpose::Shape))?;
        Ok((place, change.map(|change| [change.delta_e1, change.delta_e2])))
    }
}

/// Steps of points that are evenly spread over a square, for any number of them: powers of the plastic number 1/1.3247 (the Kronecker
/// sequence R2 of M. Roberts, 2018).
const SPREAD: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];

/// Draws differ by factors: derived quantities are replaced by numbers first, unless the Sun is drawn in their place.
fn as_numbers(base: &mut Mission, model: &Model, sun: bool) {
    if !sun && matches!(base.environment.model, DoseModel::Constant | DoseModel::SolarCycle) {
        base.environment.active_dose_rate_mev_g_yr =
            Some(model.history().active_rate_mev_g_yr / base.environment.dose_factor);
    }
    let flux_e = snr::flux_e(base, &base.galaxies[0]);
    base.galaxies[0].flux_e = Some(flux_e);
    base.galaxies[0].snr = None;
}

impl Fates {
    /// ln |Δe| at the end of the mission for the given draws that then have a shape, with their deviations.
    pub fn explained(&self, places: &[usize]) -> Explained<'_> {
        let log = |place: usize| self.fates[place].delta_e.filter(|delta_e| *delta_e > 0.0).map(f64::ln);
        let draws = places.iter().map(|&place| (self.deviations[place].as_slice(), log(place)));
        Explained::of(draws, self.of_posterior.clone(), self.names.last().is_some_and(|name| name == SOLAR_PROTONS))
    }

    /// Adds a posterior to the inputs: the values of its keys in each draw, in units of their standard deviations.
    fn add_posterior(&mut self, values: Vec<Vec<f64>>) {
        let (count, keys) = (values.len() as f64, values.first().map_or(0, Vec::len));
        for key in 0..keys {
            let mean = values.iter().map(|row| row[key]).sum::<f64>() / count;
            let sigma = (values.iter().map(|row| (row[key] - mean).powi(2)).sum::<f64>() / count).sqrt();
            for (deviations, row) in self.deviations.iter_mut().zip(&values) {
                deviations.push(if sigma > 0.0 { (row[key] - mean) / sigma } else { 0.0 });
            }
        }
        self.of_posterior = self.names.len()..self.names.len() + keys;
        self.names.push(POSTERIOR.to_string());
    }

    /// Adds the Sun to the inputs: by the logarithm of its dose at the end, without other inputs, in units of its standard
    /// deviation.
    fn add_sun(&mut self) {
        let most = self.fates.iter().map(|fate| fate.sun_mev_g).fold(0.0, f64::max);
        let logs: Vec<f64> =
            self.fates.iter().map(|fate| fate.sun_mev_g.max(LEAST_DOSE * most).max(f64::MIN_POSITIVE).ln()).collect();
        let count = logs.len() as f64;
        let mean = logs.iter().sum::<f64>() / count;
        let sigma = (logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / count).sqrt().max(f64::MIN_POSITIVE);
        for (deviations, log) in self.deviations.iter_mut().zip(logs) {
            deviations.push((log - mean) / sigma);
        }
        self.names.push(SOLAR_PROTONS.to_string());
    }
}

/// Name of the posterior among the inputs.
pub const POSTERIOR: &str = "posterior";

/// Share of the largest dose below which the dose of the Sun is replaced by this share.
const LEAST_DOSE: f64 = 1e-6;
