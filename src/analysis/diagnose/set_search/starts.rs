//! Starts of fits: the mission as given, one more effect on top of a set, and pairs of effects.

use std::collections::BTreeMap;

use toml::Table;

use super::super::explanation::{Explanation, Start, Unknown, with_values};
use super::super::fitted_model::Added;
use super::super::hypothesis::{FARTHEST, larger};
use super::super::prior::{Prior, number};
use super::linear::Linear;
use super::signature::{Promise, Strength, Trial};
use super::{FITTED, Searched, SetSearch, WORTH_A_FIT, is_event_epoch};
use crate::analysis::fit;
use crate::analysis::fit::parameter::Parameter;
use crate::effect;
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission_file;
use crate::numeric::parallel;

/// Effects fitted on top of a set, and more if they are as close to the last of them as this.
const BREADTH: usize = 6;
const MORE: usize = 10;
const CLOSE: f64 = 10.0;

/// Rough fits that are followed to their end.
const TO_THE_END: usize = 2;

/// Pairs that are fitted from the base.
const PAIRS: usize = 4;

/// Difference of −2 ln L below which two fits are the same.
const SAME: f64 = 0.5;

/// Decrease of −2 ln L for which a set is fitted again from another start.
const BETTER_START: f64 = 2.0;

impl SetSearch<'_> {
    /// The mission as given with its free keys fitted, from its own values and from those of least squares; the best first. What is
    /// missing may have driven free keys far, where no effect on them changes anything: effects are tried on top of both.
    pub(super) fn bases(&self) -> Result<Vec<Explanation>, InputError> {
        let unknowns = self.free.iter().map(|key| {
            let parameter = Parameter::of(self.given, key)?;
            Ok(Unknown { prior: Some(Prior::of_key(&parameter)), parameter })
        });
        let unknowns = unknowns.collect::<Result<Vec<Unknown>, InputError>>()?;
        let from = |mission: Mission| {
            let own = unknowns.iter().map(|unknown| {
                let parameter = Parameter::of(&mission, &unknown.parameter.key)?;
                Ok(Unknown { parameter, prior: unknown.prior })
            });
            let unknowns = own.collect::<Result<Vec<Unknown>, InputError>>()?;
            let start = Start { added: Vec::new(), mission, unknowns, choices: 0.0, known: self.nothing() };
            self.fitter.fit(&start, None, false)
        };
        let given = from(self.fitter.model.mission.clone())?;
        if self.free.is_empty() {
            return Ok(vec![given]);
        }
        // Far from the data, what free parameters could explain looks like correlated errors or wrong rows, and they have no reason to
        // move: least squares move them.
        let squares = self.least_squares(&self.fitter.model.mission, self.free);
        let other = squares.and_then(|mission| from(mission).ok());
        let mut bases = vec![given];
        bases.extend(other.filter(|other| (other.objective() - bases[0].objective()).abs() > SAME));
        bases.sort_by(|a, b| a.objective().total_cmp(&b.objective()));
        Ok(bases)
    }

    /// A mission with keys at their values of least squares, with the errors as quoted: no row is wrong, and nothing is correlated.
    pub(super) fn least_squares(&self, mission: &Mission, keys: &[String]) -> Option<Mission> {
        let options = fit::Options { scan: false, moments: false, ..fit::Options::default() };
        let count = |_| self.fitter.case.work.count();
        let model = self.fitter.model.like(mission);
        fit::fit_rows(&model, self.fitter.case.data, keys, &options, &count, |_| true).ok().map(|fit| fit.mission)
    }

    /// Fits of the most promising effects on top of a set. `known` is the objective of a set that was already fitted.
    pub(super) fn fitted(
        &self,
        line: &Explanation,
        promises: &[Promise],
        forms: usize,
        known: &dyn Fn(&[usize]) -> Option<f64>,
    ) -> Vec<Explanation> {
        let mut effects: Vec<Vec<&Promise>> = Vec::new();
        for promise in promises {
            match effects.last_mut().filter(|last| last[0].trial.hypothesis == promise.trial.hypothesis) {
                Some(last) => last.push(promise),
                None => effects.push(vec![promise]),
            }
        }
        let last = effects.get(BREADTH - 1).map_or(f64::INFINITY, |effect| effect[0].objective + CLOSE);
        effects.truncate(MORE);
        let wanted = effects.into_iter().enumerate().filter(|(place, effect)| {
            let mut set = line.set();
            set.push(effect[0].trial.hypothesis);
            set.sort_unstable();
            let is_better = known(&set).is_none_or(|known| effect[0].objective < known - BETTER_START);
            is_better && (*place < BREADTH || effect[0].objective < last)
        });
        let wanted: Vec<Vec<&Promise>> = wanted.map(|(_, effect)| effect).collect();
        let fits = parallel::map(wanted, |effect| self.fit_effect(line, &effect[..effect.len().min(forms)]));
        fits.into_iter().flatten().collect()
    }

    /// The fit of a set that the search did not need: effects one by one on top of what is known.
    pub(in super::super) fn fitted_set(&self, searched: &Searched, set: &[usize]) -> Option<Explanation> {
        let (last, before) = set.split_last()?;
        let parent = match searched.find(before) {
            Some(known) => known.clone(),
            None => self.fitted_set(searched, before)?,
        };
        let trials: Vec<Trial> = self.trials(&parent).into_iter().filter(|trial| trial.hypothesis == *last).collect();
        let promises = self.promises(&parent, &trials);
        self.fit_effect(&parent, &promises.iter().take(FITTED).collect::<Vec<_>>())
    }

    /// The fit of one effect from some of its forms: roughly from each, the best two of them to the end.
    pub(super) fn fit_effect(&self, line: &Explanation, promises: &[&Promise]) -> Option<Explanation> {
        let starts = promises.iter().flat_map(|promise| {
            let strengths: Vec<f64> = promise.strengths.iter().map(|strength| strength.clamp(0.03, FARTHEST)).collect();
            let own = vec![1.0; promise.strengths.len()];
            // Where the first order is wrong, its strength is as well.
            let both = if strengths == own { vec![strengths] } else { vec![strengths, own] };
            both.into_iter()
                .filter_map(|strengths| Some((self.start(line, promise.trial, &strengths, &promise.steps)?, *promise)))
        });
        let starts: Vec<_> = starts.collect();
        let rough = parallel::map(starts, |(start, promise)| self.fitter.fit(&start, Some(&promise.errors), true).ok());
        let mut rough: Vec<Explanation> = rough.into_iter().flatten().collect();
        rough.sort_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()));
        let least = rough.first()?.minus_2_ln_z();
        rough.retain(|found| found.minus_2_ln_z() < least + WORTH_A_FIT);
        rough.truncate(TO_THE_END);
        let ends = parallel::map(rough, |found| self.again(&found));
        // Forms with more parameters must be worth them.
        ends.into_iter().flatten().min_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()))
    }

    /// A fit to the end from where another one ended.
    pub(super) fn again(&self, one: &Explanation) -> Option<Explanation> {
        let start = self.start_at(one, one.mission.clone(), one.unknowns.clone());
        self.fitter.fit(&start, Some(&one.errors), false).ok()
    }

    /// A start of the same effects at other values.
    pub(super) fn start_at(&self, one: &Explanation, mission: Mission, unknowns: Vec<Unknown>) -> Start {
        let choices = self.choices_of(&one.added);
        Start { added: one.added.clone(), mission, unknowns, choices, known: self.nothing() }
    }

    /// The start of a set with one more effect, of some strengths, the other parameters moved as well if that makes sense.
    pub(super) fn start(&self, line: &Explanation, trial: &Trial, strengths: &[f64], steps: &[f64]) -> Option<Start> {
        let hypothesis = &self.hypotheses[trial.hypothesis];
        let scaled = |(table, strength): (&Table, &f64)| {
            let scaled = hypothesis.scaled(&line.mission, table, *strength);
            scaled.map_or_else(|| table.clone(), |(table, _)| table)
        };
        let mut tables = trial.tables.iter().zip(strengths).map(scaled);
        let first = tables.next()?;
        let table = tables.fold(first, |sum, table| larger(&sum, &table));
        self.start_with(line, trial.hypothesis, &table, &trial.tables, steps)
    }

    /// The same with a table; priors are those of the tables that were tried.
    pub(super) fn start_with(
        &self,
        line: &Explanation,
        place: usize,
        table: &Table,
        tried: &[Table],
        steps: &[f64],
    ) -> Option<Start> {
        let hypothesis = &self.hypotheses[place];
        let moved: Vec<f64> = line
            .unknowns
            .iter()
            .zip(steps)
            .map(|(unknown, step)| {
                let prior = unknown.prior?;
                let limited = step.clamp(-prior.longest(), prior.longest());
                Some(prior.value(prior.clamp(prior.coordinate(unknown.parameter.start) + limited)))
            })
            .zip(&line.unknowns)
            .map(|(moved, unknown)| moved.unwrap_or(unknown.parameter.start))
            .collect();
        let with = with_values(&line.mission, &line.unknowns, &moved).unwrap_or_else(|| line.mission.clone());
        let (mission, key) = mission_file::add_effect(&with, hypothesis.kind, table.clone()).ok()?;
        let mut added = line.added.clone();
        let mut keys: Vec<String> = line.unknowns.iter().map(|unknown| unknown.parameter.key.clone()).collect();
        let alone = format!("effects.{}", hypothesis.kind);
        if key != alone {
            // The first of several gets a number.
            let numbered = |known: &mut String| {
                if let Some(rest) = known
                    .strip_prefix(&format!("{alone}."))
                    .filter(|rest| !rest.starts_with(|c: char| c.is_ascii_digit()))
                {
                    *known = format!("{alone}.1.{rest}");
                }
            };
            keys.iter_mut().for_each(numbered);
            for known in &mut added {
                known.free.iter_mut().for_each(numbered);
                if known.key == alone {
                    known.key = format!("{alone}.1");
                }
            }
        }
        let free = hypothesis.free(&key, table, &self.fitter.case.reach);
        let nothing = (effect::find(hypothesis.kind)?.nothing)(self.given);
        let mut unknowns = Vec::new();
        for (known, key) in line.unknowns.iter().zip(&keys) {
            unknowns.push(Unknown { parameter: Parameter::of(&mission, key).ok()?, prior: known.prior });
        }
        for full in &free {
            let parameter = Parameter::of(&mission, full).ok()?;
            let name = full.strip_prefix(&format!("{key}."))?;
            let prior = (!is_event_epoch(full)).then(|| {
                // The prior is that of the trial, not of the strength from which the fit starts.
                let value = tried.iter().filter_map(|table| number(table, name)).find(|value| *value != 0.0);
                let as_tried = parameter.starting_at(value.unwrap_or(parameter.start));
                Prior::of_effect(&as_tried, name, &tried[0], &nothing)
            });
            unknowns.push(Unknown { parameter, prior });
        }
        let choices = self.choices(&free) + self.choices_of(&line.added);
        added.push(Added { hypothesis: place, key, free });
        Some(Start { added, mission, unknowns, choices, known: line.derivatives.clone() })
    }

    /// The best pairs of effects from the base, by their joint signature with rows as weighted there and plainly.
    pub(super) fn pairs(&self, line: &Explanation, trials: &[Trial]) -> Vec<Explanation> {
        let plain = self.plain(line);
        let mut found: Vec<(f64, usize, usize)> = Vec::new();
        for errors in [&line.errors, &plain] {
            let problem = Linear::of(self, line, errors);
            let gains = parallel::map(trials.iter(), |trial| problem.gain(&trial.changes, trial.strength));
            let mut chosen: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
            let mut order: Vec<usize> = (0..trials.len()).filter(|&place| trials[place].changes.len() == 1).collect();
            order.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));
            for place in order {
                let of_effect = chosen.entry(trials[place].hypothesis).or_default();
                if of_effect.len() < 3 {
                    of_effect.push(place);
                }
            }
            let chosen: Vec<usize> = chosen.into_values().flatten().collect();
            let pairs: Vec<(usize, usize)> = (0..chosen.len())
                .flat_map(|a| (a + 1..chosen.len()).map(move |b| (a, b)))
                .map(|(a, b)| (chosen[a], chosen[b]))
                .filter(|(a, b)| trials[*a].hypothesis != trials[*b].hypothesis)
                .collect();
            let joint = problem.gains_of_pairs(trials, &pairs);
            found.extend(pairs.iter().zip(joint).map(|((a, b), gain)| (gain, *a, *b)));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut wanted: Vec<(usize, usize)> = Vec::new();
        let effects = |(a, b): (usize, usize)| {
            (trials[a].hypothesis.min(trials[b].hypothesis), trials[a].hypothesis.max(trials[b].hypothesis))
        };
        for (_, a, b) in found {
            if wanted.iter().all(|known| effects(*known) != effects((a, b))) {
                wanted.push((a, b));
            }
            if wanted.len() == PAIRS {
                break;
            }
        }
        let fit = |(a, b): (usize, usize)| {
            let (a, b) = (&trials[a], &trials[b]);
            let problem = Linear::of(self, line, &line.errors);
            let changes = [a.changes.clone(), b.changes.clone()].concat();
            let found = problem.solve(&changes, Strength::Positive)?;
            let (steps, strengths) = found.split_at(line.unknowns.len());
            let of = |strength: f64| [strength.clamp(0.03, FARTHEST)];
            let first = self.start(line, a, &of(strengths[0]), steps)?;
            let between = self.fitter.fit(&first, None, true).ok()?;
            let start = self.start(&between, b, &of(strengths[1]), &[])?;
            let rough = self.fitter.fit(&start, None, true).ok()?;
            self.again(&rough)
        };
        parallel::map(wanted, fit).into_iter().flatten().collect()
    }
}
