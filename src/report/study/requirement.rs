//! `ctiplan study requirement`.

use serde::Serialize;

use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, short};
use crate::mission::Mission;
use crate::plan::date_distribution::Confidence;
use crate::report::plot::{Figure, Panel, level, line};
use crate::report::significant;
use crate::study::requirement::{Bound, Limit, Results};

/// A quantity proportional to the dose: the mission's own value, and the allowed one.
#[derive(Serialize)]
struct Row {
    quantity: &'static str,
    mission: Option<f64>,
    uncorrected: Option<f64>,
    corrected: Option<f64>,
    uncorrected_confident: Option<f64>,
    corrected_confident: Option<f64>,
}

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "what is allowed, one quantity at a time, so that |delta e| of \"{}\" stays below {} (uncorrected) and {} (corrected, \
             factor {}) to the end of the mission",
            mission.requirement.galaxy,
            short(self.limits[0].delta_e),
            short(self.limits[1].delta_e),
            mission.requirement.correction_factor
        );
        let mut report = StudyReport::of("requirement", mission, title, &self.warnings);
        report.of_galaxy_alone(mission);
        report.tables = vec![allowed(self), clocks(self)];
        report.draw(figure(self, mission));
        for (name, limit) in names().into_iter().zip(&self.limits) {
            report.find(sentence(self, name, limit));
            report.result(&format!("{name}_launches"), limit.launches);
            report.result(&format!("{name}_dose_factor"), limit.factor[0].value());
            report.result(&format!("{name}_dose_factor_confident"), limit.factor[1].value());
        }
        report.result("launches_tried", self.launches.len());
        if let Some(required) = self.confidence {
            let Confidence { probability, samples } = required;
            report.result("confidence", probability);
            let error = self.limits.iter().filter_map(|limit| limit.confident_error).fold(0.0, f64::max);
            report.find(format!(
                "With {samples} draws of the Sun and [uncertainty], a probability of {:.0} % has a standard error of {:.1} %. What is \
                 allowed with it is known to a few per cent only, because solar doses have a long tail.",
                100.0 * probability,
                100.0 * error
            ));
        }
        if self.limits.iter().any(open) {
            report.find(
                "A dash: every value tried keeps the budget, or none does (see the sentence about it); transfers are not computed with a \
                 probability.",
            );
        }
        let ends = [self.line_times.first(), self.line_times.last()].map(|end| end.map_or(0.0, |(ms, _)| *ms));
        if self.limits.iter().flat_map(|limit| limit.line_times_ms.iter().flatten()).any(|ms| ends.contains(ms)) {
            report.find(format!(
                "{} and {} ms are the ends of the range tried, not limits.",
                significant(ends[0], 3),
                significant(ends[1], 3)
            ));
        }
        report.find(
            "Dose, traps and fluence scale together: each is the mission's times the same factor. The shield is the mission's \
             own, thinner or thicker on all sides.",
        );
        report
    }
}

/// Whether a value of a limit is missing from the table.
fn open(limit: &Limit) -> bool {
    let bounds = [limit.factor, limit.shield, [limit.transfers, Bound::NotSought]];
    bounds.iter().flatten().any(|bound| matches!(bound, Bound::None | Bound::All))
}

fn names() -> [&'static str; 2] {
    ["uncorrected", "corrected"]
}

fn allowed(results: &Results) -> DataTable {
    let own = &results.own;
    let of = |limit: usize, which: usize, bound: fn(&Limit) -> [Bound; 2], times: f64| {
        bound(&results.limits[limit])[which].value().map(|value| value * times)
    };
    let row = |quantity, own: f64, unit: f64, bound: fn(&Limit) -> [Bound; 2]| Row {
        quantity,
        mission: Some(own),
        uncorrected: of(0, 0, bound, unit),
        corrected: of(1, 0, bound, unit),
        uncorrected_confident: of(0, 1, bound, unit),
        corrected_confident: of(1, 1, bound, unit),
    };
    // A bound is a factor on the mission's own value.
    let factor_on = |quantity, own: f64, bound| row(quantity, own, own, bound);
    let dose: fn(&Limit) -> [Bound; 2] = |limit| limit.factor;
    let mut rows = vec![
        factor_on("dose at the end [MeV/g]", own.dose_mev_g, dose),
        factor_on("protons of 10 MeV [1/cm2]", own.protons_10mev_cm2, dose),
        factor_on("traps at the end [1/px]", own.traps_per_px, dose),
        factor_on("factor on the dose", 1.0, dose),
    ];
    if let Some(areal) = own.shield_g_cm2 {
        rows.push(factor_on("shield, at least [g/cm2]", areal, |limit| limit.shield));
    }
    rows.push(row("transfers", f64::from(own.transfers), 1.0, |limit| [limit.transfers, Bound::NotSought]));
    let mut columns = vec![
        words("quantity", "at most"),
        column("mission", "mission", Digits::Significant(4)),
        column("uncorrected", "uncorrected", Digits::Significant(4)),
        column("corrected", "corrected", Digits::Significant(4)),
    ];
    let head = |name: &str| {
        results.confidence.map_or(String::new(), |required| format!("{name}, {:.0} %", 100.0 * required.probability))
    };
    for name in names() {
        columns.push(column(format!("{name}_confident"), head(name), Digits::Significant(2)));
    }
    DataTable::of("allowed", rows, columns)
}

/// A range of line times within which a limit is met.
#[derive(Serialize)]
struct Range {
    limit: &'static str,
    from_ms: f64,
    to_ms: f64,
}

fn clocks(results: &Results) -> DataTable {
    let ranges = names().into_iter().zip(&results.limits).flat_map(|(name, limit)| {
        limit.line_times_ms.iter().map(move |[from_ms, to_ms]| Range { limit: name, from_ms: *from_ms, to_ms: *to_ms })
    });
    let columns = vec![
        words("limit", "line times that keep it"),
        column("from_ms", "from [ms]", Digits::Significant(3)),
        column("to_ms", "to [ms]", Digits::Significant(3)),
    ];
    DataTable::of("line_times", ranges, columns)
}

fn sentence(results: &Results, name: &str, limit: &Limit) -> String {
    let factor = match limit.factor[0] {
        Bound::At(factor) if factor >= 1.0 => format!("allows {} times the mission's dose", short(factor)),
        Bound::At(factor) => format!("allows {} of the mission's dose", short(factor)),
        Bound::All => {
            format!("is kept at any dose that was tried, up to {} times the mission's", short(results.factors[1]))
        }
        Bound::None => format!("is not kept by {} of the mission's dose", short(results.factors[0])),
        Bound::NotSought => "was not solved for".into(),
    };
    let confident = match (limit.factor[1], results.confidence.map(|required| required.probability)) {
        (Bound::At(factor), Some(p)) => format!(", {} with {:.0} %", significant(factor, 2), 100.0 * p),
        (Bound::All, Some(p)) => format!(", any with {:.0} %", 100.0 * p),
        (Bound::None, Some(p)) => format!(", none with {:.0} %", 100.0 * p),
        _ => String::new(),
    };
    format!(
        "The {name} budget {factor} in the design case{confident}; {} of {} launches over a solar cycle keep it.",
        limit.launches,
        results.launches.len()
    )
}

/// |Δe| at the end of the mission against the line time, and the limits.
fn figure(results: &Results, mission: &Mission) -> Figure {
    let (x, y): (Vec<f64>, Vec<f64>) = results.line_times.iter().copied().unzip();
    let y = y.into_iter().map(|delta_e| if delta_e.is_finite() { delta_e } else { f64::NAN }).collect();
    let mut series = vec![line("at the end of life", 1, &x, y)];
    series.extend(names().into_iter().zip(&results.limits).map(|(name, limit)| level(name, limit.delta_e)));
    let panel = Panel {
        x_label: "line time [ms]".into(),
        y_label: "|Δe| at the end".into(),
        x_log: true,
        y_log: true,
        series,
        ..Panel::default()
    };
    Figure { title: format!("{}: line times that the requirement allows", mission.mission.name), panels: vec![panel] }
}
