//! The verdict in three lines: without correction, with correction, and what both are conditioned on.

use super::distribution::draws_of;
use crate::mission::Mission;
use crate::mission::keys::plain;
use crate::numeric::calendar::date_after;
use crate::numeric::estimate::Estimate;
use crate::physics::RateOrigin;
use crate::plan::assessment::Assessment;
use crate::plan::compliance::Line;
use crate::report::Parts;
use crate::report::study::estimate::plus_minus;

/// Whether all budgets are met, without and with correction, and under which conditions; without noise.
pub(super) fn say(of: &Assessment, out: &mut Parts) {
    let mission = of.evaluation.mission();
    let lines = of.lines();
    let corrected = format!("corrected, factor {}", plain(mission.requirement.correction_factor));
    let width = corrected.len();
    for (with_correction, name) in [(false, "uncorrected"), (true, corrected.as_str())] {
        let judged: Vec<&Line> = lines.iter().filter(|line| line.corrected == with_correction && !line.noise).collect();
        if judged.is_empty() {
            return;
        }
        let met = judged.iter().all(|line| line.met);
        out.judged(name, width, format!("{}{}", by_the_design_case(&judged), by_draws(of, with_correction)), met);
    }
    out.outcome("conditions", width, conditions(of, &lines));
}

/// When the first budget is exceeded, or how much of the most used one is used.
fn by_the_design_case(judged: &[&Line]) -> String {
    let exceeded = judged.iter().filter_map(|line| Some((line, line.t_yr?)));
    if let Some((line, t_yr)) = exceeded.min_by(|a, b| a.1.total_cmp(&b.1)) {
        let when = line.date.map_or(format!("after {t_yr:.2} yr"), |date| format!("on {date}"));
        let by = if judged.len() > 1 { format!(" by {}", line.requirement) } else { String::new() };
        return format!("exceeded {when}{by}");
    }
    let used = judged.iter().filter_map(|line| Some(line.at_end? / line.limit)).map(f64::abs).fold(0.0, f64::max);
    format!("met, {:.1} % used", 100.0 * used)
}

/// The probability that all budgets are met; if one is required, also how long they are met with it.
fn by_draws(of: &Assessment, with_correction: bool) -> String {
    let Some(found) = &of.distribution else { return String::new() };
    let dates = found.requirement()[usize::from(with_correction)];
    let met = Estimate { value: dates.probability_met(), error: dates.probability_error }.times(100.0);
    let said = format!("; probability met {} %", plus_minus(met));
    let Some(required) = of.confidence else { return said };
    let mission = of.evaluation.mission();
    let kept = dates.kept_yr(required).map(|t_yr| match date_after(mission.mission.launch.0, t_yr) {
        Some(date) => format!("until {date}"),
        None => format!("for {t_yr:.2} yr"),
    });
    format!("{said} ({} % required: kept {})", plain(100.0 * required), kept.unwrap_or("to the end".into()))
}

/// The budgets, the dose of the dates, and the draws of the probabilities.
fn conditions(of: &Assessment, lines: &[Line]) -> String {
    let budgets = lines.iter().filter(|line| !line.corrected && !line.noise);
    let mut said: Vec<String> =
        budgets.map(|line| format!("{} below {}", line.requirement, plain(line.limit))).collect();
    said.push(format!("date by {}", dose(of)));
    said.extend(of.distribution.as_ref().map(|found| format!("probability by {}", draws_of(found))));
    said.push("without noise".into());
    said.join("; ")
}

/// The dose of the design case.
fn dose(of: &Assessment) -> String {
    let mission = of.evaluation.mission();
    match of.evaluation.model.history().origin {
        RateOrigin::Given => "the dose rate as given".into(),
        RateOrigin::Esp { .. } | RateOrigin::Sources { .. } => by_the_sun(mission),
        RateOrigin::Spectra | RateOrigin::DoseDepth | RateOrigin::History => "the imported dose".into(),
    }
}

fn by_the_sun(mission: &Mission) -> String {
    let observed = mission.observed_to().map_or(String::new(), |day| format!("the Sun as observed to {day}, then "));
    format!("{observed}solar protons at {} %", plain(100.0 * mission.environment.confidence))
}
