//! `ctiplan catalogue`.

use clap::Args;

use super::inputs::OneMission;
use super::{Failure, Outcome, Output, print, progress};
use crate::cli::file_argument::{InputFile, OutputFile};
use crate::error::InputError;
use crate::io::atomic_file;
use crate::io::table::Table;
use crate::mission_file;
use crate::model::Model;
use crate::model::shear::SurveyGalaxy;
use crate::plan::catalogue::{Catalogue, Settings};

#[derive(Debug, Args)]
pub(super) struct CatalogueCommand {
    #[command(flatten)]
    mission: OneMission,
    /// Table of galaxies (ECSV or CSV): transfers, flux_e, half_light_px, sersic_index, e1, e2, weight_px; a column that is
    /// missing is that of the mission's judged galaxy
    #[arg(value_name = "GALAXIES")]
    galaxies: InputFile,
    /// Time of the exposure, years since launch
    #[arg(long, value_name = "YEARS", value_parser = years)]
    at: f64,
    /// Table to write (ECSV): the galaxies with the changes of their shapes
    #[arg(long, value_name = "FILE.ecsv")]
    out: OutputFile,
    /// Largest error of galaxies that are interpolated, as root mean square over that of the changes: if it is larger, all
    /// galaxies are read out
    #[arg(long, value_name = "FRACTION", default_value_t = 0.01, value_parser = fraction)]
    accuracy: f64,
    /// Read out every galaxy; interpolate none
    #[arg(long, conflicts_with = "accuracy")]
    direct: bool,
    /// Seed of the choice of galaxies that are fitted and compared, instead of the mission's
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    #[command(flatten)]
    output: Output,
}

impl CatalogueCommand {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.mission.read()?;
        if self.out.extension().is_none_or(|ending| ending != "ecsv") {
            return Err(InputError::new(
                format!("cannot write `{}`", self.out.display()),
                "the name of the table must end in .ecsv",
            )
            .into());
        }
        atomic_file::refuse_unwritable(&self.out)?;
        let table = Table::read(&*self.galaxies)?;
        let galaxies = mission_file::galaxies_of_table(&table)?;
        let galaxies: Vec<SurveyGalaxy> = galaxies.iter().map(|galaxy| SurveyGalaxy::of(&mission, galaxy)).collect();
        let model = Model::new(&mission);
        let how = Settings {
            emulate: (!self.direct).then_some(self.accuracy),
            seed: self.seed.unwrap_or(mission.accuracy.seed),
        };
        let bar = progress(galaxies.len() as u64, "galaxies");
        let done = Catalogue::of(&model, &galaxies, self.at, how, &|done| bar.set_position(done as u64))?;
        bar.finish_and_clear();
        atomic_file::write(&*self.out, done.with_changes(table)?.to_ecsv())?;
        print(&done, &self.output)?;
        Ok(Outcome::Done)
    }
}

fn years(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(t_yr) if (0.0..=100.0).contains(&t_yr) => Ok(t_yr),
        _ => Err("a time from 0 to 100 yr is needed".into()),
    }
}

fn fraction(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(fraction) if (1e-6..=1.0).contains(&fraction) => Ok(fraction),
        _ => Err("a fraction from 1e-6 to 1 is needed".into()),
    }
}
