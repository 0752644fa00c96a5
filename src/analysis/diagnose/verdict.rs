//! The verdict: from the evidence of all sets, which one is named, and with which rivals.

use super::explanation::Explanation;
use super::hypothesis::Hypothesis;
use super::set_search::{Searched, WithLaw};
use crate::analysis::likelihood::Likelihood;

/// Difference of −2 ln Z from which one set is decided against another: 27 to 1.
pub(super) const DECIDED: f64 = 6.6;

/// Difference from which evidence is positive (Kass & Raftery 1995, J. Am. Stat. Assoc. 90, 773): of errors that a smaller set needs
/// beside a larger one, the difference from which they are something that the larger set explains.
const POSITIVE: f64 = 2.0;

/// Difference below which two sets are as good.
const EQUAL: f64 = 1.0;

/// The set that is named, and what may be in its place.
#[derive(Clone)]
pub(super) struct Named<'s> {
    pub adopted: &'s Explanation,
    /// Sets that are not decided against, none larger, the best first.
    pub rivals: Vec<&'s Explanation>,
    /// A special case that would do as well, but only with errors that are less probable: which it is, the data do not decide.
    pub or_errors: Option<&'s Explanation>,
    /// A larger set that is not decided against, and needs errors that are decidedly more probable.
    pub if_errors_are_right: Option<&'s Explanation>,
    /// Whether a law explains the data clearly better.
    pub law_is_better: bool,
    /// Whether one explains them better, but not clearly.
    pub law_is_rival: bool,
    /// Whether another value of a number of the mission explains the data decidedly better than effects.
    pub number_is_better: bool,
    /// Other values, in the place of the effects, that are not decided against.
    pub numbers: Vec<&'s WithLaw>,
}

impl Named<'_> {
    /// What explains the data better than any effect: another number of the mission, or a law of the measurement.
    pub fn better<'l>(&self, searched: &'l Searched) -> Option<&'l WithLaw> {
        let number = searched.numbers.first().filter(|_| self.number_is_better);
        let law = searched.law.as_ref().filter(|_| self.law_is_better);
        // A number is physics, and a law imitates it: where both are better, the number stands unless the law is decidedly better.
        match (number, law) {
            (Some(number), Some(law)) if law.minus_2_ln_z + DECIDED < number.minus_2_ln_z => Some(law),
            (number, law) => number.or(law),
        }
    }
}

/// Whether a set is a special case of another: each of its effects is in the other, or a more general one is.
fn is_special(small: &[usize], large: &[usize], hypotheses: &[Hypothesis]) -> bool {
    let mut rest = large.to_vec();
    small.iter().all(|&effect| {
        let same = rest.iter().position(|&other| other == effect);
        let general = || rest.iter().position(|&other| hypotheses[other].generalises(&hypotheses[effect]));
        same.or_else(general).map(|place| rest.remove(place)).is_some()
    })
}

/// Names a set: the best, or the smallest of its subsets that is not decided against.
pub(super) fn name<'s>(
    searched: &'s Searched,
    hypotheses: &[Hypothesis],
    likelihood: &Likelihood,
    is_excluded: &dyn Fn(&[usize]) -> bool,
) -> Named<'s> {
    let allowed: Vec<&Explanation> = searched.sets.iter().filter(|set| !is_excluded(&set.set())).collect();
    let best = allowed.first().expect("the mission as given");
    let near = best.minus_2_ln_z() + DECIDED;
    // Fewer effects, and of as many, fewer general ones.
    let rank = |one: &&&Explanation| {
        (one.added.len(), one.added.iter().filter(|added| hypotheses[added.hypothesis].is_general()).count())
    };
    let special =
        || allowed.iter().filter(|one| one.minus_2_ln_z() < near && is_special(&one.set(), &best.set(), hypotheses));
    let simplest = |ones: &mut dyn Iterator<Item = &'_ &'s Explanation>| {
        ones.min_by(|a, b| rank(a).cmp(&rank(b)).then(a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z()))).copied()
    };
    let improbability = |one: &Explanation| -> f64 {
        one.errors.iter().enumerate().map(|(file, errors)| likelihood.improbability(file, errors)).sum()
    };
    let needs_errors =
        |one: &&&Explanation| improbability(one) > improbability(best) + POSITIVE && one.set() != best.set();
    let or_errors = simplest(&mut special().filter(needs_errors));
    let adopted = simplest(&mut special().filter(|one| !needs_errors(one))).expect("the best itself");
    // Of sets that are as good, that with the fewest parameters stands for all.
    let is_equal = |one: &&&Explanation| {
        one.minus_2_ln_z() < adopted.minus_2_ln_z() + EQUAL && one.added.len() == adopted.added.len()
    };
    let adopted =
        allowed.iter().copied().filter(|one| is_equal(&one)).min_by_key(|one| one.unknowns.len()).unwrap_or(adopted);
    let near = adopted.minus_2_ln_z() + DECIDED;
    let is_rival = |one: &&&Explanation| {
        one.minus_2_ln_z() < near
            && one.added.len() <= adopted.added.len()
            && one.set() != adopted.set()
            && !is_special(&adopted.set(), &one.set(), hypotheses)
    };
    let rivals = allowed.iter().filter(is_rival).copied().collect();
    let spares_errors = |one: &&&Explanation| {
        one.minus_2_ln_z() < near
            && one.added.len() > adopted.added.len()
            && is_special(&adopted.set(), &one.set(), hypotheses)
            && improbability(one) + DECIDED < improbability(adopted)
    };
    let if_errors_are_right = allowed.iter().find(spares_errors).copied();
    let law = searched.law.as_ref().map(|law| law.minus_2_ln_z);
    let law_is_better = law.is_some_and(|law| law + DECIDED < best.minus_2_ln_z());
    let law_is_rival = !law_is_better && law.is_some_and(|law| law < best.minus_2_ln_z());
    let numbers = || searched.numbers.iter();
    let number_is_better = numbers().any(|number| number.minus_2_ln_z + DECIDED < best.minus_2_ln_z());
    let is_rival_number = |number: &&WithLaw| number.minus_2_ln_z < near && number.beside.len() < adopted.added.len();
    let numbers = numbers().filter(|number| !number_is_better && is_rival_number(number)).collect();
    Named {
        adopted,
        rivals,
        or_errors: or_errors.filter(|one| one.added.len() < adopted.added.len()),
        if_errors_are_right,
        law_is_better,
        law_is_rival,
        number_is_better,
        numbers,
    }
}
