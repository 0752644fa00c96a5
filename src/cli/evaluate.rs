//! `ctiplan evaluate`.

use clap::Args;

use super::drawn::Drawn;
use super::inputs::OneMission;
use super::{Failure, Outcome, Output, print_and_suggest, progress};
use crate::model::noise;
use crate::plan::evaluate::evaluate;
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
        let report = EvaluateReport { evaluation, noisy, time_series };
        self.drawn.write(&report, &[mission])?;
        // What the date hangs on is worth knowing where it comes too early.
        let next = (!met).then(|| format!("ctiplan study error-budget {}", self.mission.words()));
        print_and_suggest(&report, &self.output, next)?;
        Ok(if self.check && !met { Outcome::NotMet } else { Outcome::Done })
    }
}
