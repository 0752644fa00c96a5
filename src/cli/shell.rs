//! `ctiplan completions` and `ctiplan man`, from the definitions of the command line.

use std::path::Path;

use clap::{Args, Command, CommandFactory};
use clap_complete::{Shell, generate};
use clap_mangen::Man;

use super::examples::below;
use super::{Cli, Failure, Outcome, say};
use crate::cli::file_argument::{OutputFolder, Overwrite};
use crate::io::atomic_file;

#[derive(Debug, Args)]
pub(super) struct Completions {
    /// Shell for which completions are printed
    shell: Shell,
}

impl Completions {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        let mut script = Vec::new();
        generate(self.shell, &mut below(Cli::command()), "ctiplan", &mut script);
        say(str::from_utf8(&script).expect("clap's completions are text"))?;
        Ok(Outcome::Done)
    }
}

#[derive(Debug, Args)]
pub(super) struct ManPages {
    /// Folder, such as ~/.local/share/man/man1
    #[arg(value_name = "DIR", value_parser = OutputFolder::of_manual_pages())]
    folder: OutputFolder,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl ManPages {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        atomic_file::folder(&self.folder)?;
        let mut program = below(Cli::command()).disable_help_subcommand(true);
        program.build();
        pages(program, &self.folder)?;
        Ok(Outcome::Done)
    }
}

/// A page for a command, and one for each subcommand.
fn pages(command: Command, folder: &Path) -> Result<(), Failure> {
    for below in command.get_subcommands().cloned() {
        pages(below, folder)?;
    }
    let source = format!("ctiplan {}", env!("CARGO_PKG_VERSION"));
    let page = Man::new(command).source(source);
    let mut text = Vec::new();
    page.render(&mut text).map_err(Failure::Output)?;
    let text = String::from_utf8(text).expect("clap's help is text");
    atomic_file::write(folder.join(page.get_filename()), &text)?;
    Ok(())
}
