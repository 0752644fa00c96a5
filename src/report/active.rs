//! The active years of the Sun, for figures.

use crate::environment::solar_cycle::ActiveYears;
use crate::physics::DoseHistory;
use crate::report::plot::{Mark, Series};

/// A shaded interval for each active period of a mission, between two decimal calendar years.
pub(super) fn shades(dose: &DoseHistory, launch: f64, end: f64) -> Vec<Series> {
    let flown = dose.active_stretches().iter().filter(|stretch| launch + stretch.from < end);
    let shade = |stretch: &ActiveYears| Series {
        label: Some(if stretch.extrapolated { "active Sun, extrapolated" } else { "active Sun" }.into()),
        color: 7,
        kind: Mark::Shade { from: launch + stretch.from, to: (launch + stretch.to).min(end) },
    };
    flown.map(shade).collect()
}
