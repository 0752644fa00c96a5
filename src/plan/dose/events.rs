//! Observed solar proton events of a mission, each with its dose.

use chrono::NaiveDateTime;
use serde::Serialize;

use crate::environment::source::When;
use crate::mission::Mission;
use crate::numeric::calendar::decimal_year;
use crate::physics::DoseHistory;

/// An observed event and its dose behind the shield.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventDose {
    /// Its start.
    pub start: NaiveDateTime,
    /// Its end.
    pub end: NaiveDateTime,
    /// The satellite that measured it.
    pub satellite: String,
    /// Fluence above 10 MeV outside the magnetosphere, cm⁻².
    pub above_10_mev_cm2: f64,
    /// Fluence above 100 MeV, cm⁻².
    pub above_100_mev_cm2: f64,
    /// Its dose within the mission, MeV/g.
    pub dose_mev_g: f64,
    /// Its share of the mission's dose before effects.
    pub share: f64,
    /// Its start, years since launch.
    #[serde(skip)]
    pub t_yr: f64,
}

impl EventDose {
    /// All observed events of a mission, the largest dose first.
    pub(super) fn all(mission: &Mission, history: &DoseHistory) -> Vec<EventDose> {
        let (launch, duration_yr) = (decimal_year(mission.mission.launch.0), mission.mission.duration_yr);
        let total_mev_g: f64 =
            history.sources.iter().map(|source| history.of_source_mev_g(source, 0.0, duration_yr)).sum();
        let dosed = history.sources.iter().flat_map(|source| &source.streams);
        let mut events: Vec<EventDose> = dosed
            .filter_map(|dosed| {
                let When::Event { from, event, .. } = &dosed.stream.when else { return None };
                let years = dosed.stream.when.years(launch, launch + duration_yr, 0.0);
                let dose_mev_g = mission.environment.dose_factor * years * dosed.dose_mev_g_yr;
                let spectrum = event.spectrum(0.0);
                (years > 0.0).then(|| EventDose {
                    start: event.start,
                    end: event.end,
                    satellite: event.satellite.clone(),
                    above_10_mev_cm2: spectrum.above(10.0),
                    above_100_mev_cm2: spectrum.above(100.0),
                    dose_mev_g,
                    share: dose_mev_g / total_mev_g,
                    t_yr: from - launch,
                })
            })
            .collect();
        events.sort_by(|a, b| b.dose_mev_g.total_cmp(&a.dose_mev_g));
        events
    }
}
