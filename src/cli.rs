//! The command line: arguments → results → standard output, and the exit status.
//!
//! 0: done. 2: a bad command line or bad input, one message on standard error. 1: anything else, and a requirement that is
//! not met where `--check` asks for it.

use std::ffi::OsString;
use std::fs;
use std::io::{ErrorKind, Write, stdout};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;

use clap::{Args, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};

use crate::diagnose::{self, diagnose};
use crate::dose;
use crate::error::{InputError, nearest};
use crate::evaluate::evaluate;
use crate::measurement::DataSet;
use crate::mission::{self, Mission};
use crate::model::Model;
use crate::observable::Observable;
use crate::report::{self, EvaluateReport, FitReport, Format, Report};
use crate::scenario::{Axis, compare};
use crate::validate::validate;
use crate::{effect, fit, noise, output};

/// When will radiation damage to the CCDs have spoiled the shapes of galaxies?
///
/// A mission file (launch, orbit, shielding, detector, clocking) goes in; solar-cycle and displacement-damage models give
/// trap densities year by year; the readout trails galaxies through those traps; the change of their shape is held against
/// the budget.
#[derive(Debug, Parser)]
#[command(name = "ctiplan", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Dose and traps per year, shape error against time, and when the budget is exceeded
    Evaluate(Evaluate),
    /// A mission side by side over launch epochs, clock speeds, register distances, or any other key
    Compare(Compare),
    /// Proton spectrum, shielding and displacement damage dose of a mission
    Dose(Dose),
    /// Model against measurements: how far off, and against which condition the residuals lean
    Validate(Validate),
    /// Adjust what [fit] or --free names to measurements: values with errors and correlations
    Fit(Fit),
    /// Which physical effect the model is missing: found, calibrated against noise, confirmed on rows left out, and added
    Diagnose(Diagnose),
    /// The catalogue of effects, or one of them: its physics, its parameters, and what it looks like in residuals
    Effects(Effects),
}

#[derive(Debug, Args)]
struct Output {
    /// Print one JSON document
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print one table of comma-separated values
    #[arg(long)]
    csv: bool,
}

impl Output {
    fn format(&self) -> Format {
        match (self.json, self.csv) {
            (true, _) => Format::Json,
            (_, true) => Format::Csv,
            _ => Format::Text,
        }
    }
}

#[derive(Debug, Args)]
struct Evaluate {
    /// Mission file (TOML)
    mission: PathBuf,
    /// Another value of a key, such as detector.temperature_k=150; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Also read out so many galaxies with photon and read noise at the end of the mission
    #[arg(long, value_name = "REALISATIONS", value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    monte_carlo: Option<u32>,
    /// Seed of the realisations, in place of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Exit with status 1 where the corrected requirement is not met to the end of the mission
    #[arg(long)]
    check: bool,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
struct Compare {
    /// Mission files (TOML)
    #[arg(required = true)]
    missions: Vec<PathBuf>,
    /// Launch dates: 2009-01-01,2012-01-01 or 2009-01-01..2020-01-01:1 (step in years)
    #[arg(long, value_name = "DATES")]
    launch: Option<String>,
    /// Times between two parallel transfers, ms: 5,10,25 or 5..100:log:8
    #[arg(long, value_name = "MS")]
    line_time_ms: Option<String>,
    /// Distances to the register, in transfers: 825,1650 or 100..1700:100
    #[arg(long, value_name = "TRANSFERS")]
    transfers: Option<String>,
    /// Values of any key, such as detector.temperature_k=150,153,156; may be given several times
    #[arg(long, value_name = "KEY=VALUES")]
    set: Vec<String>,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
struct Dose {
    /// Mission file (TOML)
    mission: PathBuf,
    /// Another value of a key, such as shielding.thickness_mm=20; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Energies of the spectrum, MeV
    #[arg(long, value_name = "MEV", value_delimiter = ',', value_parser = energy)]
    energies_mev: Vec<f64>,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
struct Validate {
    /// Mission file (TOML)
    mission: PathBuf,
    /// Measurement files (ECSV or CSV)
    #[arg(required = true)]
    data: Vec<PathBuf>,
    /// Another value of a key, such as detector.temperature_k=150; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Draw data, model and residuals as SVG into this folder
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    /// Write each measurement file with columns `model` and `residual_sigma` into this folder, as ECSV
    #[arg(long, value_name = "DIR")]
    residuals: Option<PathBuf>,
    /// Seed of the simulated noise that leanings are compared with, in place of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
struct Adjust {
    /// A key to adjust, such as detector.traps.VV.release_ms, in addition to [fit] free; may be given several times
    #[arg(long, value_name = "KEY")]
    free: Vec<String>,
    /// Adjust only the keys given with --free, and not those of [fit] free
    #[arg(long, requires = "free")]
    only: bool,
}

impl Adjust {
    /// Keys to adjust: those of the mission's `[fit] free`, unless only others are wanted.
    fn keys(&self, mission: &Mission) -> Vec<String> {
        let mut keys = if self.only { Vec::new() } else { mission.fit.free.clone() };
        keys.extend(self.free.iter().filter(|key| self.only || !mission.fit.free.contains(key)).cloned());
        keys
    }
}

#[derive(Debug, Args)]
struct Fit {
    /// Mission file (TOML)
    mission: PathBuf,
    /// Measurement files (ECSV or CSV)
    #[arg(required = true)]
    data: Vec<PathBuf>,
    #[command(flatten)]
    adjust: Adjust,
    /// Another value of a key to start from; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Starting points: the mission's values, and random ones around them
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    starts: u32,
    /// Seed of the random starting points, in place of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Also fit without each value of this column in turn, and predict it
    #[arg(long, value_name = "COLUMN")]
    holdout: Option<String>,
    /// Write the mission with the fitted values; comments and order are kept
    #[arg(long, value_name = "NEW.toml")]
    write: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
struct Diagnose {
    /// Mission file (TOML)
    mission: PathBuf,
    /// Measurement files (ECSV or CSV)
    #[arg(required = true)]
    data: Vec<PathBuf>,
    #[command(flatten)]
    adjust: Adjust,
    /// Another value of a key to start from; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// False alarms allowed, as a share of complete models
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = level)]
    level: f64,
    /// Seed of all simulations, in place of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Effects of your own, as [effects.formula] or [[effects.formula]] in a file of their own; they compete on equal terms
    #[arg(long, value_name = "FILE.toml")]
    candidates: Option<PathBuf>,
    /// What could be measured next, such as trail,packet_charge; anything by default
    #[arg(long, value_name = "OBSERVABLES", value_delimiter = ',', value_parser = observable)]
    can: Vec<Observable>,
    /// Write the mission with the fitted values and the effects found; comments and order are kept
    #[arg(long, value_name = "NEW.toml")]
    write: Option<PathBuf>,
    /// Draw data and model before and after, residuals, and the falling error as SVG into this folder
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
struct Effects {
    /// The effect of which more is to be told
    kind: Option<String>,
    /// Print the whole catalogue as a page of documentation
    #[arg(long, conflicts_with_all = ["kind", "json", "csv"])]
    markdown: bool,
    #[command(flatten)]
    output: Output,
}

/// What a command comes to.
enum Outcome {
    Done,
    NotMet,
}

/// Runs the program with these arguments (the first is its name) and gives its exit status.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are no errors. Where nothing can be printed there is no one to tell.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    let result = match cli.command {
        Command::Evaluate(command) => command.run(),
        Command::Compare(command) => command.run(),
        Command::Dose(command) => command.run(),
        Command::Validate(command) => command.run(),
        Command::Fit(command) => command.run(),
        Command::Diagnose(command) => command.run(),
        Command::Effects(command) => command.run(),
    };
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::NotMet) => ExitCode::from(1),
        Err(Failure::Input(error)) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
        // The reader has seen enough (`ctiplan ... | head`).
        Err(Failure::Output(error)) if error.kind() == ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(Failure::Output(error)) => {
            eprintln!("error: cannot write the result\n  {error}");
            ExitCode::from(1)
        }
    }
}

/// Why a command has no result.
enum Failure {
    Input(InputError),
    Output(std::io::Error),
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Failure {
        Failure::Input(error)
    }
}

impl Evaluate {
    fn run(&self) -> Result<Outcome, Failure> {
        let mission = mission_with(&self.mission, &self.set)?;
        let evaluation = evaluate(&mission)?;
        let noisy = match self.monte_carlo {
            None => Vec::new(),
            Some(realisations) => {
                let seed = self.seed.unwrap_or(mission.accuracy.seed);
                let device = Model::new(&mission).device_at(mission.mission.duration_yr);
                let bar = progress(u64::from(realisations) * mission.galaxies.len() as u64, "galaxies");
                let realise =
                    |galaxy| noise::realise(&mission, galaxy, &device, realisations as usize, seed, || bar.inc(1));
                let noisy = mission.galaxies.iter().map(realise).collect();
                bar.finish_and_clear();
                noisy
            }
        };
        let met = evaluation.verdict.met();
        print(&EvaluateReport { evaluation, noisy }, &self.output)?;
        Ok(if self.check && !met { Outcome::NotMet } else { Outcome::Done })
    }
}

impl Compare {
    fn run(&self) -> Result<Outcome, Failure> {
        let missions = self.missions.iter().map(Mission::read).collect::<Result<Vec<_>, _>>()?;
        let named = [
            ("mission.launch", &self.launch),
            ("readout.line_time_ms", &self.line_time_ms),
            ("readout.transfers", &self.transfers),
        ];
        let mut axes = Vec::new();
        for (key, values) in named {
            if let Some(values) = values {
                axes.push(Axis::parse(key, values)?);
            }
        }
        for setting in &self.set {
            let (key, values) = key_and_value(setting)?;
            axes.push(Axis::parse(key, values)?);
        }
        if missions.len() == 1 && axes.is_empty() {
            return Err(InputError::new("cannot compare", "there is one mission and nothing that differs")
                .with_help("give --launch, --line-time-ms, --transfers or --set KEY=VALUES, or several missions")
                .into());
        }
        let scenarios = missions.len() * axes.iter().map(|axis| axis.values.len()).product::<usize>();
        let bar = progress(scenarios as u64, "scenarios");
        let comparison = compare(&missions, &axes, || bar.inc(1));
        bar.finish_and_clear();
        print(&comparison?, &self.output)?;
        Ok(Outcome::Done)
    }
}

impl Dose {
    fn run(&self) -> Result<Outcome, Failure> {
        let mission = mission_with(&self.mission, &self.set)?;
        let energies_mev: &[f64] = if self.energies_mev.is_empty() { &dose::ENERGIES_MEV } else { &self.energies_mev };
        print(&dose::survey(&mission, energies_mev), &self.output)?;
        Ok(Outcome::Done)
    }
}

impl Validate {
    fn run(&self) -> Result<Outcome, Failure> {
        let mission = mission_with(&self.mission, &self.set)?;
        let data = data_sets(&self.data, &mission)?;
        let validation = validate(&mission, &data, self.seed.unwrap_or(mission.accuracy.seed))?;
        if let Some(folder) = &self.plots {
            output::folder(folder)?;
            for (name, figure) in validation.figures() {
                output::write(folder.join(name), &figure.svg())?;
            }
        }
        if let Some(folder) = &self.residuals {
            output::folder(folder)?;
            for (name, table) in validation.tables() {
                output::write(folder.join(name), &table.to_ecsv())?;
            }
        }
        print(&validation, &self.output)?;
        Ok(Outcome::Done)
    }
}

impl Fit {
    fn run(&self) -> Result<Outcome, Failure> {
        let mission = mission_with(&self.mission, &self.set)?;
        let data = data_sets(&self.data, &mission)?;
        let keys = self.adjust.keys(&mission);
        if keys.is_empty() {
            return Err(InputError::new("cannot fit", "no key is free")
                .with_help("name some with --free, such as --free detector.traps.VV.density_per_px, or in [fit] free")
                .into());
        }
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        let options = fit::Options { starts: self.starts as usize, seed, ..fit::Options::default() };
        let bar = searching("chi2");
        let best = Mutex::new(f64::INFINITY);
        let progress = |chi2: f64| {
            let mut best = best.lock().expect("nobody panics while holding it");
            *best = best.min(chi2);
            bar.set_message(format!("{best:.2}"));
            bar.inc(1);
        };
        let fitted = fit::fit(&mission, &data, &keys, &options, &progress)?;
        let holdout = match &self.holdout {
            Some(column) => {
                *best.lock().expect("nobody panics while holding it") = f64::INFINITY;
                let model = Model::new(&fitted.mission);
                Some(fit::holdout::holdout(&model, &data, &keys, column, &options, &progress)?)
            }
            None => None,
        };
        bar.finish_and_clear();
        if let Some(path) = &self.write {
            let text = fs::read_to_string(&self.mission).map_err(Failure::Output)?;
            let mut settings = settings(&self.set)?;
            settings.extend(fitted.parameters.iter().map(|fitted| (fitted.key.clone(), fitted.value.into())));
            output::write(path, &mission::edit(&text, &mission, &settings))?;
        }
        print(&FitReport { fit: fitted, holdout }, &self.output)?;
        Ok(Outcome::Done)
    }
}

impl Diagnose {
    fn run(&self) -> Result<Outcome, Failure> {
        let mission = mission_with(&self.mission, &self.set)?;
        let data = data_sets(&self.data, &mission)?;
        let options = diagnose::Options {
            level: self.level,
            seed: self.seed.unwrap_or(mission.accuracy.seed),
            free: self.adjust.keys(&mission),
            candidates: self.candidates.as_ref().map(candidates).transpose()?,
            can: self.can.clone(),
        };
        let bar = progress(0, "steps");
        let stage = |name: &str, steps| {
            bar.reset();
            bar.set_length(steps);
            bar.set_message(name.to_string());
        };
        let found = diagnose(&mission, &data, &options, &diagnose::Progress { stage: &stage, advance: &|| bar.inc(1) });
        bar.finish_and_clear();
        let found = found?;
        if let Some(folder) = &self.plots {
            output::folder(folder)?;
            for (name, figure) in found.figures() {
                output::write(folder.join(name), &figure.svg())?;
            }
        }
        if let Some(path) = &self.write {
            let text = fs::read_to_string(&self.mission).map_err(Failure::Output)?;
            let text = mission::edit(&text, &Mission::read(&self.mission)?, &settings(&self.set)?);
            output::write(path, &found.improved_text(&text))?;
        }
        print(&found, &self.output)?;
        Ok(Outcome::Done)
    }
}

impl Effects {
    fn run(&self) -> Result<Outcome, Failure> {
        if self.markdown {
            let mut out = stdout().lock();
            let page = report::effects::page();
            out.write_all(page.as_bytes()).and_then(|()| out.flush()).map_err(Failure::Output)?;
            return Ok(Outcome::Done);
        }
        let Some(kind) = &self.kind else {
            print(&report::effects::Catalogue, &self.output)?;
            return Ok(Outcome::Done);
        };
        let kinds = || effect::CATALOGUE.iter().map(|entry| entry.card.kind);
        let entry = effect::find(kind).ok_or_else(|| {
            let problem = format!("no effect is called `{kind}`");
            let refusal = InputError::new("cannot tell of an effect", problem);
            match nearest(kind, kinds()) {
                Some(near) => refusal.with_help(format!("did you mean `{near}`?")),
                None => refusal.with_help(format!("there are: {}", kinds().collect::<Vec<_>>().join(", "))),
            }
        })?;
        print(&report::effects::OneEffect(entry), &self.output)?;
        Ok(Outcome::Done)
    }
}

/// Reads a mission and sets single values.
fn mission_with(path: &PathBuf, settings: &[String]) -> Result<Mission, InputError> {
    let mission = Mission::read(path)?;
    if settings.is_empty() { Ok(mission) } else { mission.with(&self::settings(settings)?) }
}

/// Reads measurement files for a mission.
fn data_sets(paths: &[PathBuf], mission: &Mission) -> Result<Vec<DataSet>, InputError> {
    paths.iter().map(|path| DataSet::read(path, mission)).collect()
}

/// The effects of a file of candidates.
fn candidates(path: &PathBuf) -> Result<toml::Table, InputError> {
    let refused = || format!("cannot use the candidates in `{}`", path.display());
    let text = fs::read_to_string(path).map_err(|error| InputError::new(refused(), error.to_string()))?;
    let table: toml::Table = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| text[..span.start.min(text.len())].lines().count().max(1));
        InputError { place: Some(format!("line {line}")), ..InputError::new(refused(), error.message().to_string()) }
    })?;
    let help = "write [effects.formula] with target, expression and parameters, as in a mission file";
    if let Some(other) = table.keys().find(|key| *key != "effects") {
        return Err(
            InputError::new(refused(), format!("`{other}` is not known here; only [effects.KIND] is")).with_help(help)
        );
    }
    match table.get("effects") {
        Some(toml::Value::Table(effects)) if !effects.is_empty() => Ok(effects.clone()),
        _ => Err(InputError::new(refused(), "there are no effects in it").with_help(help)),
    }
}

/// Keys with one value each.
fn settings(settings: &[String]) -> Result<Vec<(String, toml::Value)>, InputError> {
    let mut values = Vec::new();
    for setting in settings {
        let (key, value) = key_and_value(setting)?;
        let axis = Axis::parse(key, value)?;
        let [value] = &axis.values[..] else {
            return Err(InputError::new(format!("cannot set {setting}"), "one value is needed here")
                .with_help("`ctiplan compare` takes lists and ranges"));
        };
        values.push((axis.key, value.clone()));
    }
    Ok(values)
}

fn key_and_value(setting: &str) -> Result<(&str, &str), InputError> {
    setting.split_once('=').map(|(key, value)| (key.trim(), value.trim())).ok_or_else(|| {
        InputError::new(format!("cannot set `{setting}`"), "a setting is a key, =, and a value")
            .with_help("such as --set detector.temperature_k=150")
    })
}

fn level(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(level) if level > 0.0 && level <= 0.5 => Ok(level),
        _ => Err("a share between 0 and 0.5 is needed, such as 0.01".into()),
    }
}

fn observable(text: &str) -> Result<Observable, String> {
    let names = || Observable::ALL.iter().map(|observable| observable.name());
    Observable::ALL.into_iter().find(|observable| observable.name() == text.trim()).ok_or_else(|| {
        format!("no observable is called \"{text}\"; there are: {}", names().collect::<Vec<_>>().join(", "))
    })
}

fn energy(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(energy_mev) if energy_mev > 0.0 && energy_mev.is_finite() => Ok(energy_mev),
        _ => Err("an energy above 0 MeV is needed".into()),
    }
}

fn print(report: &impl Report, output: &Output) -> Result<(), Failure> {
    let mut out = stdout().lock();
    out.write_all(report.render(output.format()).as_bytes()).and_then(|()| out.flush()).map_err(Failure::Output)
}

/// A bar on standard error where that is a terminal, and nothing where it is not.
fn progress(length: u64, unit: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{msg}} {{bar:30}} {{pos}}/{{len}} {unit}, {{eta}} left"));
    ProgressBar::new(length).with_style(style.expect("a template that a test has drawn"))
}

/// A sign of life on standard error for work of unknown length, where that is a terminal.
fn searching(what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{spinner}} {{pos}} evaluations, {{elapsed}}, {what} {{msg}}"));
    ProgressBar::new_spinner().with_style(style.expect("a template that a test has drawn"))
}
