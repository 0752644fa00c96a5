//! Doubts about a model that explains the data: weak effects that move the date far, and poor predictions outside the data's range.

use super::holdout::Carried;
use super::result::{Note, Rung, Step};
use crate::analysis::fit::{Advice, Fitted};
use crate::analysis::measurement::DataSet;
use crate::mission::Mission;
use crate::mission::keys::plain;
use crate::numeric::aliases::{Wave, even_spacing};

/// Share of what all effects explain below which one explains little.
const LITTLE: f64 = 0.05;

/// Shift of the date that counts as large, years.
const FAR_YR: f64 = 0.5;

/// Factor by which predictions at the ends of a range must worsen with an effect, and how poor they must be, sigma.
const WORSE: f64 = 1.15;
const BAD_SIGMA: f64 = 1.5;

/// Share of an effect's period down to which others are named.
const SHORTEST: f64 = 0.2;

/// Doubts about the steps from the mission as given to the final model.
pub(super) fn of(baseline: &Rung, steps: &[Step], epochs_yr: &[f64]) -> Vec<Note> {
    let mut notes = Vec::new();
    let all = baseline.chi2 - steps.last().map_or(baseline.chi2, |step| step.rung.chi2);
    let mut before = baseline;
    for step in steps {
        notes.extend(moves_the_date(before, step, all));
        notes.extend(does_not_extrapolate(before, step));
        notes.extend(part_of_a_period(step));
        notes.extend(other_periods(step, epochs_yr));
        before = &step.rung;
    }
    if !steps.is_empty() {
        notes.extend(before.carried.iter().filter_map(trust_inside));
    }
    notes
}

/// Species whose density a fit has reduced to 0 beside an additional species: the deficiency may be a parameter of theirs rather
/// than a species.
pub(super) fn replaced(steps: &[Step], fitted: &[Fitted], advice: &[Advice]) -> Vec<Note> {
    // An effect with a release time of its own is a species.
    let is_species = |step: &&Step| {
        let own = format!("effects.{}.", step.effect);
        fitted.iter().any(|fitted| fitted.key.starts_with(&own) && fitted.key.ends_with(".release_ms"))
    };
    let Some(step) = steps.iter().find(is_species) else { return Vec::new() };
    let gone = advice.iter().filter_map(|advice| match advice {
        Advice::AtBound { key, bound } if *bound == 0.0 => Some(key.strip_suffix(".density_per_px")?.to_string()),
        _ => None,
    });
    gone.filter(|species| species.starts_with("detector.traps."))
        .map(|species| Note::TakesItsPlace { effect: step.effect.clone(), species })
        .collect()
}

/// Events (what, and when) between two epochs between which a recorded condition changed for good.
pub(super) fn coincidences(events_yr: &[(String, f64)], data: &[DataSet]) -> Vec<Note> {
    let of = |(what, event_yr): &(String, f64)| {
        let (condition, values, between_yr) = data.iter().find_map(|set| changed_for_good(set, *event_yr))?;
        Some(Note::CoincidesWith { what: what.clone(), condition, values, between_yr })
    };
    events_yr.iter().filter_map(of).collect()
}

/// Events of effects: name, and time since launch.
pub(super) fn events_yr(steps: &[Step]) -> Vec<(String, f64)> {
    let of = |step: &Step| {
        let key = format!("{}.t_yr", step.key);
        let event = step.parameters.iter().find(|fitted| fitted.key == key)?;
        Some((step.effect.clone(), event.value))
    };
    steps.iter().filter_map(of).collect()
}

/// A condition of a file that has one value up to a time and another one from then on; its values, and the epochs around that time.
fn changed_for_good(set: &DataSet, t_yr: f64) -> Option<(String, [String; 2], [f64; 2])> {
    let times = set.against("t_yr");
    let from = times.iter().copied().filter(|time| *time <= t_yr).fold(f64::NEG_INFINITY, f64::max);
    let to = times.iter().copied().filter(|time| *time > t_yr).fold(f64::INFINITY, f64::min);
    let of = |name: &String| {
        let values = set.against(name);
        let only = |is_before: bool| {
            let is_here = |row: &usize| (times[*row] <= t_yr) == is_before;
            let mut here = (0..times.len()).filter(is_here);
            let first = here.next()?;
            let said = set.rows[first].word(name).map_or_else(|| plain(values[first]), str::to_string);
            here.all(|row| values[row] == values[first]).then_some((values[first], said))
        };
        let ((before, said), (after, then)) = (only(true)?, only(false)?);
        (before != after).then(|| (name.clone(), [said, then], [from, to]))
    };
    set.varying.iter().filter(|name| *name != "t_yr").find_map(of)
}

/// Effects of another temperature if all data are of one and release times are not free.
pub(super) fn release_times(steps: &[Step], data: &[DataSet], mission: &Mission, free: &[String]) -> Option<Note> {
    let step = steps.iter().find(|step| step.effect == "temperature-offset")?;
    let mut temperatures = data.iter().flat_map(|set| &set.rows).map(|row| row.at.temperature_k);
    let first = temperatures.next()?;
    if temperatures.any(|temperature_k| temperature_k != first) {
        return None;
    }
    let keys = mission.detector.traps.iter().map(|species| format!("detector.traps.{}.release_ms", species.name));
    let keys: Vec<String> = keys.filter(|key| !free.contains(key)).collect();
    (!keys.is_empty()).then(|| Note::SameAsReleaseTime { effect: step.effect.clone(), keys })
}

fn moves_the_date(before: &Rung, step: &Step, all: f64) -> Option<Note> {
    let share = (before.chi2 - step.rung.chi2) / all;
    let date = |rung: &Rung| rung.budget.as_ref().map(|budget| budget.uncorrected.t_yr);
    let (one, other) = (date(before)?, date(&step.rung)?);
    let years = one.zip(other).map(|(one, other)| other - one);
    let far = years.map_or(one.is_some() != other.is_some(), |years| years.abs() > FAR_YR);
    (share < LITTLE && far).then(|| Note::MovesTheDate { effect: step.effect.clone(), share, years })
}

fn does_not_extrapolate(before: &Rung, step: &Step) -> Option<Note> {
    let of = |carried: &Carried| {
        let known = before.carried.iter().find(|known| known.condition == carried.condition)?.beyond_rms_sigma?;
        let now = carried.beyond_rms_sigma?;
        (now > BAD_SIGMA && now > WORSE * known).then(|| Note::DoesNotExtrapolate {
            effect: step.effect.clone(),
            condition: carried.condition.clone(),
            beyond_rms_sigma: [known, now],
        })
    };
    step.rung.carried.iter().find_map(of)
}

/// The period of an effect.
fn period_yr(step: &Step) -> Option<f64> {
    Some(step.parameters.iter().find(|fitted| fitted.key.ends_with(".period_yr"))?.value)
}

/// Other periods of much the same length that evenly spaced epochs do not distinguish.
fn other_periods(step: &Step, epochs_yr: &[f64]) -> Option<Note> {
    let (period_yr, spacing_yr) = (period_yr(step)?, even_spacing(epochs_yr)?);
    let aliases = Wave { period: period_yr, maximum: 0.0 }.aliases(epochs_yr[0], spacing_yr).into_iter();
    let others_yr: Vec<f64> = aliases
        .map(|alias| alias.period)
        .filter(|other| (SHORTEST..1.0 / SHORTEST).contains(&(other / period_yr)))
        .collect();
    let effect = step.effect.clone();
    (!others_yr.is_empty()).then_some(Note::OtherPeriods { effect, period_yr, others_yr, spacing_yr })
}

fn part_of_a_period(step: &Step) -> Option<Note> {
    let period_yr = period_yr(step)?;
    let [first, last] = step.rung.carried.iter().find(|carried| carried.condition == "t_yr")?.range;
    let span_yr = last - first;
    (span_yr < period_yr).then(|| Note::PartOfAPeriod { effect: step.effect.clone(), period_yr, span_yr })
}

fn trust_inside(carried: &Carried) -> Option<Note> {
    let (inside, beyond) = (carried.inside_rms_sigma?, carried.beyond_rms_sigma?);
    let worse = beyond > BAD_SIGMA && beyond > WORSE * inside;
    worse.then(|| Note::TrustInside {
        condition: carried.condition.clone(),
        range: carried.range,
        rms_sigma: [inside, beyond],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Data over 8 years show a period of 7 years, and not one of 9.
    #[test]
    fn less_than_a_period_is_a_drift() {
        let step = |period_yr: f64| {
            let carried = Carried {
                condition: "t_yr".into(),
                range: [1.0, 9.0],
                inside_rms_sigma: Some(1.0),
                beyond_rms_sigma: Some(1.0),
            };
            let rung = Rung {
                chi2: 50.0,
                n: 50,
                free: 3,
                parameters: Vec::new(),
                holdout_rms_sigma: Some(1.0),
                carried: vec![carried],
                budget: None,
            };
            let key = "effects.cycle.period_yr".into();
            let period = Fitted { key, unit: "yr", before: 10.0, value: period_yr, sigma: None };
            let key = "effects.cycle".into();
            Step { effect: "cycle".into(), parameters: vec![period], key, rung, false_alarm: 1e-9 }
        };
        assert_eq!(part_of_a_period(&step(7.0)), None);
        let note = Note::PartOfAPeriod { effect: "cycle".into(), period_yr: 9.0, span_yr: 8.0 };
        assert_eq!(part_of_a_period(&step(9.0)), Some(note.clone()));
        assert_eq!(
            note.to_string(),
            "cycle: the data span 8 yr, less than its period of 9 yr: they show a drift, and not that it returns"
        );
    }
}
