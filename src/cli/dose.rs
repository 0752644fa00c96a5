//! `ctiplan dose`.

use clap::Args;

use super::drawn::Drawn;
use super::inputs::OneMission;
use super::{Failure, Outcome, Output, print};
use crate::plan::dose;

#[derive(Debug, Args)]
pub(super) struct Dose {
    #[command(flatten)]
    mission: OneMission,
    /// Energies at which the spectrum is printed, MeV
    #[arg(long, value_name = "MEV", value_delimiter = ',', value_parser = energy)]
    energies_mev: Vec<f64>,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

impl Dose {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.mission.read()?;
        self.drawn.check()?;
        let energies_mev: &[f64] = if self.energies_mev.is_empty() { &dose::ENERGIES_MEV } else { &self.energies_mev };
        let survey = dose::survey(&mission, energies_mev)?;
        self.drawn.write(&survey, &[mission])?;
        print(&survey, &self.output)?;
        Ok(Outcome::Done)
    }
}

fn energy(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(energy_mev) if energy_mev > 0.0 && energy_mev.is_finite() => Ok(energy_mev),
        _ => Err("an energy above 0 MeV is needed".into()),
    }
}
