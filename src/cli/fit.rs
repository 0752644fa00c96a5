//! `ctiplan fit`.

use std::sync::Mutex;

use clap::Args;

use super::drawn::Drawn;
use super::inputs::{Adjust, Measured, NewMission, trimmed};
use super::number_argument::whole;
use super::{Failure, Outcome, Output, print_and_suggest, searching};
use crate::analysis::fit;
use crate::analysis::fit::posterior::Posterior;
use crate::analysis::fit::profile::{self, Profile};
use crate::analysis::measurement::{self, DataSet};
use crate::cli::file_argument::{OutputFile, RevisedMission};
use crate::error::InputError;
use crate::io::atomic_file;
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
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1_u32..=10_000))]
    starts: u32,
    /// Seed of the random starting points and of the posterior's sample, instead of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Also hold out each group of values of this column in turn, fit the rest, and predict the group
    #[arg(long, value_name = "COLUMN")]
    holdout: Option<String>,
    /// Also scan chi2 along these free keys, all others fitted again: intervals of 68 and 95 %; --csv prints the curves
    #[arg(long, value_name = "KEYS", value_delimiter = ',', value_parser = trimmed)]
    profile: Vec<String>,
    /// Also sample the posterior: number of independent draws
    #[arg(long, value_name = "N", value_parser = whole(10_u32..=1_000_000))]
    posterior: Option<u32>,
    /// Evaluations of the model for that sample at most [default: 100 for each draw, and at least 20000]
    #[arg(long, value_name = "N", requires = "posterior", value_parser = whole(1_u32..))]
    posterior_evaluations: Option<u32>,
    /// Write the sample (ECSV), for `ctiplan evaluate --posterior`
    #[arg(long, value_name = "FILE", requires = "posterior")]
    out: Option<OutputFile>,
    /// Write the mission with the fitted values; comments and order are kept
    #[arg(long, value_name = "NEW.toml")]
    write: Option<RevisedMission>,
    #[command(flatten)]
    drawn: Drawn,
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
        self.profile.iter().try_for_each(|key| profile::place(&keys, key).map(|_| ()))?;
        self.drawn.check()?;
        self.out.as_ref().map_or(Ok(()), |path| atomic_file::refuse_unwritable(path))?;
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
        let data = measurement::with_errors_at(data, &fitted.mission)?;
        let holdout = match &self.holdout {
            Some(column) => {
                *best.lock().expect("nobody panics while holding it") = f64::INFINITY;
                let model = Model::new(&fitted.mission);
                Some(fit::holdout::holdout(&model, &data, &keys, column, &options, &progress)?)
            }
            None => None,
        };
        let profiles = self.profiles(&fitted, &data, &progress)?;
        let posterior = self.posterior(&fitted, &data, seed, &progress)?;
        bar.finish_and_clear();
        if let Some(new) = new {
            let values: Vec<_> =
                fitted.parameters.iter().map(|fitted| (fitted.key.clone(), fitted.value.into())).collect();
            new.write(|text| mission_file::edit(text, &mission, &values))?;
        }
        let next = match &self.write {
            _ if !fitted.describes_data() => Some(format!("{}{}", self.measured.command("diagnose"), self.adjust)),
            Some(new) => Some(self.measured.command_with("validate", &quoted(new))),
            None => None,
        };
        let fitted_mission = fitted.mission.clone();
        let has_common_errors = data.iter().any(DataSet::has_common_errors);
        let report = FitReport { fit: fitted, holdout, profiles, posterior, has_common_errors };
        self.drawn.write(&report, &[fitted_mission])?;
        print_and_suggest(&report, &self.output, next)?;
        Ok(Outcome::Done)
    }

    fn profiles(
        &self,
        fitted: &fit::Fit,
        data: &[DataSet],
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Vec<Profile>, InputError> {
        let model = Model::new(&fitted.mission);
        self.profile.iter().map(|key| profile::profile(&model, data, fitted, key, progress)).collect()
    }

    /// The sample, written to a file if requested.
    fn posterior(
        &self,
        fitted: &fit::Fit,
        data: &[DataSet],
        seed: u64,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Option<Posterior>, InputError> {
        let Some(samples) = self.posterior else { return Ok(None) };
        let evaluations = self.posterior_evaluations.map(|evaluations| evaluations as usize);
        let options = fit::posterior::Options { samples: samples as usize, seed, evaluations };
        let model = Model::new(&fitted.mission);
        let found = fit::posterior::posterior(&model, data, fitted, &options, progress)?;
        if let Some(path) = &self.out {
            let files: Vec<String> = data.iter().map(|set| set.file.clone()).collect();
            atomic_file::write(path, found.table(fitted, &files).to_ecsv())?;
        }
        Ok(Some(found))
    }
}
