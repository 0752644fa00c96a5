use clap::Args;

use super::{Options, numbers};
use crate::error::InputError;
use crate::study::distance::{self, Dither};

#[derive(Debug, Args)]
pub(super) struct Distance {
    /// A dither pattern: the distance to the register in each exposure, in transfers, such as 1650,1240,830,410; may be given
    /// several times [default: small steps, half a register, the whole register]
    #[arg(long, value_name = "TRANSFERS")]
    dither: Vec<String>,
}

impl Options for Distance {
    type Study = distance::Distance;

    fn study(&self, _: &[&str]) -> Result<distance::Distance, InputError> {
        let dither = |text: &String| Ok(Dither { name: text.clone(), transfers: numbers("readout.transfers", text)? });
        Ok(distance::Distance { dithers: self.dither.iter().map(dither).collect::<Result<_, InputError>>()? })
    }
}
