//! Which of several missions is best: the common order for the rankings of `compare` and studies.
//!
//! A mission is better if, in this order,
//!
//! 1. it exceeds the first of its uncorrected budgets later after launch, or never,
//! 2. it exceeds the first of its corrected budgets later, or never,
//! 3. if shear biases are limited: the largest share of a budget that it uses at the end is smaller,
//! 4. its |Δe| at the end is smaller; a lost shape is larger than any.

use serde::Serialize;

use crate::plan::judgement::{Judgement, Limited};

/// The quantities by which a mission is ranked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merit {
    /// When the first uncorrected budget is exceeded, years since launch; None if none is within the mission.
    pub uncorrected_yr: Option<f64>,
    /// The same for the corrected budgets.
    pub corrected_yr: Option<f64>,
    /// Largest share of an uncorrected budget that is used at the end of the mission, infinite if no shape is left; 0 if only |Δe|
    /// is limited.
    pub used: f64,
    /// |Δe| at the end of the mission; None if no shape is left, and 0 if it is not limited.
    pub delta_e: Option<f64>,
}

impl Merit {
    /// For a mission with this judgement, as expected or with a probability, and this |Δe| at its end.
    pub fn of(judgement: &Judgement, confidence: Option<f64>, delta_e: Option<f64>) -> Merit {
        let [uncorrected_yr, corrected_yr] = judgement.kept_yr(confidence);
        let used = if judgement.limits_biases() { judgement.used().unwrap_or(f64::INFINITY) } else { 0.0 };
        let delta_e = if judgement.limits(Limited::DeltaE) { delta_e } else { Some(0.0) };
        Merit { uncorrected_yr, corrected_yr, used, delta_e }
    }
}

/// The criterion by which one mission is better than another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The time at which the first uncorrected budget is exceeded, or until which it is met with the requested probability.
    Uncorrected,
    /// The same for the corrected budgets.
    Corrected,
    /// The largest share of a budget that is used at the end of the mission.
    #[serde(rename = "budget_used")]
    Used,
    /// |Δe| at the end of the mission.
    #[serde(rename = "delta_e")]
    End,
}

/// The criteria, in order of precedence.
const CRITERIA: [Criterion; 4] = [Criterion::Uncorrected, Criterion::Corrected, Criterion::Used, Criterion::End];

impl Criterion {
    /// A mission's value, to the digits that tables print: rows that look equal are equal. Times in years to two decimals, which is
    /// four days; None: never, or no shape is left.
    pub fn value(self, merit: &Merit) -> Option<f64> {
        let as_printed = |text: String| text.parse().expect("a number that was printed");
        match self {
            Criterion::Uncorrected => merit.uncorrected_yr.map(|t_yr| as_printed(format!("{t_yr:.2}"))),
            Criterion::Corrected => merit.corrected_yr.map(|t_yr| as_printed(format!("{t_yr:.2}"))),
            Criterion::Used => {
                Some(merit.used).filter(|used| used.is_finite()).map(|used| as_printed(format!("{used:.3}")))
            }
            Criterion::End => merit.delta_e.map(|delta_e| as_printed(format!("{delta_e:.3e}"))),
        }
    }

    /// A number that is larger for a worse mission.
    fn badness(self, merit: &Merit) -> f64 {
        let value = self.value(merit).unwrap_or(f64::INFINITY);
        match self {
            Criterion::Uncorrected | Criterion::Corrected => -value,
            Criterion::Used | Criterion::End => value,
        }
    }
}

/// The best and the worst of several missions, by their indices, in their order: more than one if there are ties.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// The best.
    pub best: Vec<usize>,
    /// The worst.
    pub worst: Vec<usize>,
    /// The criterion by which the best is better than the worst; None if all are equal.
    pub by: Option<Criterion>,
    /// The same by each criterion alone, for those by which missions differ.
    pub each: Vec<Extremes>,
}

/// The best and the worst missions by one criterion alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extremes {
    /// The criterion.
    pub by: Criterion,
    /// The best.
    pub best: Vec<usize>,
    /// The worst.
    pub worst: Vec<usize>,
    /// The value of the best and of the worst: years since launch, share, or |Δe|; None: never exceeded, or no shape is left.
    pub values: [Option<f64>; 2],
}

impl Ranking {
    /// Ranks at least one mission.
    pub fn of(merits: &[Merit]) -> Ranking {
        let each = CRITERIA.into_iter().filter_map(|by| Extremes::of(by, merits)).collect();
        let (best, worst) = (leading(merits, &CRITERIA, 1.0), leading(merits, &CRITERIA, -1.0));
        let differ = |by: &Criterion| by.badness(&merits[best[0]]) != by.badness(&merits[worst[0]]);
        let by = CRITERIA.into_iter().find(differ);
        Ranking { best, worst, by, each }
    }

    /// Criteria by which other missions are the best or the worst.
    pub fn other_criteria(&self) -> impl Iterator<Item = &Extremes> {
        let same = |one: &&Extremes| one.best.contains(&self.best[0]) && one.worst.contains(&self.worst[0]);
        self.each.iter().filter(move |one| !same(one))
    }
}

impl Extremes {
    /// By one criterion; None if all missions are equal.
    fn of(by: Criterion, merits: &[Merit]) -> Option<Extremes> {
        let (best, worst) = (leading(merits, &[by], 1.0), leading(merits, &[by], -1.0));
        let values = [best[0], worst[0]].map(|place| by.value(&merits[place]));
        (values[0] != values[1]).then_some(Extremes { by, best, worst, values })
    }
}

/// The missions that lead by one criterion after the other: with `sign` 1 the best, with −1 the worst.
fn leading(merits: &[Merit], criteria: &[Criterion], sign: f64) -> Vec<usize> {
    let mut places: Vec<usize> = (0..merits.len()).collect();
    for criterion in criteria {
        let badness = |place: &usize| sign * criterion.badness(&merits[*place]);
        let first = places.iter().map(badness).fold(f64::INFINITY, f64::min);
        places.retain(|place| badness(place) == first);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    fn merit(uncorrected_yr: Option<f64>, corrected_yr: Option<f64>, delta_e: Option<f64>) -> Merit {
        Merit { uncorrected_yr, corrected_yr, used: 0.0, delta_e }
    }

    #[test]
    fn where_biases_are_limited_the_budget_used_comes_before_the_galaxy() {
        let used = |used: f64, delta_e: f64| Merit { used, ..merit(None, None, Some(delta_e)) };
        let ranking = Ranking::of(&[used(0.5, 1e-3), used(0.4, 2e-3)]);
        assert_eq!((ranking.best, ranking.by), (vec![1], Some(Criterion::Used)));
    }

    #[test]
    fn what_lasts_longer_is_better_whatever_its_end() {
        let ranking = Ranking::of(&[
            merit(Some(0.25), None, Some(1e-3)),
            merit(Some(4.05), None, Some(2e-3)),
            merit(Some(4.05), None, Some(3e-3)),
        ]);
        assert_eq!((ranking.best, ranking.worst, ranking.by), (vec![1], vec![0], Some(Criterion::Uncorrected)));
        let ranking = Ranking::of(&[merit(None, Some(3.0), Some(1e-2)), merit(None, None, Some(2e-2))]);
        assert_eq!((ranking.best, ranking.by), (vec![1], Some(Criterion::Corrected)));
        let ranking = Ranking::of(&[merit(None, None, None), merit(None, None, Some(2e-2))]);
        assert_eq!((ranking.best, ranking.worst, ranking.by), (vec![1], vec![0], Some(Criterion::End)));
    }

    #[test]
    fn ties_are_all_named() {
        let alike = [merit(None, None, Some(1e-4)), merit(None, None, Some(1e-4 * (1.0 + 1e-12)))];
        assert_eq!(Ranking::of(&alike), Ranking { best: vec![0, 1], worst: vec![0, 1], by: None, each: Vec::new() });
        let lost = [merit(Some(0.0), Some(1.0), None), merit(Some(0.0), Some(1.0), None)];
        assert_eq!(Ranking::of(&lost).by, None);
        // What is printed alike, here to four days, counts as equal.
        let ranking = Ranking::of(&[merit(Some(2.0), None, Some(2e-3)), merit(Some(2.0003), None, Some(1e-3))]);
        assert_eq!((ranking.best, ranking.by), (vec![1], Some(Criterion::End)));
    }

    /// Every best and worst is an extreme of what is printed, and all equals of it are named, for any dates.
    #[test]
    fn each_criterion_alone_has_its_own_best_and_worst() {
        let ranking = Ranking::of(&[
            merit(Some(0.231), Some(6.29), Some(1.1e-2)),
            merit(Some(3.97), Some(6.10), Some(1.2e-2)),
            merit(Some(0.229), Some(2.36), Some(1.4e-2)),
            merit(Some(0.24), Some(2.39), Some(2.7e-2)),
            merit(Some(0.232), Some(2.361), Some(1.8e-2)),
        ]);
        assert_eq!((&ranking.best, &ranking.worst, ranking.by), (&vec![1], &vec![4], Some(Criterion::Uncorrected)));
        let others: Vec<_> = ranking.other_criteria().map(|one| (one.by, &one.best[..], &one.worst[..])).collect();
        assert_eq!(others, [(Criterion::Corrected, &[0][..], &[2, 4][..]), (Criterion::End, &[0][..], &[3][..]),]);
        assert_eq!(ranking.each[0].values, [Some(3.97), Some(0.23)]);
        assert_eq!(ranking.each[0].worst, [0, 2, 4]);
    }
}
