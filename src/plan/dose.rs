//! A mission's dose in the detail that a radiation engineer needs: the product of `ctiplan dose`.

mod events;
mod explain;
mod samples;
mod source;

pub use events::EventDose;
pub use explain::{Explained, Step};
pub use samples::{QUANTILES, Quantile, SampledYear, Samples};
pub use source::{SourceSpectrum, SourceSurvey, SourceYear};

use serde::Serialize;

use crate::environment::esp;
use crate::environment::proton::NIEL_NEUTRON_1MEV;
use crate::environment::secondaries::Secondaries;
use crate::environment::shielding::{DepthCurve, Geometry, Shield};
use crate::environment::spectrum::Spectrum;
use crate::error::InputError;
use crate::mission::{Accumulate, DoseModel, Mission, SecondariesCounted};
use crate::model::Model;
use crate::numeric::calendar::decimal_year;
use crate::numeric::parallel;
use crate::numeric::root_finding;
use crate::physics::{DoseHistory, RateOrigin};
use crate::warning::Warning;

/// Confidence levels of the table.
const CONFIDENCES: [f64; 5] = [0.50, 0.75, 0.90, 0.95, 0.99];

/// Thicknesses of the dose-depth curve, mm of aluminium.
const DEPTHS_MM: [f64; 14] = [1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 13.6, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 70.0];

/// Energies of the spectrum if none are requested, MeV.
pub const ENERGIES_MEV: [f64; 17] =
    [0.1, 0.3, 1.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 100.0, 150.0, 200.0, 300.0];

/// A complete survey of a mission's dose.
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
    /// The same damage as equivalent fluences.
    #[serde(flatten)]
    pub equivalents: Equivalents,
    /// Confidence of the curves below.
    pub confidence: f64,
    /// Solar-active years of the mission.
    pub active_years: f64,
    /// Dose by calendar year.
    pub years: Vec<CalendarYear>,
    /// Whether quantiles are those of one year or of the sum.
    #[serde(skip)]
    pub accumulate: Accumulate,
    /// Dose against confidence, behind the mission's shield; empty without a shield.
    pub confidences: Vec<AtConfidence>,
    /// Dose against thickness: for one active year, or for the mission if all sources are counted.
    pub depths: Vec<AtDepth>,
    /// Whether [`Self::depths`] is for the mission.
    #[serde(skip)]
    pub depths_of_mission: bool,
    /// Thickness of aluminium that gives the mission's active dose rate at its confidence.
    pub equivalent_mm: Equivalent,
    /// Spectrum in front of and behind the shield.
    pub spectrum: Vec<AtEnergy>,
    /// Each source of protons separately, before effects; empty if the mission gives its dose.
    pub sources: Vec<SourceSurvey>,
    /// Protons lost and secondaries added by nuclear reactions in the shield over the mission; None without sources.
    pub secondaries: Option<Secondaries>,
    /// Whether these are counted.
    #[serde(skip)]
    pub secondaries_counted: bool,
    /// For imported doses: the dose that would be derived in their place, MeV/g.
    pub derived_mev_g: Option<f64>,
    /// From the spectrum to the dose, step by step; None if the mission gives its dose.
    #[serde(skip)]
    pub explained: Option<Explained>,
    /// Observed solar events, the largest dose first; empty if the Sun is drawn at all times.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventDose>,
    /// Whether to show the steps.
    #[serde(skip)]
    pub explain: bool,
    /// The dose with the Sun drawn; None if not requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<Samples>,
    /// Warnings.
    pub warnings: Vec<Warning>,
}

/// Thickness of aluminium, mm; None outside 0.1 to 300 mm.
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
    /// Part of it within the mission, yr.
    pub flown_yr: f64,
    /// Active part of that, yr; with an observed Sun, after the observations.
    pub active_yr: f64,
    /// Part of it in which the Sun is taken as it was, yr.
    #[serde(skip_serializing_if = "is_zero")]
    pub observed_yr: f64,
    /// Dose in it, MeV/g.
    pub dose_mev_g: f64,
    /// Dose since launch at its end, MeV/g.
    pub cumulative_mev_g: f64,
}

/// A displacement damage dose as fluences of particles with the same damage in silicon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Equivalents {
    /// Protons of 10 MeV, cm⁻², by the table's own NIEL there.
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

/// Dose behind a thickness.
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
    /// Above this energy, cm⁻².
    pub integral_cm2: Over<f64>,
    /// Per MeV at this energy, cm⁻² MeV⁻¹.
    pub differential_cm2_mev: Over<f64>,
    /// Above this energy behind the shield, cm⁻²; None without a shield.
    pub shielded_integral_cm2: Over<Option<f64>>,
}

/// A fluence over two periods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Over<T> {
    /// One active year.
    pub year: T,
    /// The mission's active years: the quantile of the sum. Less than one year counts as one, none as none.
    pub mission: T,
}

/// Surveys a mission's dose, with the spectrum at these energies (MeV, above 0).
///
/// # Errors
/// If a formula has no value.
pub fn survey(mission: &Mission, energies_mev: &[f64]) -> Result<Survey, InputError> {
    let model = Model::new(mission);
    let history = model.history().clone();
    let environment = &mission.environment;
    let duration_yr = mission.mission.duration_yr;
    let total_mev_g = model.dose_mev_g(duration_yr)?;
    let active_years = history.active_years(duration_yr);
    let all_sources = matches!(environment.model, DoseModel::Derived | DoseModel::History);
    let shielding = mission.shielding.as_ref();
    Ok(Survey {
        launch: decimal_year(mission.mission.launch.0),
        years: calendar_years(&model)?,
        over_time: over_time(&model)?,
        total_mev_g,
        equivalents: Equivalents {
            protons_10mev_cm2: total_mev_g / environment.niel.at_10_mev(),
            neutrons_1mev_cm2: total_mev_g / NIEL_NEUTRON_1MEV,
        },
        confidence: environment.confidence,
        active_years,
        accumulate: environment.accumulate(),
        confidences: parallel::map(CONFIDENCES, |confidence| AtConfidence::of(mission, confidence, active_years))
            .into_iter()
            .flatten()
            .collect(),
        depths: depths_of(mission, &history),
        depths_of_mission: all_sources,
        spectrum: spectrum(mission, active_years, energies_mev),
        equivalent_mm: Equivalent {
            sphere: equivalent_mm(mission, Geometry::Sphere),
            slab: equivalent_mm(mission, Geometry::Slab),
        },
        sources: SourceSurvey::all(mission, &history, energies_mev),
        secondaries: (!history.sources.is_empty()).then(|| history.secondaries(duration_yr)),
        secondaries_counted: shielding.is_some_and(|shield| shield.secondaries == SecondariesCounted::Estimated),
        derived_mev_g: derived_in_place_of_imports(mission),
        explained: Explained::of(mission, &history),
        events: EventDose::all(mission, &history),
        explain: false,
        samples: None,
        warnings: warnings(mission, &history),
        history,
    })
}

fn warnings(mission: &Mission, history: &DoseHistory) -> Vec<Warning> {
    let mut warnings = history.warnings(mission.mission.duration_yr);
    warnings.extend(history.idle_phase(mission));
    if mission.place().is_none() {
        warnings.push(Warning::ShieldedByField);
    }
    warnings
}

/// Solar protons at 1 AU, in one active year and in the mission's, in front of and behind the shield.
fn spectrum(mission: &Mission, active_years: f64, energies_mev: &[f64]) -> Vec<AtEnergy> {
    let confidence = mission.environment.confidence;
    let (year, sum) = (esp::fluence(confidence, 1.0), esp::fluence(confidence, active_years));
    // A mission without an active year has no solar protons, although the model's shortest time is a year.
    let flown = if active_years > 0.0 { 1.0 } else { 0.0 };
    let shield = mission.shield();
    let behind = |spectrum: &Spectrum, energy_mev: f64| Some(shield.as_ref()?.fluence(spectrum, energy_mev));
    let at = |energy_mev: f64| AtEnergy {
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
    };
    parallel::map(energies_mev, |energy_mev| at(*energy_mev))
}

/// The mission without effects, with its dose derived: by its own model, or by the one that follows the solar cycle.
fn derived(mission: &Mission) -> Mission {
    let mut derived = mission.clone();
    derived.effects.clear();
    derived.environment.active_dose_rate_mev_g_yr = None;
    if derived.environment.model == DoseModel::History {
        derived.environment.model = DoseModel::Derived;
        derived.environment.history = None;
        derived.imported.history.clear();
    }
    derived
}

/// Dose (MeV/g) of a mission with derived sources in place of imported ones; None if nothing is imported, or nothing can be
/// derived.
fn derived_in_place_of_imports(mission: &Mission) -> Option<f64> {
    let environment = &mission.environment;
    let imports = [environment.history.is_some(), environment.spectra.is_some(), environment.dose_depth.is_some()];
    if !imports.contains(&true) || mission.place().is_none() || mission.shielding.is_none() {
        return None;
    }
    let mut own = derived(mission);
    (own.environment.history, own.environment.spectra, own.environment.dose_depth) = (None, None, None);
    let sectors = std::mem::take(&mut own.imported).sectors;
    own.imported.sectors = sectors;
    Some(total(&own))
}

/// Dose (MeV/g) at the end of a mission without effects.
fn total(mission: &Mission) -> f64 {
    Model::new(mission).dose_mev_g(mission.mission.duration_yr).expect("a mission without effects has no formula")
}

/// Dose behind aluminium; for a dose history, the dose that would be derived in its place.
fn depths_of(mission: &Mission, history: &DoseHistory) -> Vec<AtDepth> {
    if mission.environment.model != DoseModel::History {
        return depths(mission, history);
    }
    if mission.place().is_none() || mission.shielding.is_none() {
        return Vec::new();
    }
    let derived = derived(mission);
    depths(&derived, Model::new(&derived).history())
}

/// Dose (MeV/g) behind aluminium: for one active year, or for the mission if all sources are counted.
fn depths(mission: &Mission, history: &DoseHistory) -> Vec<AtDepth> {
    let environment = &mission.environment;
    let niel = environment.niel.curve();
    let at = |sphere: &(dyn Fn(f64) -> f64 + Sync), slab: &(dyn Fn(&Shield) -> f64 + Sync)| -> Vec<AtDepth> {
        let of = |thickness_mm: f64| AtDepth {
            thickness_mm,
            sphere_mev_g: sphere(thickness_mm),
            slab_mev_g: slab(&Shield::aluminium(Geometry::Slab, thickness_mm)),
        };
        parallel::map(DEPTHS_MM, of)
    };
    if environment.model != DoseModel::Derived || history.sources.is_empty() {
        let year = esp::fluence(environment.confidence, 1.0);
        return at(&|mm| Shield::aluminium(Geometry::Sphere, mm).dose(&year, niel), &|slab| slab.dose(&year, niel));
    }
    // A slab is crossed at all angles: many thicknesses, which a table provides.
    let terms: Vec<(f64, Spectrum)> = history
        .sources
        .iter()
        .flat_map(|source| history.terms(source, mission.mission.duration_yr))
        .map(|(years, spectrum)| (environment.dose_factor * years, spectrum))
        .collect();
    let curves = parallel::map(&terms, |(_, spectrum)| DepthCurve::of(spectrum, niel, 0.1, 2000.0));
    let sphere = |mm: f64| {
        let shield = Shield::aluminium(Geometry::Sphere, mm);
        terms.iter().map(|(years, spectrum)| years * shield.dose(spectrum, niel)).sum()
    };
    let slab = |slab: &Shield| {
        let dose = |curve: &DepthCurve| slab.mean(|direction| curve.at(direction.aluminium_g_cm2));
        terms.iter().zip(&curves).map(|((years, _), curve)| years * dose(curve)).sum()
    };
    at(&sphere, &slab)
}

impl AtConfidence {
    /// None without a shield, or if no dose can be derived.
    fn of(mission: &Mission, confidence: f64, active_years: f64) -> Option<AtConfidence> {
        mission.shielding.as_ref()?;
        let dose = |accumulate: Accumulate| {
            let mut mission = derived(mission);
            mission.environment.confidence = confidence;
            mission.environment.accumulate = Some(accumulate);
            // An observed Sun has those of the calendar.
            mission.environment.active_years = mission.observed_sun().is_none().then_some(active_years);
            total(&mission)
        };
        mission.place()?;
        let year = esp::fluence(confidence, 1.0);
        Some(AtConfidence {
            confidence,
            active_year_mev_g: mission.shield()?.dose(&year, mission.environment.niel.curve()),
            yearly_mev_g: dose(Accumulate::Yearly),
            mission_mev_g: dose(Accumulate::Mission),
        })
    }
}

/// Thickness of aluminium (mm) behind which solar protons give the dose rate that a mission states for an active year; None outside
/// 0.1 to 300 mm, and if it states none.
pub fn equivalent_mm(mission: &Mission, geometry: Geometry) -> Option<f64> {
    let environment = &mission.environment;
    let rate = environment.active_dose_rate_mev_g_yr?;
    let year = esp::fluence(environment.confidence, 1.0);
    let dose = |thickness_mm: f64| Shield::aluminium(geometry, thickness_mm).dose(&year, environment.niel.curve());
    (dose(300.0)..dose(0.1)).contains(&rate).then(|| {
        root_finding::between(0.1_f64.ln(), 300_f64.ln(), 1e-6, |log_mm| (dose(log_mm.exp()) / rate).ln()).exp()
    })
}

impl Survey {
    /// Origin of the active dose rate.
    pub fn origin(&self) -> RateOrigin {
        self.history.origin
    }
}

/// The mission divided at every new year.
fn calendar_years(model: &Model) -> Result<Vec<CalendarYear>, InputError> {
    let history = model.history();
    let mut before_mev_g = 0.0;
    let of = |(year, start_yr, end_yr): (i32, f64, f64)| {
        let cumulative_mev_g = model.dose_mev_g(end_yr)?;
        let dose_mev_g = cumulative_mev_g - before_mev_g;
        before_mev_g = cumulative_mev_g;
        Ok(CalendarYear {
            year,
            flown_yr: end_yr - start_yr,
            active_yr: history.active_years(end_yr) - history.active_years(start_yr),
            observed_yr: history.observed_years(start_yr, end_yr),
            dose_mev_g,
            cumulative_mev_g,
        })
    };
    source::calendar_years(&model.mission).map(of).collect()
}

/// Whether a part of a year is none.
fn is_zero(years: &f64) -> bool {
    *years == 0.0
}

/// Number of times of the dose curve besides those at which it bends or jumps.
const TIMES: u32 = 60;

fn over_time(model: &Model) -> Result<Vec<(f64, f64)>, InputError> {
    let duration_yr = model.mission.mission.duration_yr;
    let mut times = model.times_yr(duration_yr);
    times.extend((1..TIMES).map(|index| duration_yr * f64::from(index) / f64::from(TIMES)));
    times.sort_by(f64::total_cmp);
    times.into_iter().map(|t_yr| Ok((t_yr, model.dose_mev_g(t_yr)?))).collect()
}
