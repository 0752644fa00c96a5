//! All budgets of a requirement, judged together: |Δe| of the judged galaxy, and the shear biases c and m of the population.
//!
//! A requirement is met until the first of its budgets is exceeded. With a confidence, this is estimated from draws.

use std::collections::BTreeMap;

use chrono::NaiveDate;
use serde::Serialize;

use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::numeric::calendar::date_after;
use crate::plan::curve::{Crossing, Curve};
use crate::plan::date_distribution::{Confidence, DateDistribution};
use crate::plan::population::{BiasVerdict, PopulationBias};

/// The quantity limited by a budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limited {
    /// |Δe| of the judged galaxy.
    DeltaE,
    /// Additive shear bias of the population.
    C,
    /// Multiplicative shear bias of the population.
    M,
}

impl Limited {
    /// The quantities that a mission limits.
    pub fn by(mission: &Mission) -> Vec<Limited> {
        let requirement = &mission.requirement;
        let stated = [
            (Limited::DeltaE, requirement.limits_a_galaxy()),
            (Limited::C, requirement.c.is_some()),
            (Limited::M, requirement.m.is_some()),
        ];
        stated.into_iter().filter(|(_, stated)| *stated).map(|(limited, _)| limited).collect()
    }

    /// Its symbol in text.
    pub fn symbol(self) -> &'static str {
        match self {
            Limited::DeltaE => "|delta e|",
            Limited::C => "|c|",
            Limited::M => "|m|",
        }
    }

    /// Its key.
    pub fn key(self) -> &'static str {
        match self {
            Limited::DeltaE => "delta_e",
            Limited::C => "c",
            Limited::M => "m",
        }
    }
}

/// A budget, and when it is exceeded.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    /// The limited quantity.
    pub limited: Limited,
    /// Without and with software correction.
    pub crossings: [Crossing; 2],
}

impl Budget {
    /// Value at the end of the mission; None if no shape is left.
    pub fn at_end(&self) -> Option<f64> {
        self.crossings[0].margin.map(|margin| self.crossings[0].limit - margin)
    }
}

/// The judgement of all budgets of a mission.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// The stated budgets.
    pub budgets: Vec<Budget>,
    /// The date as a distribution, if a confidence is requested.
    pub distribution: Option<DateDistribution>,
}

impl Judgement {
    /// For a mission, with the crossings of the uncorrected and the corrected budget by its judged galaxy.
    ///
    /// # Errors
    /// If a formula has no value, no galaxy of the population can be measured, or a probability cannot be estimated.
    pub fn of(
        model: &Model,
        of_galaxy: [Crossing; 2],
        confidence: Option<Confidence>,
    ) -> Result<Judgement, InputError> {
        let mission = &model.mission;
        let requirement = &mission.requirement;
        let limits_biases = requirement.c.is_some() || requirement.m.is_some();
        let biases = if limits_biases { PopulationBias::of(model, mission.accuracy.seed)? } else { None };
        let mut budgets = Vec::new();
        if requirement.limits_a_galaxy() {
            budgets.push(Budget { limited: Limited::DeltaE, crossings: of_galaxy });
        }
        if let Some(biases) = &biases {
            let budget = |limited: Limited, verdict: &Option<BiasVerdict>| {
                let crossings = verdict.clone().map(|verdict| [verdict.uncorrected, verdict.corrected]);
                crossings.map(|crossings| Budget { limited, crossings })
            };
            budgets.extend(budget(Limited::C, &biases.c));
            budgets.extend(budget(Limited::M, &biases.m));
        }
        let distribution = confidence.map(|required| required.of(mission, biases.as_ref())).transpose()?;
        Ok(Judgement { budgets, distribution })
    }

    /// For a model whose |Δe| is known over time.
    ///
    /// # Errors
    /// As [`Judgement::of`].
    pub fn along(model: &Model, curve: &Curve, confidence: Option<Confidence>) -> Result<Judgement, InputError> {
        let of_galaxy = model.mission.requirement.limits().map(|limit| curve.crossing(limit));
        Judgement::of(model, of_galaxy, confidence)
    }

    /// The budget that is exceeded first, and when (years since launch), without and with correction; None if none is within the
    /// mission.
    pub fn first(&self) -> [Option<(Limited, f64)>; 2] {
        [0, 1].map(|corrected| {
            let exceeded =
                self.budgets.iter().filter_map(|budget| Some((budget.limited, budget.crossings[corrected].t_yr?)));
            exceeded.min_by(|a, b| a.1.total_cmp(&b.1))
        })
    }

    /// Largest share of an uncorrected budget that is used at the end of the mission; None if no shape is left.
    pub fn used(&self) -> Option<f64> {
        let used = self.budgets.iter().map(|budget| Some(budget.at_end()? / budget.crossings[0].limit));
        used.collect::<Option<Vec<f64>>>().map(|used| used.into_iter().fold(0.0, f64::max))
    }

    /// How long (years since launch) all budgets are met, without and with correction, as expected or with a probability; None if
    /// until the end of the mission.
    pub fn kept_yr(&self, confidence: Option<f64>) -> [Option<f64>; 2] {
        match (&self.distribution, confidence) {
            (Some(found), Some(p)) => found.requirement().map(|dates| dates.kept_yr(p)),
            _ => self.first().map(|first| first.map(|(_, t_yr)| t_yr)),
        }
    }

    /// Whether there is a budget for this quantity.
    pub fn limits(&self, limited: Limited) -> bool {
        self.budgets.iter().any(|budget| budget.limited == limited)
    }

    /// Whether shear biases of a population are limited.
    pub fn limits_biases(&self) -> bool {
        self.limits(Limited::C) || self.limits(Limited::M)
    }
}

/// Dates and probabilities of a judgement, for a row of a table.
#[derive(Clone, Debug, Serialize)]
pub struct JudgedRow {
    /// When the first uncorrected budget is exceeded, years since launch; None if none is, here and below.
    pub exceeded_t_yr: Option<f64>,
    /// The same as a day.
    pub exceeded_date: Option<NaiveDate>,
    /// The budget that is exceeded then.
    pub exceeded_by: Option<Limited>,
    /// When the first corrected budget is exceeded, years since launch.
    pub corrected_t_yr: Option<f64>,
    /// The same as a day.
    pub corrected_date: Option<NaiveDate>,
    /// The budget that is exceeded then.
    pub corrected_by: Option<Limited>,
    /// How long all uncorrected budgets are met with the requested probability, years since launch; None if until the end, or if no
    /// probability was requested, here and below.
    pub kept_t_yr: Option<f64>,
    /// The same for the corrected budgets.
    pub corrected_kept_t_yr: Option<f64>,
    /// Probability that all uncorrected budgets are met until the end, %.
    pub met_percent: Option<f64>,
    /// Its standard error from the finite number of draws, %.
    pub met_error_percent: Option<f64>,
    /// Probability that all corrected budgets are met until the end, %.
    pub corrected_met_percent: Option<f64>,
    /// Its standard error from the finite number of draws, %.
    pub corrected_met_error_percent: Option<f64>,
    /// Why the Sun was not drawn; None if it was, or if there were no draws.
    #[serde(skip)]
    pub sun_not_drawn: Option<String>,
    /// For each budget: under its key the value at the end of the mission, and the times (years since launch) of its crossings.
    #[serde(flatten)]
    pub each: BTreeMap<String, Option<f64>>,
}

impl JudgedRow {
    /// For a mission launched on a day, with the requested probability.
    pub fn of(judgement: &Judgement, launch: NaiveDate, confidence: Option<f64>) -> JudgedRow {
        let [exceeded, corrected] = judgement.first();
        let date = |exceeded: Option<(Limited, f64)>| date_after(launch, exceeded?.1);
        let drawn = judgement.distribution.as_ref().map(|found| found.requirement());
        let [kept_t_yr, corrected_kept_t_yr] = match drawn {
            Some(_) => judgement.kept_yr(confidence),
            None => [None, None],
        };
        let met = |limit: usize| drawn.map(|dates| 100.0 * dates[limit].probability_met());
        let met_error = |limit: usize| drawn.map(|dates| 100.0 * dates[limit].probability_error);
        let each = judgement.budgets.iter().flat_map(|budget| {
            let [exceeded, corrected] = &budget.crossings;
            Limited::keys(budget.limited).into_iter().zip([budget.at_end(), exceeded.t_yr, corrected.t_yr])
        });
        JudgedRow {
            exceeded_t_yr: exceeded.map(|exceeded| exceeded.1),
            exceeded_date: date(exceeded),
            exceeded_by: exceeded.map(|exceeded| exceeded.0),
            corrected_t_yr: corrected.map(|exceeded| exceeded.1),
            corrected_date: date(corrected),
            corrected_by: corrected.map(|exceeded| exceeded.0),
            kept_t_yr,
            corrected_kept_t_yr,
            met_percent: met(0),
            met_error_percent: met_error(0),
            corrected_met_percent: met(1),
            corrected_met_error_percent: met_error(1),
            sun_not_drawn: judgement.distribution.as_ref().and_then(|found| found.sun_not_drawn.clone()),
            each: each.collect(),
        }
    }
}

impl Limited {
    /// Keys of a value at the end of the mission, and of the times (years since launch) at which its budget is exceeded, without
    /// and with correction.
    pub fn keys(self) -> [String; 3] {
        let key = self.key();
        [format!("{key}_at_end"), format!("{key}_exceeded_t_yr"), format!("{key}_corrected_t_yr")]
    }
}
