//! Which uncertain input dominates the date on which the budget is exceeded.
//!
//! Inputs are multiplied by exp(σ z) with standard normal z and the relative uncertainties σ of `[uncertainty]`; each draw is a
//! mission of its own. Maxima of the Sun that are not known yet are shifted, each with all after it, by σ z with the scatter σ of
//! the length of a cycle. Shares are of the variance of ln |Δe| at the end of the mission, by linear regression on the z:
//!
//! ```text
//! ln |Δe| = β₀ + Σ βᵢ zᵢ + rest        share i = βᵢ²/(Σ β² + var(rest))
//! ```
//!
//! (Saltelli et al. 2008, Global Sensitivity Analysis: squared standardised regression coefficients of independent
//! inputs.) Confidence of the fluence is no such input: it is chosen, see `study shielding`.

use chrono::NaiveDate;
use clap::Args;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::estimate::with_errors;
use super::{Cell, Digits, Estimate, Kind, Study, Table};
use super::{column, days, known_date, ready, short};
use crate::cli::file_argument::InputFile;
use crate::environment::esp::Spectrum;
use crate::environment::shielding::{Geometry, dose_behind};
use crate::environment::solar_cycle::{self, ACTIVE_YR, CYCLE_SCATTER_YR, Maximum};
use crate::error::InputError;
use crate::mission::{Mission, Orbit};
use crate::model::Model;
use crate::numeric::calendar::{DAYS_PER_YEAR, date_after, decimal_year};
use crate::numeric::least_squares::Span;
use crate::physics::accuracy::Purpose;
use crate::physics::galaxy::snr;
use crate::plan::dose;
use crate::plan::timeline::Timeline;
use crate::report::plot::{Figure, Kind as Drawn, Panel, Series};

/// How far dates are followed beyond the mission where nothing else is asked for, in durations and in years.
const HORIZON: f64 = 3.0;
const HORIZON_YR: f64 = 100.0;

/// Percentiles of dates.
const PERCENTILES: [f64; 5] = [5.0, 16.0, 50.0, 84.0, 95.0];

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct ErrorBudget {
    /// Missions that are drawn
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub draws: u32,
    /// Years since launch up to which dates are followed [default: three times the mission, at most 100; the mission alone where
    /// its corrected budget is exceeded within half of it]
    #[arg(long, value_name = "YEARS")]
    pub horizon_yr: Option<f64>,
    /// Also fly this mission's detector, such as an n-channel one beside a p-channel one, all else the same
    #[arg(long, value_name = "MISSION")]
    pub detector_of: Option<InputFile>,
    /// Seed of the draws, in place of the mission's
    #[arg(long, value_name = "SEED")]
    pub seed: Option<u64>,
}

/// Changes a mission by a deviation of an input.
type Apply = dyn Fn(&mut Mission, f64) + Send + Sync;

/// An uncertain input.
struct Input {
    name: String,
    sigma: Sigma,
    apply: Box<Apply>,
}

/// How uncertain an input is.
#[derive(Clone, Copy, PartialEq)]
enum Sigma {
    /// Standard deviation of its logarithm.
    Relative(f64),
    /// Standard deviation, yr.
    Years(f64),
}

impl Input {
    /// Changes a mission by so many standard deviations of the input.
    fn deviate(&self, mission: &mut Mission, z: f64) {
        let (Sigma::Relative(sigma) | Sigma::Years(sigma)) = self.sigma;
        (self.apply)(mission, sigma * z);
    }
}

/// An input that is multiplied by a factor.
fn input(name: impl Into<String>, sigma: f64, apply: impl Fn(&mut Mission, f64) + Send + Sync + 'static) -> Input {
    let apply = Box::new(move |mission: &mut Mission, deviation: f64| apply(mission, deviation.exp()));
    Input { name: name.into(), sigma: Sigma::Relative(sigma), apply }
}

/// The lengths of cycles to maxima that are not known yet, in a mission that lists them. Each shifts all maxima after it.
fn cycles(maxima: &[Maximum]) -> Vec<Input> {
    let ahead = maxima.iter().enumerate().filter(|(_, maximum)| maximum.cycles_ahead > 0);
    let shift = |(index, maximum): (usize, &Maximum)| Input {
        name: format!("solar maximum {:.1}", maximum.year),
        sigma: Sigma::Years(CYCLE_SCATTER_YR),
        apply: Box::new(move |mission: &mut Mission, shift_yr: f64| {
            mission.environment.solar_maximum[index..].iter_mut().for_each(|year| *year += shift_yr);
        }),
    };
    ahead.map(shift).collect()
}

/// The inputs of a mission whose dose rate is given as a number, those known exactly left out. `shield` says by how much the
/// dose changes with the shield's thickness.
fn inputs(mission: &Mission, shield: Option<Shield>) -> Vec<Input> {
    let known = &mission.uncertainty;
    let scale_dose = |mission: &mut Mission, factor: f64| {
        if let Some(rate) = &mut mission.environment.active_dose_rate_mev_g_yr {
            *rate *= factor;
        }
    };
    let mut inputs = vec![input("dose model", known.dose_model, move |mission, factor| {
        scale_dose(mission, factor);
        mission.environment.cosmic_ray_floor_mev_g_yr *= factor;
    })];
    if let Some(shield) = shield {
        inputs
            .push(input("shielding", known.shielding, move |mission, factor| scale_dose(mission, shield.dose(factor))));
    }
    for (index, species) in mission.detector.traps.iter().enumerate() {
        inputs.push(input(format!("density {}", species.name), known.density, move |mission, factor| {
            mission.detector.traps[index].density_per_px *= factor;
        }));
        inputs.push(input(format!("release {}", species.name), known.release, move |mission, factor| {
            mission.detector.traps[index].release_ms *= factor;
        }));
    }
    inputs.push(input("full well", known.full_well, |mission, factor| {
        let detector = &mut mission.detector;
        detector.full_well_e = detector.notch_e + factor * (detector.full_well_e - detector.notch_e);
    }));
    inputs.push(input("well fill power", known.well_fill_power, |mission, factor| {
        mission.detector.well_fill_power *= factor;
    }));
    inputs.push(input("background", known.background, |mission, factor| mission.sky.background_e *= factor));
    inputs.push(input("galaxy flux", known.galaxy_flux, |mission, factor| {
        let galaxy = &mut mission.galaxies[0];
        galaxy.flux_e = galaxy.flux_e.map(|flux_e| flux_e * factor);
    }));
    inputs.push(input("galaxy size", known.galaxy_size, |mission, factor| mission.galaxies[0].half_light_px *= factor));
    inputs.retain(|input| input.sigma != Sigma::Relative(0.0));
    inputs
}

/// Dose of an active year behind a shield whose thickness is not quite known.
#[derive(Clone)]
struct Shield {
    spectrum: Spectrum,
    geometry: Geometry,
    thickness_mm: f64,
    niel: crate::environment::Niel,
}

impl Shield {
    /// The mission's shield, or the sphere that makes the dose rate it gives. None where there is none: in a low Earth orbit,
    /// or where no thickness makes that rate.
    fn of(mission: &Mission) -> Option<Shield> {
        let environment = &mission.environment;
        let spectrum = Spectrum::esp(environment.confidence, 1.0);
        let of = |geometry, thickness_mm| Shield {
            spectrum: spectrum.clone(),
            geometry,
            thickness_mm,
            niel: environment.niel,
        };
        match &mission.shielding {
            _ if mission.mission.orbit == Orbit::Leo => None,
            Some(shield) => Some(of(shield.geometry, shield.thickness_mm)),
            None => {
                dose::equivalent_mm(mission, Geometry::Sphere).map(|thickness_mm| of(Geometry::Sphere, thickness_mm))
            }
        }
    }

    /// Dose behind so many times the thickness, over the dose behind it.
    fn dose(&self, factor: f64) -> f64 {
        let dose = |thickness_mm: f64| dose_behind(&self.spectrum, self.geometry, thickness_mm, self.niel.curve());
        dose(factor * self.thickness_mm) / dose(self.thickness_mm)
    }
}

/// What becomes of one draw: |Δe| at the end of the mission, and when it exceeds the two limits (yr).
struct Fate {
    delta_e: Option<f64>,
    exceeded_yr: [Option<f64>; 2],
}

/// A mission that is drawn from.
struct Bench {
    model: Model,
    duration_yr: f64,
    inputs: Vec<Input>,
}

impl Bench {
    fn new(mission: &Mission, horizon_yr: f64) -> Result<Bench, InputError> {
        let model = ready(mission)?;
        let mut base = model.mission.clone();
        // Draws differ by factors: what is derived is made a number first.
        base.environment.active_dose_rate_mev_g_yr = Some(model.history().active_rate_mev_g_yr);
        let galaxy = &base.galaxies[0];
        let flux_e = snr::flux_e(&base, galaxy);
        base.galaxies[0].flux_e = Some(flux_e);
        base.galaxies[0].snr = None;
        base = Purpose::Draws.of(&base);
        let mut inputs = inputs(&base, Shield::of(mission));
        base.mission.duration_yr = horizon_yr;
        let last = decimal_year(base.mission.launch.0) + horizon_yr;
        // Those of which the active years may begin before the end; in years, so that draws can shift them.
        let maxima = solar_cycle::maxima(&base.environment.solar_maximum, last + ACTIVE_YR);
        base.environment.solar_maximum = maxima.iter().map(|maximum| maximum.year).collect();
        if !model.history().averages_the_cycle() {
            inputs.extend(cycles(&maxima));
        }
        Ok(Bench { duration_yr: mission.mission.duration_yr, model: model.like(&base), inputs })
    }

    fn fate(&self, deviations: &[f64]) -> Result<Fate, InputError> {
        let mut mission = self.model.mission.clone();
        for (input, deviation) in self.inputs.iter().zip(deviations) {
            input.deviate(&mut mission, *deviation);
        }
        let timeline = Timeline::of(&self.model.like(&mission))?;
        let requirement = &mission.requirement;
        let limits = [requirement.delta_e, requirement.delta_e * requirement.correction_factor];
        Ok(Fate {
            delta_e: timeline.at(self.duration_yr),
            exceeded_yr: limits.map(|limit| timeline.crossing(limit).t_yr),
        })
    }

    fn deviations(&self, seed: u64, draw: u32) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::from(draw));
        self.inputs.iter().map(|_| StandardNormal.sample(&mut random)).collect()
    }

    fn alone(&self, index: usize, deviation: f64) -> Result<Fate, InputError> {
        let mut deviations = vec![0.0; self.inputs.len()];
        deviations[index] = deviation;
        self.fate(&deviations)
    }
}

/// Everything that is found for one detector.
struct Budget {
    bench: Bench,
    nominal: Fate,
    fates: Vec<Fate>,
    /// What the draws tell, with the errors of their finite number.
    found: Found,
    /// Fates at −1 σ and +1 σ of each input alone.
    swings: Vec<[Fate; 2]>,
}

impl ErrorBudget {
    fn budget(&self, mission: &Mission, horizon_yr: f64, advance: &(dyn Fn() + Sync)) -> Result<Budget, InputError> {
        let bench = Bench::new(mission, horizon_yr)?;
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let needed = 2 * (bench.inputs.len() as u32 + 1);
        if self.draws < needed {
            let problem = format!("{} draws are too few for {} uncertain inputs", self.draws, bench.inputs.len());
            return Err(InputError::new("cannot draw", problem).with_help(format!("--draws {needed} or more")));
        }
        let deviations: Vec<Vec<f64>> = (0..self.draws).map(|draw| bench.deviations(seed, draw)).collect();
        let fate = |deviations: &Vec<f64>| {
            advance();
            bench.fate(deviations)
        };
        let fates: Vec<Result<Fate, InputError>> = deviations.par_iter().map(fate).collect();
        let fates = fates.into_iter().collect::<Result<Vec<Fate>, _>>()?;
        let swings: Vec<Result<[Fate; 2], InputError>> = (0..bench.inputs.len())
            .into_par_iter()
            .map(|index| Ok([bench.alone(index, -1.0)?, bench.alone(index, 1.0)?]))
            .collect();
        let swings = swings.into_iter().collect::<Result<_, _>>()?;
        let nominal = bench.fate(&vec![0.0; bench.inputs.len()])?;
        let found = Found::of(&deviations, &fates, bench.duration_yr, seed);
        Ok(Budget { nominal, fates, found, swings, bench })
    }
}

/// What draws tell, each number with its standard error.
struct Found {
    /// Share of the variance of each input, and of what is not linear; None where |Δe| does not vary or is lost.
    shares: Option<(Vec<Estimate>, Estimate)>,
    /// Standard deviation of ln |Δe| at the end of the mission.
    sigma_ln: Option<Estimate>,
    limits: [Exceeded; 2],
}

/// When a limit is exceeded.
struct Exceeded {
    /// Each percentile of the time (yr), with its error where that is known; None beyond the horizon.
    percentiles: Vec<Option<(f64, Option<f64>)>>,
    /// Share of the draws in which it is exceeded within the mission.
    within: Estimate,
}

impl Found {
    fn of(deviations: &[Vec<f64>], fates: &[Fate], duration_yr: f64, seed: u64) -> Found {
        let inputs = deviations[0].len();
        // For each limit its percentiles and the share within, then σ, then the shares and what is left of them.
        let statistics = |places: &[usize]| {
            let mut values = Vec::new();
            for limit in [0, 1] {
                let mut times: Vec<f64> =
                    places.iter().map(|place| fates[*place].exceeded_yr[limit].unwrap_or(f64::INFINITY)).collect();
                times.sort_by(f64::total_cmp);
                values.extend(PERCENTILES.map(|percent| percentile(&times, percent)));
                let within = times.partition_point(|t_yr| *t_yr <= duration_yr);
                values.push(within as f64 / times.len() as f64);
            }
            let logs = Logs::of(places, deviations, fates);
            values.push(logs.sigma());
            values.extend(logs.shares().unwrap_or(vec![f64::NAN; inputs + 1]));
            values
        };
        let mut found = with_errors(fates.len(), seed, statistics).into_iter();
        let mut next = || found.next().expect("as many as there are statistics");
        let estimate = |(value, error): (f64, Option<f64>)| Estimate { value, error: error.unwrap_or(0.0) };
        let limits = [0, 1].map(|_| Exceeded {
            percentiles: PERCENTILES.map(|_| next()).into_iter().map(|one| one.0.is_finite().then_some(one)).collect(),
            within: estimate(next()),
        });
        let sigma_ln = Some(estimate(next())).filter(|sigma| sigma.value.is_finite());
        let mut shares: Vec<Estimate> = found.map(estimate).collect();
        let rest = shares.pop().expect("what is left");
        Found { shares: (inputs > 0 && rest.value.is_finite()).then_some((shares, rest)), sigma_ln, limits }
    }
}

/// A percentile of sorted times (yr), between two of them on a straight line.
fn percentile(times: &[f64], percent: f64) -> f64 {
    let place = percent / 100.0 * (times.len() - 1) as f64;
    let (low, high) = (times[place.floor() as usize], times[place.ceil() as usize]);
    if low == high { low } else { low + place.fract() * (high - low) }
}

/// ln |Δe| at the end of the mission, and the deviations that made it, of draws that have a shape left then.
struct Logs<'a>(Vec<(&'a Vec<f64>, f64)>);

impl Logs<'_> {
    fn of<'a>(places: &[usize], deviations: &'a [Vec<f64>], fates: &[Fate]) -> Logs<'a> {
        let log = |place: &usize| {
            let delta_e = fates[*place].delta_e.filter(|delta_e| *delta_e > 0.0)?;
            Some((&deviations[*place], delta_e.ln()))
        };
        Logs(places.iter().filter_map(log).collect())
    }

    /// Standard deviation; not a number of fewer than two.
    fn sigma(&self) -> f64 {
        let n = self.0.len() as f64;
        let mean = self.0.iter().map(|(_, log)| log).sum::<f64>() / n;
        (self.0.iter().map(|(_, log)| (log - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
    }

    /// Shares of the variance of each input, and what is left. None where there are too few, or nothing varies.
    fn shares(&self) -> Option<Vec<f64>> {
        let inputs = self.0.first()?.0.len();
        if inputs == 0 || self.0.len() < 2 * (inputs + 1) {
            return None;
        }
        let design = DMatrix::from_fn(self.0.len(), inputs + 1, |row, column| match column {
            0 => 1.0,
            column => self.0[row].0[column - 1],
        });
        let values = DVector::from_iterator(self.0.len(), self.0.iter().map(|(_, log)| *log));
        let found = Span::of(&design, 1e-9).solve(&values);
        let rest = (&values - design * &found).norm_squared() / (self.0.len() - inputs - 1) as f64;
        let mut parts: Vec<f64> = found.iter().skip(1).map(|slope| slope * slope).collect();
        parts.push(rest);
        let total: f64 = parts.iter().sum();
        (total > 0.0).then(|| parts.iter().map(|part| part / total).collect())
    }
}

impl Budget {
    fn date(&self, t_yr: Option<f64>) -> Option<String> {
        date_after(self.bench.model.mission.mission.launch.0, t_yr?).map(|date| date.to_string())
    }

    /// The day that a percentile (by its place) of a limit stands for, and its error in days; None beyond the horizon.
    fn day(&self, limit: usize, percentile: usize) -> Option<(NaiveDate, Option<f64>)> {
        let (t_yr, error_yr) = self.found.limits[limit].percentiles[percentile]?;
        let date = date_after(self.bench.model.mission.mission.launch.0, t_yr)?;
        Some((date, error_yr.map(|error_yr| error_yr * DAYS_PER_YEAR)))
    }

    /// Shares of the variance, without their errors.
    fn shares(&self) -> Option<&[Estimate]> {
        self.found.shares.as_ref().map(|(shares, _)| &shares[..])
    }
}

impl Kind for ErrorBudget {
    fn study(&self, mission: &Mission, advance: &(dyn Fn() + Sync)) -> Result<Study, InputError> {
        let duration_yr = mission.mission.duration_yr;
        let corrected = mission.requirement.delta_e * mission.requirement.correction_factor;
        let soon =
            Timeline::of(&ready(mission)?)?.crossing(corrected).t_yr.is_some_and(|t_yr| t_yr < 0.5 * duration_yr);
        let long_yr = (HORIZON * duration_yr).min(HORIZON_YR).max(duration_yr);
        let horizon_yr = self.horizon_yr.unwrap_or(if soon { duration_yr } else { long_yr });
        if !(horizon_yr >= duration_yr && horizon_yr <= HORIZON_YR.max(duration_yr)) {
            let problem =
                format!("a horizon of {horizon_yr} yr; allowed: {duration_yr} (the mission) to {HORIZON_YR} yr");
            return Err(InputError::new("cannot follow dates", problem));
        }
        let own = self.budget(mission, horizon_yr, advance)?;
        let other = match &self.detector_of {
            None => None,
            Some(path) => {
                let other = Mission::read(path)?;
                let flown = Mission { detector: other.detector.clone(), ..mission.clone() };
                Some((other.mission.name, self.budget(&flown, horizon_yr, advance)?))
            }
        };
        let mut study = Study::of(
            "error-budget",
            mission,
            format!(
                "what the uncertainties of the inputs do to the date on which the budget of \"{}\" is exceeded; {} draws, \
                 followed for {} yr",
                mission.requirement.galaxy,
                self.draws,
                short(horizon_yr)
            ),
        );
        study.cite(
            "Shares of the variance: squared regression coefficients",
            "Saltelli et al. 2008, Global Sensitivity Analysis",
        );
        study.tables = vec![inputs_table(&own)];
        study.tables.push(dates_table("dates", String::new(), &own));
        if let Some((name, budget)) = &other {
            study.tables.push(dates_table("other_dates", format!("The same with the detector of \"{name}\""), budget));
        }
        study.figures = vec![("error-budget.svg".into(), figure(mission, &own))];
        conclude(&mut study, mission, &own, horizon_yr);
        if let Some((name, other)) = &other {
            side_by_side(&mut study, &own, name, other);
        }
        Ok(study)
    }
}

/// Inputs by their share, the largest first.
fn ranked(budget: &Budget) -> Vec<usize> {
    let mut order: Vec<usize> = (0..budget.bench.inputs.len()).collect();
    if let Some(shares) = budget.shares() {
        order.sort_by(|a, b| shares[*b].value.total_cmp(&shares[*a].value));
    }
    order
}

fn inputs_table(budget: &Budget) -> Table {
    let in_years = budget.bench.inputs.iter().any(|input| matches!(input.sigma, Sigma::Years(_)));
    let day = |fate: &Fate| budget.date(fate.exceeded_yr[0]).map_or(Cell::None, Cell::from);
    let over = |fate: &Fate| fate.delta_e.zip(budget.nominal.delta_e).filter(|(_, nominal)| *nominal > 0.0);
    let rows = ranked(budget).into_iter().map(|index| {
        let [low, high] = &budget.swings[index];
        let (percent, years) = match budget.bench.inputs[index].sigma {
            Sigma::Relative(sigma) => (Some(100.0 * sigma), None),
            Sigma::Years(sigma_yr) => (None, Some(sigma_yr)),
        };
        vec![
            budget.bench.inputs[index].name.clone().into(),
            percent.into(),
            years.into(),
            budget.shares().map_or(Cell::None, |shares| shares[index].times(100.0).into()),
            over(high).map(|(with, without)| 100.0 * (with / without - 1.0)).into(),
            day(low),
            day(high),
        ]
    });
    Table {
        name: "inputs",
        title:
            "Share of the variance of ln |delta e| at the end; each input alone: |delta e| at +1 sigma, and when the \
                uncorrected budget is exceeded"
                .into(),
        columns: vec![
            column("input", "input", Digits::Fixed(0)),
            column("sigma_percent", "sigma [%]", Digits::Significant(3)),
            column("sigma_yr", if in_years { "sigma [yr]" } else { "" }, Digits::Significant(3)),
            column("share_percent", "share [%]", Digits::Fixed(1)).with_error("share_error_percent"),
            column("delta_e_percent", "|delta e| [%]", Digits::Fixed(2)),
            column("low_date", "at -1 sigma", Digits::Fixed(0)),
            column("high_date", "at +1 sigma", Digits::Fixed(0)),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}

fn dates_table(name: &'static str, title: String, budget: &Budget) -> Table {
    let mut columns = vec![column("budget", "budget", Digits::Fixed(0))];
    columns.extend(PERCENTILES.iter().map(|percent| {
        let date = column(format!("p{percent:02}_date"), format!("{percent} %"), Digits::Fixed(0));
        date.with_error(format!("p{percent:02}_error_d"))
    }));
    columns
        .push(column("exceeded_within_percent", "flown", Digits::Fixed(0)).with_error("exceeded_within_error_percent"));
    let row = |(limit, name): (usize, &str)| {
        let date =
            |place: usize| budget.day(limit, place).map_or(Cell::None, |(date, error_d)| Cell::Date(date, error_d));
        let mut row: Vec<Cell> = vec![name.into()];
        row.extend((0..PERCENTILES.len()).map(date));
        row.push(budget.found.limits[limit].within.times(100.0).into());
        row
    };
    let own = "Percentiles of the date on which the budget is exceeded (-: later than the years that were followed), with standard \
               errors in days; flown: % of draws in which that is within the mission";
    Table {
        name,
        title: if title.is_empty() { own.into() } else { title },
        columns,
        rows: ["uncorrected", "corrected"].into_iter().enumerate().map(row).collect(),
        ..Table::default()
    }
}

fn figure(mission: &Mission, budget: &Budget) -> Figure {
    let launch = decimal_year(mission.mission.launch.0);
    let sorted = |limit: usize| -> (Vec<f64>, Vec<f64>) {
        let mut times: Vec<f64> = budget.fates.iter().filter_map(|fate| fate.exceeded_yr[limit]).collect();
        times.sort_by(f64::total_cmp);
        let n = budget.fates.len() as f64;
        (
            times.iter().map(|t_yr| launch + t_yr).collect(),
            (1..=times.len()).map(|rank| 100.0 * rank as f64 / n).collect(),
        )
    };
    let curve = |label: &str, color: usize, limit: usize| {
        let (x, y) = sorted(limit);
        Series { label: Some(label.into()), color, kind: Drawn::Line { x, y, dashed: false } }
    };
    let end = launch + mission.mission.duration_yr;
    let series = vec![
        curve("uncorrected", 2, 0),
        curve("corrected", 1, 1),
        Series { label: Some("mission".into()), color: 3, kind: Drawn::Shade { from: launch, to: end } },
    ];
    let dates = Panel {
        x_label: "date [year]".into(),
        y_label: "exceeded by then [% of draws]".into(),
        series,
        ..Panel::default()
    };
    let mut panels = vec![dates];
    if let Some(shares) = budget.shares() {
        let order = ranked(budget);
        let bars = order.iter().enumerate().map(|(place, index)| {
            let (x, y) = (place as f64 + 1.0, 100.0 * shares[*index].value);
            let kind = Drawn::Line { x: vec![x, x], y: vec![0.0, y], dashed: false };
            let points = Drawn::Points { x: vec![x], y: vec![y], sigma: None };
            let label = (y >= 1.0).then(|| format!("{}: {}", place + 1, budget.bench.inputs[*index].name));
            [Series { label: None, color: place % 8, kind }, Series { label, color: place % 8, kind: points }]
        });
        panels.push(Panel {
            x_label: "input".into(),
            y_label: "share [%]".into(),
            series: bars.flatten().collect(),
            ..Panel::default()
        });
    }
    Figure { title: format!("{}: error budget", mission.mission.name), panels }
}

fn conclude(study: &mut Study, mission: &Mission, budget: &Budget, horizon_yr: f64) {
    study.result("nominal_exceeded_t_yr", budget.nominal.exceeded_yr[0]);
    study.result("nominal_delta_e", budget.nominal.delta_e);
    if Shield::of(mission).is_none() {
        study.find("The shield is no input: no thickness of aluminium stands for the dose that the mission gives.");
    }
    let lost = budget.fates.iter().filter(|fate| fate.delta_e.is_none()).count();
    if lost > 0 {
        study.find(format!(
            "In {lost} of {} draws no shape is left at the end of the mission: they count as exceeded when it is lost, and not in \
             the shares.",
            budget.fates.len()
        ));
    }
    match &budget.found.shares {
        Some((shares, rest)) => {
            study.result("rest_share", rest.value);
            study.result("rest_share_error", rest.error);
            let order = ranked(budget);
            let said =
                |index: &usize| format!("{} ({} %)", budget.bench.inputs[*index].name, shares[*index].times(100.0));
            let next: Vec<String> = order.iter().skip(1).take(2).map(said).collect();
            study.result("dominant_input", budget.bench.inputs[order[0]].name.clone());
            let mut words = format!("The dominant uncertainty is {}", said(&order[0]));
            if !next.is_empty() {
                words += &format!(", before {}", next.join(" and "));
            }
            study.find(format!("{words}; {} % of the variance is not linear in the inputs.", rest.times(100.0)));
            if let Some(sigma) = budget.found.sigma_ln {
                study.result("sigma_ln_delta_e", sigma.value);
                study.result("sigma_ln_delta_e_error", sigma.error);
                study.find(format!(
                    "|delta e| at the end of the mission is known to {} % (1 sigma).",
                    sigma.times(100.0)
                ));
            }
        }
        None if budget.bench.inputs.is_empty() => study.find("No input is uncertain: there is a single date."),
        None => study.find("The inputs change nothing that can be measured at the end of the mission."),
    }
    for (limit, name) in ["uncorrected", "corrected"].into_iter().enumerate() {
        let said = |place: usize| match budget.day(limit, place) {
            Some((date, error_d)) => {
                let error = error_d.map_or("error not known".into(), days);
                format!("{} ({error})", known_date(date, error_d))
            }
            None => format!("later than {} yr after launch", short(horizon_yr)),
        };
        let [low, middle, high] = [0, 2, 4];
        let median = budget.found.limits[limit].percentiles[middle];
        study.result(&format!("{name}_median_t_yr"), median.map(|(t_yr, _)| t_yr));
        study.result(&format!("{name}_median_error_yr"), median.and_then(|(_, error_yr)| error_yr));
        study.find(if budget.day(limit, low).is_none() {
            format!("The {name} budget is exceeded {} in 95 % of the draws.", said(low))
        } else {
            format!(
                "The {name} budget is exceeded in half of the draws by {}; in nine of ten between {} and {}.",
                said(middle),
                said(low),
                said(high)
            )
        });
    }
}

/// One detector against the other.
fn side_by_side(study: &mut Study, own: &Budget, name: &str, other: &Budget) {
    let Some((mine, theirs)) = own.nominal.delta_e.zip(other.nominal.delta_e).filter(|(mine, _)| *mine > 0.0) else {
        study.find(format!("With the detector of \"{name}\", or with its own, no shape is left to compare."));
        return;
    };
    study.result("other_over_own_delta_e", theirs / mine);
    let dominant = |budget: &Budget| {
        if budget.shares().is_some() { budget.bench.inputs[ranked(budget)[0]].name.clone() } else { "nothing".into() }
    };
    study.find(format!(
        "The detector of \"{name}\" has {:.2} times the shape error under the same dose, clock, sky and galaxy; its date hangs on \
         {} most, that of the mission's own on {}.",
        theirs / mine,
        dominant(other),
        dominant(own)
    ));
}
