//! Mission and measurements → which physical effect the model lacks.
//!
//! In the order in which mistakes are avoided: whether the data can carry a verdict (`audit`), whether the readout is
//! computed finely enough (`numerics`), the fit of what is free, every effect on top of it (`hypothesis`, `search`),
//! how often noise does as well (`chance`), groups of rows left out (`holdout`), rivals (`rivals`), and the measurement
//! that would tell them apart (`next`). Nothing is called missing that noise could have made, and nothing is called certain
//! that has a rival.

mod audit;
mod case;
pub mod chance;
mod figures;
mod formula;
mod holdout;
pub mod hypothesis;
mod limits;
pub mod next;
mod numerics;
mod pairs;
mod rivals;
mod search;

use std::sync::Arc;

use nalgebra::DVector;
use rayon::prelude::*;

use crate::effect;
use crate::error::InputError;
use crate::evaluate::{self, evaluate};
use crate::fit::{self, Advice, Fitted, Problem};
use crate::measurement::DataSet;
use crate::mission::Mission;
use crate::model::Model;
use crate::observable::Observable;
use crate::validate::{Validation, validate};
use case::{Added, Case, Node};
use chance::Noise;
pub use formula::Suggestion;
pub use hypothesis::Hypothesis;
pub use limits::Limit;
pub use next::Next;
use pairs::Pair;
use search::{BREADTH, LINES, Search, Sketch};

/// How to search.
#[derive(Clone, Debug)]
pub struct Options {
    /// False alarms allowed among complete models.
    pub level: f64,
    /// Seed of all simulations.
    pub seed: u64,
    /// Keys to adjust, as dotted keys.
    pub free: Vec<String>,
    /// The user's own effects, by kind, as in a mission's `[effects]`.
    pub candidates: Option<toml::Table>,
    /// What could be measured next; all observables where empty.
    pub can: Vec<Observable>,
}

/// Signs of life.
pub struct Progress<'a> {
    /// Called at the start of a stage, with its name and how many steps it has.
    pub stage: &'a (dyn Fn(&str, u64) + Sync),
    /// Called after each step.
    pub advance: &'a (dyn Fn() + Sync),
}

impl Progress<'_> {
    fn step(&self) {
        (self.advance)();
    }
}

/// What came of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The model explains the data.
    Complete,
    /// Effects were missing; with them it does.
    Missing,
    /// The same, but some effect has rivals that these data cannot tell from it.
    Ambiguous,
    /// No combination of effects explains the data.
    Unexplained,
    /// The data cannot carry a verdict.
    Unfit,
}

impl Verdict {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Complete => "complete",
            Verdict::Missing => "missing",
            Verdict::Ambiguous => "ambiguous",
            Verdict::Unexplained => "unexplained",
            Verdict::Unfit => "unfit",
        }
    }
}

/// One rung of the ladder: a model fitted to all rows.
#[derive(Clone, Debug)]
pub struct Rung {
    /// chi2.
    pub chi2: f64,
    /// Rows.
    pub n: usize,
    /// Free parameters.
    pub free: usize,
    /// rms of (value − model)/sigma over groups left out in turn; None where nothing can be left out.
    pub holdout_rms_sigma: Option<f64>,
    /// When the budget is exceeded with this model; None where the mission's galaxies lose their shapes.
    pub budget: Option<evaluate::Verdict>,
}

impl Rung {
    /// rms of (value − model)/sigma.
    pub fn rms_sigma(&self) -> f64 {
        (self.chi2 / self.n as f64).sqrt()
    }
}

/// An effect that was added.
#[derive(Clone, Debug)]
pub struct Step {
    /// Its name: the kind, for a user's own with its number.
    pub effect: String,
    /// Its parameters with all effects added.
    pub parameters: Vec<Fitted>,
    /// Dotted key of its table in the improved mission.
    pub key: String,
    /// The model with it and those before it.
    pub rung: Rung,
    /// Chance that noise alone looks as good, over everything that was tried.
    pub false_alarm: f64,
}

/// An effect that was tried on top of the mission's own model.
#[derive(Clone, Debug)]
pub struct Tried {
    /// Its name.
    pub effect: String,
    /// chi2 with it alone; None where it changes nothing that the free parameters do not absorb.
    pub chi2: Option<f64>,
}

/// A condition or covariate that residuals lean on.
#[derive(Clone, Debug)]
pub struct Leaning {
    /// Its name.
    pub name: String,
    /// Chance that noise alone leans as much on anything.
    pub false_alarm: f64,
}

/// Everything that a diagnosis found.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The mission as given.
    pub mission: Mission,
    /// The mission with fitted values and added effects.
    pub improved: Mission,
    /// Keys that were free from the start, with their values in the improved mission.
    pub parameters: Vec<Fitted>,
    /// What came of it.
    pub verdict: Verdict,
    /// Why the data cannot carry a verdict, or what is the matter with the model, in a sentence.
    pub reason: String,
    /// The mission's own model, fitted.
    pub baseline: Rung,
    /// Effects added, best first.
    pub steps: Vec<Step>,
    /// Everything that was tried on top of the mission's own model, least chi2 first.
    pub tried: Vec<Tried>,
    /// Sets of effects that explain the data as well, the adopted one first.
    pub alternatives: Vec<Vec<String>>,
    /// What residuals lean on, the most significant first.
    pub covariates: Vec<Leaning>,
    /// A formula that describes what is left, where something is.
    pub suggestion: Option<Suggestion>,
    /// The measurement that would tell rivals apart.
    pub next: Option<Next>,
    /// What the data would have shown, where nothing is missing.
    pub limits: Vec<Limit>,
    /// The column whose groups were left out.
    pub held_out: Option<String>,
    /// Noise as the residuals of the final model show it.
    pub noise: Noise,
    /// Things seen on the way: numerics, the data.
    pub notes: Vec<String>,
    /// The mission as given against the data, after the fit of what is free.
    pub before: Validation,
    /// The improved mission against the data.
    pub after: Validation,
    /// What the data do not determine of the values of the improved mission.
    pub advice: Vec<Advice>,
}

impl Diagnosis {
    /// The tables of effects that differ from those of the mission as given, by kind.
    pub fn added_effects(&self) -> toml::Table {
        let known = &self.mission.effects;
        let new = self.steps.iter().map(|step| step.key.split('.').nth(1).expect("effects.KIND"));
        let mut added = toml::Table::new();
        for kind in new.chain(known.keys().map(String::as_str)) {
            if self.improved.effects.get(kind) != known.get(kind) {
                added.insert(kind.into(), self.improved.effects[kind].clone());
            }
        }
        added
    }

    /// The same as TOML, to six digits.
    pub fn toml(&self) -> String {
        fn rounded(value: &mut toml::Value) {
            match value {
                toml::Value::Float(number) => *number = format!("{number:.5e}").parse().expect("a number"),
                toml::Value::Array(members) => members.iter_mut().for_each(rounded),
                toml::Value::Table(members) => members.iter_mut().for_each(|(_, member)| rounded(member)),
                _ => {}
            }
        }
        let mut effects = toml::Value::Table(self.added_effects());
        rounded(&mut effects);
        let effects = toml::Table::from_iter([("effects".to_string(), effects)]);
        toml::to_string(&effects).expect("tables of numbers and words")
    }

    /// The text of the mission's file with what was found.
    pub fn improved_text(&self, text: &str) -> String {
        let settings: Vec<(String, toml::Value)> =
            self.parameters.iter().map(|fitted| (fitted.key.clone(), fitted.value.into())).collect();
        let own = settings.into_iter().filter(|(key, _)| !key.starts_with("effects.")).collect::<Vec<_>>();
        let text = crate::mission::edit(text, &self.mission, &own);
        crate::mission::with_effects(&text, &self.added_effects(), "found by `ctiplan diagnose`")
    }
}

/// Effects added at most.
const MOST: usize = 3;

/// Share of the fall of chi2 within which two models that fall as far say the same of the data.
const THE_SAME: f64 = 0.02;

/// Fall of chi2 that any effect reaches by chance.
const NO_GAIN: f64 = 4.0;

/// Share of the excess of chi2 that may be left after another effect, for one more to be tried.
const WORTH_GOING_ON: f64 = 0.5;

/// By how much less chi2 and parameters must come to with rows left out than with an effect more, for the rows to be to blame.
const MUCH_SIMPLER: f64 = 15.0;

/// Share of what chi2 has in excess that an effect must explain to be named although the data remain unexplained.
const MOST_OF_IT: f64 = 0.95;

/// False alarm to first order below which an effect is fitted to see.
const NEAR: f64 = 0.3;

/// Random starting points of the base fit.
const ELSEWHERE: usize = 3;

/// Parts of the level: of the search, of leanings, and of chi2.
const SEARCH: f64 = 0.5;
const LEAN: f64 = 0.25;
const CHI2: f64 = 0.1;

/// Part of the level at which a model that has an effect added calls for more: two are missing less often than one, and a good
/// answer is not to be spoiled as often as data are complete.
const FURTHER: f64 = 0.2;

/// Finds out what a mission's model lacks.
///
/// # Errors
/// Where keys cannot be fitted, candidates make no sense, or the model has no value for a row.
pub fn diagnose(
    mission: &Mission,
    data: &[DataSet],
    options: &Options,
    progress: &Progress,
) -> Result<Diagnosis, InputError> {
    let case = Case::of(data);
    let hypotheses = hypothesis::all(mission, options.candidates.as_ref())?;
    for key in &options.free {
        fit::parameter::Parameter::of(mission, key)?;
    }
    let refusal = audit::refusal(&case, options.free.len());
    let free = if refusal.is_some() { Vec::new() } else { options.free.clone() };
    (progress.stage)("numerics and base fit", 0);
    let (accurate, notes) = numerics::accurate(&case, mission)?;
    let base = Arc::new(base_fit(&case, &Model::new(&accurate), &free, options.seed)?);
    let search = Search::new(&case, &hypotheses, free, options.seed, progress);
    let split = holdout::split(&case);
    let told = Told { search: &search, options, base: &base, groups: split.as_ref().map(|(_, groups)| &groups[..]) };
    let found = match refusal.or_else(|| audit::sigma_too_large(&case, &base)) {
        Some(reason) => Found::of(Verdict::Unfit, reason, vec![base.clone()]),
        None => told.hunt()?,
    };
    told.diagnosis(mission, found, split.as_ref().map(|(column, _)| column.to_string()), notes)
}

/// The fit of what is free: from elsewhere too where it does not explain the data.
fn base_fit(case: &Case, model: &Model, free: &[String], seed: u64) -> Result<Node, InputError> {
    let options = fit::Options { seed, ..fit::Options::default() };
    let fit = |model: &Model| Node::fit(case, model, Vec::new(), free, &options);
    let mut best = fit(model)?;
    let clear = best.chi2() > best.freedom() + 4.0 * (2.0 * best.freedom()).sqrt();
    if free.is_empty() || !clear {
        return Ok(best);
    }
    for mission in Problem::new(model, case.data, free, &|_| (), |_| true)?.elsewhere(ELSEWHERE, seed, best.chi2()) {
        let other = fit(&model.like(&mission))?;
        if other.chi2() < best.chi2() {
            best = other;
        }
    }
    Ok(best)
}

/// What a search came to.
struct Found {
    verdict: Verdict,
    reason: String,
    /// Models from the base to that at the end.
    ladder: Vec<Arc<Node>>,
    alternatives: Vec<Vec<String>>,
    next: Option<Next>,
    limits: Vec<Limit>,
}

impl Found {
    fn of(verdict: Verdict, reason: String, ladder: Vec<Arc<Node>>) -> Found {
        Found { verdict, reason, ladder, alternatives: Vec::new(), next: None, limits: Vec::new() }
    }
}

/// What a fitted model still calls for.
struct Calls {
    chi2: bool,
    search: bool,
    leans: bool,
}

impl Calls {
    fn nothing(&self) -> bool {
        !self.chi2 && !self.search && !self.leans
    }
}

/// All that a verdict is made from.
struct Told<'a> {
    search: &'a Search<'a>,
    options: &'a Options,
    base: &'a Arc<Node>,
    groups: Option<&'a [Vec<usize>]>,
}

impl Told<'_> {
    fn case(&self) -> &Case<'_> {
        self.search.case
    }

    fn name(&self, hypothesis: usize) -> String {
        self.search.hypotheses[hypothesis].name.clone()
    }

    /// A penalty for freedom beside chi2, when models compete.
    fn score(&self, node: &Node) -> f64 {
        node.chi2() + 2.0 * node.fit.parameters.len() as f64
    }

    /// Whether a model calls for more.
    fn calls(&self, node: &Arc<Node>) -> Result<Calls, InputError> {
        let level = self.options.level * if node.added.is_empty() { 1.0 } else { FURTHER };
        let noise = Noise::left_at(self.case(), node);
        let white = Noise { scale: vec![1.0; self.case().data.len()], correlation: noise.correlation };
        // By the textbook first: far beyond it nothing need be simulated.
        if noise.correlation == 0.0 && node.chi2() > node.freedom() + 8.0 * (2.0 * node.freedom()).sqrt() {
            return Ok(Calls { chi2: true, search: false, leans: false });
        }
        let null = self.search.null(node, &white);
        let chi2 = null.chi2_above(node.chi2()) < CHI2 * level;
        let validation = validate(node.mission(), self.case().data, self.options.seed)?;
        let leans = validation.leans.iter().any(|lean| lean.false_alarm < LEAN * level);
        let expansion = self.search.expand(node);
        let alarm = |place: usize, gain: f64| null.false_alarm(place, gain);
        let near: Vec<usize> =
            expansion.promising().into_iter().filter(|&place| alarm(place, expansion.gain(place)) < NEAR).collect();
        let sketches = self.search.sketches(&expansion, &near);
        let search = sketches.iter().any(|sketch| alarm(sketch.last(), node.chi2() - sketch.chi2) < SEARCH * level);
        Ok(Calls { chi2, search, leans })
    }

    /// Searches until a model calls for nothing more, or nothing more helps.
    fn hunt(&self) -> Result<Found, InputError> {
        let hypotheses = self.search.hypotheses.len() as u64;
        (self.search.progress.stage)("every effect", 2 * hypotheses);
        self.search.expand(self.base);
        if self.calls(self.base)?.nothing() {
            let mut found = Found::of(Verdict::Complete, "the model explains the data".into(), vec![self.base.clone()]);
            found.limits = limits::all(self.search, self.base, self.options.level)?;
            return Ok(found);
        }
        let mut tried = vec![self.base.clone()];
        let found = self.lines(&mut tried)?;
        if let Some(reason) = self.odd_rows(found.as_ref(), &tried) {
            return Ok(Found::of(Verdict::Unfit, reason, vec![self.base.clone()]));
        }
        found.map_or_else(|| self.unexplained(&tried), Ok)
    }

    /// One effect more at a time on top of the best few models, from the base on, until one is adopted. All models are kept.
    fn lines(&self, tried: &mut Vec<Arc<Node>>) -> Result<Option<Found>, InputError> {
        let hypotheses = self.search.hypotheses.len() as u64;
        let mut lines = vec![self.base.clone()];
        for depth in 1..=MOST {
            let mut nodes: Vec<Arc<Node>> = Vec::new();
            for line in &lines {
                if depth > 1 {
                    (self.search.progress.stage)("several effects", hypotheses + BREADTH as u64);
                }
                let further = self.further(line, if depth == 1 { usize::MAX } else { BREADTH })?;
                if let Some(found) = self.success(&further)? {
                    return Ok(Some(found));
                }
                nodes.extend(further);
            }
            if depth == 2 {
                let pairs = self.pairs(&lines, &nodes)?;
                if let Some(found) = self.success(&pairs)? {
                    return Ok(Some(found));
                }
                nodes.extend(pairs);
            }
            self.sort(&mut nodes);
            nodes.dedup_by(|a, b| a.set() == b.set());
            self.unlike(&mut nodes);
            let Some(best) = nodes.first() else { break };
            let excess = |node: &Node| (node.chi2() - node.freedom()).max(0.0);
            let helped = excess(best) < WORTH_GOING_ON * excess(&lines[0]);
            tried.extend(nodes.iter().cloned());
            // Two effects can be needed where one is of little use; three are not looked for where the second was.
            if depth > 1 && !helped {
                break;
            }
            nodes.truncate(LINES);
            lines = nodes;
        }
        Ok(None)
    }

    /// Rows that are wrong, where that asks for less than the effects that were found: a row left out counts as a parameter.
    fn odd_rows(&self, found: Option<&Found>, tried: &[Arc<Node>]) -> Option<String> {
        let adopted = found.and_then(|found| found.ladder.last());
        let simpler = tried.iter().filter(|node| adopted.is_none_or(|adopted| node.added.len() < adopted.added.len()));
        let odd =
            simpler.filter_map(|node| audit::odd_rows(self.case(), node).map(|odd| (self.score(node) - odd.fall, odd)));
        let (score, odd) = odd.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let clear = adopted.is_none_or(|adopted| score + MUCH_SIMPLER < self.score(adopted));
        clear.then_some(odd.said)
    }

    /// The best models with one effect more, in full.
    fn further(&self, line: &Arc<Node>, breadth: usize) -> Result<Vec<Arc<Node>>, InputError> {
        let expansion = self.search.expand(line);
        let mut wanted = expansion.promising();
        // Of an effect alone the first order may be wrong, where it is far from there; on top of others it is not.
        wanted.retain(|place| line.added.is_empty() || expansion.gain(*place) > NO_GAIN);
        wanted.truncate(breadth);
        let sketches = self.search.sketches(&expansion, &wanted);
        let gaining = sketches.iter().filter(|sketch| sketch.chi2 < line.chi2() - NO_GAIN);
        let polish = |sketch: &Sketch| self.search.node(sketch, line);
        let mut nodes = gaining.map(polish).collect::<Result<Vec<_>, _>>()?;
        self.sort(&mut nodes);
        Ok(nodes)
    }

    /// The best models with two effects more than the base of which neither is among the lines that were carried on, in full;
    /// without those that leave the same residuals, to first order, as a model that was tried.
    fn pairs(&self, lines: &[Arc<Node>], tried: &[Arc<Node>]) -> Result<Vec<Arc<Node>>, InputError> {
        let expansion = self.search.expand(self.base);
        let carried_on: Vec<usize> = lines.iter().flat_map(|line| line.set()).collect();
        let mut known: Vec<DVector<f64>> = tried.iter().map(|node| node.residuals.clone()).collect();
        let mut wanted = pairs::promising(&expansion, self.search.hypotheses, |place| !carried_on.contains(&place));
        wanted.retain(|pair| {
            let new = known.iter().all(|known| (known - &pair.left).norm_squared() > NO_GAIN.max(THE_SAME * pair.gain));
            if new {
                known.push(pair.left.clone());
            }
            new
        });
        wanted.truncate(BREADTH);
        let sketch = |pair: &Pair| self.search.sketch_of(self.base, &pair.trials);
        let sketches: Vec<Sketch> = wanted.par_iter().filter_map(sketch).collect();
        let polish = |sketch: &Sketch| self.search.node(sketch, self.base);
        let mut nodes = sketches.iter().map(polish).collect::<Result<Vec<_>, _>>()?;
        self.sort(&mut nodes);
        Ok(nodes)
    }

    /// Leaves out those that say the same of the data as a better one: another name for it is tried in its place in the end
    /// (`rivals`), and would take the place of other lines here.
    fn unlike(&self, nodes: &mut Vec<Arc<Node>>) {
        let mut kept: Vec<Arc<Node>> = Vec::new();
        for node in nodes.drain(..) {
            let fall = (self.base.chi2() - node.chi2()).max(0.0);
            let same =
                |other: &Arc<Node>| (&node.residuals - &other.residuals).norm_squared() < NO_GAIN.max(THE_SAME * fall);
            if !kept.iter().any(same) {
                kept.push(node);
            }
        }
        *nodes = kept;
    }

    fn sort(&self, nodes: &mut [Arc<Node>]) {
        nodes.sort_by(|a, b| self.score(a).total_cmp(&self.score(b)).then(a.set().cmp(&b.set())));
    }

    /// The first of the best of some models that calls for nothing more, adopted.
    fn success(&self, nodes: &[Arc<Node>]) -> Result<Option<Found>, InputError> {
        let Some(best) = nodes.first() else { return Ok(None) };
        let near = self.score(best) + rivals::margin(self.options.level);
        for node in nodes.iter().filter(|node| self.score(node) < near).take(LINES) {
            let node = self.search.settled(node)?;
            if self.calls(&node)?.nothing() {
                return self.adopt(&node);
            }
        }
        Ok(None)
    }

    /// The models from the base to one with several effects, that with the larger gain first.
    fn ladder(&self, node: &Arc<Node>) -> Result<Vec<Arc<Node>>, InputError> {
        let mut rest: Vec<usize> = node.added.iter().map(|added| added.hypothesis).collect();
        let mut ladder = vec![self.base.clone()];
        let mut chosen: Vec<usize> = Vec::new();
        while !rest.is_empty() {
            let mut best: Option<(usize, Arc<Node>)> = None;
            for (place, &next) in rest.iter().enumerate() {
                let with: Vec<usize> = chosen.iter().copied().chain([next]).collect();
                let candidate = if rest.len() == 1 { node.clone() } else { self.search.with(self.base, &with)? };
                if best.as_ref().is_none_or(|(_, best)| candidate.chi2() < best.chi2()) {
                    best = Some((place, candidate));
                }
            }
            let (place, next) = best.expect("something is left");
            chosen.push(rest.remove(place));
            ladder.push(next);
        }
        Ok(ladder)
    }

    /// The model without one of its effects (by its place among those added), fitted.
    fn without(&self, node: &Node, place: usize) -> Result<Arc<Node>, InputError> {
        let others = node.added.iter().enumerate().filter(|(other, _)| *other != place);
        self.search.with(self.base, &others.map(|(_, added)| added.hypothesis).collect::<Vec<_>>())
    }

    /// Chance that noise alone makes an effect of a model look as good, given its other effects and the noise it leaves.
    fn false_alarm(&self, node: &Node, place: usize) -> Result<f64, InputError> {
        let parent = self.without(node, place)?;
        let noise = Noise::left_at(self.case(), node);
        let null = self.search.null(&parent, &noise);
        Ok(null.false_alarm(node.added[place].hypothesis, parent.chi2() - node.chi2()))
    }

    /// Whether a model also foretells rows that were left out better than without one of its effects.
    fn confirmed(&self, node: &Node, place: usize) -> Result<bool, InputError> {
        let parent = self.without(node, place)?;
        let better = |groups| holdout::surprise(groups, node) < holdout::surprise(groups, &parent);
        Ok(self.groups.is_none_or(better))
    }

    /// Adopts a model that explains the data, if noise or a few rows alone did not make it.
    fn adopt(&self, node: &Arc<Node>) -> Result<Option<Found>, InputError> {
        let (node, rivals) = rivals::of(self, node)?;
        for place in 0..node.added.len() {
            if self.false_alarm(&node, place)? > self.options.level || !self.confirmed(&node, place)? {
                return Ok(None);
            }
        }
        let names = node.added.iter().map(|added| self.name(added.hypothesis)).collect::<Vec<_>>().join(" and ");
        let mut found = Found::of(Verdict::Missing, format!("the model lacks {names}"), self.ladder(&node)?);
        if !rivals.is_empty() {
            found.verdict = Verdict::Ambiguous;
            found.reason = format!("the model lacks {names}, or an effect that these data cannot tell from it");
            found.next = next::best(self.search, &node, &rivals[0].node, &rivals, &self.options.can)?;
            for adopted in node.added.iter().map(|added| added.hypothesis) {
                let others: Vec<String> = rivals
                    .iter()
                    .filter(|rival| rival.instead_of == adopted)
                    .map(|rival| self.name(rival.hypothesis))
                    .collect();
                if !others.is_empty() {
                    found.alternatives.push([vec![self.name(adopted)], others].concat());
                }
            }
        }
        Ok(Some(found))
    }

    /// No combination explains the data: what helps most, if it helps much, and what residuals lean on; or errors that are
    /// too small, where they lean on nothing and are not off in the mean.
    fn unexplained(&self, tried: &[Arc<Node>]) -> Result<Found, InputError> {
        let validation = validate(self.base.mission(), self.case().data, self.options.seed)?;
        let leans = validation.leans.iter().any(|lean| lean.false_alarm < LEAN * self.options.level);
        let off = validation.sets.iter().any(|set| set.bias_alarm(validation.sets.len()) < LEAN * self.options.level);
        let white = !leans && !off && Noise::left_at(self.case(), self.base).correlation == 0.0;
        if white {
            let best = tried.iter().min_by(|a, b| a.chi2().total_cmp(&b.chi2())).unwrap_or(self.base);
            let reason = audit::sigma_too_small(self.case(), best);
            return Ok(Found::of(Verdict::Unfit, reason, vec![self.base.clone()]));
        }
        let mut ladder = vec![self.base.clone()];
        loop {
            let here = ladder.last().expect("the base").clone();
            let further = tried.iter().filter(|node| {
                node.added.len() == here.added.len() + 1 && here.set().iter().all(|place| node.set().contains(place))
            });
            let Some(next) = further.min_by(|a, b| self.score(a).total_cmp(&self.score(b))) else { break };
            let excess = here.chi2() - here.freedom();
            let newest = newest(&here, next);
            let new = next.added.iter().rposition(|added| added.hypothesis == newest).expect("it was added");
            let helps = here.chi2() - next.chi2() > MOST_OF_IT * excess;
            if !helps || !self.confirmed(next, new)? || self.false_alarm(next, new)? > self.options.level {
                break;
            }
            ladder.push(next.clone());
        }
        let reason = "no combination of the catalogue's effects brings the data down to their noise";
        Ok(Found::of(Verdict::Unexplained, reason.into(), ladder))
    }

    /// Everything that is told of what was found.
    fn diagnosis(
        &self,
        mission: &Mission,
        found: Found,
        held_out: Option<String>,
        notes: Vec<String>,
    ) -> Result<Diagnosis, InputError> {
        let Found { verdict, reason, ladder, alternatives, next, limits } = found;
        let node = ladder.last().expect("the base");
        (self.search.progress.stage)("budget", ladder.len() as u64);
        let improved = Mission { accuracy: mission.accuracy.clone(), ..node.mission().clone() };
        let before = validate(
            &Mission { accuracy: mission.accuracy.clone(), ..self.base.mission().clone() },
            self.case().data,
            self.options.seed,
        )?;
        let after = validate(&improved, self.case().data, self.options.seed)?;
        let rungs: Vec<Rung> = ladder
            .iter()
            .map(|node| {
                self.search.progress.step();
                Rung {
                    chi2: node.chi2(),
                    n: self.case().n(),
                    free: node.fit.parameters.len(),
                    holdout_rms_sigma: self.groups.and_then(|groups| holdout::rms_sigma(groups, node)),
                    budget: budget(node.mission()),
                }
            })
            .collect();
        let values = fit::sides::widened(&node.model, self.case().data, &node.fit)?;
        let mut steps = Vec::new();
        let mut told: Vec<usize> = Vec::new();
        for (index, pair) in ladder.windows(2).enumerate() {
            let hypothesis = newest(&pair[0], &pair[1]);
            // Of two of a kind the first is told first.
            let here = |place: &usize| node.added[*place].hypothesis == hypothesis && !told.contains(place);
            let place = (0..node.added.len()).find(here).expect("it was added");
            told.push(place);
            let added = &node.added[place];
            let parameters = values.iter().filter(|fitted| added.free.contains(&fitted.key)).cloned();
            steps.push(Step {
                effect: self.name(hypothesis),
                parameters: parameters.collect(),
                key: added.key.clone(),
                rung: rungs[index + 1].clone(),
                false_alarm: self.false_alarm(node, place)?,
            });
        }
        let tried = if verdict == Verdict::Unfit { Vec::new() } else { self.tried() };
        let mut covariates: Vec<Leaning> = Vec::new();
        let mut suggestion = None;
        if verdict == Verdict::Unexplained {
            for lean in after.leans.iter().filter(|lean| lean.false_alarm < self.options.level) {
                if covariates.iter().all(|known| known.name != lean.name) {
                    covariates.push(Leaning { name: lean.name.clone(), false_alarm: lean.false_alarm });
                }
            }
            suggestion = formula::suggest(&after, &covariates);
        }
        let parameters = values.iter().filter(|fitted| self.search.base.contains(&fitted.key)).cloned();
        Ok(Diagnosis {
            mission: mission.clone(),
            improved,
            parameters: parameters.collect(),
            verdict,
            reason,
            baseline: rungs[0].clone(),
            steps,
            tried,
            alternatives,
            covariates,
            suggestion,
            next,
            limits,
            held_out,
            noise: Noise::left_at(self.case(), node),
            notes,
            before,
            after,
            advice: node.fit.advice.iter().cloned().chain(self.assumed(node)).collect(),
        })
    }

    /// Numbers of the effects that were added which were not fitted.
    fn assumed(&self, node: &Node) -> Vec<Advice> {
        let of = |added: &Added| {
            let table = effect::table(node.mission(), &added.key)?;
            Some(self.search.hypotheses[added.hypothesis].assumed(&added.key, table, &self.case().reach))
        };
        let assumed = node.added.iter().filter_map(of).flatten();
        assumed.map(|(key, value)| Advice::Assumed { key, value }).collect()
    }

    /// chi2 of every effect alone.
    fn tried(&self) -> Vec<Tried> {
        let expansion = self.search.expand(self.base);
        let tried = |place| Tried { effect: self.name(place), chi2: expansion.chi2(place) };
        let mut tried: Vec<Tried> = (0..self.search.hypotheses.len()).map(tried).collect();
        tried.sort_by(|a, b| a.chi2.unwrap_or(f64::INFINITY).total_cmp(&b.chi2.unwrap_or(f64::INFINITY)));
        tried
    }
}

/// The effect that one model has more than another.
fn newest(before: &Node, after: &Node) -> usize {
    let (known, mut set) = (before.set(), after.set());
    for place in known {
        set.iter().position(|other| *other == place).map(|index| set.remove(index));
    }
    set[0]
}

/// Accuracy of the readout that a date needs.
const FOR_DATES: f64 = 1e-4;

/// When the budget is exceeded.
fn budget(mission: &Mission) -> Option<evaluate::Verdict> {
    let mut coarse = mission.clone();
    coarse.accuracy.relative = coarse.accuracy.relative.max(FOR_DATES);
    evaluate(&coarse).ok().map(|evaluation| evaluation.verdict)
}
