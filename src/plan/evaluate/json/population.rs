//! Shear biases of a population.

use chrono::NaiveDate;

use crate::mission::{Mission, Population};
use crate::plan::curve::Crossing;
use crate::plan::population::{BiasVerdict, PopulationBias, ShearBias};

#[derive(serde::Serialize)]
pub(super) struct Document<'a> {
    galaxies: usize,
    evaluated: usize,
    lost: usize,
    psf_stars_e: Option<f64>,
    orientations_deg: &'a [f64],
    dither_rows_px: &'a [f64],
    dither_columns_px: Option<&'a [f64]>,
    response: [f64; 2],
    years: Vec<Year>,
}

#[derive(serde::Serialize)]
struct Year {
    t_yr: f64,
    c1: f64,
    c1_error: Option<f64>,
    m1: f64,
    m1_error: Option<f64>,
    c2: f64,
    c2_error: Option<f64>,
    m2: f64,
    m2_error: Option<f64>,
}

/// A limit on a bias, and when it is exceeded.
#[derive(serde::Serialize)]
pub(super) struct Budget<'a> {
    limit: f64,
    uncorrected: Limit<'a>,
    corrected: Limit<'a>,
}

#[derive(serde::Serialize)]
struct Limit<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    factor: Option<f64>,
    exceeded: bool,
    t_yr: Option<f64>,
    date: Option<NaiveDate>,
    crossings: &'a [f64],
    limit: f64,
    margin: Option<f64>,
}

impl<'a> Document<'a> {
    pub(super) fn of(biases: &PopulationBias, population: &'a Population) -> Document<'a> {
        Document {
            galaxies: biases.galaxies,
            evaluated: biases.evaluated,
            lost: biases.lost,
            psf_stars_e: population.psf_stars_e,
            orientations_deg: &population.orientations_deg,
            dither_rows_px: &population.dither_rows_px,
            dither_columns_px: population.dither_columns_px.as_deref(),
            response: biases.response,
            years: biases.years.iter().map(|(t_yr, bias)| Year::of(*t_yr, bias)).collect(),
        }
    }
}

impl Year {
    fn of(t_yr: f64, bias: &ShearBias) -> Year {
        let ([c1, c2], [m1, m2]) = (bias.c, bias.m);
        Year {
            t_yr,
            c1: c1.value,
            c1_error: c1.error,
            m1: m1.value,
            m1_error: m1.error,
            c2: c2.value,
            c2_error: c2.error,
            m2: m2.value,
            m2_error: m2.error,
        }
    }
}

impl<'a> Budget<'a> {
    pub(super) fn of(verdict: &'a BiasVerdict, mission: &Mission) -> Budget<'a> {
        let limit = |crossing: &'a Crossing, factor: Option<f64>| Limit {
            factor,
            exceeded: crossing.t_yr.is_some(),
            t_yr: crossing.t_yr,
            date: crossing.date(mission.mission.launch.0),
            crossings: &crossing.crossings_yr,
            limit: crossing.limit,
            margin: crossing.margin,
        };
        Budget {
            limit: verdict.limit,
            uncorrected: limit(&verdict.uncorrected, None),
            corrected: limit(&verdict.corrected, Some(mission.requirement.correction_factor)),
        }
    }
}
