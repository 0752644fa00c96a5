//! The command line: arguments → results → standard output, and the exit status.
//!
//! 0: success. 2: a bad command line or bad input, one message on standard error. 1: anything else, and a requirement that is not
//! met with `--check`.

mod catalogue;
mod compare;
mod confidence;
mod diagnose;
mod dose;
mod drawn;
mod effects;
mod evaluate;
mod examples;
pub mod file_argument;
mod fit;
mod frame_argument;
mod frames;
mod init;
mod inputs;
pub mod interrupted;
mod measure;
mod number_argument;
mod predict;
mod schema;
mod shell;
mod study;
mod swapped;
mod sweep;
mod validate;

use std::ffi::OsString;
use std::io::{ErrorKind, Write, stdout};

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::file_argument::check_outputs;
use crate::error::InputError;
use crate::report::{Format, Report};

/// Predicts when radiation damage to CCDs changes the shapes of galaxies by more than the budget
///
/// The input is a mission file (launch, orbit, shielding, detector, clocking). Solar-cycle and displacement-damage models give
/// the trap densities year by year. The readout model trails galaxies through those traps. The change of their shapes is
/// compared with the budget.
#[derive(Debug, Parser)]
#[command(name = "ctiplan", version, max_term_width = 80)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Compute dose and traps per year, shape error against time, and the date on which the budget is exceeded
    Evaluate(evaluate::Evaluate),
    /// Compare missions, launch dates, clock speeds, distances to the register, or values of any key
    Compare(compare::Compare),
    /// Evaluate any keys over lists, ranges and distributions: resumable, on one machine or a Slurm cluster; Parquet or CSV
    Sweep(sweep::Sweep),
    /// Compute the change of shape of every galaxy of a catalogue, each at its own place on the detector
    Catalogue(catalogue::CatalogueCommand),
    /// Compute proton spectrum, shielding and displacement damage dose of a mission
    Dose(dose::Dose),
    /// Compare the model with measurements: residuals, and their trends against each condition
    Validate(validate::Validate),
    /// Predict observables under the conditions of a table, with simulated noise if requested: a measurement file
    Predict(predict::Predict),
    /// Fit the parameters in [fit] free or --free to measurements: values with errors and correlations
    Fit(fit::Fit),
    /// Find the physical effect that the model lacks: calibrated against noise, confirmed on held-out rows, and added
    Diagnose(diagnose::Diagnose),
    /// Add the trails of charge transfer inefficiency to whole frames (FITS)
    Readout(frames::Readout),
    /// Remove the trails of charge transfer inefficiency from whole frames (FITS), and report the residual
    Correct(frames::Correct),
    /// Make measurement tables from frames (FITS): edges of flat fields, trails of warm pixels, injected charge, dipoles
    Measure(measure::Measure),
    /// Run a trade study: clock, distance, correction, preflash, charge injection, pumping, calibration, launch, shielding, requirement, error budget
    Study(study::Study),
    /// List the catalogue of effects, or describe one: its physics, its parameters, and its residuals
    Effects(effects::Effects),
    /// Write a mission file to start from, with every key, its unit and its allowed values in comments
    Init(init::Init),
    /// Print the JSON Schema of mission files, for the completion and check of keys in editors
    Schema(schema::Schema),
    /// Print completions for a shell
    Completions(shell::Completions),
    /// Write manual pages into a folder, one for each command
    Man(shell::ManPages),
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

/// Result of a command.
enum Outcome {
    Done,
    NotMet,
}

/// The same command whose options take negative numbers for values: their ranges refuse those that are not allowed.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes_values = |arg: clap::Arg| {
        let takes_values = arg.get_action().takes_values() && !arg.is_positional();
        if takes_values { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(takes_values).mut_subcommands(with_negative_numbers)
}

/// Runs the program with these arguments (the first is its name) and returns its exit status.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let parsed = with_negative_numbers(examples::below(Cli::command())).try_get_matches_from(&arguments);
    let parsed = parsed.and_then(|matches| Ok((Cli::from_arg_matches(&matches)?, matches)));
    let (cli, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => {
            // Help and version are not errors. If nothing can be printed, the failure cannot be reported either.
            match swapped::in_place_of_a_command(&error, &arguments) {
                Some(error) => eprintln!("error: {error}"),
                None => _ = error.print(),
            }
            return if error.use_stderr() { 2 } else { 0 };
        }
    };
    let result = check_outputs(&matches).map_err(Failure::from).and_then(|()| match cli.command {
        Command::Evaluate(command) => command.run(),
        Command::Compare(command) => command.run(),
        Command::Sweep(command) => command.run(),
        Command::Catalogue(command) => command.run(),
        Command::Dose(command) => command.run(),
        Command::Validate(command) => command.run(),
        Command::Predict(command) => command.run(),
        Command::Fit(command) => command.run(),
        Command::Diagnose(command) => command.run(),
        Command::Readout(command) => command.run(),
        Command::Correct(command) => command.run(),
        Command::Measure(command) => command.run(),
        Command::Study(command) => command.run(),
        Command::Effects(command) => command.run(),
        Command::Init(command) => command.run(),
        Command::Schema(command) => command.run(),
        Command::Completions(command) => command.run(),
        Command::Man(command) => command.run(),
    });
    match result {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::NotMet) => 1,
        Err(Failure::Input(error)) => {
            eprintln!("error: {error}");
            2
        }
        // The reader has closed the pipe (`ctiplan ... | head`).
        Err(Failure::Output(error)) if error.kind() == ErrorKind::BrokenPipe => 0,
        Err(Failure::Output(error)) => {
            eprintln!("error: cannot write the result\n  {error}");
            1
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

fn print(report: &impl Report, output: &Output) -> Result<(), Failure> {
    print_and_suggest(report, output, None)
}

/// The same; text output also suggests the next command.
fn print_and_suggest(report: &impl Report, output: &Output, next: Option<String>) -> Result<(), Failure> {
    let text = report.render(output.format());
    say(&suggesting(text, next.filter(|_| output.format() == Format::Text)))
}

/// Text that ends with the next command.
fn suggesting(text: String, next: Option<String>) -> String {
    next.iter().fold(text, |text, command| text + &format!("\nnext: {command}\n"))
}

/// Text on standard output.
fn say(text: &str) -> Result<(), Failure> {
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::Output)
}

/// A progress bar on standard error if that is a terminal, and nothing otherwise.
fn progress(length: u64, unit: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{msg}} {{bar:30}} {{pos}}/{{len}} {unit}, {{eta}} left"));
    // With an unknown length a bar is empty; with length 0 it would be full.
    let bar = if length == 0 { ProgressBar::no_length() } else { ProgressBar::new(length) };
    bar.with_style(style.expect("a template that a test has drawn"))
}

/// A progress message on standard error for work of unknown length, if that is a terminal.
fn searching(what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{spinner}} {{pos}} evaluations, {{elapsed}}, {what} {{msg}}"));
    ProgressBar::new_spinner().with_style(style.expect("a template that a test has drawn"))
}
