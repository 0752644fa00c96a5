//! The effect of noise on the date, in words.

use crate::mission::keys::plain;
use crate::numeric::calendar::{DAYS_PER_YEAR, date_after};
use crate::plan::curve::Crossing;
use crate::plan::evaluate::Evaluation;
use crate::plan::noise::{NoisyCrossing, NoisyEvaluation};
use crate::report::Parts;

/// The judged galaxy with noise, and the dates with noise.
pub(super) fn say(evaluation: &Evaluation, noise: &NoisyEvaluation, out: &mut Parts) {
    let mission = evaluation.mission();
    let verdict = &evaluation.verdict;
    let end = noise.years.last().and_then(|galaxies| galaxies[evaluation.model.judged()]);
    let judged = end.map_or("no shape left".into(), |shape| {
        format!("|delta e| {:.3e} +- {:.1e} at end of life", shape.magnitude(), shape.magnitude_error())
    });
    let read_noise_e = plain((10.0 * mission.read_noise_e(mission.judged_galaxy())).round() / 10.0);
    out.verdict(format!("  with photon noise and {read_noise_e} e- read noise: {judged}"), 4);
    for (name, without, with) in [
        ("uncorrected", &verdict.uncorrected, &noise.verdict.uncorrected),
        ("corrected", &verdict.corrected, &noise.verdict.corrected),
    ] {
        out.verdict(format!("    {name}: {}", moved(without, with, mission.mission.launch.0)), 6);
    }
}

/// The effect of noise on a date.
fn moved(without: &Crossing, with: &NoisyCrossing, launch: chrono::NaiveDate) -> String {
    let Some(t_yr) = with.crossing.t_yr else {
        let used = with.crossing.margin.map(|margin| 100.0 * (1.0 - margin / with.crossing.limit));
        let used = used.map_or(String::new(), |used| format!("; {used:.1} % of the budget used at end of life"));
        return match without.t_yr {
            None => format!("not exceeded{used}"),
            Some(_) => format!("not exceeded with noise{used}"),
        };
    };
    if with.error_yr.is_some_and(|error_yr| error_yr > t_yr) {
        return "no date: the standard error of |delta e| is larger than its change since launch; more realisations give one \
                (accuracy.noise_realisations)"
            .into();
    }
    let date = date_after(launch, t_yr).map_or(format!("{t_yr:.3} yr"), |date| date.to_string());
    let error = with.error_yr.map_or(String::new(), |error| format!(" +- {:.0} d", error * DAYS_PER_YEAR));
    let shift = match with.earlier_yr {
        None => "not exceeded without noise".into(),
        Some(earlier) if earlier >= 0.0 => format!("{:.0} d earlier than without noise", earlier * DAYS_PER_YEAR),
        Some(earlier) => format!("{:.0} d later than without noise", -earlier * DAYS_PER_YEAR),
    };
    format!("exceeded on {date}{error}, {shift}")
}
