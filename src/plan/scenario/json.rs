//! Scenarios and their ranking as the JSON document that `ctiplan compare` prints.

use serde::ser::{Serialize, Serializer};
use toml::Value;

use super::{Criterion, Extremes, Ranking, Scenario};
use crate::io::json;
use crate::plan::date_distribution::DateDistribution;
use crate::plan::evaluate::json::DatedVerdict;
use crate::plan::judgement::JudgedRow;
use crate::warning::Warning;

#[derive(serde::Serialize)]
struct OneScenario<'a> {
    mission: &'a str,
    file: &'a str,
    #[serde(serialize_with = "json::settings")]
    settings: &'a [(String, Value)],
    dose_model: &'static str,
    dose_mev_g: f64,
    active_yr: f64,
    delta_e: Option<f64>,
    #[serde(flatten)]
    verdict: DatedVerdict<'a>,
    /// All budgets together, if shear biases are limited.
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<JudgedRow>,
    #[serde(skip_serializing_if = "Option::is_none")]
    budget_used: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    distribution: Option<&'a DateDistribution>,
    warnings: &'a [Warning],
}

#[derive(serde::Serialize)]
struct Places<'a> {
    best: usize,
    worst: usize,
    tied_best: &'a [usize],
    tied_worst: &'a [usize],
    ranked_by: Option<Criterion>,
    ranked_by_each: &'a [Extremes],
}

impl Serialize for Scenario {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let together = self.judgement.limits_biases();
        let scenario = OneScenario {
            mission: &self.mission.mission.name,
            file: &self.file,
            settings: &self.settings,
            dose_model: self.dose_model(),
            dose_mev_g: self.dose_mev_g,
            active_yr: self.active_yr,
            delta_e: self.delta_e,
            verdict: self.verdict.dated(&self.mission),
            first: together.then(|| JudgedRow::of(&self.judgement, self.mission.mission.launch.0, self.confidence)),
            budget_used: self.judgement.used().filter(|_| together),
            distribution: self.judgement.distribution.as_ref(),
            warnings: &self.warnings,
        };
        scenario.serialize(to)
    }
}

impl Serialize for Ranking {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let places = Places {
            best: self.best[0],
            worst: self.worst[0],
            tied_best: &self.best,
            tied_worst: &self.worst,
            ranked_by: self.by,
            ranked_by_each: &self.each,
        };
        places.serialize(to)
    }
}
