//! Everything about a mission's dose that a radiation engineer asks for: the product of `ctiplan dose`.

use chrono::{Datelike, NaiveDate};
use rayon::prelude::*;
use serde::Serialize;

use crate::environment::esp::Spectrum;
use crate::environment::proton::NIEL_NEUTRON_1MEV;
use crate::environment::shielding::{Geometry, dose_behind, fluence_behind};
use crate::error::InputError;
use crate::mission::{Accumulate, Mission, Orbit};
use crate::model::Model;
use crate::numeric::calendar::{date_after, decimal_year, years_between};
use crate::numeric::root_finding;
use crate::physics::{DoseHistory, RateOrigin};
use crate::warning::Warning;

/// Confidence levels of the table.
const CONFIDENCES: [f64; 5] = [0.50, 0.75, 0.90, 0.95, 0.99];

/// Thicknesses of the dose-depth curve, mm of aluminium.
const DEPTHS_MM: [f64; 14] = [1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 13.6, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 70.0];

/// Energies of the spectrum where none are asked for, MeV.
pub const ENERGIES_MEV: [f64; 17] =
    [0.1, 0.3, 1.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 100.0, 150.0, 200.0, 300.0];

/// A mission's dose from all sides.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// Dose since launch (MeV/g) against time (years since launch), densely enough to be drawn with straight lines.
    #[serde(skip)]
    pub over_time: Vec<(f64, f64)>,
    /// Launch, decimal calendar year.
    #[serde(skip)]
    pub launch: f64,
    /// Dose over time.
    #[serde(skip)]
    pub history: DoseHistory,
    /// Dose at the end of the mission, MeV/g.
    pub total_mev_g: f64,
    /// The same damage as fluences.
    #[serde(flatten)]
    pub equivalents: Equivalents,
    /// Confidence of the curves below.
    pub confidence: f64,
    /// Solar-active years of the mission.
    pub active_years: f64,
    /// By calendar year.
    pub years: Vec<CalendarYear>,
    /// Whether quantiles are of one year or of the sum.
    #[serde(skip)]
    pub accumulate: Accumulate,
    /// Dose against confidence, behind the mission's shield; none without a shield.
    pub confidences: Vec<AtConfidence>,
    /// Dose of one active year against thickness.
    pub depths: Vec<AtDepth>,
    /// Aluminium that makes the mission's active dose rate at its confidence.
    pub equivalent_mm: Equivalent,
    /// Spectrum before and behind the shield.
    pub spectrum: Vec<AtEnergy>,
    /// What is doubtful about it.
    pub warnings: Vec<Warning>,
}

/// Thickness of aluminium, mm; None beyond 0.1 to 300 mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Equivalent {
    /// As a sphere.
    pub sphere: Option<f64>,
    /// As one slab.
    pub slab: Option<f64>,
}

/// One calendar year of a mission.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalendarYear {
    /// The year.
    pub year: i32,
    /// Time of it within the mission, yr.
    pub flown_yr: f64,
    /// Active time of that, yr.
    pub active_yr: f64,
    /// Dose in it, MeV/g.
    pub dose_mev_g: f64,
    /// Dose since launch at its end, MeV/g.
    pub cumulative_mev_g: f64,
}

/// A displacement damage dose as fluences of particles that do the same damage in silicon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Equivalents {
    /// Protons of 10 MeV, cm⁻². Good to 4 %, as is the fitted NIEL at one energy.
    pub protons_10mev_cm2: f64,
    /// Neutrons of 1 MeV, cm⁻².
    pub neutrons_1mev_cm2: f64,
}

/// Dose at a confidence level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AtConfidence {
    /// Probability that it is not exceeded.
    pub confidence: f64,
    /// One active year, MeV/g.
    pub active_year_mev_g: f64,
    /// Quantile of one active year times the mission's active years, MeV/g.
    pub yearly_mev_g: f64,
    /// Quantile of the sum over the mission's active years, MeV/g.
    pub mission_mev_g: f64,
}

/// Dose of one active year behind a thickness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AtDepth {
    /// Aluminium, mm.
    pub thickness_mm: f64,
    /// Behind a sphere, MeV/g.
    pub sphere_mev_g: f64,
    /// Behind one slab, MeV/g.
    pub slab_mev_g: f64,
}

/// Fluence at an energy, at the mission's confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AtEnergy {
    /// Proton energy, MeV.
    pub energy_mev: f64,
    /// Above it, cm⁻².
    pub integral_cm2: Over<f64>,
    /// Per MeV at it, cm⁻² MeV⁻¹.
    pub differential_cm2_mev: Over<f64>,
    /// Above it behind the shield, cm⁻²; None without a shield.
    pub shielded_integral_cm2: Over<Option<f64>>,
}

/// A fluence over two stretches of time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Over<T> {
    /// One active year.
    pub year: T,
    /// The mission's active years: the quantile of the sum; less than one year counts as one, none as none.
    pub mission: T,
}

/// Surveys a mission's dose, with the spectrum at these energies (MeV, above 0).
///
/// # Errors
/// Where a formula has no value.
pub fn survey(mission: &Mission, energies_mev: &[f64]) -> Result<Survey, InputError> {
    let model = Model::new(mission);
    let history = model.history().clone();
    let mut warnings = history.warnings(mission.mission.duration_yr);
    if mission.mission.orbit == Orbit::Leo {
        warnings.push(Warning::ShieldedByField);
    }
    let environment = &mission.environment;
    let niel = environment.niel.curve();
    let duration_yr = mission.mission.duration_yr;
    let total_mev_g = model.dose_mev_g(duration_yr)?;
    let active_years = history.active_years(duration_yr);
    let year = Spectrum::esp(environment.confidence, 1.0);
    let sum = Spectrum::esp(environment.confidence, active_years);
    // A mission without an active year meets no solar protons, although the model's shortest time is a year.
    let flown = if active_years > 0.0 { 1.0 } else { 0.0 };
    let shield = mission.shielding.as_ref();
    let behind = |spectrum: &Spectrum, energy_mev: f64| {
        shield.map(|shield| fluence_behind(spectrum, shield.geometry, shield.thickness_mm, energy_mev))
    };
    let confidences = CONFIDENCES.into_par_iter().filter_map(|confidence| {
        let shield = shield?;
        let dose =
            |years: f64| dose_behind(&Spectrum::esp(confidence, years), shield.geometry, shield.thickness_mm, niel);
        let active_year_mev_g = dose(1.0);
        Some(AtConfidence {
            confidence,
            active_year_mev_g,
            yearly_mev_g: active_year_mev_g * active_years,
            mission_mev_g: flown * dose(active_years),
        })
    });
    let depths = DEPTHS_MM.into_par_iter().map(|thickness_mm| AtDepth {
        thickness_mm,
        sphere_mev_g: dose_behind(&year, Geometry::Sphere, thickness_mm, niel),
        slab_mev_g: dose_behind(&year, Geometry::Slab, thickness_mm, niel),
    });
    let spectrum = energies_mev.par_iter().map(|&energy_mev| AtEnergy {
        energy_mev,
        integral_cm2: Over { year: year.above(energy_mev), mission: flown * sum.above(energy_mev) },
        differential_cm2_mev: Over {
            year: year.differential(energy_mev),
            mission: flown * sum.differential(energy_mev),
        },
        shielded_integral_cm2: Over {
            year: behind(&year, energy_mev),
            mission: behind(&sum, energy_mev).map(|fluence| flown * fluence),
        },
    });
    Ok(Survey {
        launch: decimal_year(mission.mission.launch.0),
        years: calendar_years(&model)?,
        over_time: over_time(&model)?,
        total_mev_g,
        equivalents: Equivalents {
            protons_10mev_cm2: total_mev_g / niel.at(10.0),
            neutrons_1mev_cm2: total_mev_g / NIEL_NEUTRON_1MEV,
        },
        confidence: environment.confidence,
        active_years,
        accumulate: environment.accumulate,
        confidences: confidences.collect(),
        depths: depths.collect(),
        spectrum: spectrum.collect(),
        equivalent_mm: Equivalent {
            sphere: equivalent_mm(mission, Geometry::Sphere),
            slab: equivalent_mm(mission, Geometry::Slab),
        },
        history,
        warnings,
    })
}

/// Thickness of aluminium (mm) behind which solar protons make the dose rate that a mission gives for an active year; None
/// beyond 0.1 to 300 mm, and if it gives none.
pub fn equivalent_mm(mission: &Mission, geometry: Geometry) -> Option<f64> {
    let environment = &mission.environment;
    let rate = environment.active_dose_rate_mev_g_yr?;
    let year = Spectrum::esp(environment.confidence, 1.0);
    let dose = |thickness_mm: f64| dose_behind(&year, geometry, thickness_mm, environment.niel.curve());
    (dose(300.0)..dose(0.1)).contains(&rate).then(|| {
        root_finding::between(0.1_f64.ln(), 300_f64.ln(), 1e-6, |log_mm| (dose(log_mm.exp()) / rate).ln()).exp()
    })
}

impl Survey {
    /// Where the active dose rate comes from.
    pub fn origin(&self) -> RateOrigin {
        self.history.origin
    }
}

/// The mission cut at every new year.
fn calendar_years(model: &Model) -> Result<Vec<CalendarYear>, InputError> {
    let launch = model.mission.mission.launch.0;
    let duration_yr = model.mission.mission.duration_yr;
    let last = date_after(launch, duration_yr).map_or(launch.year() + duration_yr.ceil() as i32, |date| date.year());
    let mut years = Vec::new();
    let history = model.history();
    let (mut start_yr, mut before_mev_g) = (0.0, 0.0);
    for year in launch.year()..=last {
        let end_yr = NaiveDate::from_ymd_opt(year + 1, 1, 1)
            .map_or(duration_yr, |new_year| years_between(launch, new_year))
            .min(duration_yr);
        if end_yr > start_yr {
            let cumulative_mev_g = model.dose_mev_g(end_yr)?;
            years.push(CalendarYear {
                year,
                flown_yr: end_yr - start_yr,
                active_yr: history.active_years(end_yr) - history.active_years(start_yr),
                dose_mev_g: cumulative_mev_g - before_mev_g,
                cumulative_mev_g,
            });
            before_mev_g = cumulative_mev_g;
        }
        start_yr = end_yr;
    }
    Ok(years)
}

/// Times of the curve of the dose besides those at which it bends or jumps.
const TIMES: u32 = 60;

fn over_time(model: &Model) -> Result<Vec<(f64, f64)>, InputError> {
    let duration_yr = model.mission.mission.duration_yr;
    let mut times = model.times_yr(duration_yr);
    times.extend((1..TIMES).map(|index| duration_yr * f64::from(index) / f64::from(TIMES)));
    times.sort_by(f64::total_cmp);
    times.into_iter().map(|t_yr| Ok((t_yr, model.dose_mev_g(t_yr)?))).collect()
}
