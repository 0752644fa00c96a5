//! `ctiplan dose`.

use clap::Args;
use toml::Value;

use super::drawn::Drawn;
use super::inputs::OneMission;
use super::number_argument::whole;
use super::{Failure, Outcome, Output, print};
use crate::mission::Mission;
use crate::plan::dose::{self, Samples};

#[derive(Debug, Args)]
pub(super) struct Dose {
    #[command(flatten)]
    mission: OneMission,
    /// Energies at which the spectrum is printed, MeV
    #[arg(long = "energies", alias = "energies-mev", value_name = "MEV", value_delimiter = ',', value_parser = energy)]
    energies_mev: Vec<f64>,
    /// Active years of the Sun in the mission, in place of those of the calendar
    #[arg(long, value_name = "YR")]
    active_years: Option<f64>,
    /// Phase of the solar cycle at which trapped protons and cosmic rays are held
    #[arg(long, value_name = "PHASE", value_parser = ["min", "max"])]
    solar_phase: Option<String>,
    /// Print the calculation from the particle spectrum to the dose, in ten steps with their numbers
    #[arg(long)]
    explain: bool,
    /// Draws of the Sun as events: prints quantiles of the dose, year by year
    #[arg(long, alias = "draws", value_name = "N", value_parser = whole(100_u32..=100_000))]
    samples: Option<u32>,
    /// Seed of the draws, in place of the mission's
    #[arg(long, value_name = "SEED", requires = "samples")]
    seed: Option<u64>,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

impl Dose {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.of_sun(self.mission.read()?)?;
        self.drawn.check()?;
        let energies_mev: &[f64] = if self.energies_mev.is_empty() { &dose::ENERGIES_MEV } else { &self.energies_mev };
        let mut survey = dose::survey(&mission, energies_mev)?;
        survey.explain = self.explain;
        let seed = self.seed.unwrap_or(mission.accuracy.seed);
        survey.samples = self.samples.map(|samples| Samples::of(&mission, samples, seed)).transpose()?;
        self.drawn.write(&survey, &[mission])?;
        print(&survey, &self.output)?;
        Ok(Outcome::Done)
    }
}

impl Dose {
    /// The mission with the requested Sun.
    fn of_sun(&self, mission: Mission) -> Result<Mission, Failure> {
        let years = self.active_years.map(|years| ("environment.active_years".to_string(), Value::Float(years)));
        let phase = self.solar_phase.clone().map(|phase| ("environment.solar_phase".to_string(), Value::String(phase)));
        let settings: Vec<(String, Value)> = years.into_iter().chain(phase).collect();
        Ok(if settings.is_empty() { mission } else { mission.with(&settings)? })
    }
}

fn energy(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(energy_mev) if energy_mev > 0.0 && energy_mev.is_finite() => Ok(energy_mev),
        _ => Err("an energy above 0 MeV is needed".into()),
    }
}
