//! The date as a distribution, in words and as a figure.

use crate::mission::Mission;
use crate::numeric::calendar::{DAYS_PER_YEAR, decimal_year};
use crate::numeric::estimate::Estimate;
use crate::plan::date_distribution::{DateDistribution, DateQuantile, Dates, QUANTILES};
use crate::report::plot::{Figure, Mark, Panel, Series, line};
use crate::report::study::estimate::{days, known_date, plus_minus};
use crate::report::{Parts, table};

/// Quantiles of the dates, and how probable it is that there is one.
pub(super) fn say(found: &DateDistribution, mission: &Mission, out: &mut Parts) {
    out.heading(format!("Date as a distribution: {} draws of the posterior", found.samples));
    let corrected = format!("corrected, factor {}", mission.requirement.correction_factor);
    let mut dates = table(&["", "uncorrected", &corrected]);
    let limits = [&found.uncorrected, &found.corrected];
    let mut row = |name: String, cell: &dyn Fn(&Dates) -> String| {
        dates.add_row([name].into_iter().chain(limits.map(cell)));
    };
    row("exceeded within the mission [%]".into(), &|limit| {
        let exceeded = Estimate { value: limit.probability_exceeded, error: limit.probability_error };
        plus_minus(exceeded.times(100.0))
    });
    for (place, p) in QUANTILES.iter().enumerate() {
        row(format!("exceeded by then with {:.0} %", 100.0 * p), &|limit| date(&limit.quantiles[place]));
    }
    out.table(dates);
    out.words(
        format!(
            "  -: later than the mission; errors are those of a sample that is worth {:.0} independent draws",
            found.effective_samples
        ),
        4,
    );
}

fn date(at: &DateQuantile) -> String {
    let error_d = at.error_yr.map(|error_yr| error_yr * DAYS_PER_YEAR);
    let Some(date) = at.date else { return "-".into() };
    match error_d {
        Some(error_d) => format!("{} {}", known_date(date, Some(error_d)), days(error_d)),
        None => date.to_string(),
    }
}

/// Share of the draws in which the budget is exceeded by a date.
pub(super) fn figure(found: &DateDistribution, mission: &Mission) -> Figure {
    let launch = decimal_year(mission.mission.launch.0);
    let end = launch + mission.mission.duration_yr;
    let curve = |label: &str, color: usize, dates: &Dates| {
        let all = dates.times_yr.len() as f64;
        let within = dates.times_yr.iter().filter(|t_yr| t_yr.is_finite());
        let mut x: Vec<f64> = within.map(|t_yr| launch + t_yr).collect();
        let mut y: Vec<f64> = (1..=x.len()).map(|rank| 100.0 * rank as f64 / all).collect();
        x.push(end);
        y.push(100.0 * dates.probability_exceeded);
        line(label, color, &x, y)
    };
    let series = vec![
        curve("uncorrected", 2, &found.uncorrected),
        curve("corrected", 1, &found.corrected),
        Series { label: Some("mission".into()), color: 3, kind: Mark::Shade { from: launch, to: end } },
    ];
    let panel =
        Panel { x_label: "year".into(), y_label: "exceeded by then [% of draws]".into(), series, ..Panel::default() };
    Figure { title: "Date on which the budget is exceeded, over the posterior".into(), panels: vec![panel] }
}
