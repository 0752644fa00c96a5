//! From the sets that were fitted to a verdict, and the models that the report shows.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use super::explanation::Explanation;
use super::fitted_model::{Added, Case, Node};
use super::hypothesis::{Hypothesis, Trial};
use super::options::Options;
use super::ranking::Ranking;
use super::result::{Limit, Next, Note, Reason, Suggestion, Verdict};
use super::set_search::{Law, Searched, SetSearch, WithLaw};
use super::significance::{Noise, Null};
use super::verdict::{self, Named};
use super::work::Work;
use super::{data_quality, experiment_design, holdout, limits};
use crate::analysis::fit;
use crate::analysis::measurement::DataSet;
use crate::analysis::noise::SetNoise;
use crate::analysis::validate::compared;
use crate::effect::{self, AfterFit};
use crate::error::InputError;
use crate::numeric::parallel;

/// Probability of a residual trend, corrected for all that were tested, below which a model does not explain the data.
const TREND: f64 = 1e-3;

/// Share of the excess of chi2 that effects must explain to be named although the data remain unexplained.
const MOST_OF_IT: f64 = 0.95;

/// Sum of squared differences, in errors, below which two models make the same predictions.
const ONE_SIGMA: f64 = 1.0;

/// Difference of chi2 below which two fits have reached the same minimum.
const SAME_MINIMUM: f64 = 0.01;

/// An effect in the place of an adopted one.
pub(super) struct Rival {
    /// Index of the adopted effect among the hypotheses.
    pub instead_of: usize,
    /// Index of the rival.
    pub hypothesis: usize,
    pub node: Arc<Node>,
}

/// The outcome of a search.
pub(super) struct Found {
    pub verdict: Verdict,
    pub reason: Reason,
    /// Models from the base to the final one.
    pub ladder: Vec<Arc<Node>>,
    pub alternatives: Vec<Vec<String>>,
    pub next: Option<Next>,
    pub limits: Vec<Limit>,
    pub notes: Vec<Note>,
    /// A law of the measurement that explains the data better than effects.
    pub law: Option<Suggestion>,
    /// Sets of effects by their evidence; None if there was no search.
    pub ranking: Option<Ranking>,
    pub noise: Vec<SetNoise>,
}

impl Found {
    pub fn of(verdict: Verdict, reason: Reason, ladder: Vec<Arc<Node>>, noise: Vec<SetNoise>) -> Found {
        Found {
            verdict,
            reason,
            ladder,
            alternatives: Vec::new(),
            next: None,
            limits: Vec::new(),
            notes: Vec::new(),
            law: None,
            ranking: None,
            noise,
        }
    }
}

/// Trials of each effect.
type TrialsOfEffects = Arc<Vec<Vec<Trial>>>;

/// Everything that a verdict is based on: data with the errors estimated at the set that is named.
pub(super) struct Evidence<'a> {
    pub case: &'a Case<'a>,
    pub quoted: &'a [DataSet],
    pub search: &'a SetSearch<'a>,
    pub searched: &'a Searched,
    pub options: &'a Options,
    /// Columns whose groups of rows are left out, and these groups.
    pub split: Option<&'a (Vec<&'static str>, Vec<Vec<usize>>)>,
    pub noise: Vec<SetNoise>,
    /// Trials by the set of effects at whose model they were made.
    pub known_trials: Mutex<HashMap<Vec<usize>, TrialsOfEffects>>,
}

impl Evidence<'_> {
    /// Groups of rows that are left out.
    pub fn groups(&self) -> Option<&[Vec<usize>]> {
        self.split.map(|(_, groups)| &groups[..])
    }

    pub fn work(&self) -> &Work {
        &self.case.work
    }

    pub fn name(&self, hypothesis: usize) -> String {
        self.search.hypotheses[hypothesis].name.clone()
    }

    fn names(&self, set: &[usize]) -> Vec<String> {
        set.iter().map(|place| self.name(*place)).collect()
    }

    /// The model of a set, refitted to the data with the errors as allowed for.
    pub fn node(&self, explanation: &Explanation) -> Result<Arc<Node>, InputError> {
        let moments = self.case.reach.epochs_yr.len() > effect::EVENT_EPOCHS;
        let options = fit::Options { scan: false, moments, seed: self.options.seed, ..fit::Options::default() };
        let model = self.search.fitter.model.like(&explanation.mission);
        Node::fit(self.case, &model, explanation.added.clone(), self.search.free, &options).map(Arc::new)
    }

    /// A model, or an equivalent one with plainer values of its effects' parameters, if a fit from there reaches a minimum as low.
    fn plainer(&self, node: Arc<Node>) -> Arc<Node> {
        let epochs_yr = self.case.epochs_yr();
        let free = self.search.free;
        let after = AfterFit { fitted: node.mission(), given: self.search.given, free, epochs_yr: &epochs_yr };
        let plainer = |added: &Added| {
            let entry = effect::find(self.search.hypotheses[added.hypothesis].kind);
            entry.map_or_else(Vec::new, |entry| (entry.plainer)(&after, &added.key))
        };
        let in_order = fit::species_order::restored(node.mission(), self.search.given, free);
        let values = if in_order.is_empty() { node.added.iter().flat_map(plainer).collect() } else { in_order };
        let values: Vec<_> = values.into_iter().map(|(key, value)| (key, value.into())).collect();
        let Some(mission) = (!values.is_empty()).then(|| node.mission().with(&values).ok()).flatten() else {
            return node;
        };
        let options = fit::Options { scan: false, moments: false, seed: self.options.seed, ..fit::Options::default() };
        let other = Node::fit(self.case, &node.model.like(&mission), node.added.clone(), free, &options).ok();
        let as_low = other.filter(|other| other.chi2() < node.chi2() + SAME_MINIMUM);
        as_low.map_or(node, Arc::new)
    }

    /// The model of a set, which is fitted if it was not.
    fn node_of(&self, set: &[usize]) -> Result<Arc<Node>, InputError> {
        match self.searched.find(set) {
            Some(known) => self.node(known),
            None => match self.search.fitted_set(self.searched, set) {
                Some(found) => self.node(&found),
                None => self.node(self.searched.base()),
            },
        }
    }

    /// The models from the base to a set, each time adding first the effect with the better evidence.
    fn ladder(&self, adopted: &Explanation) -> Result<Vec<Arc<Node>>, InputError> {
        let mut rest = adopted.set();
        let mut chosen: Vec<usize> = Vec::new();
        let mut ladder = vec![self.node(self.searched.base())?];
        while !rest.is_empty() {
            if rest.len() == 1 {
                ladder.push(self.plainer(self.node(adopted)?));
                break;
            }
            let mut best: Option<(usize, Arc<Node>)> = None;
            for (place, &next) in rest.iter().enumerate() {
                let mut with: Vec<usize> = chosen.iter().copied().chain([next]).collect();
                with.sort_unstable();
                let candidate = self.node_of(&with)?;
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

    /// Every trial of every effect at a model, for the null distribution; none of an effect that the free parameters absorb.
    pub fn trials(&self, node: &Node) -> TrialsOfEffects {
        let set = node.set();
        let mut known = self.known_trials.lock().expect("nobody panics");
        known.entry(set.clone()).or_insert_with(|| Arc::new(self.trials_at(node, &set))).clone()
    }

    fn trials_at(&self, node: &Node, set: &[usize]) -> Vec<Vec<Trial>> {
        let of = |(place, hypothesis): (usize, &Hypothesis)| {
            let is_new =
                if set.contains(&place) { hypothesis.may_repeat() } else { hypothesis.is_new_to(node.mission()) };
            if is_new { hypothesis.trials(self.case, node) } else { Vec::new() }
        };
        parallel::map(self.search.hypotheses.iter().enumerate(), of)
    }

    /// Probability that noise alone makes the effect that a model has more than another look as good.
    pub fn false_alarm(&self, parent: &Node, node: &Node) -> f64 {
        let noise = Noise::left_at(self.case, node);
        let null = Null::simulate(self.case, parent, &self.trials(parent), &noise, self.options.seed);
        let hypothesis = newest(parent, node);
        null.false_alarm(hypothesis, (parent.chi2() - node.chi2()).max(0.0))
    }

    /// Whether each effect of a ladder's last model also improves the prediction of rows left out.
    fn is_confirmed(&self, ladder: &[Arc<Node>]) -> bool {
        let better = |groups: &[Vec<usize>]| {
            ladder
                .windows(2)
                .all(|pair| holdout::surprise_of_all(groups, &pair[1]) < holdout::surprise_of_all(groups, &pair[0]))
        };
        self.groups().is_none_or(better)
    }

    /// What is named, without rivals that predict rows left out so much worse that this alone decides against them (the product of
    /// their predictive densities: Geisser & Eddy 1979, J. Am. Stat. Assoc. 74, 153).
    fn without_refuted<'s>(&self, named: &Named<'s>, node: &Node) -> Result<Named<'s>, InputError> {
        let Some(groups) = self.groups() else { return Ok(named.clone()) };
        let most = holdout::surprise_of_all(groups, node) + verdict::DECIDED;
        let mut rivals = Vec::new();
        for rival in &named.rivals {
            if holdout::surprise_of_all(groups, &*self.node(rival)?) < most {
                rivals.push(*rival);
            }
        }
        Ok(Named { rivals, ..named.clone() })
    }

    /// The verdict for the set that is named; None if rows left out speak against it.
    pub fn judged(&self, named: &Named) -> Result<Option<Found>, InputError> {
        let ladder = self.ladder(named.adopted)?;
        let named = &self.without_refuted(named, ladder.last().expect("the base"))?;
        let ranking = Some(Ranking::of(self.search, self.searched, named));
        let mut found = self.verdict(named, ladder)?;
        if let (Some(found), Some(larger)) = (&mut found, named.if_errors_are_right) {
            let known = named.adopted.set();
            let effects: Vec<usize> = larger.set().into_iter().filter(|effect| !known.contains(effect)).collect();
            let excess = larger.minus_2_ln_z() - named.adopted.minus_2_ln_z();
            found.notes.push(Note::IfErrorsAreRight { effects: self.names(&effects), excess });
        }
        Ok(found.map(|found| Found { ranking, ..found }))
    }

    fn verdict(&self, named: &Named, ladder: Vec<Arc<Node>>) -> Result<Option<Found>, InputError> {
        let node = ladder.last().expect("the base").clone();
        let found = |verdict, reason, ladder| Found::of(verdict, reason, ladder, self.noise.clone());
        if named.better(self.searched).is_some() {
            return Ok(Some(self.unexplained(named, ladder)));
        }
        // Beside errors that would do as well nothing is certain, whether or not rows left out are predicted better.
        if !node.added.is_empty() && named.or_errors.is_none() && !self.is_confirmed(&ladder) {
            return Ok(None);
        }
        let validation = compared(node.mission(), self.case.data, self.options.seed)?;
        if validation.trends.iter().any(|trend| trend.false_alarm < TREND) {
            return Ok(Some(self.unexplained(named, ladder)));
        }
        if let Some(reason) = data_quality::errors_beyond(self.quoted, &self.noise) {
            return Ok(Some(found(Verdict::Unfit, reason, ladder[..1].to_vec())));
        }
        if node.added.is_empty() {
            let mut found = found(Verdict::Complete, Reason::Explained, ladder);
            let noise = Noise::left_at(self.case, &node);
            let trials = self.trials(&node);
            let null = Null::simulate(self.case, &node, &trials, &noise, self.options.seed);
            found.limits = limits::all(self, &node, &trials, &null);
            if !found.limits.is_empty() && found.limits.iter().all(|limit| limit.table.is_none()) {
                found.notes.push(Note::NothingDetectable);
            }
            return Ok(Some(found));
        }
        self.named(named, ladder).map(Some)
    }

    /// Whether a number makes the predictions of a set: both are then names of one correction, which no measurement like these tells apart.
    fn is_the_same(&self, set: &Explanation, number: &WithLaw) -> bool {
        let left = self.search.fitter.likelihood.off(&set.model);
        let sigmas = self.quoted.iter().flat_map(|data| data.rows.iter().map(|row| row.sigma));
        let apart =
            left.iter().zip(&number.left).zip(sigmas).map(|((set, number), sigma)| ((set - number) / sigma).powi(2));
        apart.sum::<f64>() < ONE_SIGMA
    }

    /// Effects are missing, and what may be in their place.
    fn named(&self, named: &Named, ladder: Vec<Arc<Node>>) -> Result<Found, InputError> {
        let node = ladder.last().expect("the base").clone();
        let adopted = named.adopted.set();
        let effects: Vec<String> = node.added.iter().map(|added| self.name(added.hypothesis)).collect();
        let (same, numbers): (Vec<&WithLaw>, Vec<&WithLaw>) =
            named.numbers.iter().partition(|number| self.is_the_same(named.adopted, number));
        let has_rivals = !named.rivals.is_empty() || named.law_is_rival || !numbers.is_empty();
        let verdict = if has_rivals || named.or_errors.is_some() { Verdict::Ambiguous } else { Verdict::Missing };
        let reason = match named.or_errors {
            Some(without) => self.or_errors(effects, named.adopted, without),
            None => Reason::Lacking { effects, has_rivals },
        };
        let mut found = Found::of(verdict, reason, ladder, self.noise.clone());
        let (rivals, alternatives) = self.rivals_of(named)?;
        found.alternatives = alternatives.iter().map(|set| self.names(set)).collect();
        let or = |found: &mut Found, other: String| match found.alternatives.first_mut() {
            Some(known) => known.push(other),
            None => found.alternatives.push(vec![self.name(adopted[0]), other]),
        };
        if named.or_errors.is_some() && found.alternatives.is_empty() {
            found.alternatives = vec![self.names(&adopted)];
        }
        for number in numbers.iter().chain(&same) {
            let Law::Number { key, given, right } = &number.law else { continue };
            found.notes.push(Note::MayBeANumber { key: key.clone(), given: given.clone(), right: right.clone() });
        }
        numbers.iter().filter_map(|number| number.law.key()).for_each(|key| or(&mut found, key.to_string()));
        if named.law_is_rival {
            or(&mut found, "formula".into());
            found.law = self.law();
        }
        // The first rival that a measurement can distinguish.
        for place in 0..rivals.len() {
            let (case, hypotheses, can) = (self.case, self.search.hypotheses, &self.options.can);
            let rival = &rivals[place];
            found.next = experiment_design::best(case, hypotheses, &node, &rival.node, &rivals[place..], can)?;
            if found.next.is_some() {
                break;
            }
        }
        Ok(found)
    }

    /// Rivals one by one, and for each effect in whose place there are any, that effect and those.
    fn rivals_of(&self, named: &Named) -> Result<(Vec<Rival>, Vec<Vec<usize>>), InputError> {
        let adopted = named.adopted.set();
        let (mut rivals, mut alternatives): (Vec<Rival>, Vec<Vec<usize>>) = (Vec::new(), Vec::new());
        for rival in &named.rivals {
            let set = rival.set();
            let gone = adopted.iter().copied().filter(|effect| !set.contains(effect));
            let new: Vec<usize> = set.iter().copied().filter(|effect| !adopted.contains(effect)).collect();
            for instead_of in gone {
                let place = alternatives.iter().position(|known| known[0] == instead_of);
                let place = place.unwrap_or_else(|| {
                    alternatives.push(vec![instead_of]);
                    alternatives.len() - 1
                });
                for &hypothesis in &new {
                    if !alternatives[place].contains(&hypothesis) {
                        alternatives[place].push(hypothesis);
                        rivals.push(Rival { instead_of, hypothesis, node: self.node(rival)? });
                    }
                }
            }
        }
        Ok((rivals, alternatives))
    }

    /// The law of the measurement, as a formula.
    fn law(&self) -> Option<Suggestion> {
        let law = self.searched.law.as_ref()?;
        let base = self.searched.base();
        law.suggestion(base.minus_2_ln_l)
    }

    /// No combination of effects explains the data. Effects are kept only if they explain nearly all and predict rows left out.
    fn unexplained(&self, named: &Named, ladder: Vec<Arc<Node>>) -> Found {
        let node = ladder.last().expect("the base").clone();
        let base = ladder[0].clone();
        let excess = base.chi2() - base.freedom();
        let better = named.better(self.searched);
        let beside_law = better.map(|law| law.beside.clone());
        let explains = base.chi2() - node.chi2() > MOST_OF_IT * excess && self.is_confirmed(&ladder);
        let keeps = match &beside_law {
            Some(beside) => *beside == node.set() && explains,
            None => explains,
        };
        let reason = match better {
            Some(law) => law.reason(self.names(&law.beside)),
            None => Reason::Unexplained { undone: self.work().undone() },
        };
        let shown = if keeps { ladder } else { vec![base.clone()] };
        let mut found = Found::of(Verdict::Unexplained, reason, shown, self.noise.clone());
        if !node.added.is_empty() {
            found.notes.push(Note::Nearest {
                effects: node.added.iter().map(|added| self.name(added.hypothesis)).collect(),
                chi2: [base.chi2(), node.chi2()],
                n: self.case.n(),
            });
        }
        found.law = better.and_then(|law| law.suggestion(self.searched.base().minus_2_ln_l));
        found
    }

    /// The reason for effects beside which errors other than quoted do as well.
    fn or_errors(&self, effects: Vec<String>, with: &Explanation, without: &Explanation) -> Reason {
        let has_constant = |one: &Explanation, file: usize| one.errors[file].has_pedestal;
        let files = || 0..self.quoted.len();
        let gone: Vec<usize> =
            files().filter(|&file| has_constant(without, file) && !has_constant(with, file)).collect();
        if gone.is_empty() {
            let likelihood = self.search.fitter.likelihood;
            let of = |one: &Explanation, file: usize| likelihood.improbability(file, &one.errors[file]);
            let cost = |file: usize| of(without, file) - of(with, file);
            let file = files().max_by(|a, b| cost(*a).total_cmp(&cost(*b))).expect("a file");
            return Reason::LackingOrErrors { effects, file: self.quoted[file].file.clone() };
        }
        let is_most = |&file: &usize| {
            let constant =
                self.search.fitter.likelihood.pedestal(file, &without.errors[file]).map_or(0.0, |(value, _)| value);
            let rows = &self.quoted[file].rows;
            2.0 * constant.abs() > rows.iter().map(|row| row.value.abs()).sum::<f64>() / rows.len() as f64
        };
        let are_most = gone.iter().all(is_most);
        let files = gone.into_iter().map(|file| self.quoted[file].file.clone()).collect();
        Reason::LackingOrPedestals { effect: effects.join(" and "), files, are_most }
    }
}

/// The effect that one model has more than another.
pub(super) fn newest(before: &Node, after: &Node) -> usize {
    let (known, mut set) = (before.set(), after.set());
    for place in known {
        if let Some(index) = set.iter().position(|other| *other == place) {
            set.remove(index);
        }
    }
    set[0]
}
