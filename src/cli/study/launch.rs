use chrono::NaiveDate;
use clap::Args;

use super::Options;
use crate::cli::confidence::Confident;
use crate::error::InputError;
use crate::mission::Date;
use crate::plan::scenario::{Axis, sun};
use crate::study::launch;

#[derive(Debug, Args)]
pub(super) struct Launch {
    /// Launch dates: 2009-01-01,2012-01-01 or 2009-01-01..2020-01-01:1 (step in years) [default: every half year of 22 years
    /// from the mission's launch]
    #[arg(long, value_name = "DATES")]
    launch: Option<String>,
    #[command(flatten)]
    confident: Confident,
}

impl Options for Launch {
    type Study = launch::Launch;

    fn study(&self, keys_set: &[&str]) -> Result<launch::Launch, InputError> {
        // An average over the solar cycle that is set in the same command is intended.
        let keep_average = keys_set.contains(&sun::MODEL);
        let keep_sun = keys_set.contains(&sun::SUN);
        let launches = self.launch.as_deref().map(dates).transpose()?;
        Ok(launch::Launch { launches, keep_average, keep_sun, confidence: self.confident.confidence() })
    }
}

fn dates(text: &str) -> Result<Vec<NaiveDate>, InputError> {
    let day = |value: toml::Value| Some(Date::try_from(*value.as_datetime()?).ok()?.0);
    Ok(Axis::parse("mission.launch", text)?.values.into_iter().filter_map(day).collect())
}
