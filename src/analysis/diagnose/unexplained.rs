//! What is said where no combination of effects explains the data.

use std::sync::Arc;

use super::data_quality;
use super::evidence::{Evidence, Found, newest};
use super::fitted_model::Node;
use super::result::{Reason, Verdict};
use super::significance::correlation;
use super::stopping_rule::LEAN;
use crate::analysis::validate::validate;
use crate::error::InputError;

/// Share of what chi2 has in excess that an effect must explain to be named although the data remain unexplained.
const MOST_OF_IT: f64 = 0.95;

impl Evidence<'_> {
    /// No combination explains the data: what helps most, if it helps much, and what residuals trend on; or errors that are
    /// too small, where they trend on nothing and are not off in the mean.
    pub(super) fn unexplained(&self, tried: &[Arc<Node>]) -> Result<Found, InputError> {
        let validation = validate(self.base.mission(), self.case().data, self.options.seed)?;
        let trends = validation.trends.iter().any(|trend| trend.false_alarm < LEAN * self.options.level);
        let off = validation.sets.iter().any(|set| set.bias_alarm(validation.sets.len()) < LEAN * self.options.level);
        let white = !trends && !off && correlation(self.case(), &self.base.residuals) == 0.0;
        if white {
            let best = tried.iter().min_by(|a, b| a.chi2().total_cmp(&b.chi2())).unwrap_or(self.base);
            let reason = data_quality::sigma_too_small(self.case(), best);
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
        let undone = self.work().undone();
        Ok(Found::of(Verdict::Unexplained, Reason::Unexplained { undone }, ladder))
    }
}
