//! The best and the worst of several missions, in words.

use crate::plan::scenario::{Criterion, Extremes, Ranking};

/// Maximum number of missions that are named.
const NAMED: usize = 6;

/// Names, and the number of those beyond the first ones.
pub(super) fn named(places: &[usize], name: impl Fn(usize) -> String) -> String {
    let mut names: Vec<String> = places.iter().take(NAMED).map(|place| name(*place)).collect();
    if places.len() > NAMED {
        names.push(format!("{} more", places.len() - NAMED));
    }
    // A name of several settings has commas of its own.
    names.join(if names.iter().any(|name| name.contains(',')) { "; " } else { ", " })
}

/// A criterion, after "by".
pub(super) fn criterion(by: Criterion) -> &'static str {
    match by {
        Criterion::Uncorrected => "the uncorrected budget",
        Criterion::Corrected => "the corrected budget",
        Criterion::Used => "the share of a budget used at the end",
        Criterion::End => "|delta e| at the end of the mission",
    }
}

/// A value of a criterion, as expected or with a probability.
fn value(by: Criterion, value: Option<f64>, probability: Option<f64>) -> String {
    let with = probability.map_or(String::new(), |p| format!(" with {:.0} %", 100.0 * p));
    match (by, value) {
        (Criterion::Uncorrected | Criterion::Corrected, Some(t_yr)) => match probability {
            None => format!("exceeded after {t_yr:.2} yr"),
            Some(_) => format!("kept for {t_yr:.2} yr{with}"),
        },
        (Criterion::Uncorrected | Criterion::Corrected, None) => match probability {
            None => "not exceeded".into(),
            Some(_) => format!("kept to the end{with}"),
        },
        (Criterion::Used, Some(used)) => format!("{:.1} %", 100.0 * used),
        (Criterion::End, Some(delta_e)) => format!("{delta_e:.3e}"),
        (Criterion::Used | Criterion::End, None) => "no shape left".into(),
    }
}

/// A sentence for each criterion by which other missions are the best or the worst.
pub(super) fn by_others(ranking: &Ranking, probability: Option<f64>, name: impl Fn(usize) -> String) -> Vec<String> {
    let sentence = |one: &Extremes| {
        let side = |places: &[usize], of| format!("{} ({})", named(places, &name), value(one.by, of, probability));
        let (best, worst) = (side(&one.best, one.values[0]), side(&one.worst, one.values[1]));
        format!("By {} alone: best {best}; worst {worst}.", criterion(one.by))
    };
    ranking.other_criteria().map(sentence).collect()
}
