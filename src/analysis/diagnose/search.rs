//! The search: effects tried on top of fitted models, one more at a time, with several models carried on in parallel.
//!
//! At a fitted model every trial of every effect has a signature. The part that the free parameters absorb is removed, and the rest
//! predicts the decrease of chi2. The most promising trials are fitted together with all free parameters, first roughly, then the
//! best in full. If no single effect is enough, the best few models are carried on: the first of two missing effects need not be
//! the one that explains most by itself.

mod given_values;
mod smaller;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use self::smaller::Smaller;
use super::fitted_model::{Added, Case, Node};
use super::hypothesis::{FARTHEST, Hypothesis, Trial};
use super::options::Progress;
use super::significance::{Noise, Null};
use crate::analysis::fit::{self, Optimum, Problem, helped};
use crate::effect::{self, AfterFit};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission_file;
use crate::model::Model;
use crate::numeric::parallel;

/// Trials of one effect that are fitted.
const FITTED: usize = 2;

/// Share of the predicted gain of the best trial that another must reach to be fitted as well.
const ALSO: f64 = 0.3;

/// A start is not followed to its minimum if its chi2 exceeds that of another minimum by more than this factor and this number, or
/// by less than this share of the gain that is worth a minimisation.
const FAR_BEHIND: f64 = 2.0;
const BEHIND: f64 = 50.0;
const SAME_END: f64 = 0.25;

/// Difference of chi2 below which two fits have reached the same minimum.
const SAME_MINIMUM: f64 = 0.01;

/// Most promising effects fitted on top of a model that already has some.
pub(super) const BREADTH: usize = 6;

/// Models carried on in parallel.
pub(super) const LINES: usize = 4;

/// A rough fit of one more effect.
#[derive(Clone)]
pub(super) struct Sketch {
    pub added: Vec<Added>,
    pub mission: Mission,
    pub chi2: f64,
    /// chi2 penalty of each file's pedestal in it.
    pub pedestal_costs: Vec<f64>,
}

impl Sketch {
    pub fn last(&self) -> usize {
        self.added.last().expect("one more effect").hypothesis
    }

    /// Decrease of chi2 from a model without the last effect, as evidence for it.
    pub fn gain_over(&self, node: &Node) -> f64 {
        let parameters = self.added.last().map_or(0, |added| added.free.len());
        node.gain_of(self.chi2, &self.pedestal_costs, parameters)
    }
}

/// A model with more effects on the way to its optimum: a mission, and the progress of its free parameters from there.
struct Start {
    added: Vec<Added>,
    mission: Mission,
    found: Optimum,
}

/// Effects that can be added to a fitted model.
pub(super) struct Expansion {
    pub node: Arc<Node>,
    /// By hypothesis.
    pub trials: Vec<Vec<Trial>>,
    /// Rough fits made so far, by hypothesis; None if an effect cannot be fitted.
    sketches: Mutex<BTreeMap<usize, Option<Sketch>>>,
}

impl Expansion {
    /// Decrease of chi2 with an effect, to first order and within reach of its trials.
    pub fn gain(&self, hypothesis: usize) -> f64 {
        self.trials[hypothesis].iter().map(|trial| trial.gain_in_reach(&self.node.residuals)).fold(0.0, f64::max)
    }

    /// Parameters of an effect, in the form that has most.
    pub fn parameters(&self, hypothesis: usize) -> usize {
        self.trials[hypothesis].iter().map(|trial| trial.basis.ncols()).max().unwrap_or(0)
    }

    /// Effects that can be added, by predicted decrease of chi2, the largest first.
    pub fn promising(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.trials.len()).filter(|&place| !self.trials[place].is_empty()).collect();
        order.sort_by(|a, b| self.gain(*b).total_cmp(&self.gain(*a)).then(a.cmp(b)));
        order
    }

    /// chi2 with an effect: of its rough fit if there is one, otherwise to first order. Larger than without the effect if the data
    /// rule it out; equal if its strength can be 0 and no other strength helps. None if it changes nothing.
    pub fn chi2(&self, hypothesis: usize) -> Option<f64> {
        let sketches = self.sketches.lock().expect("nobody panics");
        let fitted = sketches.get(&hypothesis).and_then(|sketch| sketch.as_ref().map(|sketch| sketch.chi2));
        let trials = &self.trials[hypothesis];
        let gains = trials.iter().map(|trial| trial.change(&self.node.residuals));
        let first_order = || gains.max_by(f64::total_cmp).map(|gain| self.node.chi2() - gain);
        let chi2 = fitted.or_else(first_order)?;
        let can_be_nothing = trials.iter().any(|trial| trial.can_be_nothing);
        Some(if can_be_nothing { chi2.min(self.node.chi2()) } else { chi2 })
    }
}

/// The most promising trials of an effect at a model, the best first.
fn most_promising<'t>(trials: &'t [Trial], node: &Node) -> Vec<&'t Trial> {
    let gain = |trial: &Trial| trial.gain_in_reach(&node.residuals);
    let mut order: Vec<&Trial> = trials.iter().collect();
    order.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    order.truncate(FITTED);
    order
}

/// Everything that stays the same during a search.
pub(super) struct Search<'a> {
    pub case: &'a Case<'a>,
    /// The same data without pedestals.
    pub level_case: &'a Case<'a>,
    pub hypotheses: &'a [Hypothesis],
    /// The mission before any fit.
    given: &'a Mission,
    /// Keys that are free from the start.
    pub base: Vec<String>,
    pub seed: u64,
    pub progress: &'a Progress<'a>,
    /// Fitted models, and those at their final optimum, one for each set of hypotheses.
    nodes: Mutex<Vec<Arc<Node>>>,
    settled: Mutex<Vec<Arc<Node>>>,
    expansions: Mutex<Vec<Arc<Expansion>>>,
    levels: Mutex<Vec<Arc<Node>>>,
    /// Predictions of models from which free keys were driven out, and the same models with the mission's values of these.
    as_given: Mutex<Vec<(Vec<f64>, Arc<Node>)>>,
    /// Models without one of the effects of others.
    smaller: Mutex<Vec<Smaller>>,
    /// Rough fits of another search of the same data, from which those of this one start.
    known: Vec<Sketch>,
    /// Counts an evaluation of the model at all rows.
    count: Box<dyn Fn(f64) + Sync + 'a>,
}

impl<'a> Search<'a> {
    pub fn new(
        [case, level_case]: [&'a Case<'a>; 2],
        given: &'a Mission,
        hypotheses: &'a [Hypothesis],
        base: Vec<String>,
        seed: u64,
        progress: &'a Progress<'a>,
    ) -> Search<'a> {
        Search {
            case,
            level_case,
            levels: Mutex::default(),
            as_given: Mutex::default(),
            smaller: Mutex::default(),
            hypotheses,
            base,
            given,
            seed,
            progress,
            nodes: Mutex::default(),
            settled: Mutex::default(),
            expansions: Mutex::default(),
            known: Vec::new(),
            count: Box::new(|_| case.work.count()),
        }
    }

    /// Begins where another search of the same data ended, if that had no other free keys. With other errors an optimum hardly
    /// moves. If errors and free keys are the same (only the simulated noise is drawn anew), everything fitted on top of the same
    /// base is reused.
    pub fn begin_like(&mut self, other: &Search, base: &Node) {
        let expansions = other.expansions.lock().expect("nobody panics");
        for expansion in expansions.iter() {
            let sketches = expansion.sketches.lock().expect("nobody panics");
            self.known.extend(sketches.values().flatten().cloned());
        }
        let same_problem = self.case.sigmas == other.case.sigmas && self.base == other.base;
        let is_base = |expansion: &&Arc<Expansion>| expansion.node.added.is_empty();
        let same_base = |known: &Arc<Expansion>| known.node.fit.values == base.fit.values;
        if same_problem && expansions.iter().find(is_base).is_some_and(same_base) {
            let of = |nodes: &Mutex<Vec<Arc<Node>>>| Mutex::new(nodes.lock().expect("nobody panics").clone());
            (self.nodes, self.settled, self.levels) = (of(&other.nodes), of(&other.settled), of(&other.levels));
            self.expansions = Mutex::new(expansions.clone());
        }
    }

    /// The full fit of a sketch, with its errors; each set of effects is fitted once.
    pub fn node(&self, sketch: &Sketch, like: &Node) -> Result<Arc<Node>, InputError> {
        let mut set: Vec<usize> = sketch.added.iter().map(|added| added.hypothesis).collect();
        set.sort_unstable();
        if let Some(node) = self.known(&set).filter(|node| node.chi2() <= sketch.chi2 + 1e-3) {
            return Ok(node);
        }
        self.fit(&like.model.like(&sketch.mission), &sketch.added, true)
    }

    /// A model at its final optimum; every interval between epochs is tried for event epochs.
    pub fn settled(&self, node: &Node) -> Result<Arc<Node>, InputError> {
        let settled =
            self.settled.lock().expect("nobody panics").iter().find(|known| known.set() == node.set()).cloned();
        if let Some(settled) = settled.filter(|settled| settled.chi2() <= node.chi2() + SAME_MINIMUM) {
            return Ok(settled);
        }
        let found = self.plainer(self.fit(&node.model, &node.added, false)?);
        self.remember_settled(&found);
        Ok(found)
    }

    /// Keeps a model at its optimum, in the place of others with the same effects.
    fn remember_settled(&self, found: &Arc<Node>) {
        let mut settled = self.settled.lock().expect("nobody panics");
        settled.retain(|known| known.set() != found.set());
        settled.push(found.clone());
        drop(settled);
        self.improve_sketch(found);
    }

    /// A fitted model, or an equivalent one with plainer values of its effects' parameters, if a fit from there reaches a minimum
    /// as low.
    fn plainer(&self, node: Arc<Node>) -> Arc<Node> {
        let epochs_yr = self.case.epochs_yr();
        let after = AfterFit { fitted: node.mission(), given: self.given, free: &self.base, epochs_yr: &epochs_yr };
        let plainer = |added: &Added| {
            let entry = effect::find(self.hypotheses[added.hypothesis].kind);
            entry.map_or_else(Vec::new, |entry| (entry.plainer)(&after, &added.key))
        };
        let in_order = fit::species_order::restored(node.mission(), self.given, &self.base);
        let values = if in_order.is_empty() { node.added.iter().flat_map(plainer).collect() } else { in_order };
        let values: Vec<_> = values.into_iter().map(|(key, value)| (key, value.into())).collect();
        let Some(mission) = (!values.is_empty()).then(|| node.mission().with(&values).ok()).flatten() else {
            return node;
        };
        let options = fit::Options { scan: false, moments: false, seed: self.seed, ..fit::Options::default() };
        let other = Node::fit(self.case, &node.model.like(&mission), node.added.clone(), &self.base, &options).ok();
        let as_low = other.filter(|other| other.chi2() < node.chi2() + SAME_MINIMUM);
        as_low.map_or(node, |other| self.remembered(other))
    }

    /// Replaces the rough fit of a model by the model at its final optimum.
    fn improve_sketch(&self, found: &Node) {
        let Some((last, before)) = found.added.split_last() else { return };
        let is_parent = |expansion: &&Arc<Expansion>| expansion.node.added == before;
        let expansions = self.expansions.lock().expect("nobody panics");
        let Some(parent) = expansions.iter().find(is_parent) else { return };
        let (added, mission, chi2) = (found.added.clone(), found.mission().clone(), found.chi2());
        let better = Sketch { added, mission, chi2, pedestal_costs: found.pedestal_costs.clone() };
        let mut sketches = parent.sketches.lock().expect("nobody panics");
        if sketches.get(&last.hypothesis).and_then(Option::as_ref).is_some_and(|known| chi2 < known.chi2) {
            sketches.insert(last.hypothesis, Some(better));
        }
    }

    fn known(&self, set: &[usize]) -> Option<Arc<Node>> {
        self.nodes.lock().expect("nobody panics").iter().find(|node| node.set() == set).cloned()
    }

    fn fit(&self, model: &Model, added: &[Added], settled: bool) -> Result<Arc<Node>, InputError> {
        // A search has tried all intervals, unless there are too many.
        let moments = self.case.reach.epochs_yr.len() > effect::EVENT_EPOCHS;
        let options = fit::Options { starts: 1, scan: !settled, seed: self.seed, moments, settled };
        Ok(self.remembered(Node::fit(self.case, model, added.to_vec(), &self.base, &options)?))
    }

    /// Stores a fitted model in place of others with the same effects.
    fn remembered(&self, node: Node) -> Arc<Node> {
        let node = Arc::new(node);
        let mut nodes = self.nodes.lock().expect("nobody panics");
        nodes.retain(|known| known.set() != node.set());
        nodes.push(node.clone());
        node
    }

    /// The fitted model with some hypotheses, added one by one to another.
    pub fn with(&self, base: &Arc<Node>, hypotheses: &[usize]) -> Result<Arc<Node>, InputError> {
        let mut set = hypotheses.to_vec();
        set.sort_unstable();
        if set.is_empty() {
            return Ok(base.clone());
        }
        if let Some(node) = self.known(&set) {
            return self.settled(&node);
        }
        let (last, before) = hypotheses.split_last().expect("not empty");
        let parent = self.with(base, before)?;
        self.make_level(&parent);
        self.make_as_given(self.case, &parent);
        let trials = self.trials(*last, &parent);
        let node = match self.sketch(&parent, *last, &trials) {
            Some(sketch) => self.node(&sketch, &parent)?,
            None => self.fit_without_trial(*last, &parent)?,
        };
        self.settled(&node)
    }

    /// A model with an effect that changes nothing beyond what its free parameters do: at any strength it explains as much.
    fn fit_without_trial(&self, place: usize, parent: &Node) -> Result<Arc<Node>, InputError> {
        let tables = self.hypotheses[place].any_table(self.case, parent).map(|table| (place, table));
        let (mission, added) = self.added(parent, tables.into_iter()).ok_or_else(|| {
            let name = &self.hypotheses[place].name;
            InputError::new("cannot diagnose", format!("{name} cannot be added to the mission on its own"))
        })?;
        self.fit(&parent.model.like(&mission), &added, false)
    }

    /// Every trial of every effect on top of a model, or of the best fit with the same effects.
    pub fn expand(&self, node: &Arc<Node>) -> Arc<Expansion> {
        let set = node.set();
        let node = &self.known(&set).filter(|known| known.chi2() <= node.chi2()).unwrap_or_else(|| node.clone());
        let known =
            self.expansions.lock().expect("nobody panics").iter().find(|known| known.node.set() == set).cloned();
        if let Some(expansion) = known.filter(|known| known.node.chi2() == node.chi2()) {
            return expansion;
        }
        self.make_as_given(self.case, node);
        let trials = |(place, hypothesis): (usize, &Hypothesis)| {
            let new = if set.contains(&place) { hypothesis.may_repeat() } else { hypothesis.is_new_to(node.mission()) };
            let trials = if new { self.trials(place, node) } else { Vec::new() };
            self.progress.step();
            trials
        };
        let trials = parallel::map(self.hypotheses.iter().enumerate(), trials);
        let expansion = Arc::new(Expansion { node: node.clone(), trials, sketches: Mutex::default() });
        let mut expansions = self.expansions.lock().expect("nobody panics");
        expansions.retain(|known| known.node.set() != set);
        expansions.push(expansion.clone());
        expansion
    }

    /// Rough fits of some effects on top of a model, lowest chi2 first.
    pub fn sketches(&self, expansion: &Expansion, wanted: &[usize]) -> Vec<Sketch> {
        let known = |place: &usize| expansion.sketches.lock().expect("nobody panics").get(place).cloned();
        let sketch = |place: &usize| {
            let sketch =
                known(place).unwrap_or_else(|| self.sketch(&expansion.node, *place, &expansion.trials[*place]));
            expansion.sketches.lock().expect("nobody panics").insert(*place, sketch.clone());
            self.progress.step();
            sketch
        };
        self.make_level(&expansion.node);
        let mut sketches: Vec<Sketch> = parallel::map(wanted, sketch).into_iter().flatten().collect();
        sketches.sort_by(|a, b| a.chi2.total_cmp(&b.chi2).then(a.last().cmp(&b.last())));
        sketches
    }

    /// The best rough fit of an effect from its most promising trials; without trials, in the place of a pedestal that does the same.
    fn sketch(&self, node: &Node, place: usize, trials: &[Trial]) -> Option<Sketch> {
        if let Some(start) = self.start_from_known(node, place) {
            return self.followed(node, vec![start]);
        }
        let mut wanted = most_promising(trials, node);
        let gain = |trial: &Trial| trial.gain_in_reach(&node.residuals);
        let first = wanted.first().map_or(0.0, |trial| gain(trial));
        wanted.retain(|trial| gain(trial) >= ALSO * first);
        let near = parallel::map(&wanted, |trial| {
            let strength = trial.strength(&node.residuals).clamp(0.1, FARTHEST);
            self.start_of(node, &[(trial, strength)])
        });
        let near = self.followed(node, near.into_iter().flatten().collect());
        let near = near.map(|near| self.refitted_from_given_values(node, near));
        if near.as_ref().is_some_and(|near| near.pedestal_costs.iter().all(|cost| *cost == 0.0)) {
            return near;
        }
        let level = self.start_from_level(node, place);
        let far = self.followed(node, level.into_iter().collect());
        near.into_iter().chain(far).min_by(|a, b| a.chi2.total_cmp(&b.chi2))
    }

    /// The start at which another search of the same data ended with the same effects; None if it did not try them.
    fn start_from_known(&self, node: &Node, place: usize) -> Option<Start> {
        let places = |added: &[Added]| added.iter().map(|added| added.hypothesis).collect::<Vec<_>>();
        let wanted = [places(&node.added), vec![place]].concat();
        let known = self.known.iter().find(|known| places(&known.added) == wanted)?;
        let mission = Mission { accuracy: node.mission().accuracy.clone(), ..known.mission.clone() };
        let model = node.model.like(&mission);
        let found = self.problem(&model, &known.added).ok()?.start();
        Some(Start { added: known.added.clone(), mission, found })
    }

    /// A start from the fit without pedestals. A pedestal that only a model without the effect needs hides the effect, and leaves
    /// the fit no gradient to follow. None if the model has no pedestal.
    fn start_from_level(&self, node: &Node, place: usize) -> Option<Start> {
        let level = self.level(node)?;
        let level = self.as_given(&level).unwrap_or(level);
        let trials = self.hypotheses[place].trials(place, self.level_case, &level);
        let starts = most_promising(&trials, &level).into_iter().filter_map(|trial| {
            let strength = trial.strength(&level.residuals).clamp(0.1, FARTHEST);
            let scaled = self.hypotheses[place].scaled(level.mission(), &trial.table, strength);
            let table = scaled.map_or_else(|| trial.table.clone(), |(table, _)| table);
            let (mission, added) = self.added(&level, std::iter::once((place, table)))?;
            let model = level.model.like(&mission);
            let problem = self.problem(&model, &added).ok()?.without_pedestals();
            let found = problem.approach(&problem.nothing_known());
            Some(Start { added, mission, found })
        });
        let Start { added, mission, found } = starts.min_by(|a, b| a.found.chi2.total_cmp(&b.found.chi2))?;
        let model = level.model.like(&mission);
        let problem = self.problem(&model, &added).ok()?.without_pedestals();
        let mission = problem.mission(&problem.polish(found).at).ok()?;
        let model = level.model.like(&mission);
        let problem = self.problem(&model, &added).ok()?;
        let found = problem.approach(&problem.nothing_known());
        Some(Start { added, mission, found })
    }

    /// Most promising effects on top of a model without pedestals, the best first.
    pub fn promising_without_pedestals(&self, node: &Node) -> Vec<usize> {
        self.make_level(node);
        let Some(level) = self.level(node) else { return Vec::new() };
        let gain = |(place, hypothesis): (usize, &Hypothesis)| {
            let trials = hypothesis.trials(place, self.level_case, &level);
            (place, trials.iter().map(|trial| trial.gain_in_reach(&level.residuals)).fold(0.0, f64::max))
        };
        let new = self.hypotheses.iter().enumerate().filter(|(_, hypothesis)| hypothesis.is_new_to(node.mission()));
        let mut gains: Vec<(usize, f64)> = parallel::map(new.collect::<Vec<_>>(), gain);
        gains.sort_by(|a, b| b.1.total_cmp(&a.1));
        gains.into_iter().map(|(place, _)| place).collect()
    }

    /// A model fitted without pedestals, if that fit was made (`make_level`).
    fn level(&self, node: &Node) -> Option<Arc<Node>> {
        let levels = self.levels.lock().expect("nobody panics");
        levels.iter().find(|known| node.has_pedestal() && known.set() == node.set()).cloned()
    }

    /// Fits a model without pedestals if it needs some; not to be called while others run in parallel.
    fn make_level(&self, node: &Node) {
        if !node.has_pedestal() || self.level(node).is_some() {
            return;
        }
        let options = fit::Options { scan: false, moments: false, ..fit::Options::default() };
        if let Ok(level) = Node::fit(self.level_case, &node.model, node.added.clone(), &self.base, &options) {
            self.make_as_given(self.level_case, &level);
            self.levels.lock().expect("nobody panics").push(Arc::new(level));
        }
    }

    /// The rough fit of some trials together, each started at a factor on the strength in its table.
    pub fn sketch_of(&self, node: &Node, trials: &[(&Trial, f64)]) -> Option<Sketch> {
        self.followed(node, self.start_of(node, trials).into_iter().collect())
    }

    /// A start of some trials together, each at a factor on the strength in its table: at a model, or where its free keys that were driven
    /// out have the mission's values again.
    fn start_of(&self, node: &Node, trials: &[(&Trial, f64)]) -> Option<Start> {
        let here = self.start_at(node, trials);
        let given = self.as_given(node).and_then(|given| self.start_at(&given, trials));
        here.into_iter().chain(given).min_by(|a, b| a.found.chi2.total_cmp(&b.found.chi2))
    }

    fn start_at(&self, node: &Node, trials: &[(&Trial, f64)]) -> Option<Start> {
        let from = |share: f64| {
            let scaled = |(trial, strength): &(&Trial, f64)| {
                let hypothesis = &self.hypotheses[trial.hypothesis];
                let scaled = hypothesis.scaled(node.mission(), &trial.table, share * strength);
                (trial.hypothesis, scaled.map_or_else(|| trial.table.clone(), |(table, _)| table))
            };
            let as_given = |(trial, _): &(&Trial, f64)| (trial.hypothesis, trial.table.clone());
            let tables = self.added(node, trials.iter().map(scaled));
            self.start(node, tables).or_else(|| self.start(node, self.added(node, trials.iter().map(as_given))))
        };
        let start = from(1.0)?;
        // More effects cannot be worse: the start was too far away.
        let astray = start.found.chi2 > node.chi2() + 1.0;
        let again = if astray { from(0.05) } else { None };
        [Some(start), again].into_iter().flatten().min_by(|a, b| a.found.chi2.total_cmp(&b.found.chi2))
    }

    /// A short minimisation from a mission with more effects than a fitted one.
    fn start(&self, node: &Node, with: Option<(Mission, Vec<Added>)>) -> Option<Start> {
        let (mission, added) = with?;
        let model = node.model.like(&mission);
        let found = self.problem(&model, &added).ok()?.approach(&node.fit.jacobian);
        found.chi2.is_finite().then_some(Start { added, mission, found })
    }

    /// The best rough fit from some starts. The nearest is followed to its minimum; another one only if it seems to lead to a
    /// different minimum and is not far behind.
    fn followed(&self, node: &Node, mut starts: Vec<Start>) -> Option<Sketch> {
        starts.sort_by(|a, b| a.found.chi2.total_cmp(&b.found.chi2));
        let mut best: Option<Start> = None;
        for start in starts {
            let chi2 = start.found.chi2;
            let elsewhere = |best: &Start| {
                let known = best.found.chi2;
                chi2 > known + SAME_END * helped(known) && chi2 < FAR_BEHIND * known + BEHIND
            };
            if !best.as_ref().is_none_or(elsewhere) {
                continue;
            }
            let model = node.model.like(&start.mission);
            let found = self.problem(&model, &start.added).ok()?.polish(start.found);
            if best.as_ref().is_none_or(|best| found.chi2 < best.found.chi2) {
                best = Some(Start { found, ..start });
            }
        }
        let Start { added, mission, found } = best?;
        let model = node.model.like(&mission);
        let mission = self.problem(&model, &added).ok()?.mission(&found.at).ok()?;
        // Needed only if the model has pedestals.
        let model = node.model.like(&mission);
        let pedestal_costs = if node.has_pedestal() { self.case.pedestal_costs(&model) } else { Vec::new() };
        found.chi2.is_finite().then_some(Sketch { added, mission, chi2: found.chi2, pedestal_costs })
    }

    /// The problem of fitting a model with added effects to all data.
    fn problem<'m>(&'m self, model: &'m Model, added: &[Added]) -> Result<Problem<'m>, InputError> {
        let keys: Vec<String> = self.base.iter().chain(added.iter().flat_map(|added| &added.free)).cloned().collect();
        Problem::new(model, self.case.data, &keys, &self.count, |_| true)
    }

    /// A fitted mission with more effects.
    fn added(&self, node: &Node, tables: impl Iterator<Item = (usize, toml::Table)>) -> Option<(Mission, Vec<Added>)> {
        let (mut mission, mut added) = (node.mission().clone(), node.added.clone());
        for (place, table) in tables {
            mission = self.add(&mission, &mut added, place, &table)?;
        }
        Some((mission, added))
    }

    /// A mission with one more effect. If there are several effects of its kind, their keys are numbered.
    fn add(&self, to: &Mission, added: &mut Vec<Added>, place: usize, table: &toml::Table) -> Option<Mission> {
        let hypothesis = &self.hypotheses[place];
        let (mission, key) = mission_file::add_effect(to, hypothesis.kind, table.clone()).ok()?;
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
        Some(mission)
    }

    /// The null distribution of the search: what it finds in noise, at a model and for its noise.
    pub fn null(&self, node: &Arc<Node>, noise: &Noise) -> Null {
        Null::simulate(self.case, node, &self.expand(node).trials, noise, self.seed)
    }
}
