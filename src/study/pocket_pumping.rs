//! Pocket pumping: which traps it finds at which temperature and phase time, and how it improves the correction.
//!
//! A flat field is shuffled back and forth N times. A trap under the right electrode captures an electron on the way there and
//! releases it within a window of one phase time t, on the wrong side of a barrier: one pixel gains charge at the expense of its
//! neighbour. The dipole has the intensity
//!
//! ```text
//! I = N P (exp(−t/τ) − exp(−2t/τ))        largest at t = τ ln 2, where it is N P/4
//! ```
//!
//! (Mostek et al. 2010, Proc. SPIE 7742; Murray et al. 2012, Proc. SPIE 8453; Hall et al. 2014, IEEE Trans. Nucl. Sci. 61, 1826;
//! Skottfelt et al. 2017), with the probability P of a capture. Measured at several phase times it gives the release time of a
//! single trap; at several temperatures, its energy level.
//!
//! Dipoles are simulated with the shot noise of the flat, read noise, and the binomial noise of the pumps, and fitted. A
//! three-phase cycle takes six phase times: long ones leave time for few cycles, which is why slow traps are pumped warm.

mod dipole;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use serde::Serialize;

use super::correction::{Knowledge, RoundTrip};
use super::{Estimate, Exposure, Study, check, ratios, ready, warnings};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::{Device, Model};
use crate::numeric::parallel;
use crate::physics::SpeciesState;
use crate::physics::conditions::Conditions;
use crate::warning::Warning;

use dipole::Grid;
pub use dipole::{Phase, dipole_e};

/// Phases of a three-phase pumping cycle, 1-2-3-1'-3-2.
const PHASES: f64 = 6.0;

/// Default range of phase times, ms, and their number.
const PHASE_MS: (f64, f64) = (1e-3, 1e4);
const PHASE_COUNT: usize = 29;

/// Default charge of the flat field, as a share of the full well.
const FLAT: f64 = 0.05;

/// Default temperatures, relative to the operating temperature, K.
const STEPS_K: [f64; 6] = [-20.0, 0.0, 20.0, 40.0, 60.0, 80.0];

/// Lowest default temperature, K.
const COLDEST_K: f64 = 40.0;

/// Share of a species' dipoles that must be detected for the species to count as found.
const MOST: f64 = 0.5;

/// Draws of assumed parameters, before and after, and iterations of the correction.
const DRAWS: u32 = 100;
const ITERATIONS: u32 = 4;

/// Options of the study.
#[derive(Clone, Debug)]
pub struct PocketPumping {
    /// Temperatures of the pumping, K; by default the operating one, 20 K below, and up to 80 K above.
    pub temperatures_k: Option<Vec<f64>>,
    /// Phase times, ms; by default 29 from 0.001 to 10000 in equal ratios.
    pub phases_ms: Option<Vec<f64>>,
    /// Maximum number of cycles per image.
    pub cycles: u32,
    /// Longest pumping of one image, s.
    pub image_s: f64,
    /// Images at each phase time.
    pub images: u32,
    /// Charge of the flat field, e- per pixel; by default 5 % of the full well.
    pub flat_e: Option<f64>,
    /// Probability that a trap in the cloud captures an electron in a cycle.
    pub capture_probability: f64,
    /// Number of dipoles of each species simulated and fitted at each temperature.
    pub dipoles: u32,
    /// Detection threshold of dipoles, in sigma of the flat's noise.
    pub threshold_sigma: f64,
    /// Error of the thermometer, K.
    pub temperature_error_k: f64,
    /// Relative error (1 sigma) of densities and release times if pumping does not find the species.
    pub known_to: f64,
    /// Seed of the dipoles; by default the mission's.
    pub seed: Option<u64>,
}

impl Default for PocketPumping {
    fn default() -> PocketPumping {
        PocketPumping {
            temperatures_k: None,
            phases_ms: None,
            cycles: 20_000,
            image_s: 60.0,
            images: 5,
            flat_e: None,
            capture_probability: 1.0,
            dipoles: 100,
            threshold_sigma: 5.0,
            temperature_error_k: 0.05,
            known_to: 0.05,
            seed: None,
        }
    }
}

/// The results of the study, at the end of the mission.
#[derive(Clone, Debug)]
pub struct Results {
    /// The options.
    pub options: PocketPumping,
    /// Charge of the flat field, e- per pixel.
    pub flat_e: f64,
    /// Noise of a dipole on the flat, e-.
    pub noise_e: f64,
    /// The pumped phase times.
    pub phases: Vec<Phase>,
    /// Operating temperature, K.
    pub operating_k: f64,
    /// Species at the operating temperature.
    pub species: Vec<SpeciesState>,
    /// Each temperature and species, the species varying fastest.
    pub dipoles: Vec<Dipole>,
    /// Knowledge of the species that are found.
    pub known: Vec<Known>,
    /// Time for all phase times at one temperature, including readout, h.
    pub hours_per_temperature: f64,
    /// The factors of the correction.
    pub earned: Earned,
    /// Warnings about the mission.
    pub warnings: Vec<Warning>,
}

/// Results for one species at one temperature.
#[derive(Clone, Debug, Serialize)]
pub struct Dipole {
    /// Temperature, K.
    pub temperature_k: f64,
    /// Name of the species.
    pub species: String,
    /// Release time, ms.
    pub release_ms: f64,
    /// Phase time of the largest dipole, ms.
    pub phase_ms: f64,
    /// Cycles at that phase time.
    pub cycles: f64,
    /// Largest dipole, e-.
    pub dipole_e: f64,
    /// The same over the noise of the flat.
    pub snr: f64,
    /// Share of its dipoles beyond the threshold, %.
    pub found_percent: f64,
    /// Root mean square of ln(fitted release time/true one) of a single trap, %; None if none is found.
    pub release_error_percent: Option<f64>,
    /// Share found, as a fraction.
    #[serde(skip)]
    found: f64,
    /// Error of the release time, as a fraction.
    #[serde(skip)]
    scatter: Option<f64>,
}

/// Knowledge of one species from pumping.
#[derive(Clone, Debug, Serialize)]
pub struct Known {
    /// Name of the species.
    pub species: String,
    /// Temperature with the best detection, K.
    pub temperature_k: f64,
    /// Phase time there, ms.
    pub phase_ms: f64,
    /// Traps found on the detector.
    pub traps: f64,
    /// Relative error of its density, %.
    pub density_error_percent: f64,
    /// Relative error of its release time at the operating temperature, %; None if that requires an energy level that is not
    /// measured.
    pub release_error_percent: Option<f64>,
    /// Error of the density, as a fraction.
    #[serde(skip)]
    density_error: f64,
    /// Error of the release time, as a fraction.
    #[serde(skip)]
    release_error: Option<f64>,
}

/// The factors of a correction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Earned {
    /// There is nothing to correct: no traps.
    NothingToCorrect,
    /// Before the correction, or after it, no shape is left.
    ShapeLost,
    /// Factors by which |Δe| is reduced, with the knowledge before pumping, and after it.
    Factors {
        /// Before.
        before: Estimate,
        /// After.
        after: Estimate,
    },
}

/// Noise and cycles of the images.
struct Setup {
    flat_e: f64,
    exposure: Exposure,
    phases: Vec<Phase>,
}

impl Study for PocketPumping {
    type Results = Results;

    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Results, InputError> {
        self.temperatures_k.iter().try_for_each(|kelvins| check("detector.temperature_k", kelvins))?;
        let model = ready(mission)?;
        let setup = self.setup(mission)?;
        let at_end = model.conditions(mission.mission.duration_yr);
        let operating_k = at_end.temperature_k;
        let temperatures = self.temperatures_k.clone().unwrap_or_else(|| {
            STEPS_K.iter().map(|step| operating_k + step).filter(|kelvin| *kelvin >= COLDEST_K).collect()
        });
        let device = |temperature_k: f64| model.device(&Conditions { temperature_k, ..at_end.clone() });
        let devices: Vec<Device> = temperatures.iter().map(|kelvin| device(*kelvin)).collect::<Result<_, _>>()?;
        let cases: Vec<(usize, usize)> = (0..devices.len())
            .flat_map(|device| (0..devices[device].traps.len()).map(move |species| (device, species)))
            .collect();
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let dipoles = parallel::try_map(&cases, |&(device, species)| {
            advance();
            Ok(self.search(&setup, &devices[device], species, seed, (device * 1000 + species) as u64))
        })?;
        let operating = device(operating_k)?;
        let known = self.known(mission, &model, &setup, &operating, &dipoles)?;
        Ok(Results {
            options: self.clone(),
            flat_e: setup.flat_e,
            noise_e: self.flat_variance(&setup).sqrt(),
            operating_k,
            hours_per_temperature: self.hours_per_temperature(&setup),
            earned: self.earned(&model, &known, seed, advance)?,
            species: operating.traps,
            phases: setup.phases,
            dipoles,
            known,
            warnings: warnings(mission),
        })
    }
}

impl PocketPumping {
    fn setup(&self, mission: &Mission) -> Result<Setup, InputError> {
        let flat_e = self.flat_e.unwrap_or(FLAT * mission.detector.full_well_e);
        if flat_e > mission.detector.full_well_e {
            let problem =
                format!("the flat has {flat_e} e-, above the full well of {} e-", mission.detector.full_well_e);
            return Err(InputError::new("cannot pump", problem));
        }
        let phases_ms = self.phases_ms.clone().unwrap_or_else(|| ratios(PHASE_MS.0, PHASE_MS.1, PHASE_COUNT));
        check("readout.line_time_ms", &phases_ms)?;
        // A dipole of half the flat is still proportional to the cycles.
        let most = f64::from(self.cycles).min(2.0 * flat_e / self.capture_probability);
        let phase = |phase_ms: f64| {
            let cycles = (1000.0 * self.image_s / (PHASES * phase_ms)).min(most).floor();
            (cycles >= 1.0).then_some(Phase { phase_ms, cycles })
        };
        let phases: Vec<Phase> = phases_ms.into_iter().filter_map(phase).collect();
        if phases.is_empty() {
            let problem = format!("no cycle of {PHASES} phases fits into {} s", self.image_s);
            return Err(
                InputError::new("cannot pump", problem).with_help("choose shorter --phase-ms or longer --image-s")
            );
        }
        Ok(Setup { flat_e, exposure: Exposure::of(mission), phases })
    }

    /// Variance of a dipole (half the difference of two pixels) from the flat's shot noise and read noise, e-².
    fn flat_variance(&self, setup: &Setup) -> f64 {
        (setup.flat_e + setup.exposure.read_noise_e.powi(2)) / (2.0 * f64::from(self.images))
    }

    /// The same with the binomial noise of the pumps: each of N succeeds or does not.
    fn variance(&self, setup: &Setup, cycles: f64, dipole_e: f64) -> f64 {
        let chance = (dipole_e * (1.0 - dipole_e / cycles)).max(0.0);
        self.flat_variance(setup) + chance / f64::from(self.images)
    }

    /// Dipoles of a species at the temperature of a device, simulated and fitted one by one.
    fn search(&self, setup: &Setup, device: &Device, species: usize, seed: u64, stream: u64) -> Dipole {
        let SpeciesState { name, release_ms, .. } = &device.traps[species];
        let expected = |phase: &Phase| dipole_e(phase.cycles, self.capture_probability, phase.phase_ms, *release_ms);
        let largest = |a: &&Phase, b: &&Phase| expected(a).total_cmp(&expected(b));
        let best = *setup.phases.iter().max_by(largest).expect("at least one phase time");
        let noise_e = self.flat_variance(setup).sqrt();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        let grid = Grid::new(&setup.phases);
        let mut deviations = Vec::new();
        for _ in 0..self.dipoles {
            let measure = |phase: &Phase| {
                let mean = expected(phase);
                let sigma = self.variance(setup, phase.cycles, mean).sqrt();
                (Normal::new(mean, sigma).expect("a finite width").sample(&mut random), sigma)
            };
            let measured: Vec<(f64, f64)> = setup.phases.iter().map(measure).collect();
            // Detected at its best phase time, that is, distinguished from the flat.
            let seen = setup.phases.iter().zip(&measured).any(|(phase, (dipole_e, _))| {
                phase.phase_ms == best.phase_ms && *dipole_e > self.threshold_sigma * noise_e
            });
            if seen {
                deviations.push((grid.fit(&measured) / release_ms).ln());
            }
        }
        let n = deviations.len() as f64;
        let found = n / f64::from(self.dipoles);
        let scatter = (n > 0.0).then(|| (deviations.iter().map(|off| off * off).sum::<f64>() / n).sqrt());
        Dipole {
            temperature_k: device.at.temperature_k,
            species: name.clone(),
            release_ms: *release_ms,
            phase_ms: best.phase_ms,
            cycles: best.cycles,
            dipole_e: expected(&best),
            snr: expected(&best) / noise_e,
            found_percent: 100.0 * found,
            release_error_percent: scatter.map(|scatter| 100.0 * scatter),
            found,
            scatter,
        }
    }

    /// Remaining uncertainty after counting and fitting all traps of the detector.
    fn known(
        &self,
        mission: &Mission,
        model: &Model,
        setup: &Setup,
        own: &Device,
        dipoles: &[Dipole],
    ) -> Result<Vec<Known>, InputError> {
        let transfers = f64::from(mission.readout.transfers);
        let noise = mission.readout.noise.as_ref();
        let pixels = transfers * noise.map_or(transfers, |noise| f64::from(noise.columns));
        let reached = own.cloud.height(setup.flat_e);
        let scatter = |dipole: &Dipole| dipole.scatter.unwrap_or(f64::INFINITY);
        let mut known = Vec::new();
        for (index, species) in own.traps.iter().enumerate() {
            let in_reach = species.density_per_px * reached * pixels;
            let counts = |dipole: &&Dipole| {
                dipole.species == species.name && dipole.found > MOST && in_reach * dipole.found >= 2.0
            };
            let seen: Vec<&Dipole> = dipoles.iter().filter(counts).collect();
            let Some(best) = seen.iter().min_by(|a, b| scatter(a).total_cmp(&scatter(b))) else { continue };
            // Release times at all temperatures where it is seen, with errors from the number of traps and the thermometer.
            let thermometer = |temperature_k: f64| self.thermometer(model, own, index, temperature_k);
            let sigma = |dipole: &&Dipole| -> Result<(f64, f64), InputError> {
                let fitted = scatter(dipole).powi(2) / (in_reach * dipole.found);
                Ok((dipole.temperature_k, (fitted + thermometer(dipole.temperature_k)?).sqrt()))
            };
            let measured = seen.iter().map(sigma).collect::<Result<Vec<_>, _>>()?;
            let operating_k = own.at.temperature_k;
            let of_thermometer = thermometer(operating_k)?;
            let release_error = extrapolated(&measured, operating_k).map(|variance| (variance + of_thermometer).sqrt());
            let traps = in_reach * best.found;
            // Poisson error of the count.
            let density_error = 1.0 / traps.sqrt();
            known.push(Known {
                species: species.name.clone(),
                temperature_k: best.temperature_k,
                phase_ms: best.phase_ms,
                traps,
                density_error_percent: 100.0 * density_error,
                release_error_percent: release_error.map(|error| 100.0 * error),
                density_error,
                release_error,
            });
        }
        Ok(known)
    }

    /// Variance of ln τ at a temperature (K) from the error of the thermometer.
    fn thermometer(&self, model: &Model, own: &Device, species: usize, temperature_k: f64) -> Result<f64, InputError> {
        let release_ms = |temperature_k: f64| -> Result<f64, InputError> {
            Ok(model.device(&Conditions { temperature_k, ..own.at.clone() })?.traps[species].release_ms)
        };
        let ratio = release_ms(temperature_k + self.temperature_error_k)? / release_ms(temperature_k)?;
        Ok(ratio.ln().powi(2))
    }

    /// Time for all phase times at one temperature, including readout, h.
    fn hours_per_temperature(&self, setup: &Setup) -> f64 {
        let images: f64 = setup.phases.iter().map(|phase| PHASES * phase.phase_ms * phase.cycles / 1000.0).sum::<f64>()
            * f64::from(self.images);
        (images + setup.exposure.readout_s * (setup.phases.len() * self.images as usize) as f64) / 3600.0
    }

    /// The factors of the correction with and without pumping. The well fill is assumed to be known.
    fn earned(
        &self,
        model: &Model,
        known: &[Known],
        seed: u64,
        advance: &(dyn Fn() + Sync),
    ) -> Result<Earned, InputError> {
        let mission = &model.mission;
        let Some(round_trip) = RoundTrip::new(model, mission.mission.duration_yr, ITERATIONS)? else {
            return Ok(Earned::ShapeLost);
        };
        let uncorrected = round_trip.uncorrected.magnitude();
        if uncorrected == 0.0 {
            return Ok(Earned::NothingToCorrect);
        }
        let of = |name: &str| known.iter().find(|known| known.species == name);
        let before = Knowledge::relative(mission, &|_| self.known_to, &|_| self.known_to, 0.0);
        let after = Knowledge::relative(
            mission,
            &|name| of(name).map_or(self.known_to, |known| known.density_error),
            &|name| of(name).and_then(|known| known.release_error).unwrap_or(self.known_to),
            0.0,
        );
        let factor = |knowledge: &Knowledge| -> Result<Option<Estimate>, InputError> {
            Ok(round_trip.drawn(knowledge, DRAWS, seed, advance)?.map(|left| left.under(uncorrected)))
        };
        let factors = factor(&before)?.zip(factor(&after)?);
        Ok(factors.map_or(Earned::ShapeLost, |(before, after)| Earned::Factors { before, after }))
    }
}

/// Variance of ln τ at a temperature (K) on the straight line of ln τT² against 1/T through measurements at others (K, with errors
/// of ln τ): the slope is the energy level. None if the only measurement is at another temperature.
fn extrapolated(measured: &[(f64, f64)], temperature_k: f64) -> Option<f64> {
    let weight = |sigma: f64| 1.0 / (sigma * sigma);
    let sum: f64 = measured.iter().map(|(_, sigma)| weight(*sigma)).sum();
    let mean = measured.iter().map(|(kelvin, sigma)| weight(*sigma) / kelvin).sum::<f64>() / sum;
    let spread: f64 = measured.iter().map(|(kelvin, sigma)| weight(*sigma) * (1.0 / kelvin - mean).powi(2)).sum();
    let away = 1.0 / temperature_k - mean;
    if away.abs() < 1e-12 {
        return Some(1.0 / sum);
    }
    // A spread within rounding counts as zero.
    (spread > 1e-20 * sum).then(|| 1.0 / sum + away * away / spread)
}
