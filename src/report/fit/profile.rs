//! Intervals by profile likelihood, in words and tables.

use super::to_digits_of;
use crate::analysis::fit::profile::{End, Interval, Profile};
use crate::mission::keys::plain;
use crate::plan::sources::Source;
use crate::report::{Parts, or_dash, table};

/// Intervals, and the reason if they are open.
pub(super) fn say(profiles: &[Profile], out: &mut Parts) {
    if profiles.is_empty() {
        return;
    }
    out.heading("Profile likelihood: all other free parameters fitted again at each value");
    let mut intervals = table(&["key", "confidence", "from", "to", "unit"]);
    for profile in profiles {
        for interval in &profile.intervals {
            let end = |end: End| or_dash(end.crossing().map(|value| number(profile, value)));
            intervals.add_row(vec![
                profile.key.clone(),
                percent(interval),
                end(interval.low),
                end(interval.high),
                profile.unit.into(),
            ]);
        }
    }
    out.table(intervals);
    out.words("  68 %: chi2 rises by 1, 95 %: by 4, to the first such value on each side", 4);
    for profile in profiles {
        doubts(profile, out);
    }
}

fn percent(interval: &Interval) -> String {
    format!("{:.0} %", 100.0 * interval.confidence)
}

/// An interval with an open end, in words.
fn words(profile: &Profile, interval: &Interval) -> Option<String> {
    let at = |way: &str, value: f64| {
        let unit = if profile.unit.is_empty() { String::new() } else { format!(" {}", profile.unit) };
        Some(format!("{way} {}{unit} at {}", number(profile, value), percent(interval)))
    };
    match (interval.low.crossing(), interval.high.crossing()) {
        (Some(_), Some(_)) => None,
        (None, Some(high)) => at("below", high),
        (Some(low), None) => at("above", low),
        (None, None) => Some(format!("not constrained at {}", percent(interval))),
    }
}

/// A value to two digits of its distance from the nearest end.
fn number(profile: &Profile, value: f64) -> String {
    let ends = profile.intervals.iter().flat_map(|interval| [interval.low, interval.high]);
    let distances = ends.filter_map(|end| Some((end.crossing()? - profile.value).abs()));
    let least = distances.filter(|distance| *distance > 0.0).fold(f64::INFINITY, f64::min);
    if least.is_finite() { to_digits_of(value, least) } else { format!("{value:.3e}") }
}

/// Ends that were not found, and a deeper minimum.
fn doubts(profile: &Profile, out: &mut Parts) {
    let key = &profile.key;
    let mut said = |said: String| out.verdict(format!("  - {key}: {said}"), 4);
    for interval in &profile.intervals {
        let Some(words) = words(profile, interval) else { continue };
        let ends = [(interval.low, "down"), (interval.high, "up")];
        let open: Vec<String> = ends.into_iter().filter_map(|(end, way)| reason(end, way)).collect();
        said(format!("{words}; chi2 rises by less than {} {}", interval.delta_chi2, open.join(" and ")));
    }
    if let Some(lower) = profile.lower {
        said(format!(
            "at {} chi2 is {:.2} below that of the fit, which is not the deepest minimum; fit again with \
             `--set {key}={}`",
            number(profile, lower.value),
            -lower.delta_chi2,
            number(profile, lower.value)
        ));
    }
}

/// How far the search went for an end that was not found.
fn reason(end: End, way: &str) -> Option<String> {
    match end {
        End::Crossing { .. } => None,
        End::Bound { value } => Some(format!("{way} to the bound, {}", plain(value))),
        End::Undone { value } => Some(format!("{way} to {value:.3e}, beyond which it was not followed")),
    }
}

/// Curves as CSV.
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

/// Source of the method.
pub(super) fn source() -> Source {
    Source::new(
        "Intervals by profile likelihood: chi2 + 1 and + 4 with all other parameters fitted again",
        "Wilks 1938, Ann. Math. Stat. 9, 60; Cash 1976, A&A 52, 307",
    )
}
