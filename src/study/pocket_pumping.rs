//! Pocket pumping: which traps it finds at which temperature and phase time, and what that adds to the correction.
//!
//! A flat field is shuffled back and forth N times. A trap under the right electrode catches an electron on the way there and
//! lets it go within a window of one phase time t, on the wrong side of a barrier: one pixel grows at the expense of its
//! neighbour. The dipole has the intensity
//!
//! ```text
//! I = N P (exp(−t/τ) − exp(−2t/τ))        largest at t = τ ln 2, where it is N P/4
//! ```
//!
//! (Mostek et al. 2010, Proc. SPIE 7742; Murray et al. 2012, Proc. SPIE 8453; Hall et al. 2014, IEEE Trans. Nucl. Sci. 61, 1826;
//! Skottfelt et al. 2017), with the probability P of a capture. Measured at several phase times it gives
//! the release time of a single trap; at several temperatures, its energy level.
//!
//! Dipoles are simulated with the shot noise of the flat, read noise, and the chance of every single pump, and fitted. A three-phase
//! cycle takes six phase times: long ones leave time for few cycles, which is why slow traps are pumped warm.

use clap::Args;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;

use super::correction::{Bench, Knowledge};
use super::{Digits, Estimate, Exposure, Kind, Study, Table};
use super::{column, line, numbers, ratios, ready, short};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Device;
use crate::model::Model;
use crate::physics::conditions::Conditions;
use crate::report::plot::{Figure, Panel};

/// Phases of a three-phase pumping cycle, 1-2-3-1'-3-2.
const PHASES: f64 = 6.0;

/// Phase times that are tried where none are given, ms, and how many.
const PHASE_MS: (f64, f64) = (1e-3, 1e4);
const PHASE_COUNT: usize = 29;

/// Temperatures that are tried where none are given, from the operating one, K.
const STEPS_K: [f64; 6] = [-20.0, 0.0, 20.0, 40.0, 60.0, 80.0];

/// Release times on which a fit starts, and steps of its golden section.
const STARTS: usize = 240;
const SECTIONS: usize = 40;

/// Share of a species' dipoles that must be found for it to count as found.
const MOST: f64 = 0.5;

/// Draws of believed parameters, before and after, and iterations of the correction.
const DRAWS: u32 = 100;
const ITERATIONS: u32 = 4;

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct PocketPumping {
    /// Temperatures at which is pumped, K [default: the operating one, 20 K below, and up to 80 K above]
    #[arg(long, value_name = "KELVIN")]
    pub temperature_k: Option<String>,
    /// Phase times, ms [default: 0.001..10000:log:29]
    #[arg(long, value_name = "MS")]
    pub phase_ms: Option<String>,
    /// Most cycles of one image
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub cycles: u32,
    /// Longest pumping of one image, s
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = positive)]
    pub image_s: f64,
    /// Images at each phase time
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub images: u32,
    /// Charge of the flat field, e- per pixel [default: 5 % of the full well]
    #[arg(long, value_name = "ELECTRONS", value_parser = positive)]
    pub flat_e: Option<f64>,
    /// Probability that a trap in the cloud catches an electron in a cycle
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = probability)]
    pub capture_probability: f64,
    /// Dipoles of each species that are simulated and fitted at each temperature
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub dipoles: u32,
    /// Dipoles count as found beyond so many sigma of the flat's noise
    #[arg(long, value_name = "SIGMA", default_value_t = 5.0, value_parser = positive)]
    pub threshold_sigma: f64,
    /// Error of the thermometer, K
    #[arg(long, value_name = "KELVIN", default_value_t = 0.05, value_parser = positive)]
    pub temperature_error_k: f64,
    /// Relative error (1 sigma) of densities and release times where pumping does not find the species
    #[arg(long, value_name = "SHARE", default_value_t = 0.05, value_parser = probability)]
    pub known_to: f64,
    /// Seed of the dipoles, in place of the mission's
    #[arg(long, value_name = "SEED")]
    pub seed: Option<u64>,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err("a number above 0 is needed".into()),
    }
}

fn probability(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => Err("a share above 0 and up to 1 is needed, such as 0.5".into()),
    }
}

/// Intensity of a dipole (e-) after so many cycles with a phase time, of a trap with a release time (both ms) that catches with
/// a probability.
pub fn dipole_e(cycles: f64, probability: f64, phase_ms: f64, release_ms: f64) -> f64 {
    let left = (-phase_ms / release_ms).exp();
    // exp(−t/τ) − exp(−2t/τ)
    cycles * probability * left * (1.0 - left)
}

/// One phase time of a series of images.
#[derive(Clone, Copy, Debug)]
struct Phase {
    phase_ms: f64,
    cycles: f64,
}

/// What is found of one species at one temperature.
struct Found {
    temperature_k: f64,
    species: usize,
    release_ms: f64,
    best: Phase,
    dipole_e: f64,
    /// Over the noise of the flat.
    snr: f64,
    /// Share of its dipoles beyond the threshold.
    share: f64,
    /// Root mean square of ln(fitted release time/true one) of a single trap.
    scatter: Option<f64>,
}

/// Noise and cycles of the images.
struct Setup {
    flat_e: f64,
    exposure: Exposure,
    phases: Vec<Phase>,
}

impl PocketPumping {
    fn setup(&self, mission: &Mission) -> Result<Setup, InputError> {
        let flat_e = self.flat_e.unwrap_or(0.05 * mission.detector.full_well_e);
        if flat_e > mission.detector.full_well_e {
            let problem =
                format!("the flat has {flat_e} e-, above the full well of {} e-", mission.detector.full_well_e);
            return Err(InputError::new("cannot pump", problem));
        }
        let phases_ms = match &self.phase_ms {
            Some(text) => numbers("readout.line_time_ms", text)?,
            None => ratios(PHASE_MS.0, PHASE_MS.1, PHASE_COUNT),
        };
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

    /// The same with the chance of the pumps: each of N succeeds or does not.
    fn variance(&self, setup: &Setup, cycles: f64, dipole_e: f64) -> f64 {
        let chance = (dipole_e * (1.0 - dipole_e / cycles)).max(0.0);
        self.flat_variance(setup) + chance / f64::from(self.images)
    }

    fn search(&self, setup: &Setup, device: &Device, species: usize, seed: u64, stream: u64) -> Found {
        let release_ms = device.traps[species].release_ms;
        let expected = |phase: &Phase| dipole_e(phase.cycles, self.capture_probability, phase.phase_ms, release_ms);
        let largest = |a: &&Phase, b: &&Phase| expected(a).total_cmp(&expected(b));
        let best = *setup.phases.iter().max_by(largest).expect("at least one phase time");
        let noise_e = self.flat_variance(setup).sqrt();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        let grid = Grid::new(&setup.phases);
        let threshold_e = self.threshold_sigma * noise_e;
        let mut deviations = Vec::new();
        for _ in 0..self.dipoles {
            let measured: Vec<(f64, f64)> = setup
                .phases
                .iter()
                .map(|phase| {
                    let mean = expected(phase);
                    let sigma = self.variance(setup, phase.cycles, mean).sqrt();
                    (Normal::new(mean, sigma).expect("a finite width").sample(&mut random), sigma)
                })
                .collect();
            // Seen at its best phase time, and so told from the flat.
            let seen = setup
                .phases
                .iter()
                .zip(&measured)
                .any(|(phase, (dipole, _))| phase.phase_ms == best.phase_ms && *dipole > threshold_e);
            if seen {
                deviations.push((grid.fit(&measured) / release_ms).ln());
            }
        }
        let n = deviations.len() as f64;
        Found {
            temperature_k: device.at.temperature_k,
            species,
            release_ms,
            best,
            dipole_e: expected(&best),
            snr: expected(&best) / noise_e,
            share: n / f64::from(self.dipoles),
            scatter: (n > 0.0).then(|| (deviations.iter().map(|off| off * off).sum::<f64>() / n).sqrt()),
        }
    }
}

/// Release times between which a fit chooses, with the shape of the dipole against phase time for each.
struct Grid<'a> {
    phases: &'a [Phase],
    nodes: Vec<(f64, Vec<f64>)>,
}

impl Grid<'_> {
    fn new(phases: &[Phase]) -> Grid<'_> {
        let ends = |pick: fn(f64, f64) -> f64| phases.iter().map(|phase| phase.phase_ms).reduce(pick).expect("a phase");
        let times = ratios(ends(f64::min) / 10.0, ends(f64::max) * 10.0, STARTS);
        let nodes = times.into_iter().map(|release_ms| (release_ms.ln(), shape(phases, release_ms))).collect();
        Grid { phases, nodes }
    }

    /// Release time (ms) that fits dipoles with errors best, whatever the probability of capture.
    fn fit(&self, measured: &[(f64, f64)]) -> f64 {
        let chi2 = |shape: &[f64]| {
            // χ² of the best amplitude: Σ y²w − (Σ y m w)²/Σ m²w, the first of which is always the same.
            let sums = measured.iter().zip(shape).fold((0.0, 0.0), |(across, own), ((dipole, sigma), model)| {
                let weight = 1.0 / (sigma * sigma);
                (across + weight * dipole * model, own + weight * model * model)
            });
            if sums.1 > 0.0 && sums.0 > 0.0 { -sums.0 * sums.0 / sums.1 } else { 0.0 }
        };
        let best = |a: &usize, b: &usize| chi2(&self.nodes[*a].1).total_cmp(&chi2(&self.nodes[*b].1));
        let node = (0..self.nodes.len()).min_by(best).expect("many nodes");
        let place = |node: usize| self.nodes[node].0;
        let (mut low, mut high) = (place(node.saturating_sub(1)), place((node + 1).min(self.nodes.len() - 1)));
        // Golden section.
        let share = 0.5 * (5_f64.sqrt() - 1.0);
        let at = |log_ms: f64| chi2(&shape(self.phases, log_ms.exp()));
        for _ in 0..SECTIONS {
            let (left, right) = (high - share * (high - low), low + share * (high - low));
            if at(left) < at(right) { high = right } else { low = left }
        }
        (0.5 * (low + high)).exp()
    }
}

/// Dipoles at each phase time for a capture that is certain, e-.
fn shape(phases: &[Phase], release_ms: f64) -> Vec<f64> {
    phases.iter().map(|phase| dipole_e(phase.cycles, 1.0, phase.phase_ms, release_ms)).collect()
}

/// Variance of ln τ at a temperature (K) on the straight line of ln τT² against 1/T through measurements at others (K, with
/// errors of ln τ): the slope is the energy level. None where there is but one measurement, at another temperature.
fn extrapolated(measured: &[(f64, f64)], temperature_k: f64) -> Option<f64> {
    let weight = |sigma: f64| 1.0 / (sigma * sigma);
    let sum: f64 = measured.iter().map(|(_, sigma)| weight(*sigma)).sum();
    let mean = measured.iter().map(|(kelvin, sigma)| weight(*sigma) / kelvin).sum::<f64>() / sum;
    let spread: f64 = measured.iter().map(|(kelvin, sigma)| weight(*sigma) * (1.0 / kelvin - mean).powi(2)).sum();
    let away = 1.0 / temperature_k - mean;
    if away.abs() < 1e-12 {
        return Some(1.0 / sum);
    }
    // A spread of rounding is none.
    (spread > 1e-20 * sum).then(|| 1.0 / sum + away * away / spread)
}

/// What pumping makes known of one species.
struct Known {
    name: String,
    /// Traps found on the detector.
    traps: f64,
    density_error: f64,
    /// At the operating temperature; None where the energy level that leads there is not measured.
    release_error: Option<f64>,
    temperature_k: f64,
    phase_ms: f64,
}

impl Kind for PocketPumping {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let model = ready(mission)?;
        let setup = self.setup(mission)?;
        let own_k = mission.detector.temperature_k;
        let temperatures = match &self.temperature_k {
            Some(text) => numbers("detector.temperature_k", text)?,
            None => STEPS_K.iter().map(|step| own_k + step).filter(|kelvin| *kelvin >= 40.0).collect(),
        };
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let duration_yr = mission.mission.duration_yr;
        let cold = |temperature_k: f64| model.device(&Conditions { temperature_k, ..model.conditions(duration_yr) });
        let devices: Vec<Device> =
            temperatures.iter().map(|temperature_k| cold(*temperature_k)).collect::<Result<_, _>>()?;
        let cases: Vec<(usize, usize)> = (0..devices.len())
            .flat_map(|device| (0..devices[device].traps.len()).map(move |species| (device, species)))
            .collect();
        let found: Vec<Found> = cases
            .par_iter()
            .map(|&(device, species)| {
                advance();
                self.search(&setup, &devices[device], species, seed, (device * 1000 + species) as u64)
            })
            .collect();
        let own = cold(own_k)?;
        let names: Vec<String> = own.traps.iter().map(|species| species.name.clone()).collect();
        let mut study = Study::of(
            "pocket-pumping",
            mission,
            format!(
                "traps found by pocket pumping at the end of the mission: {} cycles or {} s, flat of {} e-, {} images per phase \
                 time",
                self.cycles,
                short(self.image_s),
                short(setup.flat_e),
                self.images
            ),
        );
        study.cite(
            "Pocket pumping: dipoles of single traps",
            "Mostek et al. 2010 (Proc. SPIE 7742); Murray et al. 2012 (Proc. SPIE 8453); Hall et al. 2014 (IEEE Trans. Nucl. Sci. 61, 1826); Skottfelt et al. 2017",
        );
        let known = self.known(mission, &model, &setup, &own, &found)?;
        study.tables = vec![table(&found, &names), known_table(&known)];
        study.figures = vec![("pocket-pumping.svg".into(), self.figure(mission, &setup, &own))];
        self.conclude(&mut study, &setup, &own, &found, &known);
        self.correction(&mut study, &model, &known, seed, advance)?;
        Ok(study)
    }
}

impl PocketPumping {
    /// What counting and fitting all traps of the detector leaves unknown.
    fn known(
        &self,
        mission: &Mission,
        model: &Model,
        setup: &Setup,
        own: &Device,
        found: &[Found],
    ) -> Result<Vec<Known>, InputError> {
        let transfers = f64::from(mission.readout.transfers);
        let noise = mission.readout.noise.as_ref();
        let pixels = transfers * noise.map_or(transfers, |noise| f64::from(noise.columns));
        let reached = own.cloud.height(setup.flat_e);
        let scatter = |found: &Found| found.scatter.unwrap_or(f64::INFINITY);
        let mut known = Vec::new();
        for (index, species) in own.traps.iter().enumerate() {
            let in_reach = species.density_per_px * reached * pixels;
            let counts = |found: &&Found| found.species == index && found.share > MOST && in_reach * found.share >= 2.0;
            let seen: Vec<&Found> = found.iter().filter(counts).collect();
            let Some(best) = seen.iter().min_by(|a, b| scatter(a).total_cmp(&scatter(b))) else { continue };
            // Release times at all temperatures where it is seen, each as good as its traps and its thermometer.
            let thermometer = |temperature_k: f64| self.thermometer(model, own, index, temperature_k);
            let sigma = |found: &&Found| -> Result<(f64, f64), InputError> {
                let fitted = scatter(found).powi(2) / (in_reach * found.share);
                Ok((found.temperature_k, (fitted + thermometer(found.temperature_k)?).sqrt()))
            };
            let measured = seen.iter().map(sigma).collect::<Result<Vec<_>, _>>()?;
            let operating_k = own.at.temperature_k;
            let of_thermometer = thermometer(operating_k)?;
            known.push(Known {
                name: species.name.clone(),
                traps: in_reach * best.share,
                // Counted, one by one.
                density_error: 1.0 / (in_reach * best.share).sqrt(),
                release_error: extrapolated(&measured, operating_k).map(|variance| (variance + of_thermometer).sqrt()),
                temperature_k: best.temperature_k,
                phase_ms: best.best.phase_ms,
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

    fn conclude(&self, study: &mut Study, setup: &Setup, own: &Device, found: &[Found], known: &[Known]) {
        for known in known {
            study.find(format!(
                "{} is found best at {} K with phases of {} ms: {} traps in reach of the flat; density known to {:.2} %, release \
                 time at {} K {}.",
                known.name,
                short(known.temperature_k),
                short(known.phase_ms),
                short(known.traps),
                100.0 * known.density_error,
                short(own.at.temperature_k),
                known.release_error.map_or("not: its energy level needs a second temperature".into(), |error| {
                    format!("to {:.2} % (thermometer {} K)", 100.0 * error, self.temperature_error_k)
                })
            ));
        }
        for (index, species) in
            own.traps.iter().enumerate().filter(|(_, species)| known.iter().all(|known| known.name != species.name))
        {
            if species.density_per_px <= 0.0 {
                study.find(format!("{} is not there at the end of the mission.", species.name));
                continue;
            }
            let best = found.iter().filter(|found| found.species == index).max_by(|a, b| a.snr.total_cmp(&b.snr));
            if let Some(best) = best {
                study.find(format!(
                    "{} is not found: its best dipole, {} e- at {} K with phases of {} ms and {} cycles, is {:.1} sigma of the \
                     flat's noise, with a release time of {} ms.",
                    species.name,
                    short(best.dipole_e),
                    short(best.temperature_k),
                    short(best.best.phase_ms),
                    best.best.cycles,
                    best.snr,
                    short(best.release_ms)
                ));
            }
        }
        let images: f64 = setup.phases.iter().map(|phase| PHASES * phase.phase_ms * phase.cycles / 1000.0).sum::<f64>()
            * f64::from(self.images);
        let hours = (images + setup.exposure.readout_s * (setup.phases.len() * self.images as usize) as f64) / 3600.0;
        study.result("hours_per_temperature", hours);
        study.find(format!(
            "All {} phase times at one temperature take {hours:.1} h with reading out.",
            setup.phases.len()
        ));
    }

    /// What the correction earns with and without what pumping tells.
    fn correction(
        &self,
        study: &mut Study,
        model: &Model,
        known: &[Known],
        seed: u64,
        advance: &(dyn Fn() + Sync),
    ) -> Result<(), InputError> {
        let mission = &model.mission;
        let Some(bench) = Bench::new(model, mission.mission.duration_yr, ITERATIONS)? else { return Ok(()) };
        let uncorrected = bench.uncorrected.magnitude();
        if uncorrected == 0.0 {
            study.find("There is nothing to correct at the end of the mission.");
            return Ok(());
        }
        let of = |name: &str| known.iter().find(|known| known.name == name);
        let before = Knowledge::relative(mission, &|_| self.known_to, &|_| self.known_to, 0.0);
        let after = Knowledge::relative(
            mission,
            &|name| of(name).map_or(self.known_to, |known| known.density_error),
            &|name| of(name).and_then(|known| known.release_error).unwrap_or(self.known_to),
            0.0,
        );
        let factor = |knowledge: &Knowledge| -> Result<Option<Estimate>, InputError> {
            Ok(bench.drawn(knowledge, DRAWS, seed, advance)?.map(|left| left.under(uncorrected)))
        };
        let (Some(before), Some(after)) = (factor(&before)?, factor(&after)?) else { return Ok(()) };
        for (key, factor) in [("factor_before", before), ("factor_after", after)] {
            study.result(key, factor.value);
            study.result(&format!("{key}_error"), factor.error);
        }
        study.find(format!(
            "With every density and release time known to {} %, the correction earns a factor {before}; with what pumping \
             tells, {after} (well fill taken as known; read noise apart: see `study correction`).",
            100.0 * self.known_to
        ));
        Ok(())
    }

    fn figure(&self, mission: &Mission, setup: &Setup, own: &Device) -> Figure {
        let x: Vec<f64> = setup.phases.iter().map(|phase| phase.phase_ms).collect();
        let curve = |release_ms: f64| -> Vec<f64> {
            let at = |phase: &Phase| dipole_e(phase.cycles, self.capture_probability, phase.phase_ms, release_ms);
            setup.phases.iter().map(at).collect()
        };
        let mut series: Vec<_> = own
            .traps
            .iter()
            .enumerate()
            .map(|(index, species)| line(&species.name, index + 1, &x, curve(species.release_ms)))
            .collect();
        series.push(super::level("threshold", self.threshold_sigma * self.flat_variance(setup).sqrt()));
        let panel = Panel {
            x_label: "phase time [ms]".into(),
            y_label: "dipole [e-]".into(),
            x_log: true,
            series,
            ..Panel::default()
        };
        Figure {
            title: format!("{}: dipoles at {} K", mission.mission.name, short(own.at.temperature_k)),
            panels: vec![panel],
        }
    }
}

fn table(found: &[Found], names: &[String]) -> Table {
    let rows = found.iter().map(|found| {
        vec![
            found.temperature_k.into(),
            names[found.species].clone().into(),
            found.release_ms.into(),
            found.best.phase_ms.into(),
            found.best.cycles.into(),
            found.dipole_e.into(),
            found.snr.into(),
            (100.0 * found.share).into(),
            found.scatter.map(|scatter| 100.0 * scatter).into(),
        ]
    });
    Table {
        name: "dipoles",
        title: "Dipoles at the best phase time, and release times fitted to all, trap by trap".into(),
        columns: vec![
            column("temperature_k", "T [K]", Digits::Significant(4)),
            column("species", "species", Digits::Fixed(0)),
            column("release_ms", "release [ms]", Digits::Significant(3)),
            column("phase_ms", "phase [ms]", Digits::Significant(3)),
            column("cycles", "cycles", Digits::Fixed(0)),
            column("dipole_e", "dipole [e-]", Digits::Significant(3)),
            column("snr", "sigma", Digits::Fixed(1)),
            column("found_percent", "found [%]", Digits::Fixed(0)),
            column("release_error_percent", "to [%]", Digits::Significant(2)),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}

fn known_table(known: &[Known]) -> Table {
    let rows = known.iter().map(|known| {
        vec![
            known.name.clone().into(),
            known.temperature_k.into(),
            known.phase_ms.into(),
            known.traps.into(),
            (100.0 * known.density_error).into(),
            known.release_error.map(|error| 100.0 * error).into(),
        ]
    });
    Table {
        name: "known",
        title: "What becomes known of all traps in reach; release times at the operating temperature".into(),
        columns: vec![
            column("species", "species", Digits::Fixed(0)),
            column("temperature_k", "T [K]", Digits::Significant(4)),
            column("phase_ms", "phase [ms]", Digits::Significant(3)),
            column("traps", "traps", Digits::Significant(3)),
            column("density_error_percent", "density to [%]", Digits::Significant(2)),
            column("release_error_percent", "release to [%]", Digits::Significant(2)),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}
