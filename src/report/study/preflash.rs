//! `ctiplan study preflash`.

use serde_json::Value;

use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, budget, left_out, short, when};
use crate::mission::Mission;
use crate::report::plot::{Figure, Panel, line};
use crate::study::preflash::{Level, Results};

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "a flash before each exposure against shape error of \"{}\" at the end of the mission; S/N within {:.2} px",
            mission.requirement.galaxy, self.aperture_px
        );
        let mut report = StudyReport::of("preflash", mission, title, &self.warnings);
        report.of_galaxy_alone(mission);
        report.cite("A flash before each exposure", "Rhodes et al. 2010 (PASP 122, 439), section 6");
        report.tables = vec![levels(self)];
        report.draw(figure(self, mission));
        match self.levels[0].delta_e {
            None => report.find("Without a flash no shape is left at the end of the mission."),
            Some(0.0) => report.find("No flash is needed: the mission has no traps at its end."),
            Some(dark) => compare(&mut report, &self.levels, dark),
        }
        report.findings.extend(left_out(mission));
        report
    }
}

fn levels(results: &Results) -> DataTable {
    let columns = vec![
        column("electrons", "flash [e-]", Digits::Significant(4)),
        column("delta_e", "|Δe|", Digits::Scientific(3)),
        column("flux_loss_percent", "flux lost [%]", Digits::Fixed(3)),
        column("snr", "S/N", Digits::Fixed(2)),
        column("snr_loss_percent", "lost [%]", Digits::Fixed(1)),
        column("area_equal_depth", "area", Digits::Fixed(3)),
        words("exceeded_date", "exceeded"),
        words("corrected_date", "corrected"),
    ];
    DataTable::of("levels", &results.levels, columns)
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let x: Vec<f64> = results.levels.iter().map(|level| level.electrons).collect();
    let ends = results.levels.iter().map(|level| level.delta_e.unwrap_or(f64::NAN)).collect();
    let snr = results.levels.iter().map(|level| level.snr).collect();
    let panel = |y_label: &str, series| Panel {
        x_label: "flash [e- per pixel]".into(),
        y_label: y_label.into(),
        series,
        ..Panel::default()
    };
    let shapes = [line("shape error", 1, &x, ends)].into_iter().chain(budget(mission)).collect();
    Figure {
        title: format!("{}: a flash before each exposure", mission.mission.name),
        panels: vec![panel("|Δe| at the end", shapes), panel("S/N", vec![line("S/N", 2, &x, snr)])],
    }
}

fn compare(report: &mut StudyReport, levels: &[Level], dark: f64) {
    if let Some((least, with)) = levels.get(1).and_then(|least| Some((least, least.delta_e?))) {
        let (gain, cost) = (100.0 * (1.0 - with / dark), least.snr_loss_percent);
        report.find(format!(
            "The smallest flash tried, {} e-, lowers |delta e| by {gain:.1} % and S/N by {cost:.1} %: {:.1} % of shape error for \
             each % of S/N.",
            short(least.electrons),
            gain / cost
        ));
    }
    let [uncorrected, corrected] = [0, 1].map(|budget| levels.iter().find(|level| level.lasts[budget]));
    needed(report, "uncorrected", uncorrected, when(levels[0].exceeded_date));
    needed(report, "corrected", corrected, when(levels[0].corrected_date));
    if let Some(pair) = levels.windows(2).find(|pair| pair[1].delta_e > pair[0].delta_e) {
        report.find(format!(
            "A larger flash is not always better: |delta e| rises from {} to {} e-.",
            short(pair[0].electrons),
            short(pair[1].electrons)
        ));
    }
}

/// The smallest flash that meets a budget, and when the budget is exceeded without it.
fn needed(report: &mut StudyReport, budget: &str, least: Option<&Level>, without: String) {
    let key = format!("least_{budget}_electrons");
    report.result(&key, least.map_or(Value::Null, |level| level.electrons.into()));
    report.find(match least {
        Some(level) if level.electrons == 0.0 => {
            format!("The {budget} budget is already met without a flash.")
        }
        Some(level) => format!(
            "The {budget} budget is met with {} e-, the smallest flash tried that meets it (without a flash: {without}). This \
             costs {:.1} % of S/N, or {:.1} % of the survey's area at equal depth.",
            short(level.electrons),
            level.snr_loss_percent,
            100.0 * (1.0 - level.area_equal_depth)
        ),
        None => format!("No flash tried meets the {budget} budget."),
    });
}
