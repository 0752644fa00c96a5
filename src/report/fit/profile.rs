//! Intervals by profile likelihood, in words and tables.

use super::to_digits_of;
use crate::analysis::fit::profile::{End, Interval, Profile};
use crate::mission::keys::plain;
use crate::plan::sources::Source;
use crate::report::{Parts, table};

/// Intervals, and where they are open why.
pub(super) fn say(profiles: &[Profile], out: &mut Parts) {
    if profiles.is_empty() {
        return;
    }
    out.heading("Profile likelihood: all other free parameters fitted again at each value");
    let mut intervals = table(&["key", "fitted", "68 % (chi2 + 1)", "95 % (chi2 + 4)", "unit"]);
    for profile in profiles {
        let mut row = vec![profile.key.clone(), number(profile, profile.value)];
        row.extend(profile.intervals.iter().map(|interval| words(profile, interval)));
        row.push(profile.unit.into());
        intervals.add_row(row);
    }
    out.table(intervals);
    for profile in profiles {
        doubts(profile, out);
    }
}

/// An interval in words.
fn words(profile: &Profile, interval: &Interval) -> String {
    let number = |value: f64| number(profile, value);
    match (interval.low.crossing(), interval.high.crossing()) {
        (Some(low), Some(high)) => format!("{} to {}", number(low), number(high)),
        (None, Some(high)) => format!("below {}", number(high)),
        (Some(low), None) => format!("above {}", number(low)),
        (None, None) => "not constrained".into(),
    }
}

/// A value to two digits of its distance from the nearest end.
fn number(profile: &Profile, value: f64) -> String {
    let ends = profile.intervals.iter().flat_map(|interval| [interval.low, interval.high]);
    let distances = ends.filter_map(|end| Some((end.crossing()? - profile.value).abs()));
    let least = distances.filter(|distance| *distance > 0.0).fold(f64::INFINITY, f64::min);
    if least.is_finite() { to_digits_of(value, least) } else { format!("{value:.3e}") }
}

/// Ends that were not found, and a minimum that lies deeper.
fn doubts(profile: &Profile, out: &mut Parts) {
    let key = &profile.key;
    let mut said = |said: String| out.words(format!("  - {said}"), 4);
    for interval in &profile.intervals {
        let rise = interval.delta_chi2;
        for (end, way) in [(interval.low, "down"), (interval.high, "up")] {
            match end {
                End::Crossing { .. } => {}
                End::Bound { value } => {
                    said(format!("{key}: chi2 rises by less than {rise} {way} to the bound, {}", plain(value)));
                }
                End::Undone { value } => said(format!(
                    "{key}: chi2 rises by less than {rise} {way} to {value:.3e}; not followed farther, all fits are used up"
                )),
            }
        }
    }
    if let Some(lower) = profile.lower {
        said(format!(
            "{key}: at {} chi2 is {:.2} below that of the fit, which is not the deepest minimum; fit again with \
             `--set {key}={}`",
            number(profile, lower.value),
            -lower.delta_chi2,
            number(profile, lower.value)
        ));
    }
}

/// Curves for spreadsheets.
pub(super) fn curves(profiles: &[Profile]) -> Vec<Vec<String>> {
    let mut records = vec![["key", "unit", "value", "delta_chi2"].map(str::to_string).to_vec()];
    for profile in profiles {
        for point in &profile.curve {
            let numbers = [point.value, point.delta_chi2].map(|number| number.to_string());
            records.push([profile.key.clone(), profile.unit.into()].into_iter().chain(numbers).collect());
        }
    }
    records
}

/// Where the method is from.
pub(super) fn source() -> Source {
    Source::new(
        "Intervals by profile likelihood: chi2 + 1 and + 4 with all other parameters fitted again",
        "Wilks 1938, Ann. Math. Stat. 9, 60; Cash 1976, A&A 52, 307",
    )
}
