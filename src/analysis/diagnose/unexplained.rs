//! The outcome if no combination of effects explains the data.

use std::sync::Arc;

use super::evidence::{Evidence, Found, newest};
use super::fitted_model::Node;
use super::result::{Reason, Suggestion, Verdict};
use super::significance::correlation;
use super::stopping_rule::TRENDS;
use super::{data_quality, noise};
use crate::analysis::validate::validate;
use crate::error::InputError;

/// Share of the excess of chi2 that an effect must explain to be named although the data remain unexplained.
const MOST_OF_IT: f64 = 0.95;

impl Evidence<'_> {
    /// No combination explains the data. If the residuals of the base have no trend and no offset in the mean, the errors are too
    /// small; otherwise the effects that help most are named if they help much.
    pub(super) fn unexplained(&self, tried: &[Arc<Node>]) -> Result<Found, InputError> {
        let by_score = |a: &&Arc<Node>, b: &&Arc<Node>| self.score(a).total_cmp(&self.score(b));
        if self.is_white_at(self.base, self.options.level)? {
            // With at most one effect: with errors that are too small, several effects could fit anything.
            let simple = tried.iter().filter(|node| node.added.len() <= 1).min_by(by_score);
            let nearest = simple.map(|node| Ok(self.is_white(node)?.then(|| node.clone()))).transpose()?.flatten();
            let best = tried.iter().min_by(|a, b| a.chi2().total_cmp(&b.chi2()));
            let reason = data_quality::sigma_too_small(self.case(), nearest.as_ref().or(best).unwrap_or(self.base));
            return Ok(Found { nearest, ..Found::of(Verdict::Unfit, reason, vec![self.base.clone()]) });
        }
        let mut ladder = vec![self.base.clone()];
        let law = tried.iter().map(|node| self.better_law(node)).collect::<Option<Vec<_>>>();
        let law = law.and_then(|laws| laws.first().copied());
        while law.is_none() {
            let here = ladder.last().expect("the base").clone();
            let further = tried.iter().filter(|node| {
                node.added.len() == here.added.len() + 1 && here.set().iter().all(|place| node.set().contains(place))
            });
            let Some(next) = further.min_by(|a, b| self.score(a).total_cmp(&self.score(b))) else { break };
            let excess = here.chi2() - here.freedom();
            let newest = newest(&here, next);
            let new = next.added.iter().rposition(|added| added.hypothesis == newest).expect("it was added");
            let helps = here.chi2() - next.chi2() > MOST_OF_IT * excess;
            if !helps || !self.confirmed(next, new)? || self.may_be_noise(next, new)? {
                break;
            }
            ladder.push(next.clone());
        }
        let nearest = tried.iter().min_by(by_score).cloned();
        let named = law.filter(|law| law.suggestion.is_law);
        let reason =
            named.map_or_else(|| Reason::Unexplained { undone: self.work().undone() }, |law| law.reason.clone());
        // If no effect helps, the best law is a formula to start from.
        let start = || self.law().filter(|_| ladder.len() == 1);
        let law = law.map(|law| law.suggestion.clone());
        let law = law.or_else(|| start().map(|law| Suggestion { is_law: false, ..law.suggestion.clone() }));
        Ok(Found { nearest, law, ..Found::of(Verdict::Unexplained, reason, ladder) })
    }

    /// Whether a model leaves noise alone, and more of it than can be allowed for. What trends with a condition is not noise, however
    /// much it scatters.
    pub(super) fn leaves_larger_noise(&self, node: &Node) -> Result<bool, InputError> {
        let scale = (node.chi2_of_rows() / node.freedom()).sqrt();
        Ok(noise::is_far_too_small(scale) && self.is_white(node)?)
    }

    /// Whether the residuals of a model have no trend, no offset in the mean and no correlation.
    pub(super) fn is_white(&self, node: &Node) -> Result<bool, InputError> {
        self.is_white_at(node, TRENDS * self.options.level)
    }

    /// The same, with trends and offsets below a probability.
    fn is_white_at(&self, node: &Node, level: f64) -> Result<bool, InputError> {
        let validation = validate(node.mission(), self.case().data, self.options.seed)?;
        let trends = validation.trends.iter().any(|trend| trend.false_alarm < level);
        let off = validation.sets.iter().any(|set| set.bias_alarm(validation.sets.len()) < level);
        Ok(!trends && !off && correlation(self.case(), &node.residuals) == 0.0)
    }
}
