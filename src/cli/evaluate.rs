//! `ctiplan evaluate`.

use clap::Args;

use super::drawn::Drawn;
use super::inputs::OneMission;
use super::number_argument::{probability, whole};
use super::{Failure, Outcome, Output, progress, say, suggesting};
use crate::cli::file_argument::InputFile;
use crate::error::InputError;
use crate::mission::Mission;
use crate::plan::assessment::{Assessment, Options, Progress, assess};
use crate::plan::compliance::passes;
use crate::plan::mission_sample::MissionSample;
use crate::report::{Depth, Format, Report};

#[derive(Debug, Args)]
pub(super) struct Evaluate {
    #[command(flatten)]
    mission: OneMission,
    /// Also read out this number of galaxies with photon and read noise at the end of the mission
    #[arg(long, value_name = "REALISATIONS", value_parser = whole(2_u32..=10_000_000))]
    monte_carlo: Option<u32>,
    /// Seed of all random numbers, instead of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Draws of the mission, for the date as a distribution: its Sun and its [uncertainty]; 0: none. 200 at most where shapes cannot
    /// be emulated
    #[arg(long, alias = "draws", value_name = "N", default_value_t = 1000, value_parser = whole(0_u32..=65_536))]
    samples: u32,
    /// Draw keys from a posterior (`ctiplan fit --posterior N --out FILE`) in place of their uncertainties
    #[arg(long, value_name = "FILE")]
    posterior: Option<InputFile>,
    /// Exit with status 1 if a corrected budget is exceeded during the mission
    #[arg(long)]
    check: bool,
    /// Required probability that the budget of the galaxy is met to the end of the mission, such as 0.9
    #[arg(long, alias = "confidence", value_name = "P", value_parser = probability)]
    probability: Option<f64>,
    /// Print the verdict and the warnings alone
    #[arg(short = 'q', long, alias = "quiet", conflicts_with_all = ["verbose", "json", "csv"])]
    brief: bool,
    /// Print every year, every trap species and the release times too
    #[arg(short, long, conflicts_with_all = ["json", "csv"])]
    verbose: bool,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

impl Evaluate {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.mission.read()?;
        self.drawn.check()?;
        let posterior = self.posterior.as_ref().map(|path| MissionSample::read(path, &mission)).transpose()?;
        let options = Options {
            seed: self.seed,
            monte_carlo: self.monte_carlo,
            samples: self.samples,
            posterior,
            confidence: self.probability,
            time_series: self.drawn.wanted(),
        };
        let report = self.assess(&mission, &options)?;
        let met = passes(&report.lines());
        self.drawn.write(&report, &[mission])?;
        // If the date is too early, its causes are of interest.
        let next = (!met).then(|| format!("ctiplan study error-budget {}", self.mission.words()));
        match self.output.format() {
            Format::Text => say(&suggesting(report.told(self.depth()).text(), next.filter(|_| !self.brief)))?,
            format => say(&report.render(format))?,
        }
        Ok(if self.check && !met { Outcome::NotMet } else { Outcome::Done })
    }

    fn depth(&self) -> Depth {
        match (self.brief, self.verbose) {
            (true, _) => Depth::Verdict,
            (_, true) => Depth::Whole,
            _ => Depth::Short,
        }
    }

    fn assess(&self, mission: &Mission, options: &Options) -> Result<Assessment, InputError> {
        let bar = progress(0, "");
        let stage = |what: &str, count| {
            bar.reset();
            bar.set_length(count);
            bar.set_message(what.to_string());
        };
        let found = assess(mission, options, &Progress { stage: &stage, advance: &|| bar.inc(1) });
        bar.finish_and_clear();
        found
    }
}
