//! From the evidence of all sets, which one is named, and with which rivals.

use super::explanation::Explanation;
use super::hypothesis::Hypothesis;
use super::set_search::Searched;

/// Difference of −2 ln Z from which one set is decided against another: 27 to 1.
pub(super) const DECIDED: f64 = 6.6;

/// Difference below which two sets are as good.
const EQUAL: f64 = 1.0;

/// The same for a law of the measurement: it imitates almost any physics, and must be clearly better.
pub(super) const CLEARLY: f64 = 13.0;

/// The set that is named, and what may be in its place.
pub(super) struct Named<'s> {
    pub adopted: &'s Explanation,
    /// Sets that are not decided against, none larger, the best first.
    pub rivals: Vec<&'s Explanation>,
    /// Whether a law explains the data clearly better.
    pub law_is_better: bool,
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
pub(super) fn name<'s>(searched: &'s Searched, hypotheses: &[Hypothesis]) -> Named<'s> {
    let allowed: Vec<&Explanation> = searched.sets.iter().collect();
    let best = allowed.first().expect("the mission as given");
    let near = best.minus_2_ln_z() + DECIDED;
    // Fewer effects, and of as many, fewer general ones.
    let rank = |one: &&&Explanation| {
        (one.added.len(), one.added.iter().filter(|added| hypotheses[added.hypothesis].is_general()).count())
    };
    let subsets =
        allowed.iter().filter(|one| one.minus_2_ln_z() < near && is_special(&one.set(), &best.set(), hypotheses));
    let adopted = subsets
        .min_by(|a, b| rank(a).cmp(&rank(b)).then(a.minus_2_ln_z().total_cmp(&b.minus_2_ln_z())))
        .expect("the best itself");
    // Of sets that are as good, that with the fewest parameters stands for all.
    let is_equal = |one: &&&Explanation| {
        one.minus_2_ln_z() < adopted.minus_2_ln_z() + EQUAL && one.added.len() == adopted.added.len()
    };
    let adopted = allowed.iter().filter(is_equal).min_by_key(|one| one.unknowns.len()).unwrap_or(adopted);
    let near = adopted.minus_2_ln_z() + DECIDED;
    let is_rival = |one: &&&Explanation| {
        one.minus_2_ln_z() < near
            && one.added.len() <= adopted.added.len()
            && one.set() != adopted.set()
            && !is_special(&adopted.set(), &one.set(), hypotheses)
    };
    let rivals = allowed.iter().filter(is_rival).copied().collect();
    let law = searched.law.as_ref().map(|law| law.minus_2_ln_z);
    let law_is_better = law.is_some_and(|law| law + CLEARLY < best.minus_2_ln_z());
    Named { adopted, rivals, law_is_better }
}
