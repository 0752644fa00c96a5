//! Summary of all findings for the report.

use std::sync::Arc;

use super::evidence::{Evidence, Found, newest};
use super::fitted_model::{Added, Node};
use super::result::{Covariate, Diagnosis, Note, Rung, Step, Tried, Verdict};
use super::stability::Stability;
use super::unrecorded;
use super::{doubts, formula, holdout};
use crate::analysis::fit::{self, Advice, Fitted};
use crate::analysis::validate::{Validation, compared};
use crate::effect;
use crate::error::InputError;
use crate::mission::Mission;
use crate::physics::accuracy::Purpose;
use crate::plan::evaluate::{self, evaluate};

impl Evidence<'_> {
    /// Summary of all findings.
    pub(super) fn diagnosis(&self, mission: &Mission, found: Found, notes: Vec<Note>) -> Result<Diagnosis, InputError> {
        let Found { verdict, reason, ladder, alternatives, next, limits, notes: own_notes, law, ranking, noise } =
            found;
        let node = ladder.last().expect("the base");
        (self.search.progress.stage)("budget", ladder.len() as u64);
        // A search may use a coarser accuracy than requested.
        let accurate = |node: &Node| Mission { accuracy: mission.accuracy.clone(), ..node.mission().clone() };
        let improved = accurate(node);
        let before = compared(&accurate(&ladder[0]), self.case.data, self.options.seed)?;
        let after = compared(&improved, self.case.data, self.options.seed)?;
        let mut rungs: Vec<Rung> = ladder.iter().map(|node| self.rung(node, &accurate(node))).collect();
        let values = fit::profile_errors::widened(&node.model, self.case.data, &node.fit, &|_| self.case.work.count())?;
        let advice = fit::open_sides::with_open_sides(&node.model, self.case.data, &node.fit, &values, &|_| {
            self.case.work.count()
        })?;
        rungs.last_mut().expect("the base").parameters = values.clone();
        let steps = self.steps(&ladder, &rungs, &values)?;
        let tried = if verdict == Verdict::Unfit { Vec::new() } else { self.tried(&ladder[0]) };
        let is_unexplained = verdict == Verdict::Unexplained;
        let covariates = if is_unexplained { self.covariates(&after) } else { Vec::new() };
        let empirical = || is_unexplained.then(|| formula::suggest(&after, &covariates)).flatten();
        let suggestion = law.or_else(empirical);
        let replaced = doubts::replaced(&steps, &values, &node.fit.advice);
        let unrecorded = matches!(verdict, Verdict::Unexplained | Verdict::Unfit)
            .then(|| unrecorded::temperatures(self.case, &ladder[0]))
            .flatten();
        let mut events_yr = doubts::events_yr(&steps);
        events_yr.extend(suggestion.as_ref().and_then(|law| Some(("the step".to_string(), law.step_yr?))));
        let notes = [
            notes,
            own_notes,
            Vec::from_iter(unrecorded),
            doubts::of(&rungs[0], &steps, &self.case.epochs_yr()),
            replaced,
            doubts::coincidences(&events_yr, self.case.data),
            Vec::from_iter(doubts::release_times(&steps, self.case.data, mission, self.search.free)),
        ]
        .concat();
        let parameters = values.iter().filter(|fitted| self.search.free.contains(&fitted.key)).cloned();
        Ok(Diagnosis {
            mission: mission.clone(),
            improved,
            parameters: parameters.collect(),
            verdict,
            reason,
            baseline: rungs[0].clone(),
            steps,
            ranking,
            tried,
            alternatives,
            covariates,
            suggestion,
            next,
            limits,
            held_out: self.split.map(|(columns, groups)| (columns.join(", "), groups.iter().map(Vec::len).sum())),
            noise,
            stability: Stability::default(),
            notes,
            evaluations: [self.case.work.done(), self.options.evaluations],
            undone: self.case.work.undone(),
            before,
            after,
            advice: advice.into_iter().chain(self.assumed(node)).collect(),
        })
    }

    /// Summary of one model; `mission` has the accuracy requested.
    fn rung(&self, node: &Node, mission: &Mission) -> Rung {
        self.search.progress.step();
        Rung {
            chi2: node.chi2(),
            n: self.case.n(),
            free: node.fit.parameters.len(),
            parameters: node.fit.parameters.clone(),
            holdout_rms_sigma: self.groups().and_then(|groups| holdout::rms_sigma(groups, node)),
            carried: holdout::carried(self.case, node),
            budget: budget(mission),
        }
    }

    /// The effect that each model adds to the previous one; `values` are those of the last model.
    fn steps(&self, ladder: &[Arc<Node>], rungs: &[Rung], values: &[Fitted]) -> Result<Vec<Step>, InputError> {
        let node = ladder.last().expect("the base");
        let mut steps = Vec::new();
        let mut done: Vec<usize> = Vec::new();
        for (index, pair) in ladder.windows(2).enumerate() {
            let hypothesis = newest(&pair[0], &pair[1]);
            // Of two effects of a kind, the first comes first.
            let here = |place: &usize| node.added[*place].hypothesis == hypothesis && !done.contains(place);
            let place = (0..node.added.len()).find(here).expect("it was added");
            done.push(place);
            let added = &node.added[place];
            let parameters = values.iter().filter(|fitted| added.free.contains(&fitted.key)).cloned();
            steps.push(Step {
                effect: self.name(hypothesis),
                parameters: parameters.collect(),
                key: added.key.clone(),
                rung: rungs[index + 1].clone(),
                false_alarm: self.false_alarm(&pair[0], &pair[1]),
            });
        }
        Ok(steps)
    }

    /// Conditions with a remaining residual trend, each once.
    fn covariates(&self, after: &Validation) -> Vec<Covariate> {
        let mut covariates: Vec<Covariate> = Vec::new();
        for trend in after.trends.iter().filter(|trend| trend.false_alarm < self.options.level) {
            if covariates.iter().all(|known| known.name != trend.name) {
                covariates.push(Covariate { name: trend.name.clone(), false_alarm: trend.false_alarm });
            }
        }
        covariates
    }

    /// Parameters of the added effects that were not fitted.
    fn assumed(&self, node: &Node) -> Vec<Advice> {
        let of = |added: &Added| {
            let table = effect::table(node.mission(), &added.key)?;
            Some(self.search.hypotheses[added.hypothesis].assumed(&added.key, table, &self.case.reach))
        };
        let assumed = node.added.iter().filter_map(of).flatten();
        assumed.map(|(key, value)| Advice::Assumed { key, value }).collect()
    }

    /// chi2 of every effect alone: as fitted, or to first order.
    fn tried(&self, base: &Node) -> Vec<Tried> {
        let chi2_of = |model: &[f64]| self.case.residuals(model).norm_squared();
        let trials = self.trials(base);
        let tried = |place: usize| {
            let fitted = self.searched.find(&[place]).map(|known| chi2_of(&known.model));
            let alone = self.searched.alone[place].as_ref();
            let first_order = || alone.map(|(left, _)| self.case.white(left).norm_squared());
            // What can be weaker than any limit is never worse than nothing.
            let is_free = alone.is_none_or(|(_, is_free)| *is_free);
            let no_worse = |chi2: f64| if is_free { chi2.min(base.chi2()) } else { chi2 };
            let is_told = !trials[place].is_empty();
            let chi2 = fitted.or_else(first_order).filter(|_| is_told).map(no_worse);
            Tried { effect: self.name(place), chi2 }
        };
        let mut tried: Vec<Tried> = (0..self.search.hypotheses.len()).map(tried).collect();
        tried.sort_by(|a, b| a.chi2.unwrap_or(f64::INFINITY).total_cmp(&b.chi2.unwrap_or(f64::INFINITY)));
        tried
    }
}

/// When the budget is exceeded.
fn budget(mission: &Mission) -> Option<evaluate::BudgetVerdict> {
    evaluate(&Purpose::Dates.of(mission)).ok().map(|evaluation| evaluation.verdict)
}
