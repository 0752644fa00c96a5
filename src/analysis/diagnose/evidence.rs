//! The evidence for a verdict, and the outcome of a search.

use std::sync::{Arc, OnceLock};

use super::fitted_model::{Case, Node};
use super::measurement_law::MeasurementLaw;
use super::noise::SetNoise;
use super::options::Options;
use super::result::{Limit, Next, Note, Reason, Suggestion, Verdict};
use super::rivals::{self, Rival};
use super::search::Search;
use super::work::Work;

/// The outcome of a search.
pub(super) struct Found {
    pub verdict: Verdict,
    pub reason: Reason,
    /// Models from the base to the final one.
    pub ladder: Vec<Arc<Node>>,
    pub alternatives: Vec<Vec<String>>,
    pub next: Option<Next>,
    pub limits: Vec<Limit>,
    /// Models with another effect in place of one of its effects, the nearest first.
    pub rivals: Vec<Rival>,
    /// Rivals that are only slightly worse and were set aside.
    pub aside: Vec<Note>,
    /// The model nearest to the data if none explains them.
    pub nearest: Option<Arc<Node>>,
    /// A law of the measurement that explains the data better than effects.
    pub law: Option<Suggestion>,
    /// Wrong rows (indices among all), each with its residual in sigma: the search is to be repeated without them.
    pub wrong: Vec<(usize, f64)>,
    /// The errors used in the search.
    pub noise: Vec<SetNoise>,
}

impl Found {
    pub fn of(verdict: Verdict, reason: Reason, ladder: Vec<Arc<Node>>) -> Found {
        Found {
            verdict,
            reason,
            ladder,
            alternatives: Vec::new(),
            next: None,
            limits: Vec::new(),
            rivals: Vec::new(),
            nearest: None,
            aside: Vec::new(),
            law: None,
            wrong: Vec::new(),
            noise: Vec::new(),
        }
    }

    /// Whether a model explains the data.
    pub fn explains(&self) -> bool {
        !matches!(self.verdict, Verdict::Unexplained | Verdict::Unfit)
    }
}

/// The outcome of a search, or of one step of it.
pub(super) enum Ended {
    /// A model explains the data.
    Adopted(Box<Found>),
    /// A model explains the data, but noise can explain its gain.
    ByChance,
    /// A model explains the data, but others come much nearer with one more effect.
    Outdone,
    /// No model does.
    Nothing,
}

/// Everything that a verdict is based on.
pub(super) struct Evidence<'a> {
    pub search: &'a Search<'a>,
    pub options: &'a Options,
    pub base: &'a Arc<Node>,
    /// Columns whose groups of rows are left out, and these groups.
    pub split: Option<&'a (Vec<&'static str>, Vec<Vec<usize>>)>,
    /// The best law of the measurement itself, once it was looked for.
    pub law: OnceLock<Option<MeasurementLaw>>,
}

impl Evidence<'_> {
    pub fn case(&self) -> &Case<'_> {
        self.search.case
    }

    /// Groups of rows that are left out.
    pub fn groups(&self) -> Option<&[Vec<usize>]> {
        self.split.map(|(_, groups)| &groups[..])
    }

    pub fn work(&self) -> &Work {
        &self.case().work
    }

    pub fn name(&self, hypothesis: usize) -> String {
        self.search.hypotheses[hypothesis].name.clone()
    }

    /// chi2 with a penalty for free parameters, to compare models.
    pub fn score(&self, node: &Node) -> f64 {
        let general = node.added.iter().filter(|added| self.search.hypotheses[added.hypothesis].is_general()).count();
        // A general law must gain more than the margin of a rival; otherwise its special case is meant.
        node.chi2() + 2.0 * node.fit.parameters.len() as f64 + rivals::margin(self.options.level) * general as f64
    }

    /// Penalty for parameters, and for the choice of effects among all.
    pub fn cost(&self, node: &Node) -> f64 {
        2.0 * node.fit.parameters.len() as f64 + self.choice() * node.added.len() as f64
    }

    /// Gain of the best of all effects by chance.
    pub fn choice(&self) -> f64 {
        2.0 * (self.search.hypotheses.len() as f64).ln()
    }
}

/// The effect that one model has more than another.
pub(super) fn newest(before: &Node, after: &Node) -> usize {
    let (known, mut set) = (before.set(), after.set());
    for place in known {
        set.iter().position(|other| *other == place).map(|index| set.remove(index));
    }
    set[0]
}
