//! `ctiplan study clock`.

use serde::Serialize;
use serde_json::{Map, Value};

use super::judged;
use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, budget, short, when};
use crate::mission::Mission;
use crate::plan::judgement::JudgedRow;
use crate::report::plot::{Figure, Panel, dashed, line};
use crate::study::clock::{Comparison, Cost, LineTime, Results};

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title =
            format!("line time against shape error of \"{}\" at the end of the mission", mission.requirement.galaxy);
        let mut report = StudyReport::of("clock", mission, title, &self.warnings);
        report.cite("Line time against shape error", "Rhodes et al. 2010 (PASP 122, 439), sections 5.1 and 6");
        report.tables = vec![line_times(self, mission), species(self)];
        let line_time = column("line_time_ms", "line [ms]", Digits::Significant(4));
        report.tables.extend(judged::table(&self.line_times, line_time, mission));
        report.draw(figure(self, mission));
        let lost = self.line_times.iter().filter(|one| one.delta_e.is_none()).count();
        if lost > 0 {
            let all = self.line_times.len();
            report.find(format!("With {lost} of {all} line times no shape is left at the end of the mission."));
        }
        if let Some(comparison) = &self.comparison {
            compare(&mut report, self, comparison, mission);
        }
        if let Some(ranking) = &self.ranking {
            let rows: Vec<&JudgedRow> = self.line_times.iter().filter_map(|one| one.judged.as_ref()).collect();
            let line_time_ms = |place: usize| self.line_times[place].line_time_ms;
            judged::rank(&mut report, &rows, ranking, self.confidence, |place| {
                format!("{} ms", short(line_time_ms(place)))
            });
            report.result("best_for_requirement_line_time_ms", line_time_ms(ranking.best[0]));
            if let Some(required) = self.confidence {
                judged::explain(&mut report, &rows, required);
            }
        }
        report
    }
}

fn has_cost(results: &Results) -> bool {
    results.line_times.iter().any(|one| one.cost.is_some())
}

fn has_area(results: &Results) -> bool {
    results.line_times.iter().any(|one| one.cost.as_ref().is_some_and(|cost| cost.area.is_some()))
}

fn line_times(results: &Results, mission: &Mission) -> DataTable {
    let mut columns = vec![
        column("line_time_ms", "line [ms]", Digits::Significant(4)),
        column("delta_e", "|Δe|", Digits::Scientific(3)),
        column("flux_loss_percent", "flux lost [%]", Digits::Fixed(4)),
    ];
    if has_cost(results) {
        columns.extend([
            column("read_noise_e", "noise [e-]", Digits::Fixed(2)),
            column("snr", "S/N", Digits::Fixed(2)),
            column("readout_s", "readout [s]", Digits::Significant(3)),
        ]);
    }
    if has_area(results) {
        columns.extend([
            column("area", "area", Digits::Fixed(3)),
            column("area_equal_depth", "equal depth", Digits::Fixed(3)),
        ]);
    }
    if results.ranking.is_some() {
        // With a requested probability, expected values are only in the machine-readable output: there is no space for both.
        let expected = |name: &'static str| if results.confidence.is_some() { "" } else { name };
        columns.extend([words("exceeded_date", expected("exceeded")), words("corrected_date", expected("corrected"))]);
        columns.extend(judged::each(mission, false));
        columns.extend(judged::drawn(results.confidence.is_some()));
    }
    let title = if has_area(results) { "Area per time is over that of the mission's own clock" } else { "" };
    DataTable::of("line_times", &results.line_times, columns).titled(title)
}

/// Δe1 of each species alone, one column each.
#[derive(Serialize)]
struct Alone {
    line_time_ms: f64,
    #[serde(flatten)]
    delta_e1: Map<String, Value>,
}

fn species(results: &Results) -> DataTable {
    let key = |name: &str| format!("delta_e1_{name}");
    let mut columns = vec![column("line_time_ms", "line [ms]", Digits::Significant(4))];
    columns.extend(results.species.iter().map(|one| column(key(&one.name), one.name.clone(), Digits::Scientific(2))));
    let row = |one: &LineTime| Alone {
        line_time_ms: one.line_time_ms,
        delta_e1: results.species.iter().zip(&one.delta_e1_alone).map(|(s, e1)| (key(&s.name), (*e1).into())).collect(),
    };
    DataTable::of("species", results.line_times.iter().map(row), columns).titled("delta e1 of each species alone")
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let x: Vec<f64> = results.line_times.iter().map(|one| one.line_time_ms).collect();
    let of = |value: &dyn Fn(&LineTime) -> Option<f64>| -> Vec<f64> {
        results.line_times.iter().map(|one| value(one).unwrap_or(f64::NAN)).collect()
    };
    let cost = |value: fn(&Cost) -> Option<f64>| of(&|one| one.cost.as_ref().and_then(value));
    let mut shapes = vec![line("all species", 0, &x, of(&|one| one.delta_e))];
    for (index, species) in results.species.iter().enumerate() {
        shapes.push(dashed(&species.name, index + 1, &x, of(&|one| one.delta_e1_alone[index].map(f64::abs))));
    }
    shapes.extend(budget(mission));
    let panel = |y_label: &str, series| Panel {
        x_label: "line time [ms]".into(),
        y_label: y_label.into(),
        x_log: true,
        series,
        height_share: 0.6,
        ..Panel::default()
    };
    let mut panels = vec![
        Panel { height_share: 1.4, ..panel("|Δe| at the end", shapes) },
        panel("flux lost [%]", vec![line("flux lost", 2, &x, of(&|one| one.flux_loss_percent))]),
    ];
    if has_cost(results) {
        let noise = cost(|cost| Some(cost.read_noise_e));
        panels.push(panel("read noise [e⁻]", vec![line("read noise", 3, &x, noise)]));
    }
    if has_area(results) {
        let (equal_time, equal_depth) = (cost(|cost| cost.area), cost(|cost| cost.area_equal_depth));
        let series = vec![line("area", 4, &x, equal_time), line("at equal depth", 5, &x, equal_depth)];
        panels.push(panel("area per time", series));
    }
    Figure { title: format!("{}: line time", mission.mission.name), panels }
}

fn compare(report: &mut StudyReport, results: &Results, comparison: &Comparison, mission: &Mission) {
    let (worst, best) = (&results.line_times[comparison.worst], &results.line_times[comparison.best]);
    let (most, least) = (worst.delta_e.unwrap_or(0.0), best.delta_e.unwrap_or(0.0));
    report.result("worst_line_time_ms", worst.line_time_ms);
    report.result("best_line_time_ms", best.line_time_ms);
    if most == 0.0 {
        report.find("No clock changes any shape: the mission has no traps at its end.");
        return;
    }
    report.find(worst_clock(results, worst));
    let end = match is_last(results, best) {
        true => " It is at the end of the range tried: a line time beyond may be better still.",
        false => "",
    };
    report.find(format!(
        "The best clock for shapes is {} ms, with {:.2} of the worst |delta e|. It loses {:.3} % of the flux, the worst {:.3} \
         %.{end}",
        short(best.line_time_ms),
        least / most,
        best.flux_loss_percent.unwrap_or(0.0),
        worst.flux_loss_percent.unwrap_or(0.0)
    ));
    if let Some(own) = comparison.own_delta_e {
        report.result("own_delta_e", own);
        let own_ms = short(mission.readout.line_time_ms);
        report.find(format!("The mission's own {own_ms} ms has {:.2} of the worst |delta e|.", own / most));
    }
    for species in 0..results.species.len() {
        report.findings.extend(worst_alone(results, species));
    }
    report.find(format!(
        "Uncorrected budget: {} with the worst clock, {} with the best, {} with the mission's own.",
        when(comparison.worst_date),
        when(comparison.best_date),
        when(comparison.own_date)
    ));
    price(report, results, comparison, mission);
}

/// Whether a line time is at one of the ends of those tried.
fn is_last(results: &Results, one: &LineTime) -> bool {
    [results.line_times.first(), results.line_times.last()]
        .into_iter()
        .flatten()
        .any(|end| end.line_time_ms == one.line_time_ms)
}

/// |Δe1| of a species alone.
fn alone(one: &LineTime, species: usize) -> f64 {
    one.delta_e1_alone[species].map_or(0.0, f64::abs)
}

fn worst_clock(results: &Results, worst: &LineTime) -> String {
    let mut words = format!(
        "The worst clock is {} ms, with |delta e| {:.3e}",
        short(worst.line_time_ms),
        worst.delta_e.unwrap_or(0.0)
    );
    let species = 0..results.species.len();
    let total: f64 = species.clone().map(|index| alone(worst, index)).sum();
    let largest = species.max_by(|a, b| alone(worst, *a).total_cmp(&alone(worst, *b)));
    if let Some(index) = largest.filter(|_| total > 0.0) {
        words += &format!(
            "; {}, released after {} transfers, contributes {:.0} % of it",
            results.species[index].name,
            short(results.species[index].release_ms / worst.line_time_ms),
            100.0 * alone(worst, index) / total
        );
    }
    if is_last(results, worst) {
        words += ". It is at the end of the range tried";
    }
    words + "."
}

/// The line time at which a species alone is worst, if that is not an end of those tried.
fn worst_alone(results: &Results, species: usize) -> Option<String> {
    let tried = &results.line_times;
    let size = |place: usize| alone(&tried[place], species);
    let inside = 1..tried.len().saturating_sub(1);
    let peaks = inside.filter(|place| size(*place) > size(place - 1) && size(*place) > size(place + 1));
    let peak = &tried[peaks.max_by(|a, b| size(*a).total_cmp(&size(*b)))?];
    let species = &results.species[species];
    Some(format!(
        "{} alone is worst around {} ms, where it is released after {:.2} transfers.",
        species.name,
        short(peak.line_time_ms),
        species.release_ms / peak.line_time_ms
    ))
}

/// The costs in survey area and noise.
fn price(report: &mut StudyReport, results: &Results, comparison: &Comparison, mission: &Mission) {
    let Some(noise) = &mission.readout.noise else {
        report.find("The cost of a clock in read noise and time is not known: the mission has no [readout.noise].");
        return;
    };
    let beyond = results.line_times.iter().filter(|one| one.cost.is_none()).count();
    if beyond > 0 {
        report.find(format!(
            "{beyond} of {} line times have no read noise: the pixel rate for {} pixels per line is outside the table, or \
             the line time is too short for them.",
            results.line_times.len(),
            noise.columns
        ));
    }
    let Some(own) = &comparison.own_cost else {
        report.find("The mission's own clock is outside its table of read noise: there is no area to compare with.");
        return;
    };
    report.result("own_read_noise_e", own.read_noise_e);
    report.result("own_readout_s", own.readout_s);
    match comparison.most_area.map(|place| &results.line_times[place]) {
        Some(LineTime { line_time_ms, delta_e, cost: Some(cost), .. }) => {
            report.result("best_area_line_time_ms", *line_time_ms);
            report.find(format!(
                "Of the clocks within the corrected budget, {} ms covers the largest area at equal depth: {:.3} of the \
                 mission's own, with |delta e| {:.3e} and {:.2} e- of read noise.",
                short(*line_time_ms),
                cost.area_equal_depth.unwrap_or(0.0),
                delta_e.unwrap_or(0.0),
                cost.read_noise_e
            ));
        }
        _ if mission.survey.is_none() => {
            report.find("The cost of readout time in area is not known: the mission has no [survey].")
        }
        _ => report.find("No clock tried stays within the corrected budget to the end of the mission."),
    }
}
