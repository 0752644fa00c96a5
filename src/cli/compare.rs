//! `ctiplan compare`.

use clap::Args;

use super::confidence::Confident;
use super::drawn::Drawn;
use super::inputs::key_and_value;
use super::{Failure, Outcome, Output, print, progress};
use crate::cli::file_argument::InputFile;
use crate::error::InputError;
use crate::mission::Mission;
use crate::plan::scenario::{Axis, Candidate, compare};

#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Mission files (TOML)
    #[arg(required = true)]
    missions: Vec<InputFile>,
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
    confident: Confident,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

impl Compare {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let candidate =
            |path: &InputFile| Ok(Candidate { file: path.display().to_string(), mission: Mission::read(path)? });
        let candidates = self.missions.iter().map(candidate).collect::<Result<Vec<_>, InputError>>()?;
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
        if candidates.len() == 1 && axes.is_empty() {
            return Err(InputError::new("cannot compare", "there is one mission and nothing that differs")
                .with_help("give --launch, --line-time-ms, --transfers or --set KEY=VALUES, or several missions")
                .into());
        }
        self.drawn.check()?;
        let scenarios = candidates.len() * axes.iter().map(|axis| axis.values.len()).product::<usize>();
        let bar = progress(scenarios as u64, "scenarios");
        let comparison = compare(&candidates, &axes, self.confident.confidence(), || bar.inc(1));
        bar.finish_and_clear();
        let comparison = comparison?;
        let missions: Vec<Mission> = candidates.into_iter().map(|candidate| candidate.mission).collect();
        self.drawn.write(&comparison, &missions)?;
        print(&comparison, &self.output)?;
        Ok(Outcome::Done)
    }
}
