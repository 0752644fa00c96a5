//! Orbit, Sun and shield → dose at the detector, day by day.
//!
//! ```text
//! [`esp`] fluence spectrum at a confidence → [`shielding`] → NIEL in silicon ([`proton`]) → active dose rate
//!                                                       [`solar_cycle`] active years → D(t)
//! ```
//!
//! "Dose" is displacement damage dose in MeV per gram of silicon, everywhere.

pub mod esp;
pub mod proton;
pub mod shielding;
pub mod solar_cycle;

use crate::calendar::decimal_year;
use crate::mission::{Accumulate, DoseModel, Mission, Niel};
use crate::warning::Warning;
use proton::Curve;

/// Dose rate over time.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseHistory {
    /// Years since launch between which solar protons come.
    windows: Vec<(f64, f64)>,
    /// Active share of those windows: 1, or 7/11 where the windows stand for all years.
    active_share: f64,
    /// Dose rate in active years, MeV/g/yr.
    pub active_rate_mev_g_yr: f64,
    /// Dose rate in every year, MeV/g/yr.
    pub floor_mev_g_yr: f64,
    /// Where the active rate comes from.
    pub origin: RateOrigin,
    /// What is doubtful about it.
    pub warnings: Vec<Warning>,
}

/// Where an active dose rate comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RateOrigin {
    /// The mission file gives it.
    Given,
    /// Derived from the ESP model for so many active years at once.
    Esp {
        /// Active years whose sum's quantile was taken.
        active_years: f64,
    },
}

impl Niel {
    /// The damage curve.
    pub fn curve(self) -> &'static Curve {
        match self {
            Niel::Sr => &proton::NIEL_SR,
            Niel::Rd50 => &proton::NIEL_RD50,
        }
    }
}

impl DoseHistory {
    /// Dose history of a mission.
    pub fn of(mission: &Mission) -> DoseHistory {
        let environment = &mission.environment;
        let launch = decimal_year(mission.mission.launch.0);
        let duration_yr = mission.mission.duration_yr;
        let (windows, active_share) = match environment.model {
            // One endless stretch at 7/11 of the rate.
            DoseModel::Constant => (vec![(0.0, f64::INFINITY)], solar_cycle::ACTIVE_SHARE),
            DoseModel::SolarCycle => {
                let maxima = solar_cycle::active_windows(&environment.solar_maximum);
                let since_launch = maxima.iter().map(|(start, end)| ((start - launch).max(0.0), end - launch));
                (since_launch.filter(|(_, end)| *end > 0.0).collect(), 1.0)
            }
        };
        let active_years = active_share * years_within(&windows, duration_yr);
        let (rate, origin) = match environment.active_dose_rate_mev_g_yr {
            Some(rate) => (rate, RateOrigin::Given),
            None => derived_rate(mission, active_years),
        };
        let mut warnings = Vec::new();
        if environment.model == DoseModel::SolarCycle {
            let last = environment.solar_maximum.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let known_until = last + solar_cycle::CYCLE_YR - solar_cycle::ACTIVE_BEFORE_YR;
            if launch + duration_yr > known_until {
                warnings.push(Warning::BeyondSolarMaxima { last, known_until });
            }
        }
        DoseHistory {
            windows,
            active_share,
            active_rate_mev_g_yr: rate,
            floor_mev_g_yr: environment.cosmic_ray_floor_mev_g_yr,
            origin,
            warnings,
        }
    }

    /// Dose since launch, MeV/g, at a time in years since launch.
    pub fn dose_mev_g(&self, t_yr: f64) -> f64 {
        self.active_rate_mev_g_yr * self.active_years(t_yr) + self.floor_mev_g_yr * t_yr
    }

    /// Times (years since launch) up to `t_yr` at which the dose rate changes, in order.
    pub fn changes_yr(&self, t_yr: f64) -> Vec<f64> {
        self.windows.iter().flat_map(|(start, end)| [*start, *end]).filter(|t| *t > 0.0 && *t < t_yr).collect()
    }

    /// Active years among the first `t_yr` since launch; 7/11 of them with a constant dose rate.
    pub fn active_years(&self, t_yr: f64) -> f64 {
        self.active_share * years_within(&self.windows, t_yr)
    }
}

/// Time that windows cover between 0 and `t_yr`.
fn years_within(windows: &[(f64, f64)], t_yr: f64) -> f64 {
    windows.iter().map(|(start, end)| (end.min(t_yr) - start.max(0.0)).max(0.0)).sum()
}

/// Dose rate of an active year behind the mission's shield. `active_years` of the mission are those whose quantile is
/// taken at once with `accumulate = "mission"`.
fn derived_rate(mission: &Mission, active_years: f64) -> (f64, RateOrigin) {
    let environment = &mission.environment;
    let shield = mission.shielding.as_ref().expect("a mission whose dose is derived has a shield");
    let dose_of = |years: f64| {
        let spectrum = esp::Spectrum::esp(environment.confidence, years);
        shielding::dose_behind(&spectrum, shield.geometry, shield.thickness_mm, environment.niel.curve())
    };
    match environment.accumulate {
        Accumulate::Mission if active_years > 0.0 => {
            // Less than one active year counts as one, and all of it arrives within the active time there is.
            let years = active_years.max(1.0);
            (dose_of(years) / active_years, RateOrigin::Esp { active_years: years })
        }
        _ => (dose_of(1.0), RateOrigin::Esp { active_years: 1.0 }),
    }
}
