//! Change of shape against time, with the budget; dose and traps.

use super::EvaluateReport;
use crate::mission::keys::plain;
use crate::numeric::calendar::decimal_year;
use crate::plan::evaluate::Year;
use crate::plan::requirement::Crossing;
use crate::plan::time_series::Course;
use crate::report::active::shades;
use crate::report::plot::{Figure, Panel, Series, dashed, level, line, points};

/// Lines that colours tell apart; more are not drawn.
const COLOURS: usize = 6;

impl EvaluateReport {
    /// Figures with the names of their files; none where the course of the mission is not known.
    pub(super) fn drawn(&self) -> Vec<(String, Figure)> {
        let Some(course) = &self.course else { return Vec::new() };
        vec![
            ("shape.svg".into(), self.shape(course)),
            ("dose.svg".into(), self.dose(course)),
            ("traps.svg".into(), self.traps(course)),
        ]
    }

    /// |Δe| of the galaxies, the judged one first; its line after correction is held against the same budget.
    fn shape(&self, course: &Course) -> Figure {
        let (mission, verdict) = (self.evaluation.mission(), &self.evaluation.verdict);
        let requirement = &mission.requirement;
        let mut galaxies: Vec<usize> = (0..mission.galaxies.len()).collect();
        galaxies.sort_by_key(|galaxy| mission.galaxies[*galaxy].name != requirement.galaxy);
        let factor = requirement.correction_factor;
        let corrected = course.delta_e[galaxies[0]].iter().map(|delta_e| delta_e / factor).collect();

        let mut series = self.active(course);
        for (index, &galaxy) in galaxies.iter().enumerate().take(COLOURS) {
            let magnitude = |year: &Year| year.galaxies[galaxy].map_or(f64::NAN, |change| change.magnitude());
            let name = &mission.galaxies[galaxy].name;
            series.extend(self.over_time(course, name, index + 1, &course.delta_e[galaxy], magnitude));
        }
        let label = format!("{}, corrected by a factor {factor}", requirement.galaxy);
        series.push(dashed(&label, 1, &course.year, corrected));
        series.push(level(&format!("budget {}", plain(requirement.delta_e)), requirement.delta_e));
        series.extend(self.exceeded("exceeded", &verdict.uncorrected));
        series.extend(self.exceeded("exceeded after correction", &verdict.corrected));
        against_time(format!("Change of ellipticity against time{}", not_drawn(galaxies.len())), "|delta e|", series)
    }

    fn dose(&self, course: &Course) -> Figure {
        let mut series = self.active(course);
        series.extend(self.over_time(course, "dose", 1, &course.dose_mev_g, |year| year.dose_mev_g));
        against_time("Displacement damage dose".into(), "dose since launch [MeV/g]", series)
    }

    fn traps(&self, course: &Course) -> Figure {
        let mut series = self.active(course);
        for (index, (name, density)) in course.traps_per_px.iter().enumerate().take(COLOURS) {
            series.extend(self.over_time(course, name, index + 1, density, |year| year.traps[index].density_per_px));
        }
        let species = course.traps_per_px.len();
        against_time(format!("Traps of each species{}", not_drawn(species)), "traps [1/px]", series)
    }

    /// A line, with markers at the ends of the years.
    fn over_time(
        &self,
        course: &Course,
        name: &str,
        color: usize,
        values: &[f64],
        at_the_end_of: impl Fn(&Year) -> f64,
    ) -> [Series; 2] {
        let launch = decimal_year(self.evaluation.mission().mission.launch.0);
        let ends: Vec<f64> = self.evaluation.years.iter().map(|year| launch + year.t_yr).collect();
        let at_ends = self.evaluation.years.iter().map(at_the_end_of).collect();
        [line(name, color, &course.year, values.to_vec()), points(name, color, &ends, at_ends)]
    }

    fn active(&self, course: &Course) -> Vec<Series> {
        shades(self.evaluation.model.history(), course.year[0], *course.year.last().expect("a mission has an end"))
    }

    /// The moment at which a budget is exceeded.
    fn exceeded(&self, how: &str, crossing: &Crossing) -> Option<Series> {
        let mission = self.evaluation.mission();
        let launch = mission.mission.launch.0;
        let year = decimal_year(launch) + crossing.t_yr?;
        let on = crossing.date(launch).map_or_else(String::new, |date| format!(" on {date}"));
        Some(points(&format!("{how}{on}"), 0, &[year], vec![mission.requirement.delta_e]))
    }
}

fn against_time(title: String, y_label: &str, series: Vec<Series>) -> Figure {
    Figure {
        title,
        panels: vec![Panel { x_label: "year".into(), y_label: y_label.into(), series, ..Panel::default() }],
    }
}

fn not_drawn(count: usize) -> String {
    let left_out = count.saturating_sub(COLOURS);
    if left_out > 0 { format!(" ({left_out} more are not drawn)") } else { String::new() }
}
