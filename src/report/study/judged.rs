//! Budgets judged together: columns and sentences.

use serde::Serialize;
use serde_json::{Value, json};

use super::table::{column, words};
use super::{Column, DataTable, Digits, StudyReport};
use crate::mission::Mission;
use crate::plan::judgement::{JudgedRow, Limited};
use crate::plan::scenario::{Criterion, Extremes, Ranking};
use crate::report::ranked::{by_others, named};
use crate::report::study::estimate::plus_minus;
use crate::study::Estimate;

/// Each budget in a text table, beside a column that distinguishes rows; none if only |Δe| is limited.
pub(super) fn table<R: Serialize>(rows: &[R], apart: Column, mission: &Mission) -> Option<DataTable> {
    let columns = each(mission, true);
    let title = "Each budget at the end of the mission, and which one is exceeded first";
    let table = || DataTable::of("budgets", rows, [apart].into_iter().chain(columns.clone()).collect()).titled(title);
    (!columns.is_empty()).then(table)
}

/// The budget that is exceeded first, and for each budget its value at the end and when it is exceeded, for all output or only for
/// programs; empty if only |Δe| is limited.
pub(super) fn each(mission: &Mission, shown: bool) -> Vec<Column> {
    let name = |head: &'static str| if shown { head } else { "" };
    let limited = Limited::by(mission);
    if limited == [Limited::DeltaE] {
        return Vec::new();
    }
    let mut columns = vec![words("exceeded_by", name("first")), words("corrected_by", name("corrected"))];
    for one in limited {
        let head = name(one.symbol());
        let [at_end, exceeded, corrected] = one.keys();
        columns.extend([
            column(at_end, head, Digits::Scientific(2)),
            column(exceeded, name("after [yr]"), Digits::Fixed(2)),
            column(corrected, "", Digits::Fixed(2)),
        ]);
    }
    columns
}

/// How long budgets are met with a probability, and the probability that they are met until the end; with headings if they are
/// shown in text.
pub(super) fn drawn(shown: bool) -> Vec<Column> {
    let head = |name: &'static str| if shown { name } else { "" };
    vec![
        column("kept_t_yr", head("kept [yr]"), Digits::Fixed(2)),
        column("corrected_kept_t_yr", head("corrected [yr]"), Digits::Fixed(2)),
        column("met_percent", head("met [%]"), Digits::Fixed(1)).with_error("met_error_percent"),
        column("corrected_met_percent", head("corrected [%]"), Digits::Fixed(1))
            .with_error("corrected_met_error_percent"),
    ]
}

/// An explanation of the columns of [`drawn`], and why the Sun is not drawn, if so.
pub(super) fn explain(report: &mut StudyReport, rows: &[&JudgedRow], required: f64) {
    report.find(format!(
        "kept: how long all budgets are kept with {:.0} %; met: probability that they are to the end, without correction and with it.",
        100.0 * required
    ));
    if let Some(why) = rows.iter().find_map(|row| row.sun_not_drawn.as_ref()) {
        report.find(format!("The Sun is not drawn: {why}."));
    }
}

/// The best and the worst case among those judged, by name, as expected or with a probability.
pub(super) fn rank(
    report: &mut StudyReport,
    rows: &[&JudgedRow],
    ranking: &Ranking,
    required: Option<f64>,
    name: impl Fn(usize) -> String,
) {
    let names = |places: &[usize]| named(places, &name);
    let Some(by) = ranking.by else {
        report.find(format!("For the requirement all {} tried are alike.", rows.len()));
        return;
    };
    let fate = |place: usize| fate(rows[place], by, required);
    report.find(format!(
        "Best for the requirement: {} ({}). Worst: {} ({}).",
        names(&ranking.best),
        fate(ranking.best[0]),
        names(&ranking.worst),
        fate(ranking.worst[0])
    ));
    report.findings.extend(by_others(ranking, required, name));
}

/// The best and the worst by each criterion alone, by name, for programs.
pub(super) fn each_alone(ranking: &Ranking, name: impl Fn(usize) -> String) -> Value {
    let names = |places: &[usize]| places.iter().map(|place| name(*place)).collect::<Vec<_>>();
    let one = |one: &Extremes| json!({"by": one.by, "best": names(&one.best), "worst": names(&one.worst), "values": one.values});
    ranking.each.iter().map(one).collect()
}

/// The quantity by which a case is ranked.
fn fate(row: &JudgedRow, by: Criterion, required: Option<f64>) -> String {
    let corrected = usize::from(by == Criterion::Corrected);
    let word = ["uncorrected", "corrected"][corrected];
    let exceeded_by = [row.exceeded_by, row.corrected_by][corrected];
    match required {
        Some(p) => {
            let kept = [row.kept_t_yr, row.corrected_kept_t_yr][corrected];
            let percent = [row.met_percent, row.corrected_met_percent][corrected].unwrap_or(f64::NAN);
            let error = [row.met_error_percent, row.corrected_met_error_percent][corrected].unwrap_or(f64::NAN);
            let met = plus_minus(Estimate { value: percent, error });
            let kept = kept.map_or("to the end".into(), |t_yr| format!("for {t_yr:.2} yr"));
            format!("{word} budgets kept {kept} with {:.0} %, met to the end with {met} %", 100.0 * p)
        }
        None => match ([row.exceeded_t_yr, row.corrected_t_yr][corrected], exceeded_by) {
            (Some(t_yr), Some(limited)) => {
                format!("{word} budget of {} exceeded after {t_yr:.2} yr", limited.symbol())
            }
            _ => format!("{word} budgets not exceeded"),
        },
    }
}
