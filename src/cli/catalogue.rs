//! `ctiplan catalogue`.

use clap::Args;

use super::inputs::OneMission;
use super::number_argument::number;
use super::{Failure, Outcome, Output, print, progress};
use crate::cli::file_argument::{InputFile, OutputFile, Overwrite};
use crate::error::InputError;
use crate::io::atomic_file;
use crate::io::table::Table;
use crate::mission_file;
use crate::model::Model;
use crate::model::shear::SurveyGalaxy;
use crate::plan::catalogue::{Catalogue, Epochs, Settings};

#[derive(Debug, Args)]
pub(super) struct CatalogueCommand {
    #[command(flatten)]
    mission: OneMission,
    /// Table of galaxies (ECSV, CSV or Parquet): transfers, flux_e, half_light_px, sersic_index, e1, e2, weight_px; missing
    /// columns are taken from the galaxy in [requirement]
    #[arg(value_name = "GALAXIES")]
    galaxies: InputFile,
    /// Time of the exposure, years since launch; several such as 1,2.5,5 give all galaxies at each of them
    #[arg(long, value_name = "YR", value_delimiter = ',', required = true, value_parser = years)]
    at: Vec<f64>,
    /// Table to write (ECSV or Parquet): the galaxies with the changes of their shapes
    #[arg(long, value_name = "FILE")]
    out: OutputFile,
    #[command(flatten)]
    overwrite: Overwrite,
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
        let is_parquet = match self.out.extension().and_then(|ending| ending.to_str()) {
            Some("parquet") => true,
            Some("ecsv") => false,
            _ => {
                let problem = "the name of the table must end in .ecsv or .parquet";
                return Err(InputError::new(format!("cannot write `{}`", self.out.display()), problem).into());
            }
        };
        atomic_file::refuse_unwritable(&self.out)?;
        let table = Table::read(&*self.galaxies)?;
        let galaxies = mission_file::galaxies_of_table(&table)?;
        let galaxies: Vec<SurveyGalaxy> = galaxies.iter().map(|galaxy| SurveyGalaxy::of(&mission, galaxy)).collect();
        let model = Model::new(&mission);
        let how = Settings {
            emulate: (!self.direct).then_some(self.accuracy),
            seed: self.seed.unwrap_or(mission.accuracy.seed),
        };
        let bar = progress((self.at.len() * galaxies.len()) as u64, "galaxies");
        let epoch = |(place, t_yr): (usize, &f64)| {
            Catalogue::of(&model, &galaxies, *t_yr, how, &|done| {
                bar.set_position((place * galaxies.len() + done) as u64)
            })
        };
        let done = Epochs(self.at.iter().enumerate().map(epoch).collect::<Result<_, InputError>>()?);
        bar.finish_and_clear();
        let changed = done.with_changes(&table)?;
        let written = if is_parquet { changed.to_parquet()? } else { changed.to_ecsv().into_bytes() };
        atomic_file::write(&*self.out, written)?;
        print(&done, &self.output)?;
        Ok(Outcome::Done)
    }
}

fn years(text: &str) -> Result<f64, String> {
    number(text, |t_yr| (0.0..=100.0).contains(&t_yr), "a time from 0 to 100 yr is needed")
}

fn fraction(text: &str) -> Result<f64, String> {
    number(text, |fraction| (1e-6..=1.0).contains(&fraction), "a fraction from 1e-6 to 1 is needed")
}
