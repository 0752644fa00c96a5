//! Launch dates are compared under the Sun of their years.
//!
//! With `environment.model = "constant"` the dose is an average over the solar cycle, equal for every launch date, so there is
//! nothing to compare. Comparisons of launch dates use the cycle instead, unless the average is requested explicitly.

use crate::mission::{DoseModel, Mission};

/// Key of the model of the dose over time.
pub(crate) const MODEL: &str = "environment.model";

/// Note if the cycle replaces the average.
const FOLLOWS: &str = "Launch dates are compared with environment.model = \"solar-cycle\": the mission's \"constant\" \
                                  is an average over the cycle, the same for every launch (--set environment.model=constant \
                                  keeps it).";

/// Note if the average was requested.
const AVERAGED: &str = "With environment.model = \"constant\", as requested, the dose is an average over the \
                                   solar cycle: every launch date is alike.";

/// Note for a mission that solar protons do not reach.
const LOW_ORBIT: &str = "In a low Earth orbit the dose rate is the one that the mission gives, the same in all years: launch \
                         dates are alike.";

/// The mission for a comparison of launch dates: with the solar cycle in place of an average over it, unless the average was `kept`
/// on purpose; and a note for the reader.
pub(crate) fn of_launches(mission: &Mission, kept: bool) -> (Mission, Option<&'static str>) {
    let mut flown = mission.clone();
    if model(mission) != "constant" {
        return (flown, None);
    }
    if mission.place().is_none() {
        return (flown, Some(LOW_ORBIT));
    }
    if kept {
        return (flown, Some(AVERAGED));
    }
    flown.environment.model = DoseModel::SolarCycle;
    (flown, Some(FOLLOWS))
}

/// How the dose of a mission is distributed over the years, as named in the mission file.
pub(crate) fn model(mission: &Mission) -> &'static str {
    match mission.environment.model {
        DoseModel::Constant if !mission.effects.contains_key("solar-cycle") => "constant",
        DoseModel::Constant | DoseModel::SolarCycle => "solar-cycle",
        DoseModel::Derived => "derived",
        DoseModel::History => "history",
    }
}
