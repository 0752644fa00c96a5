//! An evaluation → its requirements, one line each: the compliance table.

use chrono::NaiveDate;
use serde::Serialize;

use crate::numeric::calendar::date_after;
use crate::plan::curve::Crossing;
use crate::plan::date_distribution::{DateDistribution, Dates, LimitDates};
use crate::plan::evaluate::Evaluation;
use crate::plan::population::BiasVerdict;

/// A requirement, and whether it is met until the end of the mission.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    /// The limited quantity.
    pub requirement: String,
    /// Whether software correction is assumed.
    pub corrected: bool,
    /// The correction factor; 1 without correction.
    pub correction_factor: f64,
    /// Whether photon and read noise of one exposure are included.
    pub noise: bool,
    /// Limit before correction.
    pub limit: f64,
    /// Value at the end of the mission; None if the shape is lost.
    pub at_end: Option<f64>,
    /// When the limit is first exceeded, years since launch; None if not within the mission.
    pub t_yr: Option<f64>,
    /// The day.
    pub date: Option<NaiveDate>,
    /// Probability that it is met until the end, with the Sun and `[uncertainty]` drawn; for shear biases estimated from the number
    /// of traps alone. None if not requested, or if it cannot be estimated for this requirement.
    pub probability_met: Option<f64>,
    /// Its standard error from the finite number of draws.
    pub probability_error: Option<f64>,
    /// Whether it is met: with the requested probability if there is one and it can be estimated, otherwise by the expected value.
    pub met: bool,
    /// Whether `met` is decided by a probability.
    pub by_probability: bool,
    /// Whether it limits the population, for which probabilities are estimated from the number of traps alone.
    #[serde(skip)]
    pub of_population: bool,
}

/// Whether a mission passes: all its requirements with correction and without noise are met.
pub fn passes(lines: &[Line]) -> bool {
    lines.iter().filter(|line| line.corrected && !line.noise).all(|line| line.met)
}

/// The requirements of an evaluation: |Δe| of the judged galaxy, without and with noise, and shear biases of the population, each
/// without and with correction. `confidence`: the requested probability.
pub fn lines(evaluation: &Evaluation, dates: Option<&DateDistribution>, confidence: Option<f64>) -> Vec<Line> {
    let mission = evaluation.mission();
    let (launch, requirement) = (mission.mission.launch.0, &mission.requirement);
    let line = |what: &str, crossing: &Crossing, corrected: bool, noise: bool, probability: Option<(f64, f64)>| {
        let expected = crossing.crossings_yr.is_empty();
        Line {
            requirement: what.to_string(),
            corrected,
            correction_factor: if corrected { requirement.correction_factor } else { 1.0 },
            noise,
            limit: crossing.limit,
            at_end: crossing.margin.map(|margin| crossing.limit - margin),
            t_yr: crossing.t_yr,
            date: crossing.t_yr.and_then(|t_yr| date_after(launch, t_yr)),
            probability_met: probability.map(|met| met.0),
            probability_error: probability.map(|met| met.1),
            of_population: false,
            by_probability: probability.is_some() && confidence.is_some(),
            met: probability.zip(confidence).map_or(expected, |(met, required)| met.0 >= required),
        }
    };
    let of_dates = |dates: &Dates| (dates.probability_met(), dates.probability_error);
    let mut lines = Vec::new();
    if requirement.limits_a_galaxy() {
        let shape = format!("|delta e| of \"{}\"", requirement.galaxy);
        let verdict = &evaluation.verdict;
        lines.push(line(&shape, &verdict.uncorrected, false, false, dates.map(|found| of_dates(&found.uncorrected))));
        lines.push(line(&shape, &verdict.corrected, true, false, dates.map(|found| of_dates(&found.corrected))));
        if let Some(noise) = &evaluation.noise {
            lines.push(line(&shape, &noise.verdict.uncorrected.crossing, false, true, None));
            lines.push(line(&shape, &noise.verdict.corrected.crossing, true, true, None));
        }
    }
    let mut bias = |name: &str, verdict: &Option<BiasVerdict>, dates: Option<&LimitDates>| {
        let Some(verdict) = verdict else { return };
        for (crossing, corrected) in [(&verdict.uncorrected, false), (&verdict.corrected, true)] {
            let met = dates.map(|dates| of_dates(if corrected { &dates.corrected } else { &dates.uncorrected }));
            lines.push(Line { of_population: true, ..line(name, crossing, corrected, false, met) });
        }
    };
    if let Some(population) = &evaluation.population {
        bias("|c| of the population", &population.c, dates.and_then(|found| found.c.as_ref()));
        bias("|m| of the population", &population.m, dates.and_then(|found| found.m.as_ref()));
    }
    lines
}
