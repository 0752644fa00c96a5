//! `ctiplan study calibration`.

use super::estimate::plus_minus;
use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, short};
use crate::mission::Mission;
use crate::report::plot::{Figure, Panel, level, line};
use crate::study::Estimate;
use crate::study::calibration::{Continued, Known, LEAST_MONTHS, Longest, Outcome, Results, TOLERANCE};

/// Extrapolations of densities, with their names.
const WAYS: [(Continued, &str); 2] =
    [(Continued::Constant, "held constant"), (Continued::Linear, "extrapolated linearly")];

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let limits = self.limited.iter().zip(&self.limits);
        let limits: Vec<String> = limits.map(|(one, limit)| format!("{} {}", one.symbol(), short(*limit))).collect();
        let title = format!(
            "how well a correction must know the traps so that what it leaves is within {}, and how often they must be measured",
            limits.join(", ")
        );
        let mut report = StudyReport::of("calibration", mission, title, &self.warnings);
        report.cite("Errors of a correction from errors of its parameters", "Israel et al. 2015 (MNRAS 453, 561)");
        report.tables = vec![intervals(self), longest(self), known(self)];
        report.draw(figure(self, mission));
        describe(&mut report, self);
        report
    }
}

fn intervals(results: &Results) -> DataTable {
    let percent = short(100.0 * results.probability);
    let columns = vec![
        column("interval_months", "every [months]", Digits::Significant(3)),
        words("continued", "densities"),
        column("density_error_percent", "error [%]", Digits::Significant(3)),
        column("used_percent", "limit used [%]", Digits::Significant(3)),
        words("by", "of"),
        column("beyond_percent", "beyond [%]", Digits::Significant(2)),
        column("met_percent", "met [%]", Digits::Fixed(1)).with_error("met_error_percent"),
    ];
    DataTable::of("intervals", &results.intervals, columns).titled(format!(
        "error: largest error of the densities over the mission, in % of those at the end; limit used: largest fraction of a limit; \
         both are {percent} % quantiles of the draws; beyond: mean fraction of the mission with a limit exceeded; met: probability that \
         no limit is exceeded"
    ))
}

fn longest(results: &Results) -> DataTable {
    let percent = short(100.0 * results.probability);
    let columns = vec![
        words("continued", "densities"),
        words("outcome", "longest interval"),
        column("interval_months", "months", Digits::Significant(3)).with_error("error_months"),
        words("by", "limited by"),
        column("used_at_shortest_percent", "", Digits::Significant(3)),
    ];
    DataTable::of("longest", &results.longest, columns).titled(format!(
        "Longest interval between calibrations that keeps all limits with {percent} %, between {LEAST_MONTHS} months and the mission"
    ))
}

fn known(results: &Results) -> DataTable {
    let columns = vec![
        words("parameter", "parameter"),
        column("needed_percent", "needed to [%]", Digits::Significant(2)),
        words("by", "for"),
    ];
    DataTable::of("known", &results.known, columns).titled(
        "Error (1 sigma) of a parameter that uses up a limit at the end of the mission, all others known exactly",
    )
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let series = WAYS.into_iter().enumerate().map(|(place, (continued, name))| {
        let of = || results.intervals.iter().filter(|one| one.continued == continued);
        let x: Vec<f64> = of().map(|one| one.interval_months).collect();
        line(name, place + 1, &x, of().map(|one| one.used_percent).collect())
    });
    let panel = Panel {
        x_label: "time between calibrations [months]".into(),
        y_label: "limit used [%]".into(),
        x_log: true,
        y_log: true,
        series: series.chain([level("limit", 100.0)]).collect(),
        ..Panel::default()
    };
    Figure { title: format!("{}: calibration", mission.mission.name), panels: vec![panel] }
}

fn describe(report: &mut StudyReport, results: &Results) {
    for all in ["all densities", "all release times"] {
        let found: Option<&Known> = results.known.iter().find(|known| known.parameter == all);
        if let Some((percent, by)) = found.and_then(|known| Some((known.needed_percent?, known.by?))) {
            report.result(&format!("needed_{}_percent", all.replace(' ', "_")), percent);
            report.find(format!(
                "The limit on {} asks for {all} to {} % each, independent of one another.",
                by.symbol(),
                short(percent)
            ));
        }
    }
    for longest in &results.longest {
        describe_longest(report, results, longest);
    }
    report.find(
        "Solar events are not predicted. Until the next calibration the densities are too small by the traps of the event, however short \
         the interval. A calibration after each event would avoid the time beyond a limit.",
    );
    report.find("The residual trailing is computed to first order. Read noise, and the residual of a correction with exact parameters, are in `study correction`.");
    if let Some(why) = &results.sun_not_drawn {
        report.find(format!("The Sun is not drawn: {why}. There is one history of the densities."));
    }
}

/// The longest interval, for one extrapolation of densities.
fn describe_longest(report: &mut StudyReport, results: &Results, longest: &Longest) {
    let key = if longest.continued == Continued::Linear { "longest_linear" } else { "longest_constant" };
    report.result(&format!("{key}_months"), longest.interval_months);
    report.result(&format!("{key}_error_months"), longest.error_months);
    let name = WAYS.into_iter().find(|(continued, _)| *continued == longest.continued).map_or("", |(_, name)| name);
    let percent = short(100.0 * results.probability);
    report.find(match (longest.outcome, longest.interval_months) {
        (Outcome::Solved, Some(months)) => {
            let months_and_error = plus_minus(Estimate { value: months, error: longest.error_months.unwrap_or(0.0) });
            let unknown = results.sun_not_drawn.is_none() && longest.error_months.is_none_or(|error| error > 0.5 * months);
            if unknown {
                format!(
                    "Densities {name}: the interval that keeps all limits with {percent} % is not determined by these draws \
                     ({months_and_error} months): increase --samples."
                )
            } else {
                format!(
                    "Densities {name}: calibrations every {months_and_error} months keep all limits with {percent} % (solved to {} %, \
                     between {LEAST_MONTHS} months and the end of the mission).",
                    short(100.0 * TOLERANCE)
                )
            }
        }
        (Outcome::AlwaysMet, _) => {
            format!("Densities {name}: always met. One calibration at launch keeps all limits to the end with {percent} %.")
        }
        _ => format!(
            "Densities {name}: not reachable. Calibrations every {LEAST_MONTHS} months use {} % of the limit on {} with {percent} %.",
            short(longest.used_at_shortest_percent),
            longest.by.map_or("a parameter", |by| by.symbol())
        ),
    });
}
