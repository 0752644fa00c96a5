//! The years of an active Sun, as figures show them.

use crate::environment::DoseHistory;
use crate::plot::{Kind, Series};

/// A shade over each active stretch of a mission, which flies between two decimal calendar years.
pub(super) fn shades(dose: &DoseHistory, launch: f64, end: f64) -> Vec<Series> {
    let within = |(from, to): &(f64, f64)| (launch + from, (launch + to).min(end));
    let shade = |(from, to)| Series { label: Some("active Sun".into()), color: 7, kind: Kind::Shade { from, to } };
    dose.active_windows().iter().map(within).filter(|(from, to)| from < to).map(shade).collect()
}
