//! The search: sets of effects, the best first, by their evidence.
//!
//! At a fitted set, every form of every other effect is evaluated once (`signature`), and the most promising are fitted (`starts`). The
//! best few sets are carried on, up to three effects, until none of the larger sets has better evidence; those that matter are fitted to
//! their end (`refinement`). Laws of the measurement (`law`) and other values of the mission's numbers (`wrong_number`) stand beside the
//! ranking. What they share is the problem linear in strengths and steps at a fitted set (`linear`).

mod law;
mod linear;
mod refinement;
mod signature;
mod starts;
mod wrong_number;

use nalgebra::DMatrix;

use super::explanation::{Explanation, Fitter};
use super::fitted_model::Added;
use super::hypothesis::Hypothesis;
use super::options::Progress;
use crate::error::InputError;
use crate::mission::Mission;
pub(super) use law::{Law, WithLaw};
use signature::Strength;

/// Prior probability that what is missing is an effect of the catalogue.
const EFFECTS: f64 = 0.9;

/// Effects in a set at most.
const MOST: usize = 3;

/// Sets carried on.
const LINES: usize = 3;

/// Forms of an effect that are fitted; one is enough beside effects that leave only noise.
const FITTED: usize = 3;

/// Rounds in which weights and strengths are estimated in turn.
const ROUNDS: usize = 2;

/// Excess of −2 ln L or −2 ln Z, to first order or after a rough fit, up to which a fit is followed.
const WORTH_A_FIT: f64 = 20.0;

/// Everything that was fitted.
pub(super) struct Searched {
    /// One for each set, best evidence first.
    pub sets: Vec<Explanation>,
    /// The best with a law, if there are any.
    pub law: Option<WithLaw>,
    /// With another value of a number of the mission, the best first.
    pub numbers: Vec<WithLaw>,
    /// What each effect alone leaves to first order (value − model), by its index, and whether its strength is free; None if it changes
    /// nothing.
    pub alone: Vec<Option<(Vec<f64>, bool)>>,
}

impl Searched {
    /// The mission as given, with its free keys fitted.
    pub fn base(&self) -> &Explanation {
        self.find(&[]).expect("it is fitted first")
    }

    /// The fit of a set.
    pub fn find(&self, set: &[usize]) -> Option<&Explanation> {
        self.sets.iter().find(|known| known.set() == set)
    }
}

/// Sets of effects for some data.
pub(super) struct SetSearch<'a> {
    pub fitter: Fitter<'a>,
    pub given: &'a Mission,
    pub hypotheses: &'a [Hypothesis],
    /// Keys that are free from the start.
    pub free: &'a [String],
    pub progress: &'a Progress<'a>,
}

impl SetSearch<'_> {
    /// The mission as given, without a search.
    ///
    /// # Errors
    /// If it has no value for a row.
    pub fn base_alone(&self) -> Result<Searched, InputError> {
        Ok(Searched {
            sets: vec![self.bases()?.remove(0)],
            law: None,
            numbers: Vec::new(),
            alone: vec![None; self.hypotheses.len()],
        })
    }

    /// The whole search.
    ///
    /// # Errors
    /// If the mission as given has no value for a row.
    pub fn run(&self) -> Result<Searched, InputError> {
        (self.progress.stage)("fit of the mission as given", 0);
        let mut lines = self.bases()?;
        let base = lines[0].clone();
        let mut all = vec![base.clone()];
        let mut alone: Vec<Option<(Vec<f64>, bool)>> = vec![None; self.hypotheses.len()];
        for size in 1..=MOST {
            let step = ["", "single effects", "two effects", "three effects"][size];
            if !self.fitter.case.work.allows(step) {
                break;
            }
            (self.progress.stage)(step, lines.len() as u64);
            let mut children: Vec<Explanation> = Vec::new();
            for (place, line) in lines.iter().enumerate() {
                // Beside a smaller set that leaves only noise, another of as many effects as this line will have cannot be better; nor is
                // there more to find on top of another fit of the mission as given.
                let is_explained = all.iter().any(|one| one.added.len() < size && self.is_noise(one));
                let is_found = size == 1 && children.iter().any(|one| self.is_noise(one));
                if is_explained && line.minus_2_ln_z() > best(&lines) || is_found && place > 0 {
                    break;
                }
                let trials = self.trials(line);
                let promises = self.promises(line, &trials);
                if size == 1 {
                    for promise in &promises {
                        let is_free = promise.trial.strength != Strength::Fixed;
                        alone[promise.trial.hypothesis].get_or_insert_with(|| (promise.left.clone(), is_free));
                    }
                }
                let known =
                    |set: &[usize]| children.iter().find(|known| known.set() == set).map(|known| known.objective());
                let forms = if is_explained { 1 } else { FITTED };
                let found = self.fitted(line, &promises, forms, &known);
                children.extend(found);
                if size == 1 {
                    children.extend(self.pairs(line, &trials));
                }
                self.progress.step();
            }
            all.extend(children);
            all = distinct(all);
            let of = |sizes: std::ops::Range<usize>| {
                let some = all.iter().filter(|one| sizes.contains(&one.added.len()));
                some.map(Explanation::minus_2_ln_z).fold(f64::INFINITY, f64::min)
            };
            // A pair may be better although neither of its effects is.
            if of(size..MOST + 1) >= of(0..size) {
                break;
            }
            lines = all.iter().filter(|one| one.added.len() == size).take(LINES).cloned().collect();
        }
        let mut sets = self.refined(distinct(all));
        sets.sort_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()));
        let law = self.best_law(&base, &sets);
        (self.progress.stage)("numbers of the mission", 0);
        let best = sets.first().filter(|best| !best.added.is_empty());
        let mut numbers: Vec<WithLaw> =
            [&base].into_iter().chain(best).flat_map(|line| self.numbers_of(line)).collect();
        numbers.sort_by(|a, b| a.minus_2_ln_z.total_cmp(&b.minus_2_ln_z));
        let mut known: Vec<String> = Vec::new();
        numbers.retain(|number| {
            let is_new = number.law.key().is_some_and(|key| !known.iter().any(|known| known == key));
            known.extend(number.law.key().map(str::to_string));
            is_new
        });
        Ok(Searched { sets, law, numbers, alone })
    }

    /// 2 ln of the number of effects over their probability, and of the intervals of an event.
    fn choices(&self, free: &[String]) -> f64 {
        let intervals = self.fitter.case.reach.epochs_yr.len().saturating_sub(1).max(1) as f64;
        let events = free.iter().filter(|key| is_event_epoch(key)).count() as f64;
        2.0 * (self.hypotheses.len() as f64 / EFFECTS).ln() + events * 2.0 * intervals.ln()
    }

    /// No derivatives are known.
    fn nothing(&self) -> DMatrix<f64> {
        DMatrix::zeros(self.fitter.case.n(), 0)
    }

    pub(super) fn choices_of(&self, added: &[Added]) -> f64 {
        added.iter().map(|added| self.choices(&added.free)).sum()
    }

    /// Whether a fit leaves no more than noise usually does, with the errors as quoted: −2 ln L within three of its standard deviations.
    fn is_noise(&self, one: &Explanation) -> bool {
        let n = self.fitter.case.n() as f64;
        one.minus_2_ln_l < n + 3.0 * (2.0 * n).sqrt()
    }
}

fn is_event_epoch(key: &str) -> bool {
    key.starts_with("effects.") && key.ends_with(".t_yr")
}

/// The least −2 ln Z.
fn best(sets: &[Explanation]) -> f64 {
    sets.iter().map(Explanation::minus_2_ln_z).fold(f64::INFINITY, f64::min)
}

/// The best fit of each set, best evidence first.
fn distinct(mut sets: Vec<Explanation>) -> Vec<Explanation> {
    sets.sort_by(|a, b| a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()).then(a.set().cmp(&b.set())));
    let mut kept: Vec<Explanation> = Vec::new();
    for one in sets {
        if kept.iter().all(|known| known.set() != one.set()) {
            kept.push(one);
        }
    }
    kept
}
