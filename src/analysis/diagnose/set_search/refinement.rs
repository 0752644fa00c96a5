//! Sets that matter, fitted to their end from several starts: their own, least squares, and a scan of each parameter.

use super::super::explanation::{Explanation, Start, Unknown, with_values};
use super::super::fitted_model::Added;
use super::super::prior::Prior;
use super::linear::Linear;
use super::signature::Strength;
use super::{FITTED, SetSearch, WORTH_A_FIT, best, distinct};
use crate::analysis::fit::parameter::Parameter;
use crate::analysis::likelihood::{Errors, minus_2_ln_l};
use crate::effect;
use crate::mission_file;
use crate::numeric::parallel;

/// Evidence up to which a set counts as a rival, or is fitted to the end: −2 ln Z within this of the best.
const NEAR: f64 = 20.0;

/// Sets whose subsets are fitted from their values, and rounds of that, since a subset may itself have one that is as good.
const SETS_WITH_SUBSETS: usize = 3;
const ROUNDS_OF_SUBSETS: usize = 2;

/// Sets that are scanned, and the steps of logarithms.
const SCANNED: usize = 8;
const SCAN_LN: [f64; 6] = [-3.0, -1.5, -0.7, 0.7, 1.5, 3.0];

impl SetSearch<'_> {
    /// A set from its values of least squares: rows that look wrong may be right at other values, where slopes without them never lead.
    pub(super) fn with_all_rows(&self, one: &Explanation) -> Option<Explanation> {
        one.errors.iter().flat_map(Errors::wrong).next()?;
        let moving = one.unknowns.iter().filter(|unknown| unknown.prior.is_some());
        let keys: Vec<String> = moving.map(|unknown| unknown.parameter.key.clone()).collect();
        let mission = self.least_squares(&one.mission, &keys)?;
        let unknowns = one.unknowns.iter().map(|unknown| {
            let parameter = Parameter::of(&mission, &unknown.parameter.key).ok()?;
            Some(Unknown { parameter, prior: unknown.prior })
        });
        let unknowns = unknowns.collect::<Option<Vec<Unknown>>>()?;
        let found = self.fitter.fit(&self.start_at(one, mission, unknowns), None, false).ok()?;
        (found.objective() < one.objective()).then_some(found)
    }

    /// Sets that matter, fitted to their end.
    pub(super) fn refined(&self, sets: Vec<Explanation>) -> Vec<Explanation> {
        let least = best(&sets);
        let matters = |one: &Explanation| one.minus_2_ln_z() < least + NEAR;
        let again = |one: &Explanation| {
            let wanted = matters(one) && !one.added.is_empty();
            wanted.then(|| self.again(one)).flatten().filter(|found| found.objective() < one.objective())
        };
        let better = parallel::map(sets.iter(), again);
        let mut sets: Vec<Explanation> =
            sets.into_iter().zip(better).map(|(one, better)| better.unwrap_or(one)).collect();
        sets.sort_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()));
        for _ in 0..ROUNDS_OF_SUBSETS {
            sets = self.with_subsets(sets);
        }
        // Small sets first: larger ones start from them, and are named only if these are not enough.
        let near = best(&sets) + NEAR;
        // More than noise is not left to be found by an effect beside those that leave only that.
        let explained: Vec<Vec<usize>> = sets.iter().filter(|one| self.is_noise(one)).map(Explanation::set).collect();
        let is_idle = |set: &[usize]| {
            explained.iter().any(|known| known.len() < set.len() && known.iter().all(|effect| set.contains(effect)))
        };
        let mut wanted: Vec<usize> = (0..sets.len())
            .filter(|&place| sets[place].minus_2_ln_z() < near && !is_idle(&sets[place].set()))
            .collect();
        wanted.sort_by_key(|&place| (sets[place].added.len(), place));
        wanted.truncate(SCANNED);
        for place in wanted {
            if let Some(better) = self.with_all_rows(&sets[place]) {
                sets[place] = better;
            }
            sets[place] = self.scanned(&sets[place]);
        }
        sets
    }

    /// With the subsets of the best sets, each fitted from the values of the larger one: an effect that is not needed may have led to a
    /// minimum that the search for the others alone did not reach.
    fn with_subsets(&self, sets: Vec<Explanation>) -> Vec<Explanation> {
        let near = best(&sets) + NEAR;
        let larger = sets.iter().filter(|one| one.minus_2_ln_z() < near).take(SETS_WITH_SUBSETS);
        let wanted: Vec<(&Explanation, usize)> =
            larger.flat_map(|one| (0..one.added.len()).map(move |gone| (one, gone))).collect();
        let found = parallel::map(wanted, |(one, gone)| {
            let start = self.without(one, gone)?;
            self.fitter.fit(&start, Some(&one.errors), false).ok()
        });
        let subsets: Vec<Explanation> = found.into_iter().flatten().collect();
        distinct(sets.into_iter().chain(subsets).collect())
    }

    /// A set without one of its effects, at the same values of all other parameters; None if two of the others are of one kind.
    fn without(&self, one: &Explanation, gone: usize) -> Option<Start> {
        let value = |key: &String| one.unknowns.iter().find(|unknown| unknown.parameter.key == *key);
        let settings: Vec<_> = self
            .free
            .iter()
            .map(|key| Some((key.clone(), value(key)?.parameter.start.into())))
            .collect::<Option<_>>()?;
        let mut mission = self.fitter.model.mission.with(&settings).ok()?;
        let mut keys: Vec<(String, Option<Prior>)> =
            self.free.iter().map(|key| Some((key.clone(), value(key)?.prior))).collect::<Option<_>>()?;
        let mut added: Vec<Added> = Vec::new();
        for (_, known) in one.added.iter().enumerate().filter(|(place, _)| *place != gone) {
            let kind = self.hypotheses[known.hypothesis].kind;
            if added.iter().any(|other| self.hypotheses[other.hypothesis].kind == kind) {
                return None;
            }
            let (with, key) =
                mission_file::add_effect(&mission, kind, effect::table(&one.mission, &known.key)?.clone()).ok()?;
            mission = with;
            let renamed = |full: &String| full.replacen(&known.key, &key, 1);
            keys.extend(known.free.iter().filter_map(|full| Some((renamed(full), value(full)?.prior))));
            added.push(Added { hypothesis: known.hypothesis, free: known.free.iter().map(renamed).collect(), key });
        }
        let unknown = |(key, prior): (String, Option<Prior>)| {
            Some(Unknown { parameter: Parameter::of(&mission, &key).ok()?, prior })
        };
        let unknowns = keys.into_iter().map(unknown).collect::<Option<Vec<Unknown>>>()?;
        let choices = self.choices_of(&added);
        Some(Start { added, mission, unknowns, choices, known: self.nothing() })
    }

    /// A set from other values of its parameters: a narrow minimum, or one far away, is not reached by slopes. Each parameter that is
    /// known by its size is moved while the others follow to first order; the most promising are fitted.
    pub(super) fn scanned(&self, one: &Explanation) -> Explanation {
        let at: Vec<f64> = one.unknowns.iter().map(|unknown| unknown.parameter.start).collect();
        let places = (0..at.len()).filter(|&index| one.unknowns[index].prior.is_some_and(|prior| prior.is_size()));
        let wanted: Vec<(usize, f64)> = places.flat_map(|index| SCAN_LN.map(|step| (index, step))).collect();
        let looked = parallel::map(wanted, |(index, step)| {
            let prior = one.unknowns[index].prior?;
            let coordinate = prior.coordinate(at[index]);
            let mut moved = at.clone();
            moved[index] = prior.value(prior.clamp(coordinate + step));
            let mission = with_values(&one.mission, &one.unknowns, &moved)?;
            let predicted = self.fitter.predicted(&mission)?;
            let change =
                vec![predicted.iter().zip(&one.model).map(|(moved, model)| moved - model).collect::<Vec<f64>>()];
            let problem = Linear::without(self, one, &one.errors, Some(index));
            let found = problem.solve(&change, Strength::Fixed)?;
            let errors = self.fitter.likelihood.errors(&problem.left(one, &found, &change), Some(&one.errors));
            let objective = minus_2_ln_l(&errors) + problem.prior(&found) + prior.cost(prior.coordinate(moved[index]));
            let all: Vec<f64> = moved
                .iter()
                .zip(&one.unknowns)
                .zip(&found)
                .enumerate()
                .map(|(place, ((value, unknown), step))| match unknown.prior {
                    Some(prior) if place != index => {
                        let limited = step.clamp(-prior.longest(), prior.longest());
                        prior.value(prior.clamp(prior.coordinate(*value) + limited))
                    }
                    _ => *value,
                })
                .collect();
            Some((objective, all, errors))
        });
        let mut looked: Vec<_> =
            looked.into_iter().flatten().filter(|(objective, ..)| *objective < one.objective() + WORTH_A_FIT).collect();
        looked.sort_by(|a, b| a.0.total_cmp(&b.0));
        looked.truncate(FITTED);
        let fits = parallel::map(looked, |(_, at, errors)| {
            let mission = with_values(&one.mission, &one.unknowns, &at)?;
            let unknowns = one.unknowns.iter().zip(&at).map(|(unknown, value)| Unknown {
                parameter: unknown.parameter.starting_at(*value),
                prior: unknown.prior,
            });
            let start = self.start_at(one, mission, unknowns.collect());
            self.fitter.fit(&start, Some(&errors), false).ok()
        });
        let best = fits.into_iter().flatten().min_by(|a, b| a.objective().total_cmp(&b.objective()));
        best.filter(|best| best.objective() < one.objective()).unwrap_or_else(|| one.clone())
    }
}
