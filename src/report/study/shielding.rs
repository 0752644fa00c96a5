//! `ctiplan study shielding`.

use serde::Serialize;
use serde_json::{Map, Value};

use super::judged;
use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport};
use crate::environment::shielding::Geometry;
use crate::mission::Mission;
use crate::mission::keys::plain;
use crate::plan::judgement::{JudgedRow, Limited};
use crate::plan::sources;
use crate::report::plot::{Figure, Panel, level, line};
use crate::report::study::estimate::plus_minus;
use crate::study::shielding::{Case, GEOMETRIES, Needed, Results};
use crate::study::{Estimate, budgets};

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "aluminium against margin: what is left of the corrected budget ({}) at the end of the mission",
            corrected_budgets(mission)
        );
        let mut report = StudyReport::of("shielding", mission, title, &self.warnings);
        report.sources = sources::of_dose(mission);
        report.tables = vec![margins(self)];
        if mission.place().is_none() {
            report.find(
                "In low Earth orbit trapped protons do the damage, which depend on altitude and inclination: add [orbit] with \
                 kind = \"elements\" to derive the dose from shielding. --set mission.orbit=l2 shows the same detector outside the \
                 magnetosphere.",
            );
            return report;
        }
        report.tables.extend([needed(self), cases(self, mission)]);
        report.draw(figure(self, mission));
        for geometry in GEOMETRIES {
            report.find(described(self, geometry));
        }
        with_probability(&mut report, self, mission);
        if mission.environment.active_dose_rate_mev_g_yr.is_some() {
            report.find("The mission gives its dose rate. This study derives the dose from the shield instead.");
        }
        report
    }
}

/// Corrected budgets, in words.
fn corrected_budgets(mission: &Mission) -> String {
    let requirement = &mission.requirement;
    let corrected = |limit: f64| plain(limit * requirement.correction_factor);
    let words = Limited::by(mission).into_iter().map(|limited| match limited {
        Limited::DeltaE => format!("|delta e| of \"{}\" {}", requirement.galaxy, corrected(requirement.delta_e)),
        Limited::C => format!("|c| {}", corrected(requirement.c.unwrap_or(f64::NAN))),
        Limited::M => format!("|m| {}", corrected(requirement.m.unwrap_or(f64::NAN))),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// Shields with the Sun and `[uncertainty]` drawn: a table, and the sufficient thickness.
fn with_probability(report: &mut StudyReport, results: &Results, mission: &Mission) {
    let (Some(required), Some(ranking)) = (results.probability, &results.ranking) else { return };
    let mut columns = vec![words("geometry", "shield"), column("thickness_mm", "Al [mm]", Digits::Significant(4))];
    columns.extend(judged::each(mission, false));
    columns.extend(judged::drawn(true));
    let title = "With the Sun and [uncertainty] drawn";
    report.tables.push(DataTable::of("drawn", &results.drawn, columns).titled(title));
    let rows: Vec<&JudgedRow> = results.drawn.iter().map(|drawn| &drawn.judged).collect();
    let name = |place: usize| {
        let drawn = &results.drawn[place];
        format!("a {} of {} mm", drawn.geometry, plain(drawn.thickness_mm))
    };
    judged::rank(report, &rows, ranking, Some(required), name);
    for geometry in GEOMETRIES {
        let of = || results.drawn.iter().filter(|drawn| drawn.geometry == geometry);
        let enough = of().find(|drawn| drawn.judged.corrected_kept_t_yr.is_none());
        report.result(&format!("{geometry}_enough_mm"), enough.map(|drawn| drawn.thickness_mm));
        let met = |judged: &JudgedRow| judged.corrected_met_percent.zip(judged.corrected_met_error_percent);
        let met = enough.and_then(|drawn| met(&drawn.judged)).map(|(value, error)| Estimate { value, error });
        report.find(match enough.zip(met) {
            Some((drawn, met)) => format!(
                "The thinnest {geometry} tried that keeps the corrected budgets with {:.0} % has {} mm: they are met with {} %.",
                100.0 * required,
                plain(drawn.thickness_mm),
                plus_minus(met)
            ),
            None => format!("No {geometry} tried keeps the corrected budgets with {:.0} %.", 100.0 * required),
        });
    }
    judged::explain(report, &rows, required);
}

fn percent(confidence: f64) -> String {
    format!("{}", (100.0 * confidence * 1e6).round() / 1e6)
}

/// Margins of one shield, one column for each confidence.
#[derive(Serialize)]
struct Margins {
    geometry: Geometry,
    thickness_mm: f64,
    #[serde(flatten)]
    margins: Map<String, Value>,
}

fn margins(results: &Results) -> DataTable {
    let key = |confidence: f64| format!("margin_percent_at_{}", percent(confidence));
    let mut columns = vec![words("geometry", "shield"), column("thickness_mm", "Al [mm]", Digits::Significant(4))];
    columns.extend(
        results
            .confidences
            .iter()
            .map(|confidence| column(key(*confidence), format!("at {} %", percent(*confidence)), Digits::Fixed(1))),
    );
    let margin = |case: &Case| {
        let margin = case.margin.map_or(Value::from("lost"), |margin| (100.0 * margin).into());
        (key(case.confidence), margin)
    };
    let rows = results.cases.chunks(results.confidences.len()).map(|shield| Margins {
        geometry: shield[0].geometry,
        thickness_mm: shield[0].thickness_mm,
        margins: shield.iter().map(margin).collect(),
    });
    DataTable::of("margins", rows, columns).titled("Margin in % of the budget")
}

fn needed(results: &Results) -> DataTable {
    let columns = vec![
        column("confidence_percent", "confidence [%]", Digits::Significant(6)),
        column("sphere_mm", "sphere [mm Al]", Digits::Fixed(1)),
        column("slab_mm", "slab [mm Al]", Digits::Fixed(1)),
    ];
    let title = "Least thickness that meets the corrected budget, solved for between those tried";
    DataTable::of("needed", &results.needed, columns).titled(title)
}

/// All cases, for programs and for user plots.
fn cases(results: &Results, mission: &Mission) -> DataTable {
    let mut columns = vec![
        words("geometry", "shield"),
        column("thickness_mm", "Al [mm]", Digits::Significant(4)),
        column("confidence", "confidence", Digits::Significant(6)),
        column("dose_mev_g", "dose [MeV/g]", Digits::Scientific(2)),
        column("delta_e", "|Δe|", Digits::Scientific(3)),
        words("exceeded_date", "exceeded"),
        words("corrected_date", "corrected"),
    ];
    columns.extend(judged::each(mission, false));
    DataTable { programs_only: true, ..DataTable::of("cases", &results.cases, columns).titled("Every case") }
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let panel = |geometry: &Geometry| {
        let series = results.confidences.iter().enumerate().map(|(index, confidence)| {
            let of = |case: &&Case| case.geometry == *geometry && case.confidence == *confidence;
            let curve = || results.cases.iter().filter(of);
            let x: Vec<f64> = curve().map(|case| case.thickness_mm).collect();
            let y = curve().map(|case| case.delta_e.unwrap_or(f64::NAN)).collect();
            line(&format!("{} %", percent(*confidence)), index + 1, &x, y)
        });
        let [_, corrected] = budgets(mission);
        let limit = mission.requirement.limits_a_galaxy().then(|| level("corrected budget", corrected));
        Panel {
            x_label: "aluminium [mm]".into(),
            y_label: format!("|Δe|, {geometry}"),
            x_log: true,
            y_log: true,
            series: series.chain(limit).collect(),
            ..Panel::default()
        }
    };
    Figure { title: format!("{}: shielding", mission.mission.name), panels: GEOMETRIES.iter().map(panel).collect() }
}

/// The thickness needed for a geometry.
fn described(results: &Results, geometry: Geometry) -> String {
    let (thinnest, thickest) = (results.thicknesses_mm[0], results.thicknesses_mm[results.thicknesses_mm.len() - 1]);
    let said = |thickness_mm: f64| {
        if thickness_mm.is_infinite() {
            format!("more than {thickest} mm")
        } else if thickness_mm <= thinnest {
            format!("{thinnest} mm (the least tried) or less")
        } else {
            format!("{thickness_mm:.1} mm")
        }
    };
    let all = || results.needed.iter().map(|needed: &Needed| needed.thickness_mm(geometry));
    let (least, most) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    if least == most {
        return format!("A {geometry} meets the corrected budget with {} at every confidence tried.", said(most));
    }
    format!(
        "A {geometry} meets the corrected budget with {} at the lowest confidence tried, and with {} at the highest.",
        said(least),
        said(most)
    )
}
