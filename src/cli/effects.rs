//! `ctiplan effects`.

use clap::Args;

use super::{Failure, Outcome, Output, print, say};
use crate::effect;
use crate::error::{InputError, nearest};
use crate::report;

#[derive(Debug, Args)]
pub(super) struct Effects {
    /// Effect to describe
    kind: Option<String>,
    /// Print the whole catalogue as a Markdown page
    #[arg(long, conflicts_with_all = ["kind", "json", "csv"])]
    markdown: bool,
    #[command(flatten)]
    output: Output,
}

impl Effects {
    pub(super) fn run(&self) -> Result<Outcome, Failure> {
        if self.markdown {
            say(&report::effects::page())?;
            return Ok(Outcome::Done);
        }
        let Some(kind) = &self.kind else {
            print(&report::effects::Catalogue, &self.output)?;
            return Ok(Outcome::Done);
        };
        let kinds = || effect::CATALOGUE.iter().map(|entry| entry.card.kind);
        let entry = effect::find(kind).ok_or_else(|| {
            let problem = format!("no effect is called `{kind}`");
            let refusal = InputError::new("cannot describe an effect", problem);
            match nearest(kind, kinds()) {
                Some(near) => refusal.with_help(format!("did you mean `{near}`?")),
                None => refusal.with_help(format!("there are: {}", kinds().collect::<Vec<_>>().join(", "))),
            }
        })?;
        print(&report::effects::OneEffect(entry), &self.output)?;
        Ok(Outcome::Done)
    }
}
