//! `ctiplan study launch`.

use chrono::NaiveDate;

use super::estimate::plus_minus;
use super::judged;
use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, budget};
use crate::environment::solar_cycle::{self, ActiveYears};
use crate::mission::Mission;
use crate::numeric::calendar::decimal_year;
use crate::plan::judgement::{JudgedRow, Limited};
use crate::plan::scenario::sun;
use crate::plan::sources;
use crate::report::plot::{Figure, Mark, Panel, Series, level, line};
use crate::report::ranked::{by_others, named};
use crate::study::Estimate;
use crate::study::launch::{Launched, Results};

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "launch date against shape error of \"{}\" after {} yr",
            mission.requirement.galaxy, mission.mission.duration_yr
        );
        let mut report = StudyReport::of("launch", mission, title, &self.warnings);
        if sun::model(&self.compared) != sun::model(mission) {
            report.sources.push(sources::over_time(&self.compared));
        }
        report.tables = vec![launches(self)];
        report.tables.extend(judged::table(&self.launches, words("launch", "launch"), mission));
        report.draw(figure(self, mission));
        report.findings.extend(self.note.map(String::from));
        let names = |places: &[usize]| -> Vec<String> { places.iter().map(|place| self.name(*place)).collect() };
        let ranking = &self.ranking;
        report.result("dose_model", sun::model(&self.compared));
        report.result("best_launch", self.name(ranking.best[0]));
        report.result("worst_launch", self.name(ranking.worst[0]));
        report.result("tied_best_launches", names(&ranking.best));
        report.result("tied_worst_launches", names(&ranking.worst));
        report.result("ranked_by_each", judged::each_alone(ranking, |place| self.name(place)));
        match ranking.by {
            None => {
                let fate = fate(&self.launches[0], false);
                report.find(format!("All {} launch dates tried are alike: {fate}.", self.launches.len()));
            }
            Some(_) => compare(&mut report, self),
        }
        report
    }
}

impl Results {
    fn name(&self, place: usize) -> String {
        self.launches[place].launch.to_string()
    }
}

fn launches(results: &Results) -> DataTable {
    let exceeded = results.launches.iter().any(|launched| launched.judged.corrected_t_yr.is_some());
    // With a requested confidence, expected values are only in the machine-readable output: there is no space for both.
    let expected = |name: &'static str| if results.confidence.is_some() { "" } else { name };
    let mut columns = vec![
        words("launch", "launch"),
        column("active_yr", expected("active [yr]"), Digits::Fixed(2)),
        column("dose_mev_g", "dose [MeV/g]", Digits::Scientific(2)),
        column("delta_e", "|Δe|", Digits::Scientific(3)),
        column("exceeded_t_yr", expected("after [yr]"), Digits::Fixed(2)),
        words("exceeded_date", expected("exceeded")),
        column("corrected_t_yr", if exceeded { expected("after [yr]") } else { "" }, Digits::Fixed(2)),
        words("corrected_date", expected("corrected")),
    ];
    columns.extend(judged::each(&results.compared, false));
    columns.extend(judged::drawn(results.confidence.is_some()));
    columns.push(words("dose_model", ""));
    let table = DataTable::of("launches", &results.launches, columns);
    // Many equal rows are not worth reading.
    DataTable { programs_only: results.ranking.by.is_none() && results.launches.len() > 2, ..table }
}

fn figure(results: &Results, mission: &Mission) -> Figure {
    let x: Vec<f64> = results.launches.iter().map(|launched| decimal_year(launched.launch)).collect();
    let of = |value: fn(&Launched) -> Option<f64>| -> Vec<f64> {
        results.launches.iter().map(|launched| value(launched).unwrap_or(f64::NAN)).collect()
    };
    let panel = |y_label: &str, mut series: Vec<Series>| {
        series.extend(active_years(&results.compared, &x));
        Panel { x_label: "launch [year]".into(), y_label: y_label.into(), series, ..Panel::default() }
    };
    let mut shapes = vec![line("at the end of life", 1, &x, of(|launched| launched.delta_e))];
    shapes.extend(budget(mission));
    let times = vec![
        line("uncorrected budget exceeded", 2, &x, of(|launched| launched.judged.exceeded_t_yr)),
        level("end of the mission", mission.mission.duration_yr),
    ];
    Figure {
        title: format!("{}: launch date; dose: {}", mission.mission.name, sun::model(&results.compared)),
        panels: vec![panel("|Δe| at the end", shapes), panel("exceeded after [yr]", times)],
    }
}

/// Active years of the Sun between the first and the last of some years, as shades; none for an average.
fn active_years(compared: &Mission, years: &[f64]) -> Vec<Series> {
    if sun::model(compared) == "constant" {
        return Vec::new();
    }
    let (first, last) =
        (years.iter().copied().fold(f64::INFINITY, f64::min), years.iter().copied().fold(0.0, f64::max));
    let stretches = solar_cycle::active_years(&solar_cycle::maxima(&compared.environment.solar_maximum, last));
    let shade = |stretch: ActiveYears| Series {
        label: Some(if stretch.extrapolated { "active Sun, extrapolated" } else { "active Sun" }.into()),
        color: 7,
        kind: Mark::Shade { from: stretch.from.max(first), to: stretch.to.min(last) },
    };
    stretches.into_iter().filter(|stretch| stretch.to > first && stretch.from < last).map(shade).collect()
}

/// The result of a launch, with dates if requested.
fn fate(launched: &Launched, dated: bool) -> String {
    let several = launched.judged.each.keys().any(|key| !key.starts_with(Limited::DeltaE.key()));
    let lasts = |name: &str, t_yr: Option<f64>, date: Option<NaiveDate>, by: Option<Limited>| match t_yr {
        Some(t_yr) => {
            let day = if dated { date.map_or(String::new(), |date| format!(", on {date}")) } else { String::new() };
            let of = by.filter(|_| several).map_or(String::new(), |by| format!(" of {}", by.symbol()));
            format!("{name} budget{of} exceeded after {t_yr:.2} yr{day}")
        }
        None => format!("{name} budget not exceeded"),
    };
    let judged = &launched.judged;
    let mut words = vec![
        format!("{:.2} active years", launched.active_yr),
        lasts("uncorrected", judged.exceeded_t_yr, judged.exceeded_date, judged.exceeded_by),
    ];
    if judged.corrected_t_yr.is_some() {
        words.push(lasts("corrected", judged.corrected_t_yr, judged.corrected_date, judged.corrected_by));
    }
    if let Some((value, error)) = judged.met_percent.zip(judged.met_error_percent) {
        words.push(format!("uncorrected budget met to the end with {} %", plus_minus(Estimate { value, error })));
    }
    words.push(launched.delta_e.map_or("no shape left".into(), |end| format!("|delta e| {end:.3e} at the end")));
    words.join("; ")
}

fn compare(report: &mut StudyReport, results: &Results) {
    let ranking = &results.ranking;
    let name = |place: usize| results.name(place);
    for (side, alike, places) in [("best", "good", &ranking.best), ("worst", "bad", &ranking.worst)] {
        let fate = fate(&results.launches[places[0]], true);
        report.find(format!("The {side} launch is {} ({fate}).", name(places[0])));
        if places.len() > 1 {
            report.find(format!("Equally {alike}: {}.", named(&places[1..], name)));
        }
    }
    report.findings.extend(by_others(ranking, results.confidence, name));
    let ends: Option<Vec<f64>> = results.launches.iter().map(|launched| launched.delta_e).collect();
    let ends = ends.unwrap_or_default();
    let (least, most) = (ends.iter().copied().fold(f64::INFINITY, f64::min), ends.iter().copied().fold(0.0, f64::max));
    if least > 0.0 && least.is_finite() {
        report.result("worst_over_best", most / least);
        report.find(format!(
            "|delta e| at the end of the mission is between {least:.3e} and {most:.3e}: a factor of {:.2}.",
            most / least
        ));
    }
    let all = results.launches.len();
    let lasts = |launched: &&Launched| match results.confidence {
        None => launched.judged.exceeded_t_yr.is_none(),
        Some(_) => launched.judged.kept_t_yr.is_none(),
    };
    let lasting = results.launches.iter().filter(lasts).count();
    let with = results.confidence.map_or(String::new(), |p| format!(" with {:.0} %", 100.0 * p));
    report.find(format!("{lasting} of {all} launches meet the uncorrected budget{with}."));
    if let Some(p) = results.confidence {
        let rows: Vec<&JudgedRow> = results.launches.iter().map(|launched| &launched.judged).collect();
        judged::explain(report, &rows, p);
    }
}
