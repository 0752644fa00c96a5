//! `ctiplan fit`.

use std::sync::Mutex;

use clap::Args;

use super::inputs::{Adjust, Measured, NewMission};
use super::{Failure, Outcome, Output, print_and_suggest, searching};
use crate::analysis::fit;
use crate::cli::file_argument::OutputFile;
use crate::error::InputError;
use crate::mission_file;
use crate::model::Model;
use crate::report::FitReport;
use crate::sweep::quoted;

#[derive(Debug, Args)]
pub(super) struct Fit {
    #[command(flatten)]
    measured: Measured,
    #[command(flatten)]
    adjust: Adjust,
    /// Number of starting points: the mission's values and random ones around them; each parameter is also scanned for minima
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    starts: u32,
    /// Seed of the random starting points, instead of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Also hold out each group of values of this column in turn, fit the rest, and predict the group
    #[arg(long, value_name = "COLUMN")]
    holdout: Option<String>,
    /// Write the mission with the fitted values; comments and order are kept
    #[arg(long, value_name = "NEW.toml")]
    write: Option<OutputFile>,
    #[command(flatten)]
    output: Output,
}

impl Fit {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let new = self.write.as_ref().map(|path| NewMission::from(&self.measured, path)).transpose()?;
        let (mission, data) = self.measured.read()?;
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
        if let Some(new) = new {
            let values: Vec<_> =
                fitted.parameters.iter().map(|fitted| (fitted.key.clone(), fitted.value.into())).collect();
            new.write(|text| mission_file::edit(text, &mission, &values))?;
        }
        let next = match &self.write {
            _ if fitted.excess() > 3.0 => Some(format!("{}{}", self.measured.command("diagnose"), self.adjust)),
            Some(new) => Some(self.measured.command_with("validate", &quoted(new))),
            None => None,
        };
        print_and_suggest(&FitReport { fit: fitted, holdout }, &self.output, next)?;
        Ok(Outcome::Done)
    }
}
