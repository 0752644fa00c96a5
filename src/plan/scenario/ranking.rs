//! Which of several missions is best: the common order for the rankings of `compare` and studies.
//!
//! A mission is better if, in this order,
//!
//! 1. it exceeds the first of its uncorrected budgets later after launch, or never,
//! 2. it exceeds the first of its corrected budgets later, or never,
//! 3. if shear biases are limited: the largest share of a budget that it uses at the end is smaller,
//! 4. its |Δe| at the end is smaller; a lost shape is larger than any.

use serde::Serialize;

use crate::numeric::calendar::DAYS_PER_YEAR;
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

/// Relative difference below which two |Δe| are equal except for rounding.
const ROUNDING: f64 = 1e-6;

impl Criterion {
    /// A number that is larger for a worse mission.
    fn badness(self, merit: &Merit) -> f64 {
        let time = |t_yr: Option<f64>| -t_yr.unwrap_or(f64::INFINITY);
        match self {
            Criterion::Uncorrected => time(merit.uncorrected_yr),
            Criterion::Corrected => time(merit.corrected_yr),
            Criterion::Used => merit.used,
            Criterion::End => merit.delta_e.unwrap_or(f64::INFINITY),
        }
    }

    /// Whether two such numbers count as equal: times to a day, the resolution of printed dates; |Δe| except for rounding.
    fn equal(self, a: f64, b: f64) -> bool {
        let tolerance = match self {
            Criterion::Uncorrected | Criterion::Corrected => 1.0 / DAYS_PER_YEAR,
            Criterion::Used | Criterion::End => ROUNDING * a.abs().min(b.abs()),
        };
        a == b || (a - b).abs() <= tolerance
    }
}

/// The best and the worst of several missions, by their indices, in their order: more than one if there are ties.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranking {
    /// The best.
    pub best: Vec<usize>,
    /// The worst.
    pub worst: Vec<usize>,
    /// The criterion by which the best is better than the worst; None if all are equal.
    pub by: Option<Criterion>,
}

impl Ranking {
    /// Ranks at least one mission.
    pub fn of(merits: &[Merit]) -> Ranking {
        let (best, worst) = (leading(merits, 1.0), leading(merits, -1.0));
        let differ = |criterion: &Criterion| {
            !criterion.equal(criterion.badness(&merits[best[0]]), criterion.badness(&merits[worst[0]]))
        };
        let by = CRITERIA.into_iter().find(differ);
        Ranking { best, worst, by }
    }
}

/// The missions that lead by one criterion after the other: with `sign` 1 the best, with −1 the worst.
fn leading(merits: &[Merit], sign: f64) -> Vec<usize> {
    let mut places: Vec<usize> = (0..merits.len()).collect();
    for criterion in CRITERIA {
        let badness = |place: &usize| criterion.badness(&merits[*place]);
        let first = places.iter().map(|place| sign * badness(place)).fold(f64::INFINITY, f64::min);
        places.retain(|place| criterion.equal(badness(place), sign * first));
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
        assert_eq!(ranking, Ranking { best: vec![1], worst: vec![0], by: Some(Criterion::Uncorrected) });
        let ranking = Ranking::of(&[merit(None, Some(3.0), Some(1e-2)), merit(None, None, Some(2e-2))]);
        assert_eq!((ranking.best, ranking.by), (vec![1], Some(Criterion::Corrected)));
        let ranking = Ranking::of(&[merit(None, None, None), merit(None, None, Some(2e-2))]);
        assert_eq!((ranking.best, ranking.worst, ranking.by), (vec![1], vec![0], Some(Criterion::End)));
    }

    #[test]
    fn ties_are_all_named() {
        let alike = [merit(None, None, Some(1e-4)), merit(None, None, Some(1e-4 * (1.0 + 1e-12)))];
        assert_eq!(Ranking::of(&alike), Ranking { best: vec![0, 1], worst: vec![0, 1], by: None });
        let lost = [merit(Some(0.0), Some(1.0), None), merit(Some(0.0), Some(1.0), None)];
        assert_eq!(Ranking::of(&lost).by, None);
        // A tenth of a day counts as equal.
        let ranking = Ranking::of(&[merit(Some(2.0), None, Some(2e-3)), merit(Some(2.0003), None, Some(1e-3))]);
        assert_eq!((ranking.best, ranking.by), (vec![1], Some(Criterion::End)));
    }
}
