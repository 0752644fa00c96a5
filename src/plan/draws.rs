//! A mission with uncertain inputs → results of many draws.
//!
//! ```text
//! uncertainties, posterior, Sun → [`Draws`] → a mission for each draw → when it exceeds its budget ([`Fate`])
//! ```
//!
//! Inputs are multiplied by exp(σ z) with the relative uncertainties σ of `[uncertainty]` and standard normal z, points of Sobol's
//! sequence. The Sun is drawn as events, with coming maxima: see [`crate::environment::solar_events`]; the level of cosmic rays and
//! the damage curve are inputs if they apply (`draws/input.rs`). What a posterior holds is taken from it in place of the
//! uncertainty of the same key.
//!
//! Doses and traps of each draw are those of its own model. Its changes of shape are emulated (`draws/emulator.rs`) from readouts at
//! some of the draws, if that is good to [`ACCEPTED`], and read out one by one otherwise.

mod emulator;
mod fate;
pub mod input;
mod shares;
mod sun;

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

/// Largest error of the emulator that is accepted: relative, of |Δe|, as root mean square over draws that were held back.
pub const ACCEPTED: f64 = 0.01;

/// Draws at most if each is read out by itself.
pub const MOST_DIRECT: u32 = 200;

/// Most coefficients of an emulator: those of some twenty numbers.
const MOST_TERMS: usize = 320;

/// Readouts of an emulator's fit over its coefficients.
const READOUTS_PER_TERM: f64 = 1.7;

/// Readouts that are held back from the fit.
const HELD_BACK: usize = 50;

/// |Δe| below this share of the uncorrected limit counts as this in relative errors: its errors move no date.
const SMALL: f64 = 0.1;

/// Draws of a mission.
pub struct Draws<'a> {
    /// The mission followed to the horizon, with numbers in place of what is derived.
    model: Model,
    /// The same with the dose of the Sun that is expected, if draws have their own.
    expected: Mission,
    /// End of the mission, years since launch.
    end_yr: f64,
    posterior: Option<(&'a MissionSample, Vec<usize>)>,
    /// What is uncertain, by `[uncertainty]`.
    inputs: Vec<Input>,
    points: Sample,
    /// Courses of the Sun, or why there are none.
    suns: Result<Suns, InputError>,
    /// Traps of all species (1/px) with which shear biases of the population exceed their limits.
    traps_per_px: TrapLimits,
    /// Number of draws.
    pub samples: u32,
}

/// How changes of shape were emulated.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Emulated {
    /// Readouts that it was fitted to.
    pub readouts: usize,
    /// Readouts that it was compared with.
    pub held_back: usize,
    /// Relative error of |Δe| at those, as root mean square.
    pub relative_error: f64,
}

/// What becomes of all draws.
pub struct Fates {
    /// Of each draw.
    pub fates: Vec<Fate>,
    /// Numbers of the draws.
    pub numbers: Vec<u32>,
    /// Names of the uncertain inputs, the Sun last where it is drawn.
    pub names: Vec<String>,
    /// Deviations (in σ) of those in each draw; of the Sun, that of the logarithm of the dose at the end.
    pub deviations: Vec<Vec<f64>>,
    /// How shapes were emulated; None if each was read out.
    pub emulated: Option<Emulated>,
}

/// One draw.
struct Draw {
    model: Model,
    deviations: Vec<f64>,
    /// Values of a posterior that no device shows.
    others: Vec<f64>,
}

impl<'a> Draws<'a> {
    /// So many draws of a mission, up to 65 536, with the keys of a posterior drawn from it.
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

    /// The same, with dates followed to a horizon (years since launch) at the end of the mission or beyond.
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
        // All methods of the readout expect the same.
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

    /// The same with limits on shear biases, as numbers of traps over that of the mission as it is expected, at its end.
    ///
    /// # Errors
    /// If a formula has no value.
    pub fn with_limits_on_traps(self, over_expected: &TrapLimits) -> Result<Draws<'a>, InputError> {
        let traps = self.model.traps(self.end_yr)?;
        let expected_per_px: f64 = traps.iter().map(|species| species.density_per_px).sum();
        let per_px = |limits: [f64; 2]| limits.map(|factor| factor * expected_per_px);
        Ok(Draws { traps_per_px: TrapLimits { c: per_px(over_expected.c), m: per_px(over_expected.m) }, ..self })
    }

    /// Why the Sun is not among what is drawn; None if it is.
    pub fn sun_not_drawn(&self) -> Option<&str> {
        self.suns.as_ref().err().map(|why| why.problem.as_str())
    }

    /// What is uncertain besides the Sun.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// What becomes of the mission with one input alone so many standard deviations off, or with none, under the Sun that is expected.
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

    /// What becomes of the mission with the Sun of a draw, and all else as it is expected.
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

    /// Traps of all species over those that are expected at the end, over time (years since launch): under the Sun of each draw with all
    /// else as it is expected, or under the Sun that is expected where it is not drawn.
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

    /// What becomes of each draw, or of [`MOST_DIRECT`] of them if shapes cannot be emulated.
    ///
    /// # Errors
    /// If a draw makes no sense to the mission, or a formula has no value for it; the first draw of which that is true.
    pub fn fates(&self, progress: &Progress) -> Result<Fates, InputError> {
        match self.emulator(progress)? {
            Some((emulator, emulated)) => {
                let all: Vec<u32> = (0..self.samples).collect();
                Ok(Fates { emulated: Some(emulated), ..self.followed(&all, Some(&emulator), progress)? })
            }
            None => self.read_out(MOST_DIRECT, progress),
        }
    }

    /// What becomes of so many draws, evenly chosen, with each change of shape read out.
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
        let names = self.inputs.iter().map(|input| input.name.clone()).collect();
        let mut found = Fates { fates, numbers: chosen.to_vec(), names, deviations, emulated: None };
        if self.suns.is_ok() {
            found.add_sun();
        }
        Ok(found)
    }

    /// A draw, by its number.
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

    /// An emulator of the changes of shape of draws, if a good one is found: a general one if there are effects.
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
        // Few draws are sooner read out one by one.
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
        // Every few, so that both kinds are spread over the draws alike.
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

    /// Where a draw is at some time of its mission, the end for every second: its place, its model and device.
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

/// A place with its change of shape: Δe1 and Δe2.
type Example = (Place, [f64; 2]);

/// Golden section: its multiples are spread evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Some of so many draws, evenly chosen.
fn evenly(samples: u32, count: usize) -> Vec<u32> {
    let count = count.min(samples as usize);
    (0..count).map(|place| (place * samples as usize / count) as u32).collect()
}

/// Draws differ by factors: what is derived is made a number first, unless the Sun is drawn in its place.
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
    /// ln |Δe| at the end of the mission of some draws that have a shape left then, and the deviations that made it.
    pub fn explained(&self, places: &[usize]) -> Explained<'_> {
        let log = |place: usize| self.fates[place].delta_e.filter(|delta_e| *delta_e > 0.0).map(f64::ln);
        let draws = places.iter().map(|&place| (self.deviations[place].as_slice(), log(place)));
        Explained::of(draws, self.names.last().is_some_and(|name| name == SOLAR_PROTONS))
    }

    /// Adds the Sun to the inputs: by the logarithm of the dose at the end that it makes, without other inputs, in units of its
    /// standard deviation.
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

/// Share of the largest dose below which that of the Sun is as good as none.
const LEAST_DOSE: f64 = 1e-6;
