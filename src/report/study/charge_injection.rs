//! `ctiplan study charge-injection`.

use super::table::column;
use super::{DataTable, Digits, Shown, StudyReport, budget, left_out, short};
use crate::mission::Mission;
use crate::report::plot::{Figure, Mark, Panel, Series, line};
use crate::study::budgets;
use crate::study::charge_injection::{Best, Results, Spacing};

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "lines of {} e- per pixel against shape error of \"{}\" at the end of the mission",
            short(self.charge_e),
            mission.requirement.galaxy
        );
        let mut report = StudyReport::of("charge-injection", mission, title, &self.warnings);
        report.of_galaxy_alone(mission);
        report.cite(
            "Injected lines of charge",
            "Rhodes et al. 2010 (PASP 122, 439), section 6; Massey et al. 2010 (MNRAS 401, 371) on capture at once",
        );
        report.tables = vec![spacings(self)];
        report.draw(figure(self, mission));
        match self.without_lines.delta_e {
            None => report.find("Without lines no shape is left at the end of the mission."),
            Some(0.0) => report.find("No lines are needed: the mission has no traps at its end."),
            Some(without) => {
                if let Some(best) = &self.best {
                    describe(&mut report, &self.with_lines[best.place], best, without);
                }
                let [uncorrected, corrected] = budgets(mission);
                report.find(needed(self, "uncorrected", uncorrected));
                report.find(needed(self, "corrected", corrected));
            }
        }
        report.findings.extend(left_out(mission));
        report
    }
}

fn spacings(results: &Results) -> DataTable {
    let columns = vec![
        column("spacing_rows", "line every", Digits::Fixed(0)),
        column("delta_e", "|Δe|", Digits::Scientific(3)),
        column("over_none", "of none", Digits::Fixed(3)),
        column("trail_e", "trail [e-]", Digits::Fixed(3)),
        column("snr", "S/N", Digits::Fixed(2)),
        column("snr_loss_percent", "lost [%]", Digits::Fixed(2)),
        column("rows_lost_percent", "rows lost [%]", Digits::Fixed(1)),
        column("area_equal_depth", "area", Digits::Fixed(3)),
    ];
    DataTable::of("spacings", results.all(), columns)
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let x: Vec<f64> = results.with_lines.iter().filter_map(|spacing| spacing.spacing_rows).collect();
    let of = |value: fn(&Spacing) -> f64| results.with_lines.iter().map(value).collect();
    let mut shapes = vec![line("with lines", 1, &x, of(|spacing| spacing.delta_e.unwrap_or(f64::NAN)))];
    shapes.extend(budget(mission));
    if let Some(y) = results.without_lines.delta_e {
        shapes.push(Series { label: Some("without".into()), color: 2, kind: Mark::Level { y, dashed: false } });
    }
    let areas = vec![line("area", 3, &x, of(|spacing| spacing.area_equal_depth))];
    let panel = |y_label: &str, series| Panel {
        x_label: "rows from line to line".into(),
        y_label: y_label.into(),
        x_log: true,
        series,
        ..Panel::default()
    };
    Figure {
        title: format!("{}: injected lines", mission.mission.name),
        panels: vec![panel("|Δe| at the end", shapes), panel("area at equal depth", areas)],
    }
}

fn change(spacing: &Spacing) -> f64 {
    spacing.delta_e.unwrap_or(f64::INFINITY)
}

/// The spacing of smallest shape error, given |Δe| without lines.
fn describe(report: &mut StudyReport, spacing: &Spacing, best: &Best, without: f64) {
    let rows = spacing.spacing_rows.unwrap_or(0.0);
    report.result("best_spacing_rows", rows as u32);
    report.result("best_over_none", change(spacing) / without);
    report.find(format!(
        "The best spacing tried, a line every {rows} rows, leaves {:.3} of the shape error without lines. It costs {:.1} % of \
         the rows and {:.2} % of S/N. {:.3} of the survey's area remains at equal depth.",
        change(spacing) / without,
        spacing.rows_lost_percent,
        spacing.snr_loss_percent,
        spacing.area_equal_depth
    ));
    if change(spacing) >= without {
        report.find("Lines do not help here.");
    }
    let kept: Vec<String> = best.kept.iter().map(|(name, share)| format!("{name} {:.0} %", 100.0 * share)).collect();
    report.find(format!(
        "Traps filled by a line and still full half way to the next: {}. Only slow traps stay full.",
        kept.join(", ")
    ));
}

/// The spacing that meets a budget with the largest area.
fn needed(results: &Results, name: &str, budget: f64) -> String {
    let lasting = results.all().filter(|spacing| change(spacing) < budget);
    match lasting.max_by(|a, b| a.area_equal_depth.total_cmp(&b.area_equal_depth)) {
        Some(Spacing { spacing_rows: None, .. }) => {
            format!("The {name} budget is already met without injection.")
        }
        Some(Spacing { spacing_rows: Some(rows), area_equal_depth, .. }) => format!(
            "The {name} budget is met with a line every {rows} rows, at {area_equal_depth:.3} of the survey's area."
        ),
        None => format!("No spacing tried meets the {name} budget."),
    }
}
