//! `ctiplan evaluate`.

use clap::Args;

use super::drawn::Drawn;
use super::inputs::OneMission;
use super::{Failure, Outcome, Output, print_and_suggest, progress};
use crate::cli::file_argument::InputFile;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::noise;
use crate::plan::date_distribution::{DateDistribution, over_sample};
use crate::plan::evaluate::evaluate;
use crate::plan::mission_sample::MissionSample;
use crate::plan::time_series::TimeSeries;
use crate::report::EvaluateReport;

#[derive(Debug, Args)]
pub(super) struct Evaluate {
    #[command(flatten)]
    mission: OneMission,
    /// Also read out this number of galaxies with photon and read noise at the end of the mission
    #[arg(long, value_name = "REALISATIONS", value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    monte_carlo: Option<u32>,
    /// Seed of the realisations, instead of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Also evaluate the mission with draws of a posterior (`ctiplan fit --posterior N --out FILE`): distribution of the date
    #[arg(long, value_name = "FILE")]
    posterior: Option<InputFile>,
    /// Draws that are evaluated at most, evenly chosen
    #[arg(long, value_name = "N", requires = "posterior", default_value_t = 200)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    posterior_samples: u32,
    /// Exit with status 1 if the corrected budget is exceeded during the mission
    #[arg(long)]
    check: bool,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

impl Evaluate {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.mission.read()?;
        self.drawn.check()?;
        let sample = self.posterior.as_ref().map(|path| MissionSample::read(path, &mission)).transpose()?;
        let evaluation = evaluate(&mission)?;
        let noisy = match self.monte_carlo {
            None => Vec::new(),
            Some(realisations) => {
                let seed = self.seed.unwrap_or(mission.accuracy.seed);
                let device = evaluation.model.device_at(mission.mission.duration_yr)?;
                let bar = progress(u64::from(realisations) * mission.galaxies.len() as u64, "galaxies");
                let realise =
                    |galaxy| noise::realise(&mission, galaxy, &device, realisations as usize, seed, || bar.inc(1));
                let noisy = mission.galaxies.iter().map(realise).collect::<Result<_, _>>()?;
                bar.finish_and_clear();
                noisy
            }
        };
        let met = evaluation.verdict.met();
        let time_series = self.drawn.wanted().then(|| TimeSeries::of(&evaluation.model)).transpose()?;
        let distribution = sample.map(|sample| self.distribution(&mission, &sample)).transpose()?;
        let report = EvaluateReport { evaluation, noisy, distribution, time_series };
        self.drawn.write(&report, &[mission])?;
        // What the date hangs on is worth knowing where it comes too early.
        let next = (!met).then(|| format!("ctiplan study error-budget {}", self.mission.words()));
        print_and_suggest(&report, &self.output, next)?;
        Ok(if self.check && !met { Outcome::NotMet } else { Outcome::Done })
    }

    fn distribution(&self, mission: &Mission, sample: &MissionSample) -> Result<DateDistribution, InputError> {
        let count = sample.len().min(self.posterior_samples as usize);
        let bar = progress(count as u64, "draws");
        let found = over_sample(mission, sample, count, || bar.inc(1))?;
        bar.finish_and_clear();
        Ok(found)
    }
}
