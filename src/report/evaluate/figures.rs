//! Change of shape against time, with the budget; dose and traps.

use super::distribution;
use crate::mission::keys::plain;
use crate::numeric::calendar::decimal_year;
use crate::plan::assessment::Assessment;
use crate::plan::curve::Crossing;
use crate::plan::evaluate::Year;
use crate::plan::time_series::TimeSeries;
use crate::report::active::shades;
use crate::report::plot::{Figure, Panel, Series, dashed, level, line, points};

/// Maximum number of curves, one for each colour; further ones are not drawn.
const COLOURS: usize = 6;

impl Assessment {
    /// Figures with their file names; none without the time series.
    pub(super) fn drawn(&self) -> Vec<(String, Figure)> {
        let Some(time_series) = &self.time_series else { return Vec::new() };
        let mut figures = vec![
            ("shape.svg".into(), self.shape(time_series)),
            ("dose.svg".into(), self.dose(time_series)),
            ("traps.svg".into(), self.traps(time_series)),
        ];
        let dates = self.distribution.as_ref().map(|found| distribution::figure(found, self.evaluation.mission()));
        figures.extend(dates.map(|figure| ("dates.svg".into(), figure)));
        figures
    }

    /// |Δe| of the galaxies, the judged one first; its curve after correction is compared with the same budget.
    fn shape(&self, time_series: &TimeSeries) -> Figure {
        let (mission, verdict) = (self.evaluation.mission(), &self.evaluation.verdict);
        let requirement = &mission.requirement;
        let mut galaxies: Vec<usize> = (0..mission.galaxies.len()).collect();
        galaxies.sort_by_key(|galaxy| mission.galaxies[*galaxy].name != requirement.galaxy);
        let factor = requirement.correction_factor;
        let corrected = time_series.delta_e[galaxies[0]].iter().map(|delta_e| delta_e / factor).collect();

        let mut series = self.active(time_series);
        for (index, &galaxy) in galaxies.iter().enumerate().take(COLOURS) {
            let magnitude = |year: &Year| year.galaxies[galaxy].map_or(f64::NAN, |change| change.magnitude());
            let name = &mission.galaxies[galaxy].name;
            series.extend(self.over_time(time_series, name, index + 1, &time_series.delta_e[galaxy], magnitude));
        }
        let label = format!("{}, corrected by a factor {factor}", requirement.galaxy);
        series.push(dashed(&label, 1, &time_series.year, corrected));
        series.push(level(&format!("budget {}", plain(requirement.delta_e)), requirement.delta_e));
        series.extend(self.exceeded("exceeded", &verdict.uncorrected));
        series.extend(self.exceeded("exceeded after correction", &verdict.corrected));
        against_time(format!("Change of ellipticity against time{}", not_drawn(galaxies.len())), "|Δe|", series)
    }

    fn dose(&self, time_series: &TimeSeries) -> Figure {
        let mut series = self.active(time_series);
        series.extend(self.over_time(time_series, "dose", 1, &time_series.dose_mev_g, |year| year.dose_mev_g));
        against_time("Displacement damage dose".into(), "dose D since launch [MeV/g]", series)
    }

    fn traps(&self, time_series: &TimeSeries) -> Figure {
        let mut series = self.active(time_series);
        for (index, (name, density)) in time_series.traps_per_px.iter().enumerate().take(COLOURS) {
            series
                .extend(self.over_time(time_series, name, index + 1, density, |year| year.traps[index].density_per_px));
        }
        let species = time_series.traps_per_px.len();
        against_time(format!("Traps of each species{}", not_drawn(species)), "traps ρ [1/px]", series)
    }

    /// A line, with markers at the ends of the years.
    fn over_time(
        &self,
        time_series: &TimeSeries,
        name: &str,
        color: usize,
        values: &[f64],
        at_the_end_of: impl Fn(&Year) -> f64,
    ) -> [Series; 2] {
        let launch = decimal_year(self.evaluation.mission().mission.launch.0);
        let ends: Vec<f64> = self.evaluation.years.iter().map(|year| launch + year.t_yr).collect();
        let at_ends = self.evaluation.years.iter().map(at_the_end_of).collect();
        [line(name, color, &time_series.year, values.to_vec()), points(name, color, &ends, at_ends)]
    }

    fn active(&self, time_series: &TimeSeries) -> Vec<Series> {
        shades(
            self.evaluation.model.history(),
            time_series.year[0],
            *time_series.year.last().expect("a mission has an end"),
        )
    }

    /// The time at which a budget is exceeded.
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
