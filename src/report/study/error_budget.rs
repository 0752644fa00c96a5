//! `ctiplan study error-budget`.

use serde_json::{Map, Value};

use super::estimate::{error_of_date, known_date, plus_minus};
use super::table::{column, words};
use super::{DataTable, Digits, Shown, StudyReport, short};
use crate::mission::Mission;
use crate::numeric::calendar::decimal_year;
use crate::report::plot::{Figure, Mark, Panel, Series, line};
use crate::report::{listed, significant};
use crate::study::Estimate;
use crate::study::error_budget::{Budget, Exceeded, InputShare, PERCENTILES, Percentile, Results};

/// The two budgets.
const BUDGETS: [&str; 2] = ["uncorrected", "corrected"];

impl Shown for Results {
    fn shown(&self, mission: &Mission) -> StudyReport {
        let title = format!(
            "how the uncertainties of the inputs change the date on which the budget of \"{}\" is exceeded; {} draws, followed \
             for {} yr",
            mission.requirement.galaxy,
            self.own.fates.len(),
            short(self.horizon_yr)
        );
        let mut report = StudyReport::of("error-budget", mission, title, &self.warnings);
        report.of_galaxy_alone(mission);
        report.cite(
            "Shares of the variance: squared regression coefficients",
            "Saltelli et al. 2008, Global Sensitivity Analysis",
        );
        let title = "Percentiles of the date on which the budget is exceeded (-: later than the years that were followed), \
                     with standard errors; exceeded: % of draws in which it is exceeded within the mission";
        report.tables = vec![inputs(&self.own), dates("dates", &self.own).titled(title)];
        report.draw(figure(&self.own, mission));
        describe(&mut report, self);
        if let Some((name, other)) = &self.other {
            let title = format!("The same with the detector of \"{name}\"");
            report.tables.push(dates("other_dates", other).titled(title));
            side_by_side(&mut report, &self.own, name, other);
        }
        report
    }
}

fn inputs(budget: &Budget) -> DataTable {
    let in_years = budget.inputs.iter().any(|input| input.sigma_yr.is_some());
    let columns = vec![
        words("input", "input"),
        column("sigma_percent", "sigma [%]", Digits::Significant(3)),
        column("sigma_yr", if in_years { "sigma [yr]" } else { "" }, Digits::Significant(3)),
        column("share_percent", "share [%]", Digits::Fixed(1)).with_error("share_error_percent"),
        column("delta_e_percent", "|delta e| [%]", Digits::Fixed(2)),
        words("low_date", "at -1 sigma"),
        words("high_date", "at +1 sigma"),
    ];
    DataTable::of("inputs", &budget.inputs, columns).titled(
        "Share of the variance of ln |delta e| at the end; each input alone, under the Sun of the mission's confidence: |delta e| at +1 \
         sigma, and when the uncorrected budget is exceeded (solar protons: at 16 and 84 % of their draws, against 50 %)",
    )
}

fn dates(name: &'static str, budget: &Budget) -> DataTable {
    let date_key = |percent: f64| format!("p{percent:02}_date");
    let error_key = |percent: f64| format!("p{percent:02}_error_d");
    let mut columns = vec![words("budget", "budget")];
    columns.extend(PERCENTILES.map(|p| words(date_key(p), format!("{p} %")).with_error(error_key(p))));
    columns.push(
        column("exceeded_within_percent", "exceeded", Digits::Fixed(0)).with_error("exceeded_within_error_percent"),
    );
    let row = |(name, exceeded): (&str, &Exceeded)| -> Map<String, Value> {
        let mut row = Map::from_iter([("budget".into(), name.into())]);
        for (percent, percentile) in PERCENTILES.into_iter().zip(&exceeded.percentiles) {
            let day = percentile.as_ref().and_then(Percentile::day);
            row.insert(date_key(percent), day.map(|(date, _)| date.to_string()).into());
            row.insert(error_key(percent), day.and_then(|(_, error_d)| error_d).into());
        }
        row.insert("exceeded_within_percent".into(), exceeded.within_percent.value.into());
        row.insert("exceeded_within_error_percent".into(), exceeded.within_percent.error.into());
        row
    };
    DataTable::of(name, BUDGETS.into_iter().zip(&budget.exceeded).map(row), columns)
}

fn figure(budget: &Budget, mission: &Mission) -> Figure {
    let launch = decimal_year(mission.mission.launch.0);
    let curve = |label: &str, color: usize, limit: usize| {
        let mut times: Vec<f64> = budget.fates.iter().filter_map(|fate| fate.exceeded_yr[limit]).collect();
        times.sort_by(f64::total_cmp);
        let x: Vec<f64> = times.iter().map(|t_yr| launch + t_yr).collect();
        let y = (1..=times.len()).map(|rank| 100.0 * rank as f64 / budget.fates.len() as f64).collect();
        line(label, color, &x, y)
    };
    let end = launch + mission.mission.duration_yr;
    let series = vec![
        curve("uncorrected", 2, 0),
        curve("corrected", 1, 1),
        Series { label: Some("mission".into()), color: 3, kind: Mark::Shade { from: launch, to: end } },
    ];
    let dates = Panel {
        x_label: "date [year]".into(),
        y_label: "exceeded by then [% of draws]".into(),
        series,
        ..Panel::default()
    };
    let title = format!("{}: error budget", mission.mission.name);
    Figure { title, panels: [Some(dates), shares(budget)].into_iter().flatten().collect() }
}

/// Shares of the variance as bars; None if there are none.
fn shares(budget: &Budget) -> Option<Panel> {
    budget.rest_share?;
    let bars = budget.inputs.iter().enumerate().map(|(place, input)| {
        let (x, y) = (place as f64 + 1.0, input.share_percent.unwrap_or(f64::NAN));
        let kind = Mark::Line { x: vec![x, x], y: vec![0.0, y], dashed: false };
        let points = Mark::Points { x: vec![x], y: vec![y], sigma: None };
        let label = (y >= 1.0).then(|| format!("{}: {}", place + 1, input.name));
        [Series { label: None, color: place % 8, kind }, Series { label, color: place % 8, kind: points }]
    });
    Some(Panel {
        x_label: "input".into(),
        y_label: "share [%]".into(),
        series: bars.flatten().collect(),
        ..Panel::default()
    })
}

fn describe(report: &mut StudyReport, results: &Results) {
    let budget = &results.own;
    report.result("nominal_exceeded_t_yr", budget.nominal.exceeded_yr[0]);
    report.result("nominal_delta_e", budget.nominal.delta_e);
    if !results.has_shield {
        report.find("The shield is not an input: no thickness of aluminium gives the mission's dose.");
    }
    report.find(match &budget.sun_not_drawn {
        None => "The Sun and [uncertainty] are drawn as by `ctiplan evaluate`: up to the end of the mission both have the same dates.".into(),
        Some(why) => format!("The Sun is not drawn: {why}."),
    });
    if let Some(emulated) = budget.emulated {
        report.find(format!(
            "Changes of shape are emulated from {} readouts, with an rms relative error of {:.1e} at {} others.",
            emulated.readouts, emulated.relative_error, emulated.held_back
        ));
    }
    let lost = budget.fates.iter().filter(|fate| fate.delta_e.is_none()).count();
    if lost > 0 {
        report.find(format!(
            "In {lost} of {} draws no shape is left at the end of the mission. They count as exceeded from then on, and are left \
             out of the shares.",
            budget.fates.len()
        ));
    }
    match budget.rest_share {
        Some(rest) => dominant(report, budget, rest),
        None if budget.inputs.is_empty() => report.find("No input is uncertain: there is a single date."),
        None => report.find("No input changes |delta e| at the end of the mission."),
    }
    for (name, exceeded) in BUDGETS.into_iter().zip(&budget.exceeded) {
        spread(report, name, exceeded, results.horizon_yr);
    }
}

/// The most important inputs, and the uncertainty of |Δe|.
fn dominant(report: &mut StudyReport, budget: &Budget, rest: Estimate) {
    report.result("rest_share", rest.value);
    report.result("rest_share_error", rest.error);
    let said = |input: &InputShare| match input.share() {
        Some(share) => format!("{} ({} %)", input.name, plus_minus(share)),
        None => input.name.clone(),
    };
    report.result("dominant_input", budget.inputs[0].name.clone());
    let mut words = format!("The dominant uncertainty is {}", said(&budget.inputs[0]));
    let next: Vec<String> = budget.inputs.iter().skip(1).take(2).map(said).collect();
    if !next.is_empty() {
        words += &format!(", followed by {}", listed(&next));
    }
    let rest = plus_minus(rest.times(100.0));
    report.find(format!("{words}. {rest} % of the variance is non-linear in the inputs."));
    if let Some(sigma) = budget.sigma_ln {
        report.result("sigma_ln_delta_e", sigma.value);
        report.result("sigma_ln_delta_e_error", sigma.error);
        report.find(format!(
            "The standard deviation of ln |delta e| at the end of the mission is {} (1 sigma: a factor of {}).",
            plus_minus(sigma),
            significant(sigma.value.exp(), 3)
        ));
    }
}

/// When a budget is exceeded: the median, and the range of 90 % of the draws.
fn spread(report: &mut StudyReport, name: &str, exceeded: &Exceeded, horizon_yr: f64) {
    let day = |place: usize| exceeded.percentiles[place].as_ref().and_then(Percentile::day);
    let said = |place: usize| match day(place) {
        Some((date, error_d)) => {
            format!("{} ({})", known_date(date, error_d), error_d.map_or("error not known".into(), error_of_date))
        }
        None => format!("later than {} yr after launch", short(horizon_yr)),
    };
    let [low, middle, high] = [0, 2, 4];
    let median = exceeded.percentiles[middle];
    report.result(&format!("{name}_median_t_yr"), median.map(|median| median.t_yr));
    report.result(&format!("{name}_median_error_yr"), median.and_then(|median| median.error_yr));
    report.find(if day(low).is_none() {
        format!("The {name} budget is exceeded {} in 95 % of the draws.", said(low))
    } else {
        format!(
            "Date on which the {name} budget is exceeded: median {}, 90 % interval from {} to {}.",
            said(middle),
            said(low),
            said(high)
        )
    });
}

/// Comparison of two detectors.
fn side_by_side(report: &mut StudyReport, own: &Budget, name: &str, other: &Budget) {
    let Some((mine, theirs)) = own.nominal.delta_e.zip(other.nominal.delta_e).filter(|(mine, _)| *mine > 0.0) else {
        report.find(format!("With the detector of \"{name}\", or with its own, no shape is left to compare."));
        return;
    };
    report.result("other_over_own_delta_e", theirs / mine);
    let dominant = |budget: &Budget| match budget.rest_share {
        Some(_) => budget.inputs[0].name.clone(),
        None => "nothing".into(),
    };
    report.find(format!(
        "The detector of \"{name}\" has {:.2} times the shape error under the same dose, clock, sky and galaxy; its date depends \
         most on {}, that of the mission's own on {}.",
        theirs / mine,
        dominant(other),
        dominant(own)
    ));
}
