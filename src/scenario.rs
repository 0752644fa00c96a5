//! The same mission under other circumstances, side by side: the product of `ctiplan compare`.

mod axis;

use rayon::prelude::*;

pub use axis::Axis;

use crate::error::InputError;
use crate::evaluate::{Verdict, evaluate};
use crate::mission::Mission;
use crate::model::Model;
use crate::model::SpeciesState;

/// One mission under one set of circumstances, and what becomes of it.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The mission, with its settings.
    pub mission: Mission,
    /// What was set: key and value.
    pub settings: Vec<(String, toml::Value)>,
    /// Dose at the end of the mission, MeV/g.
    pub dose_mev_g: f64,
    /// Active time of the mission, yr.
    pub active_yr: f64,
    /// |Δe| of the judged galaxy at the end of the mission; None where no shape is left.
    pub delta_e: Option<f64>,
    /// When the budget is exceeded.
    pub verdict: Verdict,
    /// Traps at the end of the mission.
    pub traps: Vec<SpeciesState>,
}

/// Scenarios, in the order asked for, and what tells them apart.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// In the order of missions, then of the axes, the last axis fastest.
    pub scenarios: Vec<Scenario>,
    /// The scenario of least |Δe| at the end of its mission; the first of equals.
    pub best: usize,
    /// The scenario of the largest |Δe|; the first of equals.
    pub worst: usize,
    /// Why the best is better than the worst; empty where all are alike.
    pub why: Vec<String>,
}

/// Evaluates missions at every combination of the axes' values.
///
/// `progress` is called once for every scenario that is done.
///
/// # Errors
/// Where a key or a value is not one of a mission's, or a galaxy has no measurable shape. The first one in order.
pub fn compare(missions: &[Mission], axes: &[Axis], progress: impl Fn() + Sync) -> Result<Comparison, InputError> {
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
    let scenarios = missions
        .iter()
        .flat_map(|mission| combinations.iter().map(move |settings| (mission, settings)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(mission, settings)| scenario(mission, settings).inspect(|_| progress()))
        .collect::<Result<Vec<_>, _>>()?;
    // A lost shape is worse than any other.
    let change = |index: &usize| scenarios[*index].delta_e.unwrap_or(f64::INFINITY);
    let all = || 0..scenarios.len();
    let best = all().min_by(|a, b| change(a).total_cmp(&change(b))).expect("at least one scenario");
    let worst = all().rev().max_by(|a, b| change(a).total_cmp(&change(b))).expect("at least one scenario");
    let why = why(&scenarios[best], &scenarios[worst])?;
    Ok(Comparison { scenarios, best, worst, why })
}

fn scenario(mission: &Mission, settings: &[(String, toml::Value)]) -> Result<Scenario, InputError> {
    let mission = if settings.is_empty() { mission.clone() } else { mission.with(settings)? };
    let judged = Mission { galaxies: vec![mission.judged_galaxy().clone()], ..mission.clone() };
    let evaluation = evaluate(&judged)?;
    let end = evaluation.end();
    Ok(Scenario {
        settings: settings.to_vec(),
        dose_mev_g: end.dose_mev_g,
        active_yr: evaluation.model.history().active_years(end.t_yr),
        delta_e: end.galaxies[0].map(|change| change.magnitude()),
        traps: end.traps.clone(),
        verdict: evaluation.verdict,
        mission,
    })
}

/// What makes the best scenario better than the worst: dose, and what the same dose does; species by species.
fn why(best: &Scenario, worst: &Scenario) -> Result<Vec<String>, InputError> {
    let (Some(best_e), Some(worst_e)) = (best.delta_e, worst.delta_e) else {
        return Ok(vec!["in the worst the galaxy has no measurable shape left".into()]);
    };
    if best_e >= worst_e {
        return Ok(Vec::new());
    }
    let mut reasons = Vec::new();
    let alike = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
    if !alike(best.dose_mev_g, worst.dose_mev_g) {
        let although = if best.dose_mev_g > worst.dose_mev_g { "although the " } else { "" };
        reasons.push(format!(
            "{although}dose {:.3e} against {:.3e} MeV/g ({:.2} against {:.2} active years)",
            best.dose_mev_g, worst.dose_mev_g, best.active_yr, worst.active_yr
        ));
    }
    if best.dose_mev_g > 0.0 && worst.dose_mev_g > 0.0 {
        let (best_per, worst_per) = (best_e / best.dose_mev_g, worst_e / worst.dose_mev_g);
        if !alike(best_per, worst_per) && (best_per / worst_per - 1.0).abs() > 0.01 {
            let although = if best_per > worst_per { "although " } else { "" };
            reasons.push(format!("{although}the same dose does {:.3} of the change of shape", best_per / worst_per));
        }
        let (from, to) = (shares(worst)?, shares(best)?);
        for ((name, worst_share, worst_transfers), (_, best_share, best_transfers)) in
            from.iter().zip(&to).filter(|(from, to)| from.0 == to.0 && (from.1 - to.1).abs() > 0.02)
        {
            reasons.push(format!(
                "{name}, released after {best_transfers:.3} against {worst_transfers:.3} transfers, makes {:.0} % of it \
                 against {:.0} %",
                100.0 * best_share,
                100.0 * worst_share
            ));
        }
    }
    Ok(reasons)
}

/// For each species its share of |Δe| were it alone, and its release time in transfers.
fn shares(scenario: &Scenario) -> Result<Vec<(String, f64, f64)>, InputError> {
    let judged = Mission { galaxies: vec![scenario.mission.judged_galaxy().clone()], ..scenario.mission.clone() };
    let model = Model::new(&judged);
    let device = model.device_at(judged.mission.duration_yr)?;
    let alone = |index: usize| -> Result<f64, InputError> {
        Ok(model.change_by(0, &device.with_species(index))?.map_or(0.0, |change| change.magnitude()))
    };
    let alone = (0..device.traps.len()).map(alone).collect::<Result<Vec<f64>, _>>()?;
    let total: f64 = alone.iter().sum();
    let line_time_ms = device.at.line_time_ms;
    let shares = device.traps.iter().zip(&alone).map(|(species, alone)| {
        let share = if total > 0.0 { alone / total } else { 0.0 };
        (species.name.clone(), share, species.release_ms / line_time_ms)
    });
    Ok(shares.collect())
}
