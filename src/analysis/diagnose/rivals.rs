//! Effects that explain the data as well as the adopted one.
//!
//! Every other effect is fitted in place of each adopted effect. If a rival were the truth, the adopted effect could have a chi2
//! lower by d by chance with a probability of at most Φ(−√d): the difference of the two fits has a mean of λ and a standard
//! deviation of 2√λ, and λ = d is the worst case. A rival is ruled out if this is below half the level. Each additional parameter
//! of the adopted effect widens this margin by 2, and each additional parameter of the rival narrows it by 1.

use std::collections::HashSet;
use std::sync::Arc;

use statrs::distribution::{ContinuousCDF, Normal};

use super::evidence::Evidence;
use super::fitted_model::Node;
use super::holdout;
use super::result::Note;
use crate::error::InputError;

/// An effect in the place of an adopted one.
pub struct Rival {
    /// Index of the adopted effect among the hypotheses.
    pub(super) instead_of: usize,
    /// Index of the rival.
    pub(super) hypothesis: usize,
    pub(super) node: Arc<Node>,
}

/// Other models that explain the data.
pub(super) struct Around {
    /// Equally well, lowest chi2 first.
    pub rivals: Vec<Rival>,
    /// Slightly worse.
    pub aside: Vec<Note>,
}

/// Excess of chi2 below which a rival is not ruled out.
pub(super) fn margin(level: f64) -> f64 {
    Normal::standard().inverse_cdf(level / 2.0).powi(2)
}

/// Share of the gain of an effect that a rival must reach to first order to be fitted, if there are other effects.
const LITTLE: f64 = 0.2;

/// Rivals within this number of margins are reported as set aside.
const NEARLY: f64 = 2.0;

/// Share of what the adopted effect explains that such a rival must explain.
const MOST_OF_IT: f64 = 0.5;

/// Sketches are rough: those within this number of margins are fitted in full.
const ROUGH: f64 = 3.0;

/// Difference of chi2, corrected for parameters, below which two models explain the data equally well.
const EQUAL: f64 = 1.0;

/// A model's rivals, lowest chi2 first; and the model itself, or a preferred rival: one that is better by its number of parameters,
/// or, among equals, one that predicts the ends of the conditions' ranges better from the rest. (Among all models within the margin
/// of a rival, the best at the ends was the true one less often than the one with the lowest chi2: the ends are few rows.)
pub(super) fn of(evidence: &Evidence, node: &Arc<Node>) -> Result<(Arc<Node>, Around), InputError> {
    let mut adopted = node.clone();
    // A preferred rival has rivals of its own.
    for _ in 0..3 {
        let around = around(evidence, &adopted)?;
        match preferred(evidence, &adopted, &around.rivals) {
            Some(best) => adopted = best,
            None => return Ok((adopted, around)),
        }
    }
    let around = around(evidence, &adopted)?;
    Ok((adopted, around))
}

/// The rival preferred to a model; None if the model is the best.
fn preferred(evidence: &Evidence, node: &Arc<Node>, rivals: &[Rival]) -> Option<Arc<Node>> {
    let beyond = |node: &Node| holdout::surprise_beyond(evidence.case(), node);
    let all = || std::iter::once(node).chain(rivals.iter().map(|rival| &rival.node));
    let least = all().map(|node| evidence.score(node)).fold(f64::INFINITY, f64::min);
    let equal = all().filter(|node| evidence.score(node) < least + EQUAL);
    let best = equal.min_by(|a, b| beyond(a).total_cmp(&beyond(b)))?;
    (best.set() != node.set()).then(|| best.clone())
}

/// Rivals of a model, and those that are only slightly worse.
fn around(evidence: &Evidence, node: &Arc<Node>) -> Result<Around, InputError> {
    let margin = margin(evidence.options.level);
    let (mut rivals, mut worse): (Vec<Rival>, Vec<Rival>) = Default::default();
    for (place, added) in node.added.iter().enumerate() {
        let parent = evidence.without(node, place)?;
        let expansion = evidence.search.expand(&parent);
        let needed = LITTLE * (parent.chi2() - node.chi2());
        let mut wanted = expansion.promising();
        wanted.retain(|place| parent.added.is_empty() || expansion.gain(*place) > needed);
        let mut sketches = evidence.search.sketches(&expansion, &wanted);
        if !parent.added.is_empty() {
            sketches.extend(evidence.search.sketches_in_place(&parent, node, place, &wanted));
            sketches.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
            let mut seen = HashSet::new();
            sketches.retain(|sketch| seen.insert(sketch.last()));
        }
        for sketch in sketches.iter().filter(|sketch| sketch.last() != added.hypothesis) {
            if sketch.chi2 > node.chi2() + ROUGH * margin || node.set().contains(&sketch.last()) {
                continue;
            }
            let rival = evidence.search.settled(&*evidence.search.node(sketch, &parent)?)?;
            let [general, special] = [sketch.last(), added.hypothesis].map(|place| &evidence.search.hypotheses[place]);
            // A generalisation of the same effect is no rival.
            if general.generalises(special) && rival.chi2() > node.chi2() - margin {
                continue;
            }
            // Each parameter lowers chi2 by 1 on average, whether it is needed or not.
            let freedom = node.fit.parameters.len() as f64 - rival.fit.parameters.len() as f64;
            if rival.chi2() < node.chi2() + margin + 2.0 * freedom.max(0.0) + freedom.min(0.0) {
                rivals.push(Rival { instead_of: added.hypothesis, hypothesis: sketch.last(), node: rival });
            } else if rival.chi2() < node.chi2() + NEARLY * margin
                && parent.chi2() - rival.chi2() > MOST_OF_IT * (parent.chi2() - node.chi2())
            {
                worse.push(Rival { instead_of: added.hypothesis, hypothesis: sketch.last(), node: rival });
            }
        }
    }
    let mut seen = HashSet::new();
    for found in [&mut rivals, &mut worse] {
        found.sort_by(|a, b| a.node.chi2().total_cmp(&b.node.chi2()).then(a.hypothesis.cmp(&b.hypothesis)));
        // The same effect in place of each of several equal ones is one rival, at its nearest.
        found.retain(|rival| seen.insert((rival.hypothesis, rival.instead_of)));
    }
    let note = |rival: &Rival| Note::SetAside {
        effect: evidence.name(rival.hypothesis),
        instead_of: evidence.name(rival.instead_of),
        chi2: rival.node.chi2() - node.chi2(),
        parameters: rival.node.fit.parameters.len() as i64 - node.fit.parameters.len() as i64,
    };
    let aside = worse.iter().map(note).collect();
    Ok(Around { rivals, aside })
}
