use clap::Args;

use super::{Options, numbers};
use crate::cli::confidence::Confident;
use crate::error::InputError;
use crate::study::clock;

#[derive(Debug, Args)]
pub(super) struct Clock {
    /// Times between two parallel transfers, ms, such as 1,5,25 or 5..100:log:8 [default: 1/30 to 30 times the mission's]
    #[arg(long, value_name = "MS")]
    line_time_ms: Option<String>,
    #[command(flatten)]
    confident: Confident,
}

impl Options for Clock {
    type Study = clock::Clock;

    fn study(&self, _: &[&str]) -> Result<clock::Clock, InputError> {
        let line_times_ms = self.line_time_ms.as_ref().map(|text| numbers("readout.line_time_ms", text));
        Ok(clock::Clock { line_times_ms: line_times_ms.transpose()?, confidence: self.confident.confidence() })
    }
}
