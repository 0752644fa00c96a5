//! What complete data would have shown: for each effect the strength that they reveal with 95 % power.

use std::sync::Arc;

use rayon::prelude::*;
use toml::Table;

use super::case::Node;
use super::chance::Noise;
use super::hypothesis::Trial;
use super::result::Limit;
use super::search::Search;
use crate::error::InputError;
use crate::mission_file;

/// Normal quantile of 95 %.
const POWER: f64 = 1.645;

/// Factor by which a strength is changed at most in the search for its limit.
const FARTHEST: f64 = 1e4;

/// Limits of all effects.
pub(super) fn all(search: &Search, base: &Arc<Node>, level: f64) -> Result<Vec<Limit>, InputError> {
    (search.progress.stage)("detection limits", search.hypotheses.len() as u64);
    let noise = Noise::left_at(search.case, base);
    let null = search.null(base, &noise);
    let expansion = search.expand(base);
    let here = search.case.over_sigma(&base.fit.values);
    let limit = |(place, trials): (usize, &Vec<Trial>)| {
        let hypothesis = &search.hypotheses[place];
        search.progress.step();
        let none = || Limit { effect: hypothesis.name.clone(), table: None, parameter: String::new() };
        // Neither the easiest of its trials nor the hardest.
        let mut order: Vec<&Trial> = trials.iter().collect();
        order.sort_by(|a, b| a.moved_sigma.total_cmp(&b.moved_sigma));
        let Some(trial) = order.get(order.len() / 2) else { return none() };
        let needed = null.threshold(place, super::calls::SEARCH * level).sqrt() + POWER;
        let moved = |table: &Table| -> Option<f64> {
            let (mission, _) = mission_file::add_effect(base.mission(), hypothesis.kind, table.clone()).ok()?;
            let signature = search.case.predict_sigma(&base.model.like(&mission)).ok()? - &here;
            Some(base.beyond(&signature).norm())
        };
        let Some((_, names)) = hypothesis.scaled(base.mission(), &trial.table, 1.0) else {
            let seen = trial.moved_sigma > 2.0 * needed;
            return Limit { table: seen.then(|| trial.table.clone()), ..none() };
        };
        // Along the straight line from nothing to the trial, in the logarithm of the place on it.
        let at = |place: f64| {
            hypothesis
                .scaled(base.mission(), &trial.table, place)
                .map_or_else(|| trial.table.clone(), |(table, _)| table)
        };
        let seen = |log: f64| moved(&at(log.exp())).is_some_and(|moved| moved > needed);
        let mut bounds = [0.0_f64, 0.0];
        let step = if seen(0.0) { -1.0 } else { 1.0 };
        while seen(bounds[1]) == (step < 0.0) {
            bounds = [bounds[1], bounds[1] + step * (10.0_f64).ln() / 2.0];
            if bounds[1].abs() > FARTHEST.ln() {
                return none();
            }
        }
        for _ in 0..8 {
            let middle = 0.5 * (bounds[0] + bounds[1]);
            if seen(middle) == (step < 0.0) { bounds[0] = middle } else { bounds[1] = middle }
        }
        let table = at(bounds[if step < 0.0 { 0 } else { 1 }].exp());
        Limit { effect: hypothesis.name.clone(), table: Some(table), parameter: names[0].clone() }
    };
    Ok(expansion.trials.par_iter().enumerate().map(limit).collect())
}
