//! The distribution of the date, in words and as a figure.

use comfy_table::Table;

use crate::mission::Mission;
use crate::mission::keys::plain;
use crate::numeric::calendar::{DAYS_PER_YEAR, decimal_year};
use crate::numeric::estimate::Estimate;
use crate::plan::compliance::Line;
use crate::plan::date_distribution::{DateDistribution, DateQuantile, Dates, NOT_LINEAR, QUANTILES};
use crate::report::plot::{Figure, Mark, Panel, Series, line};
use crate::report::study::estimate::{error_of_date, known_date, plus_minus};
use crate::report::{Parts, counted, listed, table};

/// Maximum number of inputs named with their shares.
const NAMED: usize = 6;

/// Minimum share, of 1, of the inputs named.
const NAMED_FROM: f64 = 0.01;

/// Quantiles of the dates, the probability that there is one, and its causes.
pub(super) fn say(found: &DateDistribution, mission: &Mission, out: &mut Parts) {
    let what =
        if mission.requirement.limits_a_galaxy() { "Date of |delta e| as a distribution" } else { "Distribution" };
    out.heading(format!("{what}: {}", draws_of(found)));
    let mut legend = String::new();
    if mission.requirement.limits_a_galaxy() {
        out.table(dates_of(found, mission));
        legend.push_str("dates are without noise; ");
        let never = |limit: &Dates| limit.quantiles.iter().any(|quantile| quantile.t_yr.is_none());
        if never(&found.uncorrected) || never(&found.corrected) {
            legend.insert_str(0, "-: later than the mission; ");
        }
    }
    out.words(format!("  {legend}{}", conditions(found, mission)), 4);
    if !found.shares.is_empty() {
        out.words(format!("  Variance of ln |delta e| at the end: {}", contributions(found)), 4);
    }
}

/// The probability that each budget is met, and quantiles of the date at which it is exceeded.
fn dates_of(found: &DateDistribution, mission: &Mission) -> Table {
    let corrected = format!("corrected, factor {}", mission.requirement.correction_factor);
    let mut dates = table(&["", "uncorrected", &corrected]);
    let limits = [&found.uncorrected, &found.corrected];
    let noisy = limits.iter().all(|limit| limit.probability_exceeded_with_noise.is_some());
    let mut row = |name: String, cell: &dyn Fn(&Dates) -> String| {
        dates.add_row([name].into_iter().chain(limits.map(cell)));
    };
    row("met to the end of the mission [%]".into(), &|limit| {
        let met = Estimate { value: 1.0 - limit.probability_exceeded, error: limit.probability_error };
        plus_minus(met.times(100.0))
    });
    if noisy {
        row("the same with noise [%]".into(), &|limit| {
            let value = limit.probability_met_with_noise().unwrap_or(f64::NAN);
            plus_minus(Estimate { value, error: limit.probability_error }.times(100.0))
        });
    }
    for (place, p) in QUANTILES.iter().enumerate() {
        row(format!("exceeded in {:.0} % of draws by", 100.0 * p), &|limit| date(&limit.quantiles[place]));
    }
    dates
}

/// Probability that corrected budgets are met: all of them if a confidence is requested, otherwise those missing from the table of
/// dates.
pub(super) fn say_met(lines: &[Line], confidence: Option<f64>, out: &mut Parts) {
    for line in lines.iter().filter(|line| line.corrected && !line.noise) {
        let Some((value, error)) = line.probability_met.zip(line.probability_error) else { continue };
        let met = plus_minus(Estimate { value, error }.times(100.0));
        let how =
            if line.of_population { " (scaled with the number of traps, galaxies not read out again)" } else { "" };
        let said = format!("{}, corrected, is met with a probability of {met} %{how}", line.requirement);
        match confidence {
            Some(required) => {
                let passed = if line.met { "passed" } else { "not passed" };
                out.verdict(format!("  {passed}: {said} (required: {} %)", plain(100.0 * required)), 4);
            }
            None if line.of_population => out.words(format!("  {said}"), 4),
            None => {}
        }
    }
}

/// How many draws, and of what.
pub(super) fn draws_of(found: &DateDistribution) -> String {
    format!("{} of {}", counted(found.samples as u64, "draw"), drawn(found))
}

/// What was drawn.
fn drawn(found: &DateDistribution) -> String {
    let sun = if found.sun_not_drawn.is_none() { "the Sun and [uncertainty]" } else { "[uncertainty], not of the Sun" };
    match &found.posterior_keys[..] {
        [] => sun.to_string(),
        _ => format!("{sun}, and of a posterior"),
    }
}

/// The conditions of the numbers.
fn conditions(found: &DateDistribution, mission: &Mission) -> String {
    let mut said = Vec::new();
    if let Some(why) = &found.sun_not_drawn {
        said.push(format!("the Sun is not drawn: {why}"));
    }
    let environment = &mission.environment;
    if found.sun_not_drawn.is_none() && environment.active_dose_rate_mev_g_yr.is_some() {
        let percent = plain(100.0 * environment.confidence);
        said.push(format!(
            "solar proton events are drawn behind the aluminium thickness that gives the stated rate at {percent} %"
        ));
    }
    if let Some(part) = &found.part_of_a_year {
        let [uncorrected, corrected] = part.probability_exceeded.map(|exceeded| 100.0 * (1.0 - exceeded));
        said.push(format!(
            "ESP counts one active year at least, more than the mission's {:.2}: of a mission of {:.2} yr with one, {uncorrected:.1} % \
             meet the uncorrected budget by the same date and {corrected:.1} % the corrected one",
            part.active_years, part.followed_yr
        ));
    }
    said.push(match &found.emulated {
        Some(emulated) => format!(
            "changes of shape emulated from {} readouts, with an rms relative error of {:.1e} at {} others",
            emulated.readouts, emulated.relative_error, emulated.held_back
        ),
        None if found.samples < found.asked as usize => {
            format!("{} of {} draws, each read out: shapes cannot be emulated to 1 %", found.samples, found.asked)
        }
        None => "each draw read out".into(),
    });
    if found.posterior_converged == Some(false) {
        said.push("the sample of the posterior has not converged: its intervals may be too narrow".into());
    }
    if found.posterior_describes_data == Some(false) {
        said.push(
            "the posterior is that of a fit that does not describe its data: its intervals are too narrow".into(),
        );
    }
    if !found.posterior_differing.is_empty() {
        let differing = &found.posterior_differing;
        let named = listed(&differing[..differing.len().min(NAMED)]);
        let more = differing.len().saturating_sub(NAMED);
        let more = if more > 0 { format!(" and {more} more keys") } else { String::new() };
        said.push(format!("the posterior was fitted to a mission with other values of {named}{more}"));
    }
    if !found.posterior_keys.is_empty() {
        said.push(format!("the posterior is that of {}", listed(&found.posterior_keys)));
        said.push(format!("errors are those of {:.0} independent draws", found.effective_samples));
    }
    said.join("; ")
}

/// The largest shares, in words.
fn contributions(found: &DateDistribution) -> String {
    let large = found.shares.iter().filter(|share| share.share >= NAMED_FROM).take(NAMED);
    let said = large.map(|share| {
        let estimate = Estimate { value: share.share, error: share.error }.times(100.0);
        let name = if share.input == NOT_LINEAR { "what is not linear".into() } else { share.input.clone() };
        format!("{name} {} %", plus_minus(estimate))
    });
    said.collect::<Vec<_>>().join(", ")
}

fn date(at: &DateQuantile) -> String {
    let error_d = at.error_yr.map(|error_yr| error_yr * DAYS_PER_YEAR);
    let Some(date) = at.date else { return "-".into() };
    match error_d {
        Some(error_d) => format!("{} {}", known_date(date, Some(error_d)), error_of_date(error_d)),
        None => date.to_string(),
    }
}

/// Fraction of the draws in which the budget is exceeded by a date.
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
    Figure { title: "Date on which the budget is exceeded".into(), panels: vec![panel] }
}
