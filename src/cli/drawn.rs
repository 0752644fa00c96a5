//! Figures and pages of a result, in addition to the printed output.

use clap::Args;

use crate::cli::file_argument::{OutputFile, OutputFolder, Overwrite};
use crate::error::InputError;
use crate::io::atomic_file;
use crate::mission::Mission;
use crate::report::plot::Format;
use crate::report::{Page, page};

#[derive(Debug, Args)]
pub(super) struct Drawn {
    /// Write the figures into this folder
    #[arg(long, value_name = "DIR", value_parser = OutputFolder::of_figures())]
    plots: Option<OutputFolder>,
    /// File formats of the figures: svg, pdf (as wide as a column of a paper), png
    #[arg(long, value_name = "KINDS", value_delimiter = ',', value_parser = plot_format, default_value = "svg")]
    #[arg(requires = "plots")]
    plots_as: Vec<Format>,
    /// Write verdict, figures, tables, mission and sources as one HTML page that needs no other file
    #[arg(long, value_name = "FILE")]
    html: Option<OutputFile>,
    #[command(flatten)]
    overwrite: Overwrite,
}

fn plot_format(text: &str) -> Result<Format, String> {
    let known = |format: &Format| format.ending() == text;
    let refused = if cfg!(feature = "figures") {
        "figures can be svg, pdf and png"
    } else {
        "figures can be svg; pdf and png take ctiplan with its feature `figures`"
    };
    Format::ALL.iter().copied().find(known).ok_or_else(|| refused.into())
}

impl Drawn {
    /// Whether anything is to be drawn.
    pub fn wanted(&self) -> bool {
        self.plots.is_some() || self.html.is_some()
    }

    /// Checks before the computation that its result can be written.
    pub fn check(&self) -> Result<(), InputError> {
        if let Some(folder) = &self.plots {
            atomic_file::folder(folder)?;
        }
        self.html.as_ref().map_or(Ok(()), |path| atomic_file::refuse_unwritable(path))
    }

    /// Draws the requested figures of a result for these missions.
    pub fn write(&self, result: &impl Page, missions: &[Mission]) -> Result<(), InputError> {
        if let Some(folder) = &self.plots {
            for (name, figure) in result.figures() {
                for format in &self.plots_as {
                    let path = folder.join(&name).with_extension(format.ending());
                    atomic_file::write(path, figure.to(*format))?;
                }
            }
        }
        match &self.html {
            Some(path) => atomic_file::write(path, page(result, missions)),
            None => Ok(()),
        }
    }
}
