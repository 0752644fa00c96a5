//! Mission and measurements → which physical effect the model lacks.
//!
//! In the order in which mistakes are avoided: whether the data can carry a verdict (`audit`), whether the readout is
//! computed finely enough (`numerics`), the fit of what is free, every effect on top of it and pairs (`hunt`, with
//! `hypothesis`, `search`, `pairs`) until nothing more is called for (`calls`); of what was found how often noise does as well
//! (`adopt`, `chance`), groups of rows left out (`holdout`), rivals (`rivals`), and the measurement that would tell them apart
//! (`next`); or what is left (`unexplained`, `formula`). Then everything that is told of it (`tell`). Nothing is called missing
//! that noise could have made, and nothing is called certain that has a rival.

mod adopt;
mod audit;
mod calls;
mod case;
pub mod chance;
mod formula;
mod holdout;
mod hunt;
pub mod hypothesis;
mod json;
mod limits;
pub mod next;
mod numerics;
mod pairs;
mod rivals;
mod search;
mod tell;
mod unexplained;
mod work;

use std::sync::Arc;

use serde::Serialize;

use crate::analysis::fit::{self, Advice, Fitted, Problem};
use crate::analysis::measurement::DataSet;
use crate::analysis::validate::Validation;
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::physics::observable::Observable;
use crate::plan::evaluate;
use case::{Case, Node};
use chance::Noise;
pub use formula::Suggestion;
pub use hypothesis::Hypothesis;
pub use limits::Limit;
pub use next::Next;
use search::Search;
use work::Work;

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
    /// Evaluations of the model at all rows after which no further step of the search is begun.
    pub evaluations: u64,
}

impl Default for Options {
    fn default() -> Options {
        Options { level: 0.01, seed: 1, free: Vec::new(), candidates: None, can: Vec::new(), evaluations: EVALUATIONS }
    }
}

/// Evaluations of the model that a search may make by default: twice as many as the longest of the cases of
/// `docs/diagnosis.md` takes.
pub const EVALUATIONS: u64 = 12_000;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
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
    /// Their values.
    pub parameters: Vec<Fitted>,
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
#[derive(Clone, Debug, Serialize)]
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
    /// Evaluations of the model at all rows that the search made, and after how many it begins no further step.
    pub evaluations: [u64; 2],
    /// Steps of the search that were left undone for that.
    pub undone: Vec<String>,
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
        let text = crate::mission_file::edit(text, &self.mission, &own);
        crate::mission_file::with_effects(&text, &self.added_effects(), "found by `ctiplan diagnose`")
    }
}

/// Random starting points of the base fit.
const ELSEWHERE: usize = 3;

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
    let case = Case { work: Work::of_at_most(options.evaluations), ..Case::of(data) };
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
    let options = fit::Options { seed, scan: false, ..fit::Options::default() };
    let fit = |model: &Model| Node::fit(case, model, Vec::new(), free, &options);
    let mut best = fit(model)?;
    let clear = best.chi2() > best.freedom() + 4.0 * (2.0 * best.freedom()).sqrt();
    if free.is_empty() || !clear {
        return Ok(best);
    }
    let count = |_| case.work.count();
    for mission in Problem::new(model, case.data, free, &count, |_| true)?.elsewhere(ELSEWHERE, seed, best.chi2()) {
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

    fn work(&self) -> &Work {
        &self.case().work
    }

    fn name(&self, hypothesis: usize) -> String {
        self.search.hypotheses[hypothesis].name.clone()
    }

    /// A penalty for freedom beside chi2, when models compete.
    fn score(&self, node: &Node) -> f64 {
        node.chi2() + 2.0 * node.fit.parameters.len() as f64
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
