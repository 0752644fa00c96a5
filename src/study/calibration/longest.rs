//! The longest interval between calibrations that meets all limits.
//!
//! The share u of a limit that is used over the mission, not exceeded with the requested probability, is a function of the interval
//! Δ. From the shortest interval on, Δ increases in equal ratios until u exceeds 1; u(Δ) = 1 is solved between the last two by
//! Brent's method in ln Δ. With few draws u is jagged, as events fall just before or after a calibration; the error of the interval
//! includes this. If u decreases again at longer intervals, as it may because of the dates of single events, these are ignored:
//! every interval tried up to the longest meets the limits.

use serde::Serialize;

use super::{Calibration, Continued, DensityHistories, LEAST_MONTHS, MONTHS, Sensitivity};
use crate::numeric::estimate::quantile;
use crate::numeric::root_finding;
use crate::plan::judgement::Limited;

/// Relative tolerance of the solution for the interval.
pub const TOLERANCE: f64 = 1e-3;

/// Ratio of successive trial intervals.
const RATIO: f64 = 1.3;

/// The longest interval between calibrations.
#[derive(Clone, Debug, Serialize)]
pub struct Longest {
    /// How densities are continued.
    pub continued: Continued,
    /// Whether such an interval exists.
    pub outcome: Outcome,
    /// The interval, months; the length of the mission if that meets the limits, None if no interval does.
    pub interval_months: Option<f64>,
    /// Its standard error from the finite number of draws, months; None without draws, or if the error is as large as the range.
    pub error_months: Option<f64>,
    /// Share of a limit that is used at the shortest interval, %, not exceeded with the requested probability.
    pub used_at_shortest_percent: f64,
    /// The limit with the largest share used at the longest interval, or at the shortest if none meets the limits.
    pub by: Option<Limited>,
}

/// Whether an interval meets the limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Up to the interval found, and not beyond.
    Solved,
    /// No interval meets them, however short.
    NotReachable,
    /// One calibration at launch meets them until the end of the mission.
    AlwaysMet,
}

/// An interval (months), and the used share of a limit for each draw, ascending.
type Tried = (f64, Vec<f64>);

impl Calibration {
    /// The longest interval that meets all limits with the requested probability.
    pub(super) fn longest(
        &self,
        sensitivities: &[Sensitivity],
        histories: &DensityHistories,
        continued: Continued,
    ) -> Longest {
        let used = |months: f64| -> Vec<f64> {
            let worst = self.over_draws(sensitivities, histories, months, continued);
            let mut used: Vec<f64> = worst.iter().map(|worst| worst.used).collect();
            used.sort_by(f64::total_cmp);
            used
        };
        let tried: Vec<Tried> =
            intervals(MONTHS * histories.end_yr).into_iter().map(|months| (months, used(months))).collect();
        let solve = |probability: f64| solved(&tried, probability, &used);
        let (outcome, months) = solve(self.probability);
        // The probability has an error from the finite number of draws: the limits are also solved with a higher and a lower one.
        let drawn = histories.sun_not_drawn.is_none();
        let shown = months.unwrap_or(LEAST_MONTHS);
        let error = histories.error_of_met(&self.over_draws(sensitivities, histories, shown, continued));
        let ends = || [1.0, -1.0].map(|sign| solve((self.probability + sign * error).clamp(0.0, 1.0)));
        let error_months =
            months.filter(|_| drawn && outcome == Outcome::Solved).and_then(|months| half(ends(), months));
        Longest {
            continued,
            outcome,
            interval_months: months,
            error_months,
            used_at_shortest_percent: 100.0 * quantile(&tried[0].1, self.probability),
            by: self.interval(sensitivities, histories, shown, continued).by,
        }
    }
}

/// Half the distance between two ends; if one is out of range, the distance of the other from the value; None if both are.
fn half(ends: [(Outcome, Option<f64>); 2], value: f64) -> Option<f64> {
    let [low, high] = ends.map(|(outcome, months)| months.filter(|_| outcome == Outcome::Solved));
    match (low, high) {
        (Some(low), Some(high)) => Some(0.5 * (high - low)),
        (Some(end), None) | (None, Some(end)) => Some((end - value).abs()),
        (None, None) => None,
    }
}

/// Intervals in equal ratios, from the shortest to the length of the mission (months).
fn intervals(most_months: f64) -> Vec<f64> {
    let least = LEAST_MONTHS.min(most_months);
    let steps = ((most_months / least).ln() / RATIO.ln()).ceil().max(1.0);
    (0..=steps as usize).map(|step| least * (most_months / least).powf(step as f64 / steps)).collect()
}

/// Up to which interval (months) the limits are met with a probability.
fn solved(tried: &[Tried], probability: f64, used: &dyn Fn(f64) -> Vec<f64>) -> (Outcome, Option<f64>) {
    // In logarithms: the curve bends less if the limit is far off.
    let over = |used: &[f64]| quantile(used, probability).max(f64::MIN_POSITIVE).ln();
    match tried.iter().position(|(_, used)| over(used) > 0.0) {
        None => (Outcome::AlwaysMet, tried.last().map(|(months, _)| *months)),
        Some(0) => (Outcome::NotReachable, None),
        Some(first) => {
            let ends = [first - 1, first].map(|place| (tried[place].0.ln(), over(&tried[place].1)));
            let log = root_finding::try_between(ends, TOLERANCE, |log| {
                Ok::<_, std::convert::Infallible>(over(&used(log.exp())))
            });
            (Outcome::Solved, Some(log.unwrap_or_else(|never| match never {}).exp()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten draws that use (k/10)(Δ/6 months)² of a limit: at 90 % it is met up to 6/√0.91 months, between the ninth and the tenth.
    #[test]
    fn an_interval_is_solved_for_and_said_to_be_none_or_any() {
        let used = |scale: f64| {
            move |months: f64| {
                (1..=10).map(|draw| scale * f64::from(draw) / 10.0 * (months / 6.0).powi(2)).collect::<Vec<_>>()
            }
        };
        let of = |scale: f64, probability: f64| {
            let used = used(scale);
            let tried: Vec<Tried> = intervals(60.0).into_iter().map(|months| (months, used(months))).collect();
            assert_eq!((tried[0].0, tried.len()), (LEAST_MONTHS, 26));
            assert!((tried[25].0 / 60.0 - 1.0).abs() < 1e-12);
            solved(&tried, probability, &used)
        };
        let (outcome, months) = of(1.0, 0.9);
        assert_eq!(outcome, Outcome::Solved);
        assert!((months.unwrap() * 0.91_f64.sqrt() / 6.0 - 1.0).abs() < TOLERANCE, "{months:?}");
        assert_eq!(of(1e5, 0.9), (Outcome::NotReachable, None));
        assert_eq!(of(1e-3, 0.9).0, Outcome::AlwaysMet);
        // Half the distance between both ends, or the part of it that exists.
        assert_eq!(half([(Outcome::Solved, Some(4.0)), (Outcome::Solved, Some(7.0))], 5.0), Some(1.5));
        assert_eq!(half([(Outcome::Solved, Some(4.0)), (Outcome::AlwaysMet, Some(60.0))], 5.0), Some(1.0));
        assert_eq!(half([(Outcome::NotReachable, None), (Outcome::AlwaysMet, Some(60.0))], 5.0), None);
    }
}
