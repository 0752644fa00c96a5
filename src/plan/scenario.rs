//! The same mission under different conditions, side by side: the product of `ctiplan compare`.

mod axis;
mod cause;
mod json;
mod ranking;
pub(crate) mod sun;

use std::path::Path;

use serde::Serialize;

pub use axis::Axis;
pub use cause::Cause;
use cause::{State, why};
pub use ranking::{Criterion, Extremes, Merit, Ranking};

use crate::error::InputError;
use crate::mission::Mission;
use crate::numeric::parallel;
use crate::physics::SpeciesState;
use crate::plan::date_distribution::Confidence;
use crate::plan::evaluate::{BudgetVerdict, evaluate};
use crate::plan::judgement::Judgement;
use crate::warning::{self, Warning};

/// A mission to be compared.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Its file.
    pub file: String,
    /// The mission.
    pub mission: Mission,
}

/// One mission under one set of conditions, and its results.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Label that distinguishes its mission from the others: its name, with its file if others have the same name.
    pub name: String,
    /// The file of its mission.
    pub file: String,
    /// The mission, with its settings.
    pub mission: Mission,
    /// The changed settings: key and value.
    pub settings: Vec<(String, toml::Value)>,
    /// Dose at the end of the mission, MeV/g.
    pub dose_mev_g: f64,
    /// Active time of the mission, yr.
    pub active_yr: f64,
    /// Active years of which the dose of solar protons is the quantile of the sum; None if it is not such a quantile.
    pub quantile_active_yr: Option<f64>,
    /// |Δe| of the judged galaxy at the end of the mission; None if the shape is lost.
    pub delta_e: Option<f64>,
    /// When |Δe| exceeds its budget.
    pub verdict: BudgetVerdict,
    /// All budgets together, with the distribution of the date if a confidence is requested.
    pub judgement: Judgement,
    /// Probability with which budgets are to be met, if requested.
    pub confidence: Option<f64>,
    /// Traps at the end of the mission.
    pub traps: Vec<SpeciesState>,
    /// Warnings.
    pub warnings: Vec<Warning>,
}

/// Scenarios, in the order requested, with labels that distinguish them.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// In the order of missions, then of the axes, the last axis varying fastest.
    pub scenarios: Vec<Scenario>,
    /// Labels that distinguish their missions, in the missions' order.
    #[serde(skip)]
    pub names: Vec<String>,
    /// Probability with which budgets are to be met: scenarios are ranked by how long they are met. None: by the expected date.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// The best scenarios and the worst.
    #[serde(flatten)]
    pub ranking: Ranking,
    /// Times (years since launch) at which the best is compared with the worst: when the worst exceeds the decisive budget, or the
    /// end of each.
    #[serde(skip)]
    pub compared_at_yr: [f64; 2],
    /// |Δe| of the first best over that of the first worst at those times; None if one is lost or 0.
    #[serde(skip)]
    pub ratio: Option<f64>,
    /// Why the best is better than the worst at those times; empty if all are equal.
    pub why: Vec<Cause>,
    /// Further notes for the reader.
    pub notes: Vec<String>,
    /// Warnings of all scenarios, without repetition.
    pub warnings: Vec<Warning>,
}

/// Evaluates missions at every combination of the axes' values.
///
/// If launch dates are compared and the dose model is not among the axes, missions with a dose averaged over the solar cycle follow
/// the cycle instead; `notes` say so. With a confidence each date also has a distribution, and scenarios are ranked by how long
/// they meet their budgets with that probability. `progress` is called after every scenario.
///
/// # Errors
/// If a key or a value is invalid for a mission, or a galaxy has no measurable shape; reports the first in order.
pub fn compare(
    candidates: &[Candidate],
    axes: &[Axis],
    confidence: Option<Confidence>,
    progress: impl Fn() + Sync,
) -> Result<Comparison, InputError> {
    let (candidates, mut notes) = under_the_sun(candidates, axes);
    let names = names(&candidates);
    let mut combinations: Vec<Vec<(String, toml::Value)>> = vec![Vec::new()];
    for axis in axes {
        combinations = combinations
            .iter()
            .flat_map(|settings| {
                axis.values.iter().map(move |value| {
                    let mut settings = settings.clone();
                    settings.push((axis.key.clone(), value.clone()));
                    settings
                })
            })
            .collect();
    }
    let scenarios = candidates
        .iter()
        .zip(&names)
        .flat_map(|named| combinations.iter().map(move |settings| (named, settings)))
        .collect::<Vec<_>>();
    let flown = scenarios.iter().map(|((candidate, _), settings)| candidate.mission.with(settings));
    let flown = flown.collect::<Result<Vec<Mission>, InputError>>()?;
    let asked = axes.iter().any(|axis| axis.key == sun::SUN);
    notes.extend(sun::of_the_past(flown.iter(), asked)?.map(String::from));
    let scenarios = parallel::try_map(scenarios, |((candidate, name), settings)| {
        scenario(candidate, name, settings, confidence).inspect(|_| progress())
    })?;
    let confidence = confidence.map(|required| required.probability);
    let merits: Vec<Merit> = scenarios.iter().map(|scenario| scenario.merit(confidence)).collect();
    let ranking = Ranking::of(&merits);
    let (best, worst) = (&scenarios[ranking.best[0]], &scenarios[ranking.worst[0]]);
    let exceeded_yr = match ranking.by {
        Some(Criterion::Uncorrected) => worst.judgement.kept_yr(None)[0],
        Some(Criterion::Corrected) => worst.judgement.kept_yr(None)[1],
        _ => None,
    };
    let at = |scenario: &Scenario| {
        let end_yr = scenario.mission.mission.duration_yr;
        // At launch there is little to compare.
        exceeded_yr.filter(|t_yr| *t_yr > 0.0).map_or(end_yr, |t_yr| t_yr.min(end_yr))
    };
    let compared_at_yr = [at(best), at(worst)];
    let (ratio, why) = match ranking.by {
        Some(_) => why(&State::of(&best.mission, compared_at_yr[0])?, &State::of(&worst.mission, compared_at_yr[1])?),
        None => (None, Vec::new()),
    };
    notes.extend(confidence.is_none().then(|| quantiles_of_sums(&scenarios)).flatten());
    let warnings = warning::together(scenarios.iter().flat_map(|scenario| &scenario.warnings));
    Ok(Comparison { scenarios, names, confidence, ranking, compared_at_yr, ratio, why, notes, warnings })
}

/// A note if expected dates of missions of different lengths are compared that have quantiles of different sums: each quantile is
/// spread evenly over its mission, so a longer one has less in its first years.
fn quantiles_of_sums(scenarios: &[Scenario]) -> Option<String> {
    let mut of_sums = scenarios.iter().filter(|scenario| scenario.quantile_active_yr.is_some());
    let first = of_sums.next()?;
    let differ = |of: fn(&Scenario) -> Option<f64>| of_sums.clone().any(|scenario| of(scenario) != of(first));
    let differ =
        differ(|scenario| Some(scenario.mission.mission.duration_yr)) && differ(|scenario| scenario.quantile_active_yr);
    differ.then(|| {
        let environment = &first.mission.environment;
        format!(
            "Missions of different lengths: the dose of solar protons at {} % confidence is that of each mission as a whole, spread \
             evenly over its active years. A longer mission has less of it in its first years, and later dates at the same risk. \
             --probability {} compares dates of equal risk; environment.accumulate = \"yearly\" takes the quantile of each year.",
            100.0 * environment.confidence,
            environment.confidence,
        )
    })
}

/// Candidates for a comparison of launch dates, if these are compared, and notes for the reader.
fn under_the_sun(candidates: &[Candidate], axes: &[Axis]) -> (Vec<Candidate>, Vec<String>) {
    let mut candidates = candidates.to_vec();
    let mut notes: Vec<String> = Vec::new();
    let model = axes.iter().find(|axis| axis.key == sun::MODEL);
    let asked_for = |axis: &Axis| axis.values.iter().any(|value| value.as_str() == Some("constant"));
    let launches = axes.iter().any(|axis| axis.key == "mission.launch" && axis.values.len() > 1);
    if launches && model.is_none_or(asked_for) {
        for candidate in &mut candidates {
            let (flown, note) = sun::of_launches(&candidate.mission, model.is_some());
            candidate.mission = flown;
            notes.extend(note.map(String::from).filter(|note| !notes.contains(note)));
        }
    }
    (candidates, notes)
}

/// Labels that distinguish candidates: their names; names and files if a name is duplicate; the path if files have the same name.
fn names(candidates: &[Candidate]) -> Vec<String> {
    let name = |candidate: &Candidate| candidate.mission.mission.name.clone();
    let short = |candidate: &Candidate| {
        let file = Path::new(&candidate.file).file_name();
        format!("{} ({})", name(candidate), file.unwrap_or_default().to_string_lossy())
    };
    let long = |candidate: &Candidate| format!("{} ({})", name(candidate), candidate.file);
    let once = |label: &dyn Fn(&Candidate) -> String, own: &Candidate| {
        candidates.iter().filter(|other| label(other) == label(own)).count() == 1
    };
    let tell = |own: &Candidate| {
        if once(&name, own) {
            name(own)
        } else if once(&short, own) {
            short(own)
        } else {
            long(own)
        }
    };
    candidates.iter().map(tell).collect()
}

fn scenario(
    candidate: &Candidate,
    name: &str,
    settings: &[(String, toml::Value)],
    confidence: Option<Confidence>,
) -> Result<Scenario, InputError> {
    let mission = if settings.is_empty() { candidate.mission.clone() } else { candidate.mission.with(settings)? };
    let judged = Mission { galaxies: vec![mission.judged_galaxy().clone()], ..mission.clone() };
    let evaluation = evaluate(&judged)?;
    let end = evaluation.end();
    let of_galaxy = [&evaluation.verdict.uncorrected, &evaluation.verdict.corrected].map(Clone::clone);
    Ok(Scenario {
        name: name.into(),
        file: candidate.file.clone(),
        settings: settings.to_vec(),
        dose_mev_g: end.dose_mev_g,
        active_yr: evaluation.model.history().active_years(end.t_yr),
        quantile_active_yr: evaluation.model.history().quantile_active_years(),
        delta_e: end.galaxies[0].map(|change| change.magnitude()),
        traps: end.traps.clone(),
        verdict: evaluation.verdict,
        judgement: Judgement::of(&evaluation.model, of_galaxy, confidence)?,
        confidence: confidence.map(|required| required.probability),
        warnings: evaluation.warnings,
        mission,
    })
}

impl Scenario {
    /// The merit by which it is ranked: how long it meets its budgets, as expected or with a probability.
    fn merit(&self, confidence: Option<f64>) -> Merit {
        Merit::of(&self.judgement, confidence, self.delta_e)
    }

    /// How its dose is distributed over the years: "constant" or "solar-cycle".
    pub fn dose_model(&self) -> &'static str {
        sun::model(&self.mission)
    }
}
