//! The search: sets of effects, the best first, by their evidence.
//!
//! At a fitted set, every form of every other effect is evaluated once. Its strength is solved for together with the free parameters,
//! and the likelihood of what remains is computed with all errors estimated anew, since rows that look wrong without an effect may
//! be its signature. The most promising are fitted. The best few sets are carried on, up to three effects, until none of the larger
//! sets has better evidence. Pairs are also tried from the base: each of two effects may help only beside the other. Laws of the
//! measurement go through the same fits, beside the ranking: they imitate almost any physics.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use toml::Table;

use super::explanation::{Explanation, Fitter, Start, Unknown, volume};
use super::fitted_model::Added;
use super::formula::{Argument, Formula, laws};
use super::hypothesis::{FARTHEST, Hypothesis};
use super::options::Progress;
use super::prior::{Prior, number};
use super::result::{Reason, Suggestion};
use super::unrecorded;
use crate::analysis::fit;
use crate::analysis::fit::parameter::Parameter;
use crate::analysis::likelihood::{Errors, minus_2_ln_l};
use crate::analysis::measurement::DataSet;
use crate::effect;
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission_file;
use crate::numeric::parallel;

/// Prior probability that what is missing is an effect of the catalogue, and that it is a law of the measurement.
const EFFECTS: f64 = 0.9;
const LAWS: f64 = 0.1;

/// Effects in a set at most.
const MOST: usize = 3;

/// Sets carried on; effects fitted on top of each, and more if they are as close to the last of them as this.
const LINES: usize = 3;
const BREADTH: usize = 6;
const MORE: usize = 10;
const CLOSE: f64 = 10.0;

/// Forms of an effect whose remaining errors are estimated anew, for each of the two ways to weigh rows; and those that are fitted, of which
/// one is enough beside effects that leave only noise.
const SHORTLISTED: usize = 3;
const FITTED: usize = 3;

/// Rough fits that are followed to their end.
const TO_THE_END: usize = 2;

/// Pairs that are fitted from the base.
const PAIRS: usize = 4;

/// Evidence up to which a set counts as a rival, or is fitted to the end: −2 ln Z within this of the best.
const NEAR: f64 = 20.0;

/// Rounds in which weights and strengths are estimated in turn.
const ROUNDS: usize = 2;

/// Difference of −2 ln L below which two fits are the same.
const SAME: f64 = 0.5;

/// Decrease of −2 ln L for which a set is fitted again from another start.
const BETTER_START: f64 = 2.0;

/// Sets that are scanned, the steps of logarithms, and the excess of −2 ln L, to first order, up to which a fit starts there.
const SCANNED: usize = 8;
const SCAN_LN: [f64; 6] = [-3.0, -1.5, -0.7, 0.7, 1.5, 3.0];
const WORTH_A_FIT: f64 = 20.0;

/// Laws that are also tried on top of the sets that are not among the best.
const LAWS_ELSEWHERE: usize = 5;

/// Scatter of temperatures that no column records, K: that of a thermostat, of a radiator, of a detector without either.
const SCATTERS_K: [f64; 3] = [0.5, 1.5, 5.0];

/// A law changes values by about this share, or by this many typical errors.
const LAW_SHARE: f64 = 0.3;

/// One form of an effect at a fitted set: tables whose changes of the predictions add.
struct Trial {
    hypothesis: usize,
    tables: Vec<Table>,
    /// Changes of the predictions, in their units.
    changes: Vec<Vec<f64>>,
    strength: Strength,
}

/// What is known of the strength of a trial.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Strength {
    /// As it is.
    Fixed,
    /// Not below zero.
    Positive,
}

/// What a trial promises.
#[derive(Clone)]
struct Promise<'t> {
    trial: &'t Trial,
    /// −2 ln L and priors that it may reach, with its parameters' price.
    objective: f64,
    /// Factors on the strengths of its tables.
    strengths: Vec<f64>,
    /// Steps of the other parameters.
    steps: Vec<f64>,
    errors: Vec<Errors>,
    /// value − model, to first order.
    left: Vec<f64>,
}

/// A law of the measurement on top of a set.
pub(super) struct WithLaw {
    pub law: Law,
    /// Values of its parameters.
    pub values: Vec<f64>,
    /// The effects beside it.
    pub beside: Vec<usize>,
    pub minus_2_ln_z: f64,
    pub minus_2_ln_l: f64,
    /// The errors with it, and what it leaves (value − model).
    pub errors: Vec<Errors>,
    pub left: Vec<f64>,
}

impl WithLaw {
    /// As a formula to start from, if it is one.
    pub fn suggestion(&self, minus_2_ln_l: f64) -> Option<Suggestion> {
        let Law::Formula(law) = &self.law else { return None };
        let step_yr = match law.argument {
            Argument::Above(_, limit) => Some(limit),
            _ => None,
        };
        let chi2 = [minus_2_ln_l, self.minus_2_ln_l];
        Some(Suggestion { toml: law.toml(&self.values), chi2, is_law: true, is_fitted: true, step_yr })
    }

    /// For a verdict that names it.
    pub fn reason(&self, beside: Vec<String>) -> Reason {
        if let Law::Number { key, given, right } = &self.law {
            return Reason::WrongNumber { key: key.clone(), given: given.clone(), right: right.clone(), beside };
        }
        let target = match &self.law {
            Law::Formula(law) => law.target(),
            _ => "value".into(),
        };
        Reason::BetterLaw { target, expression: self.law.expression(), beside }
    }
}

/// Everything that was fitted.
pub(super) struct Searched {
    /// One for each set, best evidence first.
    pub sets: Vec<Explanation>,
    /// The best with a law, if there are any.
    pub law: Option<WithLaw>,
    /// With another value of a number of the mission, the best first.
    pub numbers: Vec<WithLaw>,
    /// What each effect alone leaves to first order (value − model), by its index, and whether its strength is free; None if it changes
    /// nothing.
    pub alone: Vec<Option<(Vec<f64>, bool)>>,
}

impl Searched {
    /// The mission as given, with its free keys fitted.
    pub fn base(&self) -> &Explanation {
        self.find(&[]).expect("it is fitted first")
    }

    /// The fit of a set.
    pub fn find(&self, set: &[usize]) -> Option<&Explanation> {
        self.sets.iter().find(|known| known.set() == set)
    }
}

/// Sets of effects for some data.
pub(super) struct SetSearch<'a> {
    pub fitter: Fitter<'a>,
    pub given: &'a Mission,
    pub hypotheses: &'a [Hypothesis],
    /// Keys that are free from the start.
    pub free: &'a [String],
    pub progress: &'a Progress<'a>,
}

impl SetSearch<'_> {
    /// The mission as given, without a search.
    ///
    /// # Errors
    /// If it has no value for a row.
    pub fn base_alone(&self) -> Result<Searched, InputError> {
        Ok(Searched {
            sets: vec![self.bases()?.remove(0)],
            law: None,
            numbers: Vec::new(),
            alone: vec![None; self.hypotheses.len()],
        })
    }

    /// The whole search.
    ///
    /// # Errors
    /// If the mission as given has no value for a row.
    pub fn run(&self) -> Result<Searched, InputError> {
        (self.progress.stage)("fit of the mission as given", 0);
        let mut lines = self.bases()?;
        let base = lines[0].clone();
        let mut all = vec![base.clone()];
        let mut alone: Vec<Option<(Vec<f64>, bool)>> = vec![None; self.hypotheses.len()];
        for size in 1..=MOST {
            let step = ["", "single effects", "two effects", "three effects"][size];
            if !self.fitter.case.work.allows(step) {
                break;
            }
            (self.progress.stage)(step, lines.len() as u64);
            let mut children: Vec<Explanation> = Vec::new();
            for (place, line) in lines.iter().enumerate() {
                // Beside a smaller set that leaves only noise, another of as many effects as this line will have cannot be better; nor is
                // there more to find on top of another fit of the mission as given.
                let is_explained = all.iter().any(|one| one.added.len() < size && self.is_noise(one));
                let is_found = size == 1 && children.iter().any(|one| self.is_noise(one));
                if is_explained && line.minus_2_ln_z() > best(&lines) || is_found && place > 0 {
                    break;
                }
                let trials = self.trials(line);
                let promises = self.promises(line, &trials);
                if size == 1 {
                    for promise in &promises {
                        let is_free = promise.trial.strength != Strength::Fixed;
                        alone[promise.trial.hypothesis].get_or_insert_with(|| (promise.left.clone(), is_free));
                    }
                }
                let known =
                    |set: &[usize]| children.iter().find(|known| known.set() == set).map(|known| known.objective());
                let forms = if is_explained { 1 } else { FITTED };
                let found = self.fitted(line, &promises, forms, &known);
                children.extend(found);
                if size == 1 {
                    children.extend(self.pairs(line, &trials));
                }
                self.progress.step();
            }
            all.extend(children);
            all = distinct(all);
            let of = |sizes: std::ops::Range<usize>| {
                let some = all.iter().filter(|one| sizes.contains(&one.added.len()));
                some.map(Explanation::minus_2_ln_z).fold(f64::INFINITY, f64::min)
            };
            // A pair may be better although neither of its effects is.
            if of(size..MOST + 1) >= of(0..size) {
                break;
            }
            lines = all.iter().filter(|one| one.added.len() == size).take(LINES).cloned().collect();
        }
        let mut sets = self.refined(distinct(all));
        sets.sort_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()));
        let law = self.best_law(&base, &sets);
        (self.progress.stage)("numbers of the mission", 0);
        let best = sets.first().filter(|best| !best.added.is_empty());
        let mut numbers: Vec<WithLaw> =
            [&base].into_iter().chain(best).flat_map(|line| self.numbers_of(line)).collect();
        numbers.sort_by(|a, b| a.minus_2_ln_z.total_cmp(&b.minus_2_ln_z));
        Ok(Searched { sets, law, numbers, alone })
    }

    /// 2 ln of the number of effects over their probability, and of the intervals of an event.
    fn choices(&self, free: &[String]) -> f64 {
        let intervals = self.fitter.case.reach.epochs_yr.len().saturating_sub(1).max(1) as f64;
        let events = free.iter().filter(|key| is_event_epoch(key)).count() as f64;
        2.0 * (self.hypotheses.len() as f64 / EFFECTS).ln() + events * 2.0 * intervals.ln()
    }

    /// No derivatives are known.
    fn nothing(&self) -> DMatrix<f64> {
        DMatrix::zeros(self.fitter.case.n(), 0)
    }

    /// The mission as given with its free keys fitted, from its own values and from those of least squares; the best first. What is
    /// missing may have driven free keys far, where no effect on them changes anything: effects are tried on top of both.
    fn bases(&self) -> Result<Vec<Explanation>, InputError> {
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
    fn least_squares(&self, mission: &Mission, keys: &[String]) -> Option<Mission> {
        let options = fit::Options { scan: false, moments: false, ..fit::Options::default() };
        let count = |_| self.fitter.case.work.count();
        let model = self.fitter.model.like(mission);
        fit::fit_rows(&model, self.fitter.case.data, keys, &options, &count, |_| true).ok().map(|fit| fit.mission)
    }

    /// A set from its values of least squares: rows that look wrong may be right at other values, where slopes without them never lead.
    fn with_all_rows(&self, one: &Explanation) -> Option<Explanation> {
        let is_wrong = |errors: &Errors| errors.right.iter().any(|right| *right < 0.5);
        if !one.errors.iter().any(is_wrong) {
            return None;
        }
        let moving = one.unknowns.iter().filter(|unknown| unknown.prior.is_some());
        let keys: Vec<String> = moving.map(|unknown| unknown.parameter.key.clone()).collect();
        let mission = self.least_squares(&one.mission, &keys)?;
        let unknowns = one.unknowns.iter().map(|unknown| {
            let parameter = Parameter::of(&mission, &unknown.parameter.key).ok()?;
            Some(Unknown { parameter, prior: unknown.prior })
        });
        let unknowns = unknowns.collect::<Option<Vec<Unknown>>>()?;
        let choices = self.choices_of(&one.added);
        let start = Start { added: one.added.clone(), mission, unknowns, choices, known: self.nothing() };
        let found = self.fitter.fit(&start, None, false).ok()?;
        (found.objective() < one.objective()).then_some(found)
    }

    /// Every form of every effect on top of a set, evaluated once.
    fn trials(&self, line: &Explanation) -> Vec<Trial> {
        let model = self.fitter.model.like(&line.mission);
        let reach = self.fitter.case.reach.with_dose(|t_yr| model.dose_mev_g(t_yr).ok());
        let set = line.set();
        let mut wanted: Vec<(usize, Vec<Table>, Strength)> = Vec::new();
        for (place, hypothesis) in self.hypotheses.iter().enumerate() {
            let is_new =
                if set.contains(&place) { hypothesis.may_repeat() } else { hypothesis.is_new_to(&line.mission) };
            if !is_new {
                continue;
            }
            for tables in hypothesis.ways(&line.mission, &reach) {
                let has_strength = !hypothesis.free("", &tables[0], &reach).is_empty();
                let strength = if has_strength { Strength::Positive } else { Strength::Fixed };
                wanted.push((place, tables, strength));
            }
        }
        let evaluated = parallel::map(wanted, |(hypothesis, tables, strength)| {
            let kind = self.hypotheses[hypothesis].kind;
            let change = |table: &Table| {
                let (mission, _) = mission_file::add_effect(&line.mission, kind, table.clone()).ok()?;
                let moved = self.fitter.predicted(&mission)?;
                Some(moved.iter().zip(&line.model).map(|(moved, model)| moved - model).collect::<Vec<f64>>())
            };
            let changes = tables.iter().map(change).collect::<Option<Vec<_>>>()?;
            let moves = changes.iter().flatten().any(|change| *change != 0.0);
            moves.then_some(Trial { hypothesis, tables, changes, strength })
        });
        evaluated.into_iter().flatten().collect()
    }

    /// What the best forms of each effect promise, those of the same effect together, the best effect first.
    fn promises<'t>(&self, line: &Explanation, trials: &'t [Trial]) -> Vec<Promise<'t>> {
        let plain = self.plain(line);
        let problems = [&line.errors, &plain].map(|errors| Linear::of(self, line, errors));
        let mut by_effect: BTreeMap<usize, Vec<&Trial>> = BTreeMap::new();
        for trial in trials {
            by_effect.entry(trial.hypothesis).or_default().push(trial);
        }
        let mut shortlist: Vec<&Trial> = Vec::new();
        for trials in by_effect.into_values() {
            let mut chosen: Vec<usize> = Vec::new();
            for problem in &problems {
                let gains = parallel::map(trials.iter(), |trial| problem.gain(&trial.changes, trial.strength));
                let mut order: Vec<usize> = (0..trials.len()).collect();
                order.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));
                order.truncate(SHORTLISTED);
                chosen.extend(order);
            }
            chosen.sort_unstable();
            chosen.dedup();
            shortlist.extend(chosen.into_iter().map(|place| trials[place]));
        }
        let promises = parallel::map(shortlist, |trial| self.promise(line, &plain, trial));
        let mut promises: Vec<Promise> = promises.into_iter().flatten().collect();
        promises.sort_by(|a, b| a.objective.total_cmp(&b.objective).then(a.trial.hypothesis.cmp(&b.trial.hypothesis)));
        let mut order: Vec<usize> = Vec::new();
        for promise in &promises {
            if !order.contains(&promise.trial.hypothesis) {
                order.push(promise.trial.hypothesis);
            }
        }
        let rank = |promise: &Promise| order.iter().position(|place| *place == promise.trial.hypothesis);
        promises.sort_by_key(|promise| rank(promise));
        promises
    }

    /// Errors with every row right, from the scatter of the residuals.
    fn plain(&self, line: &Explanation) -> Vec<Errors> {
        let all_right =
            |errors: &Errors| Errors { right: vec![1.0; errors.right.len()], correlation: 0.0, ..errors.clone() };
        line.errors.iter().map(all_right).collect()
    }

    /// What a trial promises, with all errors estimated anew at what it leaves.
    fn promise<'t>(&self, line: &Explanation, plain: &[Errors], trial: &'t Trial) -> Option<Promise<'t>> {
        let price =
            self.hypotheses[trial.hypothesis].parameters(&trial.tables[0], &self.fitter.case.reach) as f64 * 2.0;
        let mut best: Option<Promise> = None;
        for from in [&line.errors[..], plain] {
            let mut errors = from.to_vec();
            for _ in 0..ROUNDS {
                let problem = Linear::of(self, line, &errors);
                let Some(found) = problem.solve(&trial.changes, trial.strength) else { break };
                let left = problem.left(line, &found, &trial.changes);
                errors = self.fitter.likelihood.errors(&left, Some(&errors));
                let objective = minus_2_ln_l(&errors) + problem.prior(&found) + price;
                if best.as_ref().is_none_or(|best| objective < best.objective) {
                    let (steps, strengths) = found.split_at(line.unknowns.len());
                    best = Some(Promise {
                        trial,
                        objective,
                        strengths: strengths.to_vec(),
                        steps: steps.to_vec(),
                        errors: errors.clone(),
                        left,
                    });
                }
            }
        }
        best
    }

    /// Fits of the most promising effects on top of a set. `known` is the objective of a set that was already fitted.
    fn fitted(
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
    pub fn fitted_set(&self, searched: &Searched, set: &[usize]) -> Option<Explanation> {
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
    fn fit_effect(&self, line: &Explanation, promises: &[&Promise]) -> Option<Explanation> {
        let starts = promises.iter().flat_map(|promise| {
            let strengths: Vec<f64> = promise.strengths.iter().map(|strength| strength.clamp(0.03, FARTHEST)).collect();
            let own = vec![1.0; promise.strengths.len()];
            // Where the first order is wrong, its strength is as well.
            let both = if strengths == own { vec![strengths] } else { vec![strengths, own] };
            both.into_iter()
                .filter_map(|strengths| Some((self.start(line, promise.trial, &strengths, &promise.steps)?, *promise)))
        });
        let starts: Vec<_> = starts.collect();
        let rough = parallel::map(starts, |(start, promise)| {
            let found = self.fitter.fit(&start, Some(&promise.errors), true).ok()?;
            Some((start, found))
        });
        let mut rough: Vec<(Start, Explanation)> = rough.into_iter().flatten().collect();
        rough.sort_by(|a, b| a.1.minus_2_ln_z().total_cmp(&b.1.minus_2_ln_z()));
        let least = rough.first()?.1.minus_2_ln_z();
        rough.retain(|(_, found)| found.minus_2_ln_z() < least + WORTH_A_FIT);
        rough.truncate(TO_THE_END);
        let ends = parallel::map(rough, |(start, found)| self.again(&start, &found));
        // Forms with more parameters must be worth them.
        ends.into_iter().flatten().min_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()))
    }

    /// A fit to the end from a rough one.
    fn again(&self, start: &Start, rough: &Explanation) -> Option<Explanation> {
        let start = Start {
            added: start.added.clone(),
            mission: rough.mission.clone(),
            unknowns: rough.unknowns.clone(),
            choices: start.choices,
            known: self.nothing(),
        };
        self.fitter.fit(&start, Some(&rough.errors), false).ok()
    }

    /// The start of a set with one more effect, of some strengths, the other parameters moved as well if that makes sense.
    fn start(&self, line: &Explanation, trial: &Trial, strengths: &[f64], steps: &[f64]) -> Option<Start> {
        let hypothesis = &self.hypotheses[trial.hypothesis];
        let scaled = |(table, strength): (&Table, &f64)| {
            let scaled = hypothesis.scaled(&line.mission, table, *strength);
            scaled.map_or_else(|| table.clone(), |(table, _)| table)
        };
        let mut tables = trial.tables.iter().zip(strengths).map(scaled);
        let first = tables.next()?;
        let table = tables.fold(first, |sum, table| super::hypothesis::larger(&sum, &table));
        self.start_with(line, trial.hypothesis, &table, &trial.tables, steps)
    }

    /// The same with a table; priors are those of the tables that were tried.
    fn start_with(
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
        let with = super::explanation::with_values(&line.mission, &line.unknowns, &moved)
            .unwrap_or_else(|| line.mission.clone());
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

    pub(super) fn choices_of(&self, added: &[Added]) -> f64 {
        added.iter().map(|added| self.choices(&added.free)).sum()
    }

    /// The best pairs of effects from the base, by their joint signature with rows as weighted there and plainly.
    fn pairs(&self, line: &Explanation, trials: &[Trial]) -> Vec<Explanation> {
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
            self.again(&start, &rough)
        };
        parallel::map(wanted, fit).into_iter().flatten().collect()
    }

    /// Sets that matter, fitted to their end; a set that is worse than one of its subsets starts again from it, with almost no
    /// strength.
    fn refined(&self, sets: Vec<Explanation>) -> Vec<Explanation> {
        let least = best(&sets);
        let matters = |one: &Explanation| one.minus_2_ln_z() < least + NEAR;
        let again = |one: &Explanation| {
            let start = Start {
                added: one.added.clone(),
                mission: one.mission.clone(),
                unknowns: one.unknowns.clone(),
                choices: self.choices_of(&one.added),
                known: self.nothing(),
            };
            if matters(one) && !one.added.is_empty() {
                self.fitter
                    .fit(&start, Some(&one.errors), false)
                    .ok()
                    .filter(|found| found.objective() < one.objective())
            } else {
                None
            }
        };
        let better = parallel::map(sets.iter(), again);
        let mut sets: Vec<Explanation> =
            sets.into_iter().zip(better).map(|(one, better)| better.unwrap_or(one)).collect();
        sets.sort_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()));
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

    /// Whether a fit leaves no more than noise usually does, with the errors as quoted: −2 ln L within three of its standard deviations.
    fn is_noise(&self, one: &Explanation) -> bool {
        let n = self.fitter.case.n() as f64;
        one.minus_2_ln_l < n + 3.0 * (2.0 * n).sqrt()
    }

    /// A set from other values of its parameters: a narrow minimum, or one far away, is not reached by slopes. Each parameter that is
    /// known by its size is moved while the others follow to first order; the most promising are fitted.
    fn scanned(&self, one: &Explanation) -> Explanation {
        let at: Vec<f64> = one.unknowns.iter().map(|unknown| unknown.parameter.start).collect();
        let places = (0..at.len()).filter(|&index| one.unknowns[index].prior.is_some_and(|prior| prior.is_size()));
        let wanted: Vec<(usize, f64)> = places.flat_map(|index| SCAN_LN.map(|step| (index, step))).collect();
        let looked = parallel::map(wanted, |(index, step)| {
            let prior = one.unknowns[index].prior?;
            let coordinate = prior.coordinate(at[index]);
            let mut moved = at.clone();
            moved[index] = prior.value(prior.clamp(coordinate + step));
            let mission = super::explanation::with_values(&one.mission, &one.unknowns, &moved)?;
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
            let mission = super::explanation::with_values(&one.mission, &one.unknowns, &at)?;
            let unknowns = one.unknowns.iter().zip(&at).map(|(unknown, value)| Unknown {
                parameter: unknown.parameter.starting_at(*value),
                prior: unknown.prior,
            });
            let start = Start {
                added: one.added.clone(),
                mission,
                unknowns: unknowns.collect(),
                choices: self.choices_of(&one.added),
                known: self.nothing(),
            };
            self.fitter.fit(&start, Some(&errors), false).ok()
        });
        let best = fits.into_iter().flatten().min_by(|a, b| a.objective().total_cmp(&b.objective()));
        best.filter(|best| best.objective() < one.objective()).unwrap_or_else(|| one.clone())
    }

    /// The best law of the measurement, on top of the base or of the best sets; the best laws there also on top of all others, since an
    /// effect may be seen only beside a law. Laws are linear: their evidence needs no evaluation.
    fn best_law(&self, base: &Explanation, sets: &[Explanation]) -> Option<WithLaw> {
        (self.progress.stage)("laws of the measurement", 0);
        let (first, rest) = sets.split_at(sets.len().min(LINES));
        let mut lines: Vec<&Explanation> = first.iter().collect();
        if lines.iter().all(|line| !line.added.is_empty()) {
            lines.push(base);
        }
        let mut found: Vec<WithLaw> = lines.iter().flat_map(|line| self.laws_of(line, |_| true)).collect();
        found.sort_by(|a, b| a.minus_2_ln_z.total_cmp(&b.minus_2_ln_z));
        let best: Vec<String> = found.iter().take(LAWS_ELSEWHERE).map(|found| found.law.expression()).collect();
        found.extend(rest.iter().flat_map(|line| self.laws_of(line, |law| best.contains(&law.expression()))));
        found.into_iter().min_by(|a, b| a.minus_2_ln_z.total_cmp(&b.minus_2_ln_z))
    }

    /// Some laws on top of a set.
    fn laws_of(&self, line: &Explanation, wanted: impl Fn(&Law) -> bool) -> Vec<WithLaw> {
        let data = || self.fitter.case.data.iter();
        let formulas = laws(self.fitter.case.data).into_iter();
        let formulas = formulas.map(|law| (law.columns(data(), &line.model), Law::Formula(law)));
        let groups = groups_of_rows(self.fitter.case.data).into_iter().flat_map(|(name, members)| {
            let column = |(_, rows): &Group, of: &dyn Fn(usize) -> f64| {
                let mut column = vec![0.0; line.model.len()];
                rows.iter().for_each(|&row| column[row] = of(row));
                column
            };
            let times = |group: &Group| column(group, &|row| line.model[row]);
            let one = |group: &Group| {
                let law = |multiplied| Law::Group { column: name.clone(), value: group.0.clone(), multiplied };
                [(vec![times(group)], law(true)), (vec![column(group, &|_| 1.0)], law(false))]
            };
            let mut all: Vec<_> = members.iter().flat_map(one).collect();
            if members.len() <= GROUPS {
                all.push((members.iter().map(times).collect(), Law::Groups(name.clone())));
            }
            all
        });
        let mut all: Vec<(Vec<Vec<f64>>, Law)> = formulas.chain(groups).collect();
        let temperatures = SCATTERS_K.map(Law::Temperatures);
        if temperatures.iter().any(&wanted) {
            let model = self.fitter.model.like(&line.mission);
            let columns = unrecorded::per_kelvin(self.fitter.case, &model, &line.model);
            all.extend(columns.iter().flat_map(|columns| temperatures.clone().map(|law| (columns.clone(), law))));
        }
        let choices = 2.0 * (all.len().max(1) as f64 / LAWS).ln();
        let some: Vec<_> = all.into_iter().filter(|(_, law)| wanted(law)).collect();
        parallel::map(some, |(columns, law)| self.with_law(line, law, &columns, choices))
            .into_iter()
            .flatten()
            .collect()
    }

    /// Evidence of a set with a law; None if the free parameters do the same.
    fn with_law(&self, line: &Explanation, law: Law, columns: &[Vec<f64>], choices: f64) -> Option<WithLaw> {
        let widths = law.widths(columns, &line.model);
        let plain = self.plain(line);
        let mut best: Option<WithLaw> = None;
        for from in [&line.errors, &plain] {
            let mut errors = from.clone();
            for _ in 0..ROUNDS {
                let problem = Linear::of(self, line, &errors);
                let found = problem.solve_any(columns, &widths)?;
                let left = problem.left(line, &found, columns);
                errors = self.fitter.likelihood.errors(&left, Some(&errors));
                let values = found[line.unknowns.len()..].to_vec();
                let priors: f64 = values.iter().zip(&widths).map(|(value, width)| (value / width).powi(2)).sum();
                let steps = if matches!(&law, Law::Formula(law) if matches!(law.argument, Argument::Above(..))) {
                    2.0
                } else {
                    0.0
                };
                let price =
                    self.volume_with(line, &errors, columns, &widths) + choices + steps + self.choices_of(&line.added);
                let l = minus_2_ln_l(&errors);
                let minus_2_ln_z = l + problem.prior(&found) + priors + price;
                if best.as_ref().is_none_or(|best| minus_2_ln_z < best.minus_2_ln_z) {
                    best = Some(WithLaw {
                        law: law.clone(),
                        values,
                        beside: line.set(),
                        minus_2_ln_z,
                        minus_2_ln_l: l,
                        errors: errors.clone(),
                        left,
                    });
                }
            }
        }
        let multiplies_too_much = |found: &WithLaw| match &law {
            Law::Formula(law) => {
                let factors = law.factors(self.fitter.case.data.iter(), &line.model, &found.values);
                !factors.is_empty() && factors.iter().all(|factor| factor.abs() > IN_PLACE)
            }
            _ => false,
        };
        best.filter(|best| !multiplies_too_much(best))
    }

    /// A set with a change of its predictions.
    pub(super) fn with_fixed(&self, line: &Explanation, changes: &[f64]) -> Option<LineFit> {
        let columns = [changes.to_vec()];
        let plain = self.plain(line);
        let mut best: Option<LineFit> = None;
        for from in [&line.errors, &plain] {
            let mut errors = from.clone();
            for _ in 0..ROUNDS {
                let problem = Linear::of(self, line, &errors);
                let found = problem.solve(&columns, Strength::Fixed)?;
                let left = problem.left(line, &found, &columns);
                errors = self.fitter.likelihood.errors(&left, Some(&errors));
                let l = minus_2_ln_l(&errors);
                let objective = l + problem.prior(&found[..line.unknowns.len()]);
                if best.as_ref().is_none_or(|best| objective < best.objective) {
                    best = Some(LineFit { objective, minus_2_ln_l: l, errors: errors.clone(), left });
                }
            }
        }
        best
    }

    /// ln det(1 + Π A'A Π) with further columns.
    pub(super) fn volume_with(
        &self,
        line: &Explanation,
        errors: &[Errors],
        columns: &[Vec<f64>],
        widths: &[f64],
    ) -> f64 {
        let further: Vec<DVector<f64>> = columns.iter().map(|column| DVector::from_column_slice(column)).collect();
        let own = line.derivatives.column_iter().map(|column| column.into_owned());
        let all: Vec<DVector<f64>> = own.chain(further).collect();
        if all.is_empty() {
            return 0.0;
        }
        let white = self.fitter.whitened(errors, &DMatrix::from_columns(&all));
        let own = line.unknowns.iter().map(|unknown| unknown.prior.map_or(0.0, |prior| prior.width));
        volume(&white, &own.chain(widths.iter().copied()).collect::<Vec<f64>>())
    }
}

/// A law of the measurement.
#[derive(Clone)]
pub(super) enum Law {
    /// As a formula.
    Formula(Formula),
    /// A factor, or a constant, of its own for the rows with one value of a column.
    Group { column: String, value: String, multiplied: bool },
    /// For every word or value of a column.
    Groups(String),
    /// A temperature of its own at every epoch, in files that do not record it, with this scatter in K.
    Temperatures(f64),
    /// No law, but another value of a number of the mission.
    Number { key: String, given: String, right: String },
}

/// A set with one fixed change of its predictions, the other parameters and errors following to first order.
pub(super) struct LineFit {
    /// −2 ln L and the priors' part.
    pub objective: f64,
    pub minus_2_ln_l: f64,
    pub errors: Vec<Errors>,
    /// value − model.
    pub left: Vec<f64>,
}

impl Law {
    /// In words, as a formula where it is one.
    pub fn expression(&self) -> String {
        match self {
            Law::Formula(law) => law.expression(),
            Law::Group { column, value, multiplied: true } => format!("value * (1 + a) where {column} is {value}"),
            Law::Group { column, value, multiplied: false } => format!("value + a where {column} is {value}"),
            Law::Groups(column) => format!("value * (1 + a), with another a for every {column}"),
            Law::Number { key, given, right } => format!("{key} = {right} in place of {given}"),
            Law::Temperatures(scatter_k) => {
                format!("value at temperature_k + a, with another a for every t_yr, of some {scatter_k} K")
            }
        }
    }

    /// Prior widths of its parameters.
    fn widths(&self, columns: &[Vec<f64>], model: &[f64]) -> Vec<f64> {
        if let Law::Temperatures(scatter_k) = self {
            return vec![*scatter_k; columns.len()];
        }
        let largest = |column: &[f64]| column.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let typical = largest(model);
        columns.iter().map(|column| LAW_SHARE * typical / largest(column).max(f64::MIN_POSITIVE)).collect()
    }
}

/// Values of a column at most for which rows with one of them are a group: of one that is no condition of the model, and of a condition,
/// such as the pixel of a trail.
const GROUPS: usize = 12;
const VALUES: usize = 40;

/// A word or value of a column, and the rows that have it.
type Group = (String, Vec<usize>);

/// Rows with the same word or value in a column, by the name of the column; two groups or more.
fn groups_of_rows(data: &[DataSet]) -> Vec<(String, Vec<Group>)> {
    let mut names: Vec<&String> = data.iter().flat_map(|set| &set.varying).collect();
    names.sort();
    names.dedup();
    let of = |name: &&String| {
        if ["galaxy", "date"].contains(&name.as_str()) {
            return None;
        }
        let is_condition = crate::physics::conditions::NAMES.contains(&name.as_str());
        let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        let mut first = 0;
        for set in data {
            let values = set.against(name);
            for (row, value) in values.into_iter().enumerate().filter(|(_, value)| value.is_finite()) {
                let word = set.rows[row].word(name).map_or_else(|| value.to_string(), str::to_string);
                groups.entry(word).or_default().push(first + row);
            }
            first += set.rows.len();
        }
        let most = if is_condition { VALUES } else { GROUPS };
        (2..=most).contains(&groups.len()).then(|| (name.to_string(), groups.into_iter().collect()))
    };
    names.iter().filter_map(of).collect()
}

/// A law that multiplies every value by more takes the place of the model, whose own traps then hardly count.
const IN_PLACE: f64 = 10.0;

fn is_event_epoch(key: &str) -> bool {
    key.starts_with("effects.") && key.ends_with(".t_yr")
}

/// The least −2 ln Z.
fn best(sets: &[Explanation]) -> f64 {
    sets.iter().map(Explanation::minus_2_ln_z).fold(f64::INFINITY, f64::min)
}

/// The best fit of each set, best evidence first.
fn distinct(mut sets: Vec<Explanation>) -> Vec<Explanation> {
    sets.sort_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()).then(a.set().cmp(&b.set())));
    let mut kept: Vec<Explanation> = Vec::new();
    for one in sets {
        if kept.iter().all(|known| known.set() != one.set()) {
            kept.push(one);
        }
    }
    kept
}

/// The linear problem at a set: steps of its parameters, and strengths of columns, for errors as given.
struct Linear {
    whitener: crate::analysis::likelihood::Whitener,
    residuals: DVector<f64>,
    /// Whitened derivatives.
    derivatives: DMatrix<f64>,
    /// Of each parameter: distance to its prior's mean, and its width; None if it stays.
    priors: Vec<Option<(f64, f64)>>,
    off: Vec<f64>,
}

impl Linear {
    fn of(search: &SetSearch, line: &Explanation, errors: &[Errors]) -> Linear {
        Linear::without(search, line, errors, None)
    }

    /// The same with one parameter held.
    fn without(search: &SetSearch, line: &Explanation, errors: &[Errors], held: Option<usize>) -> Linear {
        let whitener = search.fitter.likelihood.whitener(errors);
        let off = search.fitter.likelihood.off(&line.model);
        let derivatives: Vec<DVector<f64>> =
            line.derivatives.column_iter().map(|column| whitener.apply(column.as_slice())).collect();
        let derivatives =
            if derivatives.is_empty() { DMatrix::zeros(off.len(), 0) } else { DMatrix::from_columns(&derivatives) };
        let derivatives = match held {
            Some(held) => {
                let mut derivatives = derivatives;
                derivatives.column_mut(held).fill(0.0);
                derivatives
            }
            None => derivatives,
        };
        let prior = |(index, unknown): (usize, &Unknown)| {
            let prior = unknown.prior.filter(|_| Some(index) != held)?;
            Some((prior.pull(prior.coordinate(unknown.parameter.start)), prior.width))
        };
        Linear {
            residuals: whitener.apply(&off),
            whitener,
            derivatives,
            priors: line.unknowns.iter().enumerate().map(prior).collect(),
            off,
        }
    }

    /// Normal matrix and right-hand side of parameters and further columns.
    fn normal(&self, white: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let (k, q) = (self.derivatives.ncols(), white.ncols());
        let all = DMatrix::from_fn(self.residuals.len(), k + q, |row, column| {
            if column < k { self.derivatives[(row, column)] } else { white[(row, column - k)] }
        });
        let mut normal = all.tr_mul(&all);
        let mut right = all.tr_mul(&self.residuals);
        for (index, prior) in self.priors.iter().enumerate() {
            match prior {
                Some((apart, width)) => {
                    normal[(index, index)] += width.powi(-2);
                    right[index] += apart / (width * width);
                }
                None => normal[(index, index)] += 1.0,
            }
        }
        (normal, right)
    }

    fn white(&self, columns: &[Vec<f64>]) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = columns.iter().map(|column| self.whitener.apply(column)).collect();
        if columns.is_empty() { DMatrix::zeros(self.residuals.len(), 0) } else { DMatrix::from_columns(&columns) }
    }

    /// Decrease of the sum of squares with some columns.
    fn gain(&self, columns: &[Vec<f64>], strength: Strength) -> f64 {
        let Some(found) = self.solve(columns, strength) else { return 0.0 };
        let squares = |found: &[f64]| {
            let mut left = self.residuals.clone();
            for (column, value) in self.derivatives.column_iter().zip(found) {
                left -= column * *value;
            }
            for (column, value) in self.white(columns).column_iter().zip(&found[self.derivatives.ncols()..]) {
                left -= column * *value;
            }
            left.norm_squared() + self.prior(found)
        };
        self.residuals.norm_squared() + self.prior(&vec![0.0; self.priors.len()]) - squares(&found)
    }

    /// Steps of the parameters, then strengths of the columns.
    fn solve(&self, columns: &[Vec<f64>], strength: Strength) -> Option<Vec<f64>> {
        let k = self.derivatives.ncols();
        if strength == Strength::Fixed {
            let mut fixed = self.residuals.clone();
            for column in self.white(columns).column_iter() {
                fixed -= column;
            }
            let (normal, _) = self.normal(&DMatrix::zeros(self.residuals.len(), 0));
            let mut right = self.derivatives.tr_mul(&fixed);
            for (index, prior) in self.priors.iter().enumerate() {
                right[index] += prior.map_or(0.0, |(apart, width)| apart / (width * width));
            }
            let mut found = if k == 0 { Vec::new() } else { normal.cholesky()?.solve(&right).as_slice().to_vec() };
            found.extend(vec![1.0; columns.len()]);
            return Some(found);
        }
        let white = self.white(columns);
        let (mut normal, right) = self.normal(&white);
        // A strength far beyond its trial is not believed.
        for column in 0..columns.len() {
            normal[(k + column, k + column)] += FARTHEST.powi(-2);
        }
        let mut wanted: Vec<usize> = (0..k + columns.len()).collect();
        loop {
            let matrix = DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| normal[(wanted[i], wanted[j])]);
            let vector = DVector::from_fn(wanted.len(), |i, _| right[wanted[i]]);
            let solved = if wanted.is_empty() { vector } else { matrix.cholesky()?.solve(&vector) };
            let negative = wanted.iter().zip(solved.iter()).filter(|(index, value)| **index >= k && **value < 0.0);
            let worst = negative.min_by(|a, b| a.1.total_cmp(b.1)).map(|(index, _)| *index);
            match worst {
                Some(worst) => wanted.retain(|index| *index != worst),
                None => {
                    let mut found = vec![0.0; k + columns.len()];
                    wanted.iter().zip(solved.iter()).for_each(|(index, value)| found[*index] = *value);
                    return Some(found);
                }
            }
        }
    }

    /// The same for strengths of either sign with priors around 0.
    fn solve_any(&self, columns: &[Vec<f64>], widths: &[f64]) -> Option<Vec<f64>> {
        let k = self.derivatives.ncols();
        let (mut normal, right) = self.normal(&self.white(columns));
        for (column, width) in widths.iter().enumerate() {
            normal[(k + column, k + column)] += width.powi(-2);
        }
        Some(normal.cholesky()?.solve(&right).as_slice().to_vec())
    }

    /// Gains of pairs of trials of one column each.
    fn gains_of_pairs(&self, trials: &[Trial], pairs: &[(usize, usize)]) -> Vec<f64> {
        let mut used: Vec<usize> = pairs.iter().flat_map(|(a, b)| [*a, *b]).collect();
        used.sort_unstable();
        used.dedup();
        let columns: Vec<Vec<f64>> = used.iter().map(|&place| trials[place].changes[0].clone()).collect();
        let (normal, right) = self.normal(&self.white(&columns));
        let k = self.derivatives.ncols();
        let gain = |&(a, b): &(usize, usize)| {
            let place = |trial: usize| k + used.binary_search(&trial).expect("it is used");
            let wanted: Vec<usize> = (0..k).chain([place(a), place(b)]).collect();
            let matrix = DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| {
                normal[(wanted[i], wanted[j])] + if i == j && i >= k { FARTHEST.powi(-2) } else { 0.0 }
            });
            let vector = DVector::from_fn(wanted.len(), |i, _| right[wanted[i]]);
            let Some(found) = matrix.cholesky().map(|factor| factor.solve(&vector)) else { return 0.0 };
            let is_allowed = (k..k + 2).all(|index| found[index] > 0.0);
            if is_allowed { found.dot(&vector) } else { 0.0 }
        };
        parallel::map(pairs.iter(), gain)
    }

    /// value − model after the steps, and with the columns, to first order.
    fn left(&self, line: &Explanation, found: &[f64], columns: &[Vec<f64>]) -> Vec<f64> {
        let mut left = self.off.clone();
        for (column, step) in line.derivatives.column_iter().zip(found) {
            left.iter_mut().zip(column.iter()).for_each(|(left, value)| *left -= step * value);
        }
        for (column, strength) in columns.iter().zip(&found[line.unknowns.len()..]) {
            left.iter_mut().zip(column).for_each(|(left, value)| *left -= strength * value);
        }
        left
    }

    /// The priors' part after steps.
    fn prior(&self, found: &[f64]) -> f64 {
        let one = |(prior, step): (&Option<(f64, f64)>, &f64)| {
            prior.map_or(0.0, |(apart, width)| ((step - apart) / width).powi(2))
        };
        self.priors.iter().zip(found).map(one).sum()
    }
}
