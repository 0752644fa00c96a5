//! `ctiplan study`.

use clap::{Args, Subcommand};

use super::drawn::Drawn;
use super::inputs::OneMission;
use super::{Failure, Outcome, Output, print, searching};
use crate::study;

#[derive(Debug, Args)]
pub(super) struct Study {
    #[command(subcommand)]
    which: Which,
}

/// A study of a mission, with its own options.
#[derive(Debug, Args)]
struct Asked<K: Args> {
    #[command(flatten)]
    mission: OneMission,
    #[command(flatten)]
    options: K,
    #[command(flatten)]
    drawn: Drawn,
    #[command(flatten)]
    output: Output,
}

/// The list of all studies: what each asks, its name, and its options.
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
    Clock(study::clock::Clock),
    /// Distance to the register: the farthest, the mean over the detector, and what a dither pattern buys
    Distance(study::distance::Distance),
    /// Software correction: what imperfect knowledge of traps and read noise leave, and the factor that is earned
    Correction(study::correction::Correction),
    /// A flash before each exposure: shape error against signal-to-noise ratio
    Preflash(study::preflash::Preflash),
    /// Injected lines of charge: shape error against signal-to-noise ratio and lost rows
    ChargeInjection(study::charge_injection::ChargeInjection),
    /// Pocket pumping: which traps it finds at which temperature, and what that adds to the correction
    PocketPumping(study::pocket_pumping::PocketPumping),
    /// Launch date over two solar cycles: shape error at the end of life, and when the budget is exceeded
    Launch(study::launch::Launch),
    /// Aluminium against margin, as sphere and slab, at each confidence
    Shielding(study::shielding::Shielding),
    /// Which uncertain input dominates the date on which the budget is exceeded
    ErrorBudget(study::error_budget::ErrorBudget),
}

impl<K: study::Kind> Asked<K> {
    fn run(&self) -> Result<Outcome, Failure> {
        let mission = self.mission.read()?;
        self.drawn.check()?;
        let bar = searching("study");
        let options = self.options.clone().with_keys_set(&self.mission.keys_set());
        let found = options.study(&mission, &|| bar.inc(1));
        bar.finish_and_clear();
        let found = found?;
        self.drawn.write(&found, &[mission])?;
        print(&found, &self.output)?;
        Ok(Outcome::Done)
    }
}
