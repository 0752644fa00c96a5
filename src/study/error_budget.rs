//! Which uncertain input dominates the date on which the budget is exceeded.
//!
//! Inputs are multiplied by exp(σ z) with standard normal z and the relative uncertainties σ of `[uncertainty]`; each draw is a
//! mission of its own. Shares are of the variance of ln |Δe| at the end of the mission, by linear regression on the z:
//!
//! ```text
//! ln |Δe| = β₀ + Σ βᵢ zᵢ + rest        share i = βᵢ²/(Σ β² + var(rest))
//! ```
//!
//! (Saltelli et al. 2008, Global Sensitivity Analysis: squared standardised regression coefficients of independent
//! inputs.) Confidence of the fluence is no such input: it is chosen, see `study shielding`.

use clap::Args;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::launch::until;
use super::{Cell, Digits, Kind, Study, Table, Timeline};
use super::{column, ready, short};
use crate::accuracy::Purpose;
use crate::calendar::{date_after, decimal_year};
use crate::dose;
use crate::environment::esp::Spectrum;
use crate::environment::shielding::{Geometry, dose_behind};
use crate::error::InputError;
use crate::file_argument::InputFile;
use crate::galaxy::snr;
use crate::least_squares::Span;
use crate::mission::{Mission, Orbit};
use crate::model::Model;
use crate::plot::{Figure, Kind as Drawn, Panel, Series};

/// How far dates are followed beyond the mission where nothing else is asked for, in durations and in years.
const HORIZON: f64 = 3.0;
const HORIZON_YR: f64 = 100.0;

/// Percentiles of dates.
const PERCENTILES: [f64; 5] = [5.0, 16.0, 50.0, 84.0, 95.0];

/// Options of the study.
#[derive(Clone, Debug, Args)]
pub struct ErrorBudget {
    /// Missions that are drawn
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
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

/// Multiplies an input of a mission by a factor.
type Apply = dyn Fn(&mut Mission, f64) + Send + Sync;

/// An uncertain input.
struct Input {
    name: String,
    sigma: f64,
    apply: Box<Apply>,
}

fn input(name: impl Into<String>, sigma: f64, apply: impl Fn(&mut Mission, f64) + Send + Sync + 'static) -> Input {
    Input { name: name.into(), sigma, apply: Box::new(apply) }
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
    inputs.retain(|input| input.sigma > 0.0);
    inputs
}

/// Dose of an active year behind a shield whose thickness is not quite known.
#[derive(Clone)]
struct Shield {
    spectrum: Spectrum,
    geometry: Geometry,
    thickness_mm: f64,
    niel: crate::mission::Niel,
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
        let inputs = inputs(&base, Shield::of(mission));
        let (mut base, _) = until(&base, decimal_year(base.mission.launch.0) + horizon_yr);
        base.mission.duration_yr = horizon_yr;
        Ok(Bench { duration_yr: mission.mission.duration_yr, model: model.like(&base), inputs })
    }

    fn fate(&self, deviations: &[f64]) -> Result<Fate, InputError> {
        let mut mission = self.model.mission.clone();
        for (input, deviation) in self.inputs.iter().zip(deviations) {
            (input.apply)(&mut mission, (input.sigma * deviation).exp());
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
    /// Share of the variance of each input, and of what is not linear; None where |Δe| does not vary or is lost.
    shares: Option<(Vec<f64>, f64)>,
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
        Ok(Budget { shares: shares(&deviations, &fates), nominal, fates, swings, bench })
    }
}

/// Shares of the variance of ln |Δe|, and what is left.
fn shares(deviations: &[Vec<f64>], fates: &[Fate]) -> Option<(Vec<f64>, f64)> {
    let inputs = deviations[0].len();
    let measured: Vec<(&Vec<f64>, f64)> = deviations
        .iter()
        .zip(fates)
        .filter_map(|(deviations, fate)| Some((deviations, fate.delta_e.filter(|delta_e| *delta_e > 0.0)?.ln())))
        .collect();
    if inputs == 0 || measured.len() < 2 * (inputs + 1) {
        return None;
    }
    let design = DMatrix::from_fn(measured.len(), inputs + 1, |row, column| match column {
        0 => 1.0,
        column => measured[row].0[column - 1],
    });
    let values = DVector::from_iterator(measured.len(), measured.iter().map(|(_, value)| *value));
    let found = Span::of(&design, 1e-9).solve(&values);
    let rest = (&values - design * &found).norm_squared() / (measured.len() - inputs - 1) as f64;
    let squares: Vec<f64> = found.iter().skip(1).map(|slope| slope * slope).collect();
    let total = squares.iter().sum::<f64>() + rest;
    (total > 0.0).then(|| (squares.iter().map(|square| square / total).collect(), rest / total))
}

impl Budget {
    /// Percentile of the date on which a limit is exceeded (yr); None beyond the horizon.
    fn percentile(&self, limit: usize, percent: f64) -> Option<f64> {
        let mut times: Vec<f64> =
            self.fates.iter().map(|fate| fate.exceeded_yr[limit].unwrap_or(f64::INFINITY)).collect();
        times.sort_by(f64::total_cmp);
        let place = percent / 100.0 * (times.len() - 1) as f64;
        let (low, high) = (times[place.floor() as usize], times[place.ceil() as usize]);
        let between = if low == high { low } else { low + place.fract() * (high - low) };
        between.is_finite().then_some(between)
    }

    /// Share of the draws in which a limit is exceeded within the mission.
    fn exceeded(&self, limit: usize) -> f64 {
        let within = |fate: &&Fate| fate.exceeded_yr[limit].is_some_and(|t_yr| t_yr <= self.bench.duration_yr);
        self.fates.iter().filter(within).count() as f64 / self.fates.len() as f64
    }

    fn date(&self, t_yr: Option<f64>) -> Option<String> {
        date_after(self.bench.model.mission.mission.launch.0, t_yr?).map(|date| date.to_string())
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
    if let Some((shares, _)) = &budget.shares {
        order.sort_by(|a, b| shares[*b].total_cmp(&shares[*a]));
    }
    order
}

fn inputs_table(budget: &Budget) -> Table {
    let day = |fate: &Fate| budget.date(fate.exceeded_yr[0]).map_or(Cell::None, Cell::from);
    let over = |fate: &Fate| fate.delta_e.zip(budget.nominal.delta_e).filter(|(_, nominal)| *nominal > 0.0);
    let rows = ranked(budget).into_iter().map(|index| {
        let [low, high] = &budget.swings[index];
        vec![
            budget.bench.inputs[index].name.clone().into(),
            (100.0 * budget.bench.inputs[index].sigma).into(),
            budget.shares.as_ref().map(|(shares, _)| 100.0 * shares[index]).into(),
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
            column("share_percent", "share [%]", Digits::Fixed(1)),
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
    let percentile = |percent: &f64| column(format!("p{percent:02}_date"), format!("{percent} %"), Digits::Fixed(0));
    columns.extend(PERCENTILES.iter().map(percentile));
    columns.push(column("exceeded_within_percent", "flown", Digits::Fixed(0)));
    let row = |(limit, name): (usize, &str)| {
        let date = |percent: &f64| budget.date(budget.percentile(limit, *percent)).map_or(Cell::None, Cell::from);
        let mut row: Vec<Cell> = vec![name.into()];
        row.extend(PERCENTILES.iter().map(date));
        row.push((100.0 * budget.exceeded(limit)).into());
        row
    };
    let own = "Percentiles of the date on which the budget is exceeded (-: later than the years that were followed); flown: % of \
               draws in which that is within the mission";
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
    if let Some((shares, _)) = &budget.shares {
        let order = ranked(budget);
        let bars = order.iter().enumerate().map(|(place, index)| {
            let (x, y) = (place as f64 + 1.0, 100.0 * shares[*index]);
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
    match &budget.shares {
        Some((shares, rest)) => {
            study.result("rest_share", *rest);
            let order = ranked(budget);
            let said =
                |index: &usize| format!("{} ({:.0} %)", budget.bench.inputs[*index].name, 100.0 * shares[*index]);
            let next: Vec<String> = order.iter().skip(1).take(2).map(said).collect();
            study.result("dominant_input", budget.bench.inputs[order[0]].name.clone());
            let mut words = format!("The dominant uncertainty is {}", said(&order[0]));
            if !next.is_empty() {
                words += &format!(", before {}", next.join(" and "));
            }
            study.find(format!("{words}; {:.1} % of the variance is not linear in the inputs.", 100.0 * rest));
            let spread = budget.fates.iter().filter_map(|fate| fate.delta_e);
            let logs: Vec<f64> = spread.filter(|delta_e| *delta_e > 0.0).map(f64::ln).collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            let sigma = (logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (logs.len() - 1) as f64).sqrt();
            study.result("sigma_ln_delta_e", sigma);
            study.find(format!("|delta e| at the end of the mission is known to {:.0} % (1 sigma).", 100.0 * sigma));
        }
        None if budget.bench.inputs.is_empty() => study.find("No input is uncertain: there is a single date."),
        None => study.find("The inputs change nothing that can be measured at the end of the mission."),
    }
    for (limit, name) in ["uncorrected", "corrected"].into_iter().enumerate() {
        let [low, _, middle, _, high] = PERCENTILES.map(|percent| budget.date(budget.percentile(limit, percent)));
        let said =
            |date: Option<String>| date.unwrap_or_else(|| format!("later than {} yr after launch", short(horizon_yr)));
        study.result(&format!("{name}_median_t_yr"), budget.percentile(limit, 50.0));
        study.find(if low.is_none() {
            format!("The {name} budget is exceeded {} in 95 % of the draws.", said(None))
        } else {
            format!(
                "The {name} budget is exceeded on {} in the median; in nine of ten draws between {} and {}.",
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
        if budget.shares.is_some() { budget.bench.inputs[ranked(budget)[0]].name.clone() } else { "nothing".into() }
    };
    study.find(format!(
        "The detector of \"{name}\" has {:.2} times the shape error under the same dose, clock, sky and galaxy; its date hangs on \
         {} most, that of the mission's own on {}.",
        theirs / mine,
        dominant(other),
        dominant(own)
    ));
}
