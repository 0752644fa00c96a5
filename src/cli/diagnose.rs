//! `ctiplan diagnose`.

use std::path::Path;

use clap::Args;

use super::drawn::Drawn;
use super::inputs::{Adjust, Measured, NewMission};
use super::number_argument::{number, whole};
use super::{Failure, Outcome, Output, print_and_suggest, progress};
use crate::analysis::diagnose::{self, Verdict, diagnose};
use crate::cli::file_argument::{InputFile, RevisedMission};
use crate::error::InputError;
use crate::io::input;
use crate::mission::Mission;
use crate::physics::observable::Observable;
use crate::sweep::quoted;

#[derive(Debug, Args)]
pub(super) struct Diagnose {
    #[command(flatten)]
    measured: Measured,
    #[command(flatten)]
    adjust: Adjust,
    /// Level of significance: probability of adding an effect to a complete model
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = level)]
    level: f64,
    /// Seed of all simulations, instead of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// File with additional candidates, [effects.formula] or [[effects.formula]]; all candidates compete on equal terms
    #[arg(long, value_name = "FILE.toml")]
    candidates: Option<InputFile>,
    /// Observables that could be measured next, such as trail,packet_charge; by default all
    #[arg(long, value_name = "OBSERVABLES", value_delimiter = ',', value_parser = observable)]
    can: Vec<Observable>,
    /// Evaluations of the model at all rows after which no further step of the search begins
    #[arg(long, value_name = "N", default_value_t = diagnose::EVALUATIONS, value_parser = whole(1_u64..))]
    evaluations: u64,
    /// Do not repeat the search with larger errors and with other starts or free keys
    #[arg(long)]
    no_stability: bool,
    /// Write the mission with the fitted values and the added effects; comments and order are kept
    #[arg(long, value_name = "NEW.toml")]
    write: Option<RevisedMission>,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

impl Diagnose {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let new = self.write.as_ref().map(|path| NewMission::from(&self.measured, path)).transpose()?;
        let (mission, data) = self.measured.read()?;
        self.drawn.check()?;
        let options = diagnose::Options {
            level: self.level,
            seed: self.seed.unwrap_or(mission.accuracy.seed),
            free: self.adjust.keys(&mission),
            candidates: self.candidates.as_ref().map(|path| candidates(path, &mission)).transpose()?,
            can: self.can.clone(),
            evaluations: self.evaluations,
            stability: !self.no_stability,
        };
        let bar = progress(0, "steps");
        let stage = |name: &str, steps| {
            bar.reset();
            bar.set_length(steps);
            bar.set_message(name.to_string());
        };
        let advance = || bar.inc(1);
        let progress = diagnose::Progress { stage: &stage, advance: &advance };
        let found = diagnose(&mission, &data, &options, &progress);
        bar.finish_and_clear();
        let found = found?;
        self.drawn.write(&found, &[mission])?;
        if let Some(new) = new {
            new.write(|text| found.improved_text(text))?;
        }
        let next = match &self.write {
            Some(new) if !found.steps.is_empty() => Some(self.measured.command_with("validate", &quoted(new))),
            None if found.verdict == Verdict::Missing => {
                Some(format!("{}{} --write NEW.toml", self.measured.command("diagnose"), self.adjust))
            }
            _ => None,
        };
        print_and_suggest(&found, &self.output, next)?;
        Ok(Outcome::Done)
    }
}

/// The effects in a file of candidates, checked for a mission.
fn candidates(path: &Path, mission: &Mission) -> Result<toml::Table, InputError> {
    let refused = || format!("cannot use the candidates in `{}`", path.display());
    let text = input::text(path).map_err(|problem| InputError::new(refused(), problem))?;
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
        Some(toml::Value::Table(effects)) if !effects.is_empty() => {
            // The line refers to the text of a mission that includes them.
            let key = |place: String| place.split_once(": ").map_or(place.clone(), |(_, key)| key.to_string());
            let named = |error: InputError| InputError { refused: refused(), place: error.place.map(key), ..error };
            diagnose::hypothesis::all(mission, Some(effects)).map_err(named)?;
            Ok(effects.clone())
        }
        _ => Err(InputError::new(refused(), "there are no effects in it").with_help(help)),
    }
}

fn level(text: &str) -> Result<f64, String> {
    number(text, |level| level > 0.0 && level <= 0.5, "a fraction above 0 and up to 0.5 is needed, such as 0.01")
}

fn observable(text: &str) -> Result<Observable, String> {
    let names = || Observable::ALL.iter().map(|observable| observable.name());
    Observable::named(text.trim()).ok_or_else(|| {
        format!("no observable is called \"{text}\"; there are: {}", names().collect::<Vec<_>>().join(", "))
    })
}
