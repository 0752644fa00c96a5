//! An evaluation → its requirements, one line each: the table that is signed.

use chrono::NaiveDate;
use serde::Serialize;

use crate::numeric::calendar::date_after;
use crate::plan::date_distribution::{DateDistribution, Dates};
use crate::plan::evaluate::Evaluation;
use crate::plan::population::BiasVerdict;
use crate::plan::requirement::Crossing;

/// A requirement, and whether it is met to the end of the mission.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    /// What is limited.
    pub requirement: String,
    /// Whether software correction is assumed.
    pub corrected: bool,
    /// Its factor; 1 without.
    pub correction_factor: f64,
    /// Whether photon and read noise of one exposure are counted.
    pub noise: bool,
    /// Limit before correction.
    pub limit: f64,
    /// Value at the end of the mission; None where no shape is left.
    pub at_end: Option<f64>,
    /// When the limit is first exceeded, years since launch; None where it is not within the mission.
    pub t_yr: Option<f64>,
    /// The day.
    pub date: Option<NaiveDate>,
    /// Probability that it is met to the end, with the Sun and `[uncertainty]` drawn; None where that was not asked for, or is not
    /// told of this requirement.
    pub probability_met: Option<f64>,
    /// Its standard error from the finite number of draws.
    pub probability_error: Option<f64>,
    /// Whether it is met: with the probability that is asked for where one is told and asked for, as expected otherwise.
    pub met: bool,
}

/// Whether a mission passes: all its requirements are met with correction, noise left out.
pub fn passes(lines: &[Line]) -> bool {
    lines.iter().filter(|line| line.corrected && !line.noise).all(|line| line.met)
}

/// The requirements of an evaluation: |Δe| of the judged galaxy, without and with noise, and shear biases of the population, each
/// without and with correction. `confidence`: the probability that is asked for.
pub fn lines(evaluation: &Evaluation, dates: Option<&DateDistribution>, confidence: Option<f64>) -> Vec<Line> {
    let mission = evaluation.mission();
    let (launch, requirement) = (mission.mission.launch.0, &mission.requirement);
    let line = |what: &str, crossing: &Crossing, corrected: bool, noise: bool, dates: Option<&Dates>| {
        let probability_met = dates.map(|dates| 1.0 - dates.probability_exceeded);
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
            probability_met,
            probability_error: dates.map(|dates| dates.probability_error),
            met: probability_met.zip(confidence).map_or(expected, |(met, asked)| met >= asked),
        }
    };
    let shape = format!("|delta e| of \"{}\"", requirement.galaxy);
    let verdict = &evaluation.verdict;
    let mut lines = vec![
        line(&shape, &verdict.uncorrected, false, false, dates.map(|found| &found.uncorrected)),
        line(&shape, &verdict.corrected, true, false, dates.map(|found| &found.corrected)),
    ];
    if let Some(noise) = &evaluation.noise {
        lines.push(line(&shape, &noise.verdict.uncorrected.crossing, false, true, None));
        lines.push(line(&shape, &noise.verdict.corrected.crossing, true, true, None));
    }
    let mut bias = |name: &str, verdict: &Option<BiasVerdict>| {
        if let Some(verdict) = verdict {
            lines.push(line(name, &verdict.uncorrected, false, false, None));
            lines.push(line(name, &verdict.corrected, true, false, None));
        }
    };
    if let Some(population) = &evaluation.population {
        bias("|c| of the population", &population.c);
        bias("|m| of the population", &population.m);
    }
    lines
}
