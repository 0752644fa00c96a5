//! A single source of protons.

use chrono::Datelike;
use serde::Serialize;

use crate::environment::source::Card;
use crate::mission::Mission;
use crate::numeric::calendar::{date_after, years_between};
use crate::numeric::parallel;
use crate::physics::{DoseHistory, SourceDose};

/// A source of protons over a mission.
#[derive(Clone, Debug, Serialize)]
pub struct SourceSurvey {
    /// Name: that of its card, or the imported file.
    pub name: String,
    /// Its card; None for an imported source.
    #[serde(skip)]
    pub card: Option<&'static Card>,
    /// Dose of the mission, MeV/g.
    pub total_mev_g: f64,
    /// By calendar year.
    pub years: Vec<SourceYear>,
    /// Fluences over the mission.
    pub spectrum: Vec<SourceSpectrum>,
}

/// Dose of one source in a calendar year.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SourceYear {
    /// The year.
    pub year: i32,
    /// Dose in it, MeV/g.
    pub dose_mev_g: f64,
}

/// Fluence of one source over the mission.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SourceSpectrum {
    /// Proton energy, MeV.
    pub energy_mev: f64,
    /// Above this energy, along the orbit, cm⁻².
    pub integral_cm2: f64,
    /// Above this energy behind the shield, cm⁻².
    pub shielded_integral_cm2: f64,
}

impl SourceSurvey {
    /// All sources of a mission.
    pub(super) fn all(mission: &Mission, history: &DoseHistory, energies_mev: &[f64]) -> Vec<SourceSurvey> {
        if let Some(file) = &mission.environment.history {
            return vec![SourceSurvey::of_history(mission, history, file)];
        }
        history.sources.iter().map(|source| SourceSurvey::of(mission, history, source, energies_mev)).collect()
    }

    /// A dose history, which has no spectrum.
    fn of_history(mission: &Mission, history: &DoseHistory, file: &str) -> SourceSurvey {
        let dose = |from_yr: f64, to_yr: f64| history.imported_mev_g(to_yr) - history.imported_mev_g(from_yr);
        let years = calendar_years(mission);
        SourceSurvey {
            name: file.to_string(),
            card: None,
            total_mev_g: dose(0.0, mission.mission.duration_yr),
            years: years.map(|(year, from, to)| SourceYear { year, dose_mev_g: dose(from, to) }).collect(),
            spectrum: Vec::new(),
        }
    }

    fn of(mission: &Mission, history: &DoseHistory, source: &SourceDose, energies_mev: &[f64]) -> SourceSurvey {
        let duration_yr = mission.mission.duration_yr;
        let shield = mission.shield();
        let at = |&energy_mev: &f64| SourceSpectrum {
            energy_mev,
            integral_cm2: history.of_spectrum(source, duration_yr, |spectrum| spectrum.above(energy_mev)),
            shielded_integral_cm2: history.of_spectrum(source, duration_yr, |spectrum| {
                shield.as_ref().map_or(0.0, |shield| shield.fluence(spectrum, energy_mev))
            }),
        };
        let years = calendar_years(mission).map(|(year, from_yr, to_yr)| SourceYear {
            year,
            dose_mev_g: history.of_source_mev_g(source, from_yr, to_yr),
        });
        SourceSurvey {
            name: source.name.clone(),
            card: source.card,
            total_mev_g: history.of_source_mev_g(source, 0.0, duration_yr),
            years: years.collect(),
            spectrum: parallel::map(energies_mev, at),
        }
    }
}

/// Calendar years of a mission, each with its start and end in years since launch.
pub(super) fn calendar_years(mission: &Mission) -> impl Iterator<Item = (i32, f64, f64)> {
    let (launch, duration_yr) = (mission.mission.launch.0, mission.mission.duration_yr);
    let last = date_after(launch, duration_yr).map_or(launch.year() + duration_yr.ceil() as i32, |date| date.year());
    let new_year = move |year: i32| {
        chrono::NaiveDate::from_ymd_opt(year, 1, 1)
            .map_or(duration_yr, |day| years_between(launch, day))
            .clamp(0.0, duration_yr)
    };
    (launch.year()..=last).map(move |year| (year, new_year(year), new_year(year + 1))).filter(|(_, from, to)| to > from)
}
