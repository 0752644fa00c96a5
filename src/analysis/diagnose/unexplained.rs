//! The outcome if no combination of effects explains the data.

use std::sync::Arc;

use super::data_quality;
use super::evidence::{Evidence, Found, newest};
use super::fitted_model::Node;
use super::result::{Reason, Verdict};
use super::significance::correlation;
use super::stopping_rule::TRENDS;
use crate::analysis::validate::validate;
use crate::error::InputError;

/// Share of the excess of chi2 that an effect must explain to be named although the data remain unexplained.
const MOST_OF_IT: f64 = 0.95;

impl Evidence<'_> {
    /// No combination explains the data. If the residuals of the base have no trend and no offset in the mean, the errors are too
    /// small; otherwise the effects that help most are named if they help much.
    pub(super) fn unexplained(&self, tried: &[Arc<Node>]) -> Result<Found, InputError> {
        let by_score = |a: &&Arc<Node>, b: &&Arc<Node>| self.score(a).total_cmp(&self.score(b));
        if self.is_white(self.base)? {
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
        let law = law.map(|law| law.suggestion.clone());
        Ok(Found { nearest, law, ..Found::of(Verdict::Unexplained, reason, ladder) })
    }

    /// Whether the residuals of a model have no trend, no offset in the mean and no correlation.
    pub(super) fn is_white(&self, node: &Node) -> Result<bool, InputError> {
        let validation = validate(node.mission(), self.case().data, self.options.seed)?;
        let level = TRENDS * self.options.level;
        let trends = validation.trends.iter().any(|trend| trend.false_alarm < level);
        let off = validation.sets.iter().any(|set| set.bias_alarm(validation.sets.len()) < level);
        Ok(!trends && !off && correlation(self.case(), &node.residuals) == 0.0)
    }
}
