//! A diagnosis as one JSON document.

use serde::ser::{Serialize, Serializer};

use crate::analysis::diagnose::{
    Changed, Covariate, Diagnosis, Limit, Next, Note, Ranking, Reason, Rung, Step, Verdict,
};
use crate::analysis::fit::{Advice, Fitted};
use crate::analysis::noise::SetNoise;
use crate::effect::CATALOGUE;
use crate::io::json;
use crate::warning::Warning;

#[derive(serde::Serialize)]
struct Document<'a> {
    mission: &'a str,
    verdict: Verdict,
    reason: &'a Reason,
    baseline: &'a Rung,
    steps: &'a [Step],
    alternatives: &'a [Vec<String>],
    covariates: &'a [Covariate],
    ranking: Option<&'a Ranking>,
    next_measurement: Option<&'a Next>,
    parameters: Vec<Parameter<'a>>,
    tried: Vec<Attempt<'a>>,
    held_out: Option<&'a str>,
    noise: &'a [SetNoise],
    stable: Option<bool>,
    stability: &'a [Changed],
    residual_trends: Vec<String>,
    formula: Option<&'a str>,
    notes: &'a [Note],
    work: Work<'a>,
    advice: &'a [Advice],
    warnings: Vec<&'a Warning>,
    /// If the model is complete.
    #[serde(skip_serializing_if = "Option::is_none")]
    detection_limits: Option<Limits<'a>>,
}

#[derive(serde::Serialize)]
struct Parameter<'a> {
    key: &'a str,
    unit: &'static str,
    value: f64,
    sigma: Option<f64>,
}

#[derive(serde::Serialize)]
struct Attempt<'a> {
    effect: &'a str,
    chi2: Option<f64>,
    gain: Option<f64>,
}

#[derive(serde::Serialize)]
struct Work<'a> {
    evaluations: u64,
    most: u64,
    undone: &'a [String],
}

/// Limits by effect, in the order of the catalogue.
struct Limits<'a>(&'a [Limit]);

/// Parameters of an effect; null without a limit.
#[derive(serde::Serialize)]
#[serde(transparent)]
struct Table<'a>(#[serde(serialize_with = "json::table")] &'a toml::Table);

impl Serialize for Diagnosis {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let document = Document {
            mission: &self.mission.mission.name,
            verdict: self.verdict,
            reason: &self.reason,
            baseline: &self.baseline,
            steps: &self.steps,
            alternatives: &self.alternatives,
            covariates: &self.covariates,
            ranking: self.ranking.as_ref(),
            next_measurement: self.next.as_ref(),
            parameters: self.parameters.iter().map(Parameter::of).collect(),
            tried: self.tried.iter().map(|tried| Attempt::of(&tried.effect, tried.chi2, &self.baseline)).collect(),
            held_out: self.held_out.as_ref().map(|(column, _)| &column[..]),
            noise: &self.noise,
            stable: self.stability.holds(),
            stability: &self.stability.done,
            residual_trends: self.after.words(),
            formula: self.suggestion.as_ref().map(|suggestion| suggestion.toml.as_str()),
            notes: &self.notes,
            work: Work { evaluations: self.evaluations[0], most: self.evaluations[1], undone: &self.undone },
            advice: &self.advice,
            warnings: self.before.warnings(),
            detection_limits: (self.verdict == Verdict::Complete).then_some(Limits(&self.limits)),
        };
        document.serialize(to)
    }
}

impl<'a> Parameter<'a> {
    fn of(fitted: &'a Fitted) -> Parameter<'a> {
        Parameter { key: &fitted.key, unit: fitted.unit, value: fitted.value, sigma: fitted.sigma }
    }
}

impl<'a> Attempt<'a> {
    fn of(effect: &'a str, chi2: Option<f64>, baseline: &Rung) -> Attempt<'a> {
        Attempt { effect, chi2, gain: chi2.map(|chi2| baseline.chi2 - chi2) }
    }
}

impl Serialize for Limits<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let limit = |kind: &str| self.0.iter().find(|limit| limit.effect == kind)?.table.as_ref().map(Table);
        to.collect_map(CATALOGUE.iter().map(|entry| (entry.card.kind, limit(entry.card.kind))))
    }
}
