//! Accuracy to which parameters of the detector must be known for the residual of a correction to meet a limit.

use serde::Serialize;

use super::slopes::{Parameter, Quantity, slopes};
use crate::error::InputError;
use crate::mission::Mission;
use crate::model::Model;
use crate::plan::judgement::Limited;

/// Densities and then release times of all species, by their keys, each with a deviation equal to its value.
pub(super) fn trap_parameters(mission: &Mission) -> Vec<Parameter> {
    let traps = &mission.detector.traps;
    let densities =
        traps.iter().map(|trap| (format!("detector.traps.{}.density_per_px", trap.name), trap.density_per_px));
    let releases = traps.iter().map(|trap| (format!("detector.traps.{}.release_ms", trap.name), trap.release_ms));
    densities.chain(releases).collect()
}

/// Limit on a quantity, without correction; None if there is none.
pub(super) fn limit(mission: &Mission, limited: Limited) -> Option<f64> {
    let requirement = &mission.requirement;
    match limited {
        Limited::DeltaE => Some(requirement.delta_e).filter(|_| requirement.limits_a_galaxy()),
        Limited::C => requirement.c,
        Limited::M => requirement.m,
    }
}

/// Derivatives of a limited quantity at the end of the mission, over its limit: by the logarithms of densities and release times.
pub(super) struct Sensitivity {
    pub limited: Limited,
    /// Components (1 and 2) for each species.
    densities: Vec<[f64; 2]>,
    releases: Vec<[f64; 2]>,
}

impl Sensitivity {
    /// From the derivatives by [`trap_parameters`] in their order, and the limit.
    pub fn of(limited: Limited, limit: f64, slopes: &[[Quantity; 2]]) -> Sensitivity {
        let over = |members: &[Quantity; 2]| [0, 1].map(|member| members[member].value / limit);
        let all: Vec<[f64; 2]> = slopes.iter().map(over).collect();
        let (densities, releases) = all.split_at(all.len() / 2);
        Sensitivity { limited, densities: densities.to_vec(), releases: releases.to_vec() }
    }

    /// For every limited quantity of a mission.
    ///
    /// # Errors
    /// If a formula has no value, or no shape is left.
    pub fn all(model: &Model, advance: &(dyn Fn() + Sync)) -> Result<Vec<Sensitivity>, InputError> {
        let mission = &model.mission;
        let limited = Limited::by(mission);
        let found = slopes(model, &trap_parameters(mission), &limited, advance)?;
        let of = |(limited, slopes): (Limited, &Vec<[Quantity; 2]>)| {
            Sensitivity::of(limited, limit(mission, limited).unwrap_or(f64::NAN), slopes)
        };
        Ok(limited.into_iter().zip(&found).map(of).collect())
    }

    /// Share of the limit that is used with independent relative errors of the parameters, and one common to all densities; `traps`
    /// is relative to the number at the end.
    pub fn used(&self, density_error: f64, release_error: f64, common: f64, traps: f64) -> f64 {
        let member = |member: usize| {
            let squares = |of: &[[f64; 2]], error: f64| of.iter().map(|one| (one[member] * error).powi(2)).sum::<f64>();
            let all: f64 = self.densities.iter().map(|one| one[member]).sum();
            let own = squares(&self.densities, density_error) + squares(&self.releases, release_error * traps);
            (own + (all * common).powi(2)).sqrt()
        };
        member(0).max(member(1))
    }
}

/// Required knowledge of a parameter, all others known exactly.
#[derive(Clone, Debug, Serialize)]
pub struct Known {
    /// The parameter.
    pub parameter: String,
    /// Largest relative error (1 σ) with which every limit is met at the end of the mission, %; None if it has no effect.
    pub needed_percent: Option<f64>,
    /// The limit that requires it.
    pub by: Option<Limited>,
}

/// Required knowledge of each parameter, and of all of them.
pub(super) fn known(mission: &Mission, sensitivities: &[Sensitivity]) -> Vec<Known> {
    let species = &mission.detector.traps;
    let of = |parameter: String, used: &dyn Fn(&Sensitivity) -> f64| {
        let most = sensitivities.iter().map(|one| (one.limited, used(one))).max_by(|a, b| a.1.total_cmp(&b.1));
        let most = most.filter(|(_, used)| *used > 0.0);
        Known { parameter, needed_percent: most.map(|(_, used)| 100.0 / used), by: most.map(|(limited, _)| limited) }
    };
    let largest = |members: [f64; 2]| members[0].abs().max(members[1].abs());
    let mut known = Vec::new();
    for (place, trap) in species.iter().enumerate() {
        known.push(of(format!("density {}", trap.name), &|one| largest(one.densities[place])));
    }
    known.push(of(ALL_DENSITIES.into(), &|one| one.used(1.0, 0.0, 0.0, 1.0)));
    for (place, trap) in species.iter().enumerate() {
        known.push(of(format!("release {}", trap.name), &|one| largest(one.releases[place])));
    }
    known.push(of(ALL_RELEASES.into(), &|one| one.used(0.0, 1.0, 0.0, 1.0)));
    known
}

/// Name of the row of all densities, with independent errors.
pub const ALL_DENSITIES: &str = "all densities";

/// Name of the row of all release times.
pub const ALL_RELEASES: &str = "all release times";
