//! What complete data would have shown: for each effect the strength that they detect with 95 % power.

use std::convert::Infallible;

use super::evidence::Evidence;
use super::fitted_model::{Case, Node};
use super::hypothesis::{Hypothesis, Trial};
use super::result::Limit;
use super::significance::Null;
use crate::mission_file;
use crate::numeric::parallel;
use crate::numeric::root_finding;

/// Normal quantile of 95 %.
const POWER: f64 = 1.645;

/// Largest factor on a strength in the search for its limit, and its largest increase per step.
const FARTHEST: f64 = 1e4;
const GROWTH: f64 = 3.2;

/// A step goes this factor beyond the expected limit, for a signature proportional to the strength; and the least step, as a
/// logarithm.
const BEYOND: f64 = 1.1;
const LEAST: f64 = 0.05;

/// Share of its steepest slope below which a signature levels off.
const LEVELLED: f64 = 0.5;

/// Accuracy of a limit, as a logarithm of the strength and of the signature.
const EXACT: f64 = 1e-3;

/// Share of the level for the search of all effects.
const SEARCH: f64 = 0.5;

/// Limits of all effects, from their trials at the base and the null distribution there.
pub(super) fn all(evidence: &Evidence, base: &Node, trials: &[Vec<Trial>], null: &Null) -> Vec<Limit> {
    let hypotheses = evidence.search.hypotheses;
    (evidence.search.progress.stage)("detection limits", hypotheses.len() as u64);
    let limit = |(place, trials): (usize, &Vec<Trial>)| {
        evidence.search.progress.step();
        let needed = null.threshold(place, SEARCH * evidence.options.level).sqrt() + POWER;
        limit(evidence.case, base, &hypotheses[place], trials, needed)
    };
    parallel::map(trials.iter().enumerate(), limit)
}

/// The limit of one effect: the strength that changes the predictions by the given number of sigma.
fn limit(case: &Case, base: &Node, hypothesis: &Hypothesis, trials: &[Trial], needed_sigma: f64) -> Limit {
    let none = Limit { effect: hypothesis.name.clone(), table: None, parameter: String::new(), increases: true };
    // The median of its trials by detectability.
    let mut order: Vec<&Trial> = trials.iter().collect();
    order.sort_by(|a, b| a.moved_sigma.total_cmp(&b.moved_sigma));
    let Some(trial) = order.get(order.len() / 2) else { return none };
    let scaled = |factor: f64| hypothesis.scaled(base.mission(), &trial.table, factor);
    let Some((_, names)) = scaled(1.0) else {
        let seen = trial.moved_sigma > 2.0 * needed_sigma;
        return Limit { table: seen.then(|| trial.table.clone()), ..none };
    };
    let at = |log: f64| scaled(log.exp()).map_or_else(|| trial.table.clone(), |(table, _)| table);
    // Logarithm of the change of the predictions over the change needed; a change of 0 if the model has no value.
    let excess = |log: f64| -> f64 {
        let moved_sigma = || -> Option<f64> {
            let (mission, _) = mission_file::add_effect(base.mission(), hypothesis.kind, at(log)).ok()?;
            let signature = case.change(base, &base.model.like(&mission)).ok()?;
            Some(base.beyond(&signature).norm())
        };
        let excess = (moved_sigma().unwrap_or(0.0) / needed_sigma).ln();
        if excess.abs() < EXACT { 0.0 } else { excess }
    };
    let Some(log) = crossing(excess) else { return none };
    let strength = |log: f64| number(&at(log), &names[0]);
    let increases = strength(log + LEAST) > strength(log);
    Limit { table: Some(at(log)), parameter: names[0].clone(), increases, ..none }
}

/// A number of an effect's table, or of its first species.
fn number(table: &toml::Table, name: &str) -> Option<f64> {
    let inner = || table.get("traps")?.as_array()?.first()?.as_table()?.get(name);
    table.get(name).or_else(inner)?.as_float()
}

/// Logarithm of the strength at which `excess` vanishes; its slope in that logarithm is nearly 1. Steps from a strength of 1 until
/// the sign changes, then searches in between. None if that is too far away, or the function levels off before it.
fn crossing(excess: impl Fn(f64) -> f64) -> Option<f64> {
    let mut here = (0.0, excess(0.0));
    let is_up = here.1 <= 0.0;
    let longest = if is_up { GROWTH.ln() } else { FARTHEST.ln() };
    let mut least = LEAST;
    let mut steepest = 0.0_f64;
    loop {
        let stride = (BEYOND * here.1.abs()).max(least).min(longest);
        // Larger steps each time, for signatures that hardly change.
        least *= 2.0;
        let place = here.0 + if is_up { stride } else { -stride };
        if place.abs() > FARTHEST.ln() {
            return None;
        }
        let there = (place, excess(place));
        if (there.1 > 0.0) == is_up {
            let found = root_finding::try_between([here, there], EXACT, |log| Ok::<_, Infallible>(excess(log)));
            return Some(found.unwrap_or_else(|never| match never {}));
        }
        // A signature that has begun to level off does not steepen again.
        let slope = (there.1 - here.1) / stride;
        let is_hopeless = there.1 + slope.max(0.0) * (FARTHEST.ln() - place) < 0.0;
        if is_up && slope < LEVELLED * steepest && is_hopeless {
            return None;
        }
        if slope.is_finite() {
            steepest = steepest.max(slope);
        }
        here = there;
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn a_crossing_is_found_below_above_and_behind_a_flat_start() {
        for root in [-5.0_f64, -0.3, 0.4, 6.0] {
            let found = crossing(|log| log - root).unwrap();
            assert!((found - root).abs() < 2.0 * EXACT, "{found}, not {root}");
        }
        // Nothing at all up to a threshold, as for a notch below the background.
        let found = crossing(|log| if log < 3.0 { f64::NEG_INFINITY } else { 10.0 * (log - 3.2) }).unwrap();
        assert!((found - 3.2).abs() < 2.0 * EXACT, "{found}");
    }

    #[test]
    fn a_signature_that_levels_off_too_low_has_none() {
        let asked = Cell::new(0);
        let levels_off = |log: f64| {
            asked.set(asked.get() + 1);
            // Grows in proportion to the strength, and ends at 1/e of what is needed.
            -1.0 - (1.0 + (2.0 - log).exp()).ln()
        };
        assert_eq!(crossing(levels_off), None);
        assert!(asked.get() < 8, "{} evaluations", asked.get());
    }
}
