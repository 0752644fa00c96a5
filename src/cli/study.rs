//! `ctiplan study`: the list of all studies, and their arguments, one file each.

mod calibration;
mod charge_injection;
mod clock;
mod correction;
mod distance;
mod error_budget;
mod launch;
mod pocket_pumping;
mod preflash;
mod requirement;
mod shielding;

use clap::{Args, Subcommand};

use super::drawn::Drawn;
use super::inputs::OneMission;
use super::{Failure, Outcome, Output, print, searching};
use crate::error::InputError;
use crate::plan::scenario::Axis;
use crate::report::study::Shown;
use crate::study;

#[derive(Debug, Args)]
pub(super) struct Study {
    #[command(subcommand)]
    which: Which,
}

/// Arguments of a study.
trait Options: Args {
    type Study: study::Study<Results: Shown>;

    /// The requested study, for a mission in which these keys were set in the same command.
    ///
    /// # Errors
    /// If a list, range or file cannot be read.
    fn study(&self, keys_set: &[&str]) -> Result<Self::Study, InputError>;
}

/// A study of a mission, with its own arguments.
#[derive(Debug, Args)]
struct Asked<O: Args> {
    #[command(flatten)]
    mission: OneMission,
    #[command(flatten)]
    options: O,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

/// The list of all studies: description, name, and options.
macro_rules! studies {
    ($($(#[$what:meta])+ $name:ident($options:ty),)+) => {
        #[derive(Debug, Subcommand)]
        enum Which {
            $($(#[$what])+ $name(Asked<$options>),)+
        }

        impl Study {
            pub(super) fn run(&self) -> Result<Outcome, Failure> {
                match &self.which {
                    $(Which::$name(asked) => asked.run(),)+
                }
            }
        }
    };
}

studies! {
    /// Line time: shape error, photometric loss, read noise, readout time and survey area; the worst clock and the best
    Clock(clock::Clock),
    /// Distance to the register: worst case, mean over the detector, and the reduction by a dither pattern
    Distance(distance::Distance),
    /// Software correction: residual from imperfect knowledge of traps and from read noise, and the correction factor
    Correction(correction::Correction),
    /// Calibration of a correction: how well traps must be known, and how often they must be measured
    Calibration(calibration::Calibration),
    /// Preflash before each exposure: shape error against signal-to-noise ratio
    Preflash(preflash::Preflash),
    /// Injected lines of charge: shape error against signal-to-noise ratio and lost rows
    ChargeInjection(charge_injection::ChargeInjection),
    /// Pocket pumping: traps found at each temperature, and the improvement of the correction
    PocketPumping(pocket_pumping::PocketPumping),
    /// Launch date over two solar cycles: shape error at the end of life, and when the budget is exceeded
    Launch(launch::Launch),
    /// Shielding: margin against thickness of aluminium, as sphere and slab, at each confidence
    Shielding(shielding::Shielding),
    /// Requirement: what it allows of dose, traps, shielding, transfers, clock and launch
    Requirement(requirement::Requirement),
    /// Error budget: contribution of each uncertain input to the date on which the budget is exceeded
    ErrorBudget(error_budget::ErrorBudget),
}

impl<O: Options> Asked<O> {
    fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.mission.read()?;
        self.drawn.check()?;
        let bar = searching("study");
        let asked = self.options.study(&self.mission.keys_set())?;
        let results = study::Study::study(&asked, &mission, &|| bar.inc(1));
        bar.finish_and_clear();
        let report = results?.shown(&mission);
        self.drawn.write(&report, &[mission])?;
        print(&report, &self.output)?;
        Ok(Outcome::Done)
    }
}

/// Numbers of an argument: a list or a range, as for a key of the mission.
fn numbers(key: &str, text: &str) -> Result<Vec<f64>, InputError> {
    let number = |value: &toml::Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
    Ok(Axis::parse(key, text)?.values.iter().filter_map(number).collect())
}

/// Numbers as a list in the notation of [`numbers`].
fn list(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}
