//! Launch dates are compared under the Sun of their years.
//!
//! With `environment.model = "constant"` the dose is an average over the solar cycle, equal for every launch date, so there is
//! nothing to compare. Comparisons of launch dates use the cycle instead, unless the average is requested explicitly.

use crate::error::InputError;
use crate::mission::{DoseModel, Mission};
use crate::numeric::calendar::decimal_year;

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

/// Key of the Sun at times that were observed.
pub(crate) const SUN: &str = "environment.sun";

/// Note if observed and drawn Suns are compared on purpose.
const MIXED: &str = "Observed and drawn Suns are compared, as requested: differences between them are partly those of the Sun that \
                     came and of the one expected.";

/// Refuses a comparison of missions of which some fly under the Sun as it was and others under a drawn one, unless the Sun was
/// `asked` for; then a note for the reader.
///
/// # Errors
/// If they are mixed.
pub(crate) fn of_the_past<'a>(
    missions: impl Iterator<Item = &'a Mission>,
    asked: bool,
) -> Result<Option<&'static str>, InputError> {
    let flown: Vec<(&Mission, f64)> = missions.map(|mission| (mission, observed_share(mission))).collect();
    let Some((first, _)) = flown.first() else { return Ok(None) };
    let all = |share: f64| flown.iter().all(|other| (other.1 - share).abs() < 1e-6);
    let wanted = |mission: &Mission| mission.observed_sun().is_some();
    let same_sun =
        flown.iter().all(|(other, _)| other.mission.launch == first.mission.launch && wanted(other) == wanted(first));
    if all(0.0) || all(1.0) || same_sun {
        return Ok(None);
    }
    if asked {
        return Ok(Some(MIXED));
    }
    let (least, most) =
        (flown.iter().map(|one| one.1).fold(1.0, f64::min), flown.iter().map(|one| one.1).fold(0.0, f64::max));
    let problem = format!(
        "they have different Suns: observed in {:.0} to {:.0} % of their time, drawn in the rest",
        100.0 * least,
        100.0 * most
    );
    Err(InputError::new("cannot compare these missions", problem)
        .with_help("--set environment.sun=drawn draws the Sun of all of them; --set environment.sun=observed compares them as they are"))
}

/// Share of a mission in which its Sun is taken as it was.
fn observed_share(mission: &Mission) -> f64 {
    let launch = decimal_year(mission.mission.launch.0);
    let end = launch + mission.mission.duration_yr;
    mission.observed_sun().map_or(0.0, |sun| {
        let [from, to] = sun.span();
        ((to.min(end) - from.max(launch)) / mission.mission.duration_yr).max(0.0)
    })
}
