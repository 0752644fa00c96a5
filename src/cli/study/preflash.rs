use clap::Args;

use super::{Options, list, numbers};
use crate::error::InputError;
use crate::study::preflash;

#[derive(Debug, Args)]
pub(super) struct Preflash {
    /// Charges of the flash, e- per pixel; none at all is always among them
    #[arg(long, value_name = "ELECTRONS", default_value_t = list(&preflash::Preflash::default().electrons))]
    electrons: String,
}

impl Options for Preflash {
    type Study = preflash::Preflash;

    fn study(&self, _: &[&str]) -> Result<preflash::Preflash, InputError> {
        Ok(preflash::Preflash { electrons: numbers("sky.background_e", &self.electrons)? })
    }
}
