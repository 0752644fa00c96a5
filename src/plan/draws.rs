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
//! at some of the draws, if the emulator is accurate to [`ACCEPTED`], and read out one by one otherwise.

mod emulator;
mod fate;
pub mod input;
mod shares;
mod sun;

use std::ops::Range;

use statrs::distribution::{ContinuousCDF, Normal};

use crate::environment::solar_cycle::{self, ACTIVE_YR};
use crate::error::InputError;
use crate::mission::{DoseModel, FitSettings, Mission, ReadoutMethod};
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

use emulator::{Emulator, Place};
pub use fate::Fate;
use input::{Derived, Input, cycles, inputs};
use shares::Explained;
use sun::Suns;

/// Largest accepted error of the emulator: relative, of |Δe|, as root mean square over held-back draws.
pub const ACCEPTED: f64 = 0.01;

/// Maximum number of draws if each is read out.
pub const MOST_DIRECT: u32 = 200;

/// Maximum number of coefficients of an emulator: those of some twenty numbers.
const MOST_TERMS: usize = 320;

/// Readouts per coefficient in an emulator's fit.
const READOUTS_PER_TERM: f64 = 1.7;

/// Readouts held back from the fit.
const HELD_BACK: usize = 50;

/// |Δe| below this share of the uncorrected limit is replaced by it in relative errors: its errors shift no date.
const SMALL: f64 = 0.1;

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

    /// The results of `count` draws, evenly chosen, with each change of shape read out.
    ///
    /// # Errors
    /// As [`Draws::fates`].
    pub fn read_out(&self, count: u32, progress: &Progress) -> Result<Fates, InputError> {
        self.followed(&evenly(self.samples, count as usize), None, progress)
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
        let mut found = Fates { fates, numbers: chosen.to_vec(), names, deviations, of_posterior, emulated: None };
        if let Some((sample, rows)) = &self.posterior {
            let of_draw = |index: &u32| sample.values(rows[*index as usize % rows.len()]);
            found.add_posterior(chosen.iter().map(of_draw).collect());
        }
        if self.suns.is_ok() {
            found.add_sun();
        }
        Ok(found)
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
            let [delta_e1, delta_e2] =
                emulator.at(&Place::of(&draw.model.mission, &device, &draw.others, emulator.general));
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
        let looked_at = evenly(self.samples, MOST_TERMS);
        let of = |(place, index): (usize, &u32)| Ok(self.place(place, *index, general)?.0);
        let places: Vec<Place> = parallel::try_map(looked_at.iter().enumerate(), of)?;
        let terms = Emulator::coefficients(&places, general);
        let readouts = (READOUTS_PER_TERM * terms as f64).ceil() as usize + HELD_BACK;
        // Reading out a few draws one by one is faster.
        if terms > MOST_TERMS || 10 * self.samples as usize <= readouts {
            return Ok(None);
        }
        let numbers: Vec<u32> = (0..readouts as u32).map(|number| number % self.samples).collect();
        (progress.stage)("readouts", numbers.len() as u64);
        let example = |(place, index): (usize, &u32)| {
            let example = self.example(place, *index, general);
            (progress.advance)();
            example
        };
        let known: Option<Vec<Example>> = parallel::try_map(numbers.iter().enumerate(), example)?.into_iter().collect();
        let Some(known) = known else { return Ok(None) };
        // One in every few, so that both kinds are spread evenly over the draws.
        let every = readouts / HELD_BACK;
        let (mut fitted, mut held) = (Vec::new(), Vec::new());
        for (place, one) in known.into_iter().enumerate() {
            if place % every == 0 && held.len() < HELD_BACK { held.push(one) } else { fitted.push(one) }
        }
        let least = SMALL * self.model.mission.requirement.delta_e;
        let Some(emulator) = Emulator::fitted(&fitted, least, general) else { return Ok(None) };
        let relative_error = emulator.error(&held, least);
        let emulated = Emulated { readouts: fitted.len(), held_back: held.len(), relative_error };
        Ok((relative_error <= ACCEPTED).then_some((emulator, emulated)))
    }

    /// Coordinates of a draw at some time of its mission (the end for every second one), with its model and device.
    fn place(&self, place: usize, index: u32, general: bool) -> Result<(Place, Draw, Device), InputError> {
        let draw = self.draw(index)?;
        let share = if place.is_multiple_of(2) { 1.0 } else { (GOLDEN * place as f64).fract() };
        let device = draw.model.device_at(share * self.model.mission.mission.duration_yr)?;
        Ok((Place::of(&draw.model.mission, &device, &draw.others, general), draw, device))
    }

    /// The same with its change of shape, read out; None if no shape is left.
    fn example(&self, place: usize, index: u32, general: bool) -> Result<Option<Example>, InputError> {
        let (place, draw, device) = self.place(place, index, general)?;
        let change = draw.model.trailed(0, &device.fit_for(Purpose::Shape))?;
        Ok(change.map(|change| (place, [change.delta_e1, change.delta_e2])))
    }
}

/// Coordinates with their change of shape: Δe1 and Δe2.
type Example = (Place, [f64; 2]);

/// Golden ratio: its multiples are evenly spread.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// `count` of all draws, evenly chosen.
fn evenly(samples: u32, count: usize) -> Vec<u32> {
    let count = count.min(samples as usize);
    (0..count).map(|place| (place * samples as usize / count) as u32).collect()
}

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
