//! What a verdict is made from, and what a search came to.

use std::sync::Arc;

use super::fitted_model::{Case, Node};
use super::noise::SetNoise;
use super::options::Options;
use super::result::{Limit, Next, Note, Reason, Verdict};
use super::rivals::{self, Rival};
use super::search::Search;
use super::work::Work;

/// What a search came to.
pub(super) struct Found {
    pub verdict: Verdict,
    pub reason: Reason,
    /// Models from the base to that at the end.
    pub ladder: Vec<Arc<Node>>,
    pub alternatives: Vec<Vec<String>>,
    pub next: Option<Next>,
    pub limits: Vec<Limit>,
    /// Models with others in the place of one of its effects, the nearest first.
    pub rivals: Vec<Rival>,
    /// Rivals that are hardly worse, and were set aside.
    pub aside: Vec<Note>,
    /// The model nearest to the data, where none explains them.
    pub nearest: Option<Arc<Node>>,
    /// Rows that are wrong (by their places among all), each with how far it is off, in sigma: the search is to be repeated without.
    pub wrong: Vec<(usize, f64)>,
    /// The errors that the search saw.
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
            wrong: Vec::new(),
            noise: Vec::new(),
        }
    }

    /// Whether a model explains the data.
    pub fn explains(&self) -> bool {
        !matches!(self.verdict, Verdict::Unexplained | Verdict::Unfit)
    }
}

/// How a search ends, or one step of it.
pub(super) enum Ended {
    /// A model explains the data.
    Adopted(Box<Found>),
    /// A model explains the data, and noise explains what it gains.
    ByChance,
    /// None does.
    Nothing,
}

/// All that a verdict is made from.
pub(super) struct Evidence<'a> {
    pub search: &'a Search<'a>,
    pub options: &'a Options,
    pub base: &'a Arc<Node>,
    /// Columns, and the groups of rows that are left out by them.
    pub split: Option<&'a (Vec<&'static str>, Vec<Vec<usize>>)>,
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

    /// A penalty for freedom beside chi2, when models compete.
    pub fn score(&self, node: &Node) -> f64 {
        let general = node.added.iter().filter(|added| self.search.hypotheses[added.hypothesis].is_general()).count();
        // A general law must bring more than a rival may be worse by, or its special case is what is meant.
        node.chi2() + 2.0 * node.fit.parameters.len() as f64 + rivals::margin(self.options.level) * general as f64
    }

    /// What parameters cost, and the choice of effects among all.
    pub fn cost(&self, node: &Node) -> f64 {
        2.0 * node.fit.parameters.len() as f64 + self.choice() * node.added.len() as f64
    }

    /// What the best of all effects gains by chance.
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
