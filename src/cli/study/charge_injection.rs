use clap::Args;

use super::{Options, list, numbers};
use crate::error::InputError;
use crate::study::charge_injection;

#[derive(Debug, Args)]
pub(super) struct ChargeInjection {
    /// Rows from one line to the next; no lines at all are always among them
    #[arg(
        long,
        value_name = "ROWS",
        default_value_t = list(&charge_injection::ChargeInjection::default().spacings_rows)
    )]
    spacing_rows: String,
    /// Charge of a line, e- per pixel [default: a tenth of the full well]
    #[arg(long, value_name = "ELECTRONS")]
    charge_e: Option<f64>,
    /// Rows on each side of a line that are not measured [default: the width of the galaxy's weight]
    #[arg(long, value_name = "ROWS")]
    guard_rows: Option<u32>,
}

impl Options for ChargeInjection {
    type Study = charge_injection::ChargeInjection;

    fn study(&self, _: &[&str]) -> Result<charge_injection::ChargeInjection, InputError> {
        Ok(charge_injection::ChargeInjection {
            spacings_rows: numbers("readout.transfers", &self.spacing_rows)?,
            charge_e: self.charge_e,
            guard_rows: self.guard_rows,
        })
    }
}
