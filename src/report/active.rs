//! The years of an active Sun, as figures show them.

use crate::environment::solar_cycle::ActiveYears;
use crate::physics::DoseHistory;
use crate::report::plot::{Mark, Series};

/// A shade over each active stretch of a mission, which flies between two decimal calendar years.
pub(super) fn shades(dose: &DoseHistory, launch: f64, end: f64) -> Vec<Series> {
    let flown = dose.active_stretches().iter().filter(|stretch| launch + stretch.from < end);
    let shade = |stretch: &ActiveYears| Series {
        label: Some(if stretch.extrapolated { "active Sun, extrapolated" } else { "active Sun" }.into()),
        color: 7,
        kind: Mark::Shade { from: launch + stretch.from, to: (launch + stretch.to).min(end) },
    };
    flown.map(shade).collect()
}
