//! The search: effects tried on top of a fitted model, one more at a time, several lines at once.
//!
//! At a fitted model every trial of every effect gives a signature; what the free parameters absorb of it is taken out, and
//! the rest foretells how far chi2 falls. The trials that promise most are fitted, all free parameters with them, first
//! roughly, then the best in full. Where no single effect is enough, the best few are carried on together: the first of two
//! missing effects need not be the one that explains most by itself.

use std::sync::Mutex;

use rayon::prelude::*;

use super::Progress;
use super::case::{Added, Case, Node};
use super::chance::{Noise, Null};
use super::hypothesis::{Hypothesis, Trial};
use crate::effect;
use crate::error::InputError;
use crate::fit::{self, Problem};
use crate::mission::Mission;

/// Trials of one effect that are fitted.
const FITTED: usize = 2;

/// Effects tried on top of a model that has some already: those that promise most.
const BREADTH: usize = 6;

/// Models that are carried on together.
pub(super) const LINES: usize = 4;

/// A rough fit of one more effect.
#[derive(Clone)]
pub(super) struct Sketch {
    pub added: Vec<Added>,
    pub mission: Mission,
    pub chi2: f64,
}

impl Sketch {
    pub fn last(&self) -> usize {
        self.added.last().expect("one more effect").hypothesis
    }
}

/// What can be added to a fitted model.
pub(super) struct Expansion {
    /// By hypothesis.
    pub trials: Vec<Vec<Trial>>,
    /// Best sketch of each hypothesis that was fitted, least chi2 first.
    pub sketches: Vec<Sketch>,
}

/// All that stays the same during a search.
pub(super) struct Search<'a> {
    pub case: &'a Case<'a>,
    pub hypotheses: &'a [Hypothesis],
    /// Keys that are free from the start.
    pub base: Vec<String>,
    pub seed: u64,
    pub progress: &'a Progress<'a>,
    /// Models fitted in full, by their hypotheses.
    nodes: Mutex<Vec<std::sync::Arc<Node>>>,
    expansions: Mutex<Vec<(Vec<usize>, bool, std::sync::Arc<Expansion>)>>,
}

impl<'a> Search<'a> {
    pub fn new(
        case: &'a Case<'a>,
        hypotheses: &'a [Hypothesis],
        base: Vec<String>,
        seed: u64,
        progress: &'a Progress<'a>,
    ) -> Search<'a> {
        Search { case, hypotheses, base, seed, progress, nodes: Mutex::default(), expansions: Mutex::default() }
    }

    /// Fits a sketch in full; the same effects are fitted once.
    pub fn node(&self, sketch: &Sketch, like: &Node) -> Result<std::sync::Arc<Node>, InputError> {
        let mut set: Vec<usize> = sketch.added.iter().map(|added| added.hypothesis).collect();
        set.sort_unstable();
        let known = self.nodes.lock().expect("nobody panics").iter().find(|node| node.set() == set).cloned();
        if let Some(node) = known.filter(|node| node.chi2() <= sketch.chi2 + 1e-3) {
            return Ok(node);
        }
        let many = self.case.reach.epochs_yr.len() > 48;
        let options = fit::Options { starts: 1, seed: self.seed, moments: many };
        let model = like.model.like(&sketch.mission);
        let node = Node::fit(self.case, &model, sketch.added.clone(), &self.base, &options, &|_| ())?;
        let node = std::sync::Arc::new(node);
        let mut nodes = self.nodes.lock().expect("nobody panics");
        nodes.retain(|known| known.set() != set);
        nodes.push(node.clone());
        Ok(node)
    }

    /// The fitted model with some hypotheses, added one by one to another.
    pub fn with(&self, base: &std::sync::Arc<Node>, hypotheses: &[usize]) -> Result<std::sync::Arc<Node>, InputError> {
        let mut set = hypotheses.to_vec();
        set.sort_unstable();
        if set.is_empty() {
            return Ok(base.clone());
        }
        let known = self.nodes.lock().expect("nobody panics").iter().find(|node| node.set() == set).cloned();
        if let Some(node) = known {
            return Ok(node);
        }
        let (last, before) = hypotheses.split_last().expect("not empty");
        let parent = self.with(base, before)?;
        let trials = self.hypotheses[*last].trials(*last, self.case, &parent);
        let sketch = self
            .sketch(&parent, &trials)
            .ok_or_else(|| InputError::new("cannot diagnose", "an effect that was there has no trial any more"))?;
        self.node(&sketch, &parent)
    }

    /// Tries every effect on top of a model. Thorough: all of them are fitted; otherwise those that promise most.
    pub fn expand(&self, node: &Node, thorough: bool) -> std::sync::Arc<Expansion> {
        let set = node.set();
        let known = self.expansions.lock().expect("nobody panics");
        if let Some((.., expansion)) = known.iter().find(|(known, all, _)| *known == set && (*all || !thorough)) {
            return expansion.clone();
        }
        drop(known);
        let trials: Vec<Vec<Trial>> = self
            .hypotheses
            .par_iter()
            .enumerate()
            .map(|(place, hypothesis)| {
                let again = set.contains(&place) && !hypothesis.may_repeat();
                let trials = if again || !hypothesis.is_new_to(node.mission()) && !set.contains(&place) {
                    Vec::new()
                } else {
                    hypothesis.trials(place, self.case, node)
                };
                self.progress.step();
                trials
            })
            .collect();
        let best = |trials: &Vec<Trial>| trials.iter().map(|trial| trial.gain(&node.residuals)).fold(0.0, f64::max);
        let mut order: Vec<usize> = (0..trials.len()).filter(|&place| !trials[place].is_empty()).collect();
        order.sort_by(|a, b| best(&trials[*b]).total_cmp(&best(&trials[*a])));
        if !thorough {
            order.truncate(BREADTH);
        }
        let mut sketches: Vec<Sketch> = order
            .par_iter()
            .filter_map(|&place| {
                let sketch = self.sketch(node, &trials[place]);
                self.progress.step();
                sketch
            })
            .collect();
        sketches.sort_by(|a, b| a.chi2.total_cmp(&b.chi2).then(a.last().cmp(&b.last())));
        let expansion = std::sync::Arc::new(Expansion { trials, sketches });
        self.expansions.lock().expect("nobody panics").push((set, thorough, expansion.clone()));
        expansion
    }

    /// The best rough fit of an effect from its most promising trials.
    fn sketch(&self, node: &Node, trials: &[Trial]) -> Option<Sketch> {
        let mut order: Vec<&Trial> = trials.iter().collect();
        order.sort_by(|a, b| b.gain(&node.residuals).total_cmp(&a.gain(&node.residuals)));
        let fitted = order.into_iter().take(FITTED).filter_map(|trial| {
            let (mission, added) = self.add(node, trial.hypothesis, &trial.table)?;
            let keys: Vec<String> =
                self.base.iter().chain(added.iter().flat_map(|added| &added.free)).cloned().collect();
            let model = node.model.like(&mission);
            let problem = Problem::new(&model, self.case.data, &keys, &|_| (), |_| true).ok()?;
            let (mission, chi2) = problem.sketch().ok()?;
            chi2.is_finite().then_some(Sketch { added, mission, chi2 })
        });
        fitted.min_by(|a, b| a.chi2.total_cmp(&b.chi2))
    }

    /// A model's mission with one more effect. Keys of an effect that gets company of its kind get numbers.
    fn add(&self, node: &Node, place: usize, table: &toml::Table) -> Option<(Mission, Vec<Added>)> {
        let hypothesis = &self.hypotheses[place];
        let (mission, key) = effect::add(node.mission(), hypothesis.kind, table.clone()).ok()?;
        let mut added = node.added.clone();
        let alone = format!("effects.{}", hypothesis.kind);
        if key != alone {
            for known in added.iter_mut().filter(|known| known.key == alone) {
                known.key = format!("{alone}.1");
                for free in &mut known.free {
                    *free = free.replacen(&alone, &known.key, 1);
                }
            }
        }
        added.push(Added { hypothesis: place, free: hypothesis.free(&key, table, &self.case.reach), key });
        Some((mission, added))
    }

    /// How often the search finds as much in noise, at a model whose noise is given.
    pub fn null(&self, node: &Node, noise: &Noise) -> Null {
        let expansion = self.expand(node, node.added.is_empty());
        Null::simulate(self.case, node, &expansion.trials, noise, self.seed)
    }
}
