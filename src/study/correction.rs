//! Software correction: the factor not assumed but earned.
//!
//! A galaxy is read out through the detector as it is, and corrected with the detector as it is believed to be, by iterating the
//! forward model (Bristow 2003; Massey et al. 2010, MNRAS 401, 371):
//!
//! ```text
//! image₀ = observed        imageₖ₊₁ = imageₖ + observed − trail(imageₖ)
//! ```
//!
//! What is left of the change of shape, over what it was, says how much is corrected. Read noise is added after the transfers
//! but corrected as if before them, which leaves a part of its own (Massey et al. 2014, MNRAS 439, 887). Published: 97 % of
//! trails corrected on ACS (Massey et al. 2010), 98 % (Massey et al. 2014), and for a perfect model with read noise alone 99.68 %
//! of ellipticity in simulations for Euclid (Israel et al. 2015, MNRAS 453, 561).

use std::path::Path;

use clap::Args;
use nalgebra::{Cholesky, DMatrix, DVector};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson, StandardNormal};
use rayon::prelude::*;
use serde_json::Value;

use super::estimate::with_errors;
use super::{Cell, Digits, Estimate, Exposure, Kind, Study, Table};
use super::{column, days, known_date, level, line, ready, short, when};
use crate::cli::file_argument::InputFile;
use crate::error::InputError;
use crate::io::input;
use crate::mission::Mission;
use crate::model::{Above, Beside, Device, Model, Scene, downstream};
use crate::physics::galaxy::{Profile, snr};
use crate::physics::shape::{Moments, ShapeChange};
use crate::plan::timeline::Timeline;
use crate::readout::Downstream;
use crate::report::plot::{Figure, Panel};

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct Correction {
    /// Relative error (1 sigma) of each species' density
    #[arg(long, value_name = "SHARE", default_value_t = 0.05, value_parser = share)]
    pub density_error: f64,
    /// Relative error (1 sigma) of each release time
    #[arg(long, value_name = "SHARE", default_value_t = 0.05, value_parser = share)]
    pub release_error: f64,
    /// Relative error (1 sigma) of the well fill power
    #[arg(long, value_name = "SHARE", default_value_t = 0.02, value_parser = share)]
    pub well_fill_error: f64,
    /// Take parameters, their errors and correlations from what `ctiplan fit --json` printed, instead of the three above
    #[arg(long, value_name = "FIT.json", conflicts_with_all = ["density_error", "release_error", "well_fill_error"])]
    pub fit: Option<InputFile>,
    /// Iterations of the forward model
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=50))]
    pub iterations: u32,
    /// Sets of believed parameters that are drawn
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub draws: u32,
    /// Read noise, e- per pixel [default: that of the mission's clock, or of its galaxy]
    #[arg(long, value_name = "ELECTRONS", value_parser = electrons)]
    pub read_noise_e: Option<f64>,
    /// Galaxies with noise that are corrected with the true model; 0 for none
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    pub realisations: u32,
    /// Seed of the draws and of the noise, in place of the mission's
    #[arg(long, value_name = "SEED")]
    pub seed: Option<u64>,
}

fn share(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("a share between 0 and 1 is needed, such as 0.05 for 5 %".into()),
    }
}

fn electrons(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(electrons) if (0.0..=1e4).contains(&electrons) => Ok(electrons),
        _ => Err("a read noise between 0 and 10000 e- is needed".into()),
    }
}

/// An image (e-, background included) as it was before the transfers, from what was observed and a believed detector.
pub fn corrected(
    believed: &Device,
    observed_e: &Array2<f64>,
    downstream: Downstream,
    beside: Beside,
    iterations: u32,
) -> Result<Array2<f64>, InputError> {
    let mut image = observed_e.clone();
    for _ in 0..iterations {
        let trailed = believed.read(&image, downstream, beside)?;
        image = image + observed_e - trailed;
    }
    Ok(image)
}

/// What is known of the detector: parameters by their keys in the mission, with errors (1 σ) and correlations.
#[derive(Clone, Debug)]
pub struct Knowledge {
    /// Key, and error in the key's unit.
    pub parameters: Vec<(String, f64)>,
    /// Correlation of the errors; none where they are independent.
    pub correlation: Option<Vec<Vec<f64>>>,
}

impl Knowledge {
    /// Independent relative errors of densities, release times and well fill power of the mission's detector.
    pub fn relative(
        mission: &Mission,
        density: &dyn Fn(&str) -> f64,
        release: &dyn Fn(&str) -> f64,
        well_fill: f64,
    ) -> Knowledge {
        let detector = &mission.detector;
        let mut parameters = Vec::new();
        for species in &detector.traps {
            let key = |field: &str| format!("detector.traps.{}.{field}", species.name);
            parameters.push((key("density_per_px"), density(&species.name) * species.density_per_px));
            parameters.push((key("release_ms"), release(&species.name) * species.release_ms));
        }
        parameters.push(("detector.well_fill_power".into(), well_fill * detector.well_fill_power));
        parameters.retain(|(_, sigma)| *sigma > 0.0);
        Knowledge { parameters, correlation: None }
    }

    /// From the JSON of `ctiplan fit`.
    fn read(path: &Path, mission: &Mission) -> Result<Knowledge, InputError> {
        let refuse = |problem: String| {
            InputError::new(format!("cannot use the fit `{}`", path.display()), problem)
                .with_help("it must be what `ctiplan fit MISSION DATA... --json` prints")
        };
        let text = input::text(path).map_err(refuse)?;
        let fit: Value = serde_json::from_str(&text).map_err(|error| refuse(error.to_string()))?;
        let listed = fit["parameters"].as_array().ok_or_else(|| refuse("there are no `parameters`".into()))?;
        let mut parameters = Vec::new();
        for parameter in listed {
            let key = parameter["key"].as_str().ok_or_else(|| refuse("a parameter has no `key`".into()))?;
            if mission.number(key).is_none() {
                return Err(refuse(format!("`{key}` is no number of the mission \"{}\"", mission.mission.name)));
            }
            let sigma = parameter["sigma"].as_f64();
            let sigma = sigma.ok_or_else(|| refuse(format!("`{key}` has no error: the data did not determine it")))?;
            parameters.push((key.to_string(), sigma));
        }
        let row = |row: &Value| row.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>();
        let correlation =
            fit["correlation"].as_array().and_then(|rows| rows.iter().map(row).collect::<Option<Vec<_>>>());
        let whole = |rows: &Vec<Vec<f64>>| {
            rows.len() == parameters.len() && rows.iter().all(|row| row.len() == parameters.len())
        };
        match correlation {
            Some(rows) if whole(&rows) => Ok(Knowledge { parameters, correlation: Some(rows) }),
            _ => Err(refuse("`correlation` is not a square of numbers, one row for each parameter".into())),
        }
    }

    /// Deviations (in σ) of one draw, correlated as the errors are.
    fn draw(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let free: Vec<f64> = self.parameters.iter().map(|_| StandardNormal.sample(random)).collect();
        let Some(rows) = &self.correlation else { return free };
        // A hair on the diagonal: parameters that are fully correlated have no Cholesky factor otherwise.
        let matrix = DMatrix::from_fn(rows.len(), rows.len(), |row, column| {
            rows[row][column] + if row == column { 1e-9 } else { 0.0 }
        });
        match Cholesky::new(matrix) {
            Some(cholesky) => (cholesky.l() * DVector::from_vec(free)).iter().copied().collect(),
            None => free,
        }
    }
}

/// A galaxy on its way through a detector and back.
pub(super) struct Bench<'a> {
    model: &'a Model,
    t_yr: f64,
    scene: &'a Scene,
    truth: Device,
    downstream: Downstream,
    iterations: u32,
    /// Change of shape without correction.
    pub uncorrected: ShapeChange,
}

impl<'a> Bench<'a> {
    /// The judged galaxy at a time (years since launch). None where no shape is left to correct.
    ///
    /// # Errors
    /// Where a formula has no value, here and below.
    pub fn new(model: &'a Model, t_yr: f64, iterations: u32) -> Result<Option<Bench<'a>>, InputError> {
        let truth = model.device_at(t_yr)?;
        let (Some(scene), Some(uncorrected)) = (model.scene(0), model.change_by(0, &truth)?) else {
            return Ok(None);
        };
        let downstream = downstream(truth.at.transfers, scene.half_px(), truth.at.background_e);
        Ok(Some(Bench { model, t_yr, scene, truth, downstream, iterations, uncorrected }))
    }

    /// What is left of the change of shape after correction with a believed detector. None where no shape is left.
    ///
    /// # Errors
    /// As [`Bench::new`].
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

    /// The same with deviations (in σ) of what is known. Positive parameters stay positive: errors are taken of the logarithm.
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

    /// Root mean square of |Δe| that is left over draws of what is known, with its standard error. None where a draw leaves no
    /// shape.
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
        let left: Vec<Result<_, InputError>> = (0..draws).into_par_iter().map(one).collect();
        // The first of several errors, whichever came first.
        let left = left.into_iter().collect::<Result<Vec<_>, _>>()?;
        let squares: Option<Vec<f64>> = left.iter().map(|change| Some(change.as_ref()?.magnitude().powi(2))).collect();
        let Some(squares) = squares else { return Ok(None) };
        let rms = |places: &[usize]| {
            vec![(places.iter().map(|place| squares[*place]).sum::<f64>() / places.len() as f64).sqrt()]
        };
        let (value, error) = with_errors(squares.len(), seed, rms)[0];
        Ok(error.map(|error| Estimate { value, error }))
    }

    /// What the true model leaves of galaxies with photon noise (before the transfers) and read noise (after them): mean, and
    /// its standard error. None without realisations.
    ///
    /// The difference between the corrected image and the one before the transfers, with the same read noise, is added to the
    /// galaxy without noise, to first order: what becomes of a stack of many. (Ellipticities of single faint galaxies have no
    /// mean worth the name: noise brings their size close to 0.)
    fn noisy(
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
            // With the same read noise of both signs: what is proportional to it has no mean, and cancels.
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
        let changes: Vec<Result<_, InputError>> = (0..realisations).into_par_iter().map(one).collect();
        let changes: Option<Vec<ShapeChange>> = changes.into_iter().collect::<Result<_, _>>()?;
        Ok(changes.filter(|changes| changes.len() > 1).map(|changes| ShapeChange::mean_and_error(&changes)))
    }
}

/// Standard errors beyond which a mean is not chance.
const STANDS_OUT: f64 = 3.0;

/// Share of a difference that is added to a galaxy: small enough for its shape to follow in proportion.
const FIRST_ORDER: f64 = 1e-3;

/// Streams of the noise, apart from those of the draws.
const NOISE: u64 = 1 << 32;

/// What one cause leaves.
struct Left {
    cause: String,
    /// Its error in %, where it is a parameter's.
    error_percent: Option<f64>,
    delta_e: Option<f64>,
    /// Standard error of that, where it is estimated from draws.
    sigma: Option<f64>,
}

impl Left {
    /// A number made of |Δe| by a law, for a column.
    fn cell(&self, law: impl Fn(Estimate) -> Estimate) -> Cell {
        let of = |error: f64| self.delta_e.map(|value| law(Estimate { value, error }));
        match self.sigma {
            Some(sigma) => of(sigma).map_or(Cell::None, Cell::from),
            None => of(0.0).map(|exact| exact.value).into(),
        }
    }
}

impl Kind for Correction {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let model = ready(mission)?;
        let knowledge = match &self.fit {
            Some(path) => Knowledge::read(path, mission)?,
            None => Knowledge::relative(
                &model.mission,
                &|_| self.density_error,
                &|_| self.release_error,
                self.well_fill_error,
            ),
        };
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let mut study = Study::of(
            "correction",
            mission,
            format!(
                "what correction leaves of the shape error of \"{}\" at the end of the mission",
                mission.requirement.galaxy
            ),
        );
        study.cite(
            "Correction by iterating the readout",
            "Bristow 2003; Massey et al. 2010 (MNRAS 401, 371); Massey et al. 2014 (MNRAS 439, 887)",
        );
        let bench = Bench::new(&model, mission.mission.duration_yr, self.iterations)?;
        let Some(bench) = bench.filter(|bench| bench.uncorrected.magnitude() > 0.0) else {
            study.tables = vec![table(&[], 1.0)];
            study.find("There is nothing to correct at the end of the mission: no traps, or no shape left.");
            return Ok(study);
        };
        let uncorrected = bench.uncorrected.magnitude();
        let none = vec![0.0; knowledge.parameters.len()];
        let magnitude = |change: Option<ShapeChange>| change.map(|change| change.magnitude());
        let mut left = vec![Left {
            cause: "perfect knowledge".into(),
            error_percent: None,
            delta_e: magnitude(bench.left_with(&knowledge, &none)?),
            sigma: None,
        }];
        let single = |index: usize| {
            let mut deviations = none.clone();
            deviations[index] = 1.0;
            let (key, sigma) = &knowledge.parameters[index];
            let value = model.mission.number(key).unwrap_or(0.0);
            advance();
            Ok(Left {
                cause: key.strip_prefix("detector.").unwrap_or(key).into(),
                error_percent: (value != 0.0).then(|| 100.0 * sigma / value.abs()),
                delta_e: magnitude(bench.left_with(&knowledge, &deviations)?),
                sigma: None,
            })
        };
        left.extend((0..none.len()).into_par_iter().map(single).collect::<Result<Vec<_>, InputError>>()?);
        let together = match none.is_empty() {
            true => left[0].delta_e.map(|value| Estimate { value, error: 0.0 }),
            false => bench.drawn(&knowledge, self.draws, seed, advance)?,
        };
        left.push(Left {
            cause: "all together, rms".into(),
            error_percent: None,
            delta_e: together.map(|rms| rms.value),
            sigma: together.map(|rms| rms.error),
        });
        let read_noise_e = self.read_noise_e.unwrap_or_else(|| Exposure::of(mission).read_noise_e);
        // Without read noise the true model leaves nothing but the readout's accuracy.
        let realisations = if read_noise_e > 0.0 { self.realisations } else { 0 };
        let noisy = bench.noisy(read_noise_e, realisations, seed, advance)?;
        if let Some((mean, error)) = noisy {
            left.push(Left {
                cause: format!("noise, {} e- of reading", short(read_noise_e)),
                error_percent: None,
                delta_e: Some(mean.delta_e1.abs()),
                sigma: Some(error.delta_e1),
            });
        }
        study.tables = vec![table(&left, uncorrected)];
        study.result("uncorrected_delta_e", uncorrected);
        let noise = noisy.map(|(mean, error)| Estimate { value: mean.delta_e1.abs(), error: error.delta_e1 });
        conclude(&mut study, &model, &left, uncorrected, together, noise)?;
        Ok(study)
    }
}

fn table(left: &[Left], uncorrected: f64) -> Table {
    let rows = left.iter().map(|left| {
        vec![
            left.cause.clone().into(),
            left.error_percent.into(),
            left.cell(|delta_e| delta_e),
            left.cell(|delta_e| delta_e.times(100.0 / uncorrected)),
            left.cell(|delta_e| delta_e.under(uncorrected)),
        ]
    });
    Table {
        name: "causes",
        title: String::new(),
        columns: vec![
            column("cause", "imperfect", Digits::Fixed(0)),
            column("error_percent", "by [%]", Digits::Significant(3)),
            column("delta_e", "|delta e| left", Digits::Scientific(2)).with_error("delta_e_sigma"),
            column("left_percent", "left [%]", Digits::Significant(3)).with_error("left_error_percent"),
            column("factor", "factor", Digits::Significant(3)).with_error("factor_error"),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}

/// What errors of the parameters and noise leave together. The mean that noise leaves is a bias whose square is known from the
/// square of its estimate less that of its error: what is chance alone is nothing on average.
fn earned(uncorrected: f64, together: Estimate, noise: Option<Estimate>) -> Estimate {
    let noise = noise.unwrap_or(Estimate { value: 0.0, error: 0.0 });
    let bias2 = (noise.value.powi(2) - noise.error.powi(2)).max(0.0);
    let value = (together.value.powi(2) + bias2).sqrt();
    // Errors of the squares: 2 x σ, and for the bias 2 σ² at least.
    let squares = (2.0 * together.value * together.error)
        .hypot(2.0 * bias2.sqrt() * noise.error)
        .hypot(std::f64::consts::SQRT_2 * noise.error.powi(2));
    Estimate { value, error: 0.5 * squares / value }.under(uncorrected)
}

fn conclude(
    study: &mut Study,
    model: &Model,
    left: &[Left],
    uncorrected: f64,
    together: Option<Estimate>,
    noise: Option<Estimate>,
) -> Result<(), InputError> {
    let mission = &model.mission;
    let requirement = &mission.requirement;
    let timeline = Timeline::of(model)?;
    let assumed = requirement.correction_factor;
    let needed = uncorrected / requirement.delta_e;
    study.result("needed_factor", needed);
    study.result("assumed_factor", assumed);
    let Some(together) = together else {
        study.find("Correction with what is known leaves no shape to measure.");
        return Ok(());
    };
    let factor = earned(uncorrected, together, noise);
    let removed =
        Estimate { value: 100.0 * (1.0 - 1.0 / factor.value), error: 100.0 * factor.error / factor.value.powi(2) };
    study.result("earned_factor", factor.value);
    study.result("earned_factor_error", factor.error);
    study.result("corrected_percent", removed.value);
    study.result("corrected_error_percent", removed.error);
    let causes = || left.iter().filter(|left| left.error_percent.is_some());
    let square = |left: &Left| left.delta_e.map_or(0.0, |delta_e| delta_e * delta_e);
    if let Some(limits) = causes().max_by(|a, b| square(a).total_cmp(&square(b))) {
        let all: f64 = causes().map(square).sum();
        if all > 0.0 {
            study.result("limited_by", limits.cause.clone());
            study.find(format!(
                "What limits the correction is {}: its error of {} % alone leaves {:.2} % of the shape error, {:.0} % of the \
                 squares of all.",
                limits.cause,
                short(limits.error_percent.unwrap_or(0.0)),
                100.0 * limits.delta_e.unwrap_or(0.0) / uncorrected,
                100.0 * square(limits) / all
            ));
        }
    }
    study.find(match noise {
        Some(noise) if noise.value > STANDS_OUT * noise.error => format!(
            "Noise leaves {} even with the true model: read noise was not trailed, but is corrected as if it were.",
            noise.scientific()
        ),
        Some(noise) => format!(
            "Noise leaves nothing that stands out of its standard error, {:.0e}; more --realisations would tell more.",
            noise.error
        ),
        None => "Read noise is not in these figures: --read-noise-e, [readout.noise] or the galaxy's read_noise_e would give it."
            .into(),
    });
    let within = if needed <= 1.0 {
        "no correction is needed to the end of the mission".to_string()
    } else {
        format!("a factor {needed:.2} is needed to stay within the budget to the end")
    };
    study.find(format!(
        "The correction earns a factor {factor} ({removed} % removed), where the mission assumes {assumed}; {within}. Published: \
         a factor 10 (Massey et al. 2009, ACS), 98 % removed (Massey et al. 2014, ACS), 99.68 % in simulations with a perfect \
         model (Israel et al. 2015, Euclid)."
    ));
    study.find(format!(
        "The budget is exceeded: uncorrected {}, with the assumed factor {}, with the earned one {}.",
        when(timeline.date(requirement.delta_e)),
        when(timeline.date(requirement.delta_e * assumed)),
        earned_date(&timeline, requirement.delta_e, factor)
    ));
    let x: Vec<f64> = timeline.points.iter().map(|point| point.0).collect();
    let curve = |factor: f64| -> Vec<f64> {
        timeline.points.iter().map(|point| point.1.map_or(f64::NAN, |delta_e| delta_e / factor)).collect()
    };
    let panel = Panel {
        x_label: "years since launch".into(),
        y_label: "|delta e|".into(),
        series: vec![
            line("uncorrected", 2, &x, curve(1.0)),
            line(&format!("assumed factor {assumed}"), 1, &x, curve(assumed)),
            line(&format!("earned factor {factor}"), 3, &x, curve(factor.value)),
            level("budget", requirement.delta_e),
        ],
        ..Panel::default()
    };
    study.figures = vec![(
        "correction.svg".into(),
        Figure { title: format!("{}: correction", mission.mission.name), panels: vec![panel] },
    )];
    Ok(())
}

/// When the budget is exceeded with a factor that is known to its error: the dates of one error less and one more tell how well.
fn earned_date(timeline: &Timeline, delta_e: f64, factor: Estimate) -> String {
    let [low, own, high] =
        [-1.0, 0.0, 1.0].map(|errors| timeline.date(delta_e * (factor.value + errors * factor.error)));
    let Some(date) = own else { return when(own) };
    match low.zip(high.or(own)) {
        Some((low, high)) => {
            let error_d = 0.5 * (high - low).num_days() as f64;
            format!("{} ({})", known_date(date, Some(error_d)), days(error_d))
        }
        None => known_date(date, None),
    }
}
