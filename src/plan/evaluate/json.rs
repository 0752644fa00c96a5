//! An evaluation as the JSON document that `ctiplan evaluate` prints.

mod population;

use chrono::NaiveDate;
use serde::ser::{Serialize, Serializer};

use super::{BudgetVerdict, Evaluation, Year};
use crate::io::json;
use crate::mission::Mission;
use crate::physics::SpeciesState;
use crate::physics::shape::ShapeChange;
use crate::plan::curve::Crossing;
use crate::plan::noise::{self, NoisyCrossing, NoisyShape, NoisyVerdict};
use crate::warning::Warning;

#[derive(serde::Serialize)]
struct Document<'a> {
    mission: &'a str,
    launch: NaiveDate,
    duration_yr: f64,
    active_dose_rate_mev_g_yr: f64,
    active_years: f64,
    years: Vec<NamedYear<'a>>,
    budget: Budget<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<NoiseSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    population: Option<population::Document<'a>>,
    warnings: &'a [Warning],
    version: &'static str,
    #[serde(serialize_with = "json::table")]
    resolved_mission: toml::Table,
}

#[derive(serde::Serialize)]
struct NamedYear<'a> {
    t_yr: f64,
    date: Option<NaiveDate>,
    dose_mev_g: f64,
    traps: &'a [SpeciesState],
    galaxies: Vec<WithNoise<'a>>,
}

/// A galaxy's change of shape, and that of its ellipticity with noise.
#[derive(serde::Serialize)]
struct WithNoise<'a> {
    #[serde(flatten)]
    change: NamedChange<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<NoisyChange>,
}

/// A mean change of ellipticity with the noise of one exposure, and its standard error.
#[derive(serde::Serialize)]
struct NoisyChange {
    delta_e1: f64,
    error: f64,
    delta_e2: f64,
    error_e2: f64,
}

/// How noise was realised.
#[derive(serde::Serialize)]
struct NoiseSettings {
    centroid: &'static str,
    estimator: &'static str,
    realisations: u32,
    realisations_of_others: u32,
    seed: u64,
}

/// When the budget is exceeded with noise.
#[derive(serde::Serialize)]
struct NoisyBudget<'a> {
    uncorrected: NoisyLimit<'a>,
    corrected: NoisyLimit<'a>,
}

#[derive(serde::Serialize)]
struct NoisyLimit<'a> {
    #[serde(flatten)]
    crossing: DatedCrossing<'a>,
    error_yr: Option<f64>,
    earlier_yr: Option<f64>,
}

#[derive(serde::Serialize)]
struct Budget<'a> {
    /// Null if shear biases alone are limited.
    delta_e: Option<f64>,
    galaxy: &'a str,
    #[serde(flatten)]
    verdict: DatedVerdict<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<NoisyBudget<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    c: Option<population::Budget<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    m: Option<population::Budget<'a>>,
}

/// The change of one galaxy's shape; null if no shape is left.
#[derive(serde::Serialize)]
pub(crate) struct NamedChange<'a> {
    name: &'a str,
    delta_e1: Option<f64>,
    delta_e2: Option<f64>,
    delta_y: Option<f64>,
    delta_size: Option<f64>,
    delta_flux: Option<f64>,
}

/// A verdict with the dates and the correction of its mission; no crossings if shear biases alone are limited.
#[derive(serde::Serialize)]
pub(crate) struct DatedVerdict<'a> {
    uncorrected: Option<DatedCrossing<'a>>,
    corrected: Option<DatedCrossing<'a>>,
    rate_at_launch_per_yr: Option<f64>,
    mean_rate_per_yr: Option<f64>,
}

#[derive(serde::Serialize)]
struct DatedCrossing<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    factor: Option<f64>,
    exceeded: bool,
    t_yr: Option<f64>,
    date: Option<NaiveDate>,
    crossings: &'a [f64],
    limit_delta_e: f64,
    margin_delta_e: Option<f64>,
}

impl Serialize for Evaluation {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let (mission, dose) = (self.mission(), self.model.history());
        let (header, requirement) = (&mission.mission, &mission.requirement);
        let biases = self.population.as_ref();
        let noise = self.noise.as_ref().filter(|_| requirement.limits_a_galaxy());
        let document = Document {
            mission: &header.name,
            launch: header.launch.0,
            duration_yr: header.duration_yr,
            active_dose_rate_mev_g_yr: dose.active_rate_mev_g_yr,
            active_years: dose.active_years(header.duration_yr),
            years: (0..self.years.len()).map(|year| NamedYear::of(self, year)).collect(),
            budget: Budget {
                delta_e: requirement.limits_a_galaxy().then_some(requirement.delta_e),
                galaxy: &requirement.galaxy,
                verdict: self.verdict.dated(mission),
                noise: noise.map(|noise| NoisyBudget::of(&noise.verdict, mission)),
                c: biases.and_then(|biases| Some(population::Budget::of(biases.c.as_ref()?, mission))),
                m: biases.and_then(|biases| Some(population::Budget::of(biases.m.as_ref()?, mission))),
            },
            noise: self.noise.as_ref().map(|noise| NoiseSettings {
                centroid: noise::CENTROID,
                estimator: noise::ESTIMATOR,
                realisations: noise.realisations.count,
                realisations_of_others: noise::others(noise.realisations.count),
                seed: noise.realisations.seed,
            }),
            population: biases
                .zip(mission.population.as_ref())
                .map(|(biases, of)| population::Document::of(biases, of)),
            warnings: &self.warnings,
            version: env!("CARGO_PKG_VERSION"),
            resolved_mission: mission.to_table(),
        };
        document.serialize(to)
    }
}

impl<'a> NamedYear<'a> {
    /// One year of an evaluation, by its index.
    fn of(evaluation: &'a Evaluation, place: usize) -> NamedYear<'a> {
        let year: &Year = &evaluation.years[place];
        let noisy = |galaxy: usize| evaluation.noise.as_ref().and_then(|noise| noise.years[place][galaxy]);
        let galaxies = evaluation.mission().galaxies.iter().zip(&year.galaxies).enumerate();
        let galaxies = galaxies.map(|(index, (galaxy, change))| WithNoise {
            change: NamedChange::of(&galaxy.name, change.as_ref()),
            noise: noisy(index).map(NoisyChange::of),
        });
        NamedYear {
            t_yr: year.t_yr,
            date: year.date,
            dose_mev_g: year.dose_mev_g,
            traps: &year.traps,
            galaxies: galaxies.collect(),
        }
    }
}

impl NoisyChange {
    fn of(shape: NoisyShape) -> NoisyChange {
        let ([delta_e1, delta_e2], [error, error_e2]) = (shape.delta_e, shape.error);
        NoisyChange { delta_e1, error, delta_e2, error_e2 }
    }
}

impl<'a> NoisyBudget<'a> {
    fn of(verdict: &'a NoisyVerdict, mission: &Mission) -> NoisyBudget<'a> {
        let limit = |noisy: &'a NoisyCrossing, factor: Option<f64>| NoisyLimit {
            crossing: DatedCrossing::of(&noisy.crossing, factor, mission.mission.launch.0),
            error_yr: noisy.error_yr,
            earlier_yr: noisy.earlier_yr,
        };
        NoisyBudget {
            uncorrected: limit(&verdict.uncorrected, None),
            corrected: limit(&verdict.corrected, Some(mission.requirement.correction_factor)),
        }
    }
}

impl<'a> NamedChange<'a> {
    /// The change of a galaxy of this name.
    pub(crate) fn of(name: &'a str, change: Option<&ShapeChange>) -> NamedChange<'a> {
        NamedChange {
            name,
            delta_e1: change.map(|change| change.delta_e1),
            delta_e2: change.map(|change| change.delta_e2),
            delta_y: change.map(|change| change.delta_y_px),
            delta_size: change.map(|change| change.delta_size),
            delta_flux: change.map(|change| change.delta_flux),
        }
    }
}

impl BudgetVerdict {
    /// For JSON.
    pub(crate) fn dated(&self, mission: &Mission) -> DatedVerdict<'_> {
        let requirement = &mission.requirement;
        let dated = |crossing, factor| {
            requirement.limits_a_galaxy().then(|| DatedCrossing::of(crossing, factor, mission.mission.launch.0))
        };
        DatedVerdict {
            uncorrected: dated(&self.uncorrected, None),
            corrected: dated(&self.corrected, Some(requirement.correction_factor)),
            rate_at_launch_per_yr: self.rate_at_launch_per_yr,
            mean_rate_per_yr: self.mean_rate_per_yr,
        }
    }
}

impl<'a> DatedCrossing<'a> {
    fn of(crossing: &'a Crossing, factor: Option<f64>, launch: NaiveDate) -> DatedCrossing<'a> {
        DatedCrossing {
            factor,
            exceeded: crossing.t_yr.is_some(),
            t_yr: crossing.t_yr,
            date: crossing.date(launch),
            crossings: &crossing.crossings_yr,
            limit_delta_e: crossing.limit,
            margin_delta_e: crossing.margin,
        }
    }
}
