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

use std::fmt;
use std::sync::Arc;

use gauss_quad::GaussLegendre;

use crate::calendar::decimal_year;
use crate::mission::{Accumulate, DoseModel, Mission, Niel};
use crate::warning::Warning;
use proton::Curve;

/// Dose rate over time.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseHistory {
    /// Years since launch between which solar protons come in an 11-year cycle, whether the model follows it or not.
    cycle: Vec<(f64, f64)>,
    /// Years since launch between which solar protons come.
    windows: Vec<(f64, f64)>,
    /// Active share of those windows: 1, or 7/11 where the windows stand for all years.
    active_share: f64,
    /// Dose rate in active years, MeV/g/yr.
    pub active_rate_mev_g_yr: f64,
    /// Dose rate in every year, MeV/g/yr.
    pub floor_mev_g_yr: f64,
    /// Doses (MeV/g) that come at once, each with its time in years since launch.
    pub steps: Vec<(f64, f64)>,
    /// What becomes of the dose rate (MeV/g/yr), in turn.
    pub rate_laws: Vec<Law>,
    /// What becomes of the dose (MeV/g), in turn.
    pub dose_laws: Vec<Law>,
    /// Where the active rate comes from.
    pub origin: RateOrigin,
    /// What is doubtful about it.
    pub warnings: Vec<Warning>,
}

/// What a quantity becomes, from the time (years since launch) and what it was.
#[derive(Clone)]
pub struct Law(Arc<dyn Fn(f64, f64) -> f64 + Send + Sync>);

impl Law {
    /// A law.
    pub fn new(law: impl Fn(f64, f64) -> f64 + Send + Sync + 'static) -> Law {
        Law(Arc::new(law))
    }
}

impl fmt::Debug for Law {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("Law")
    }
}

impl PartialEq for Law {
    fn eq(&self, other: &Law) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
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
        let maxima = solar_cycle::active_windows(&environment.solar_maximum);
        let since_launch = maxima.iter().map(|(start, end)| ((start - launch).max(0.0), end - launch));
        let cycle: Vec<(f64, f64)> = since_launch.filter(|(_, end)| *end > 0.0).collect();
        let (windows, active_share) = match environment.model {
            // One endless stretch at 7/11 of the rate.
            DoseModel::Constant => (vec![(0.0, f64::INFINITY)], solar_cycle::ACTIVE_SHARE),
            DoseModel::SolarCycle => (cycle.clone(), 1.0),
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
            cycle,
            windows,
            active_share,
            active_rate_mev_g_yr: rate,
            floor_mev_g_yr: environment.cosmic_ray_floor_mev_g_yr,
            steps: Vec::new(),
            rate_laws: Vec::new(),
            dose_laws: Vec::new(),
            origin,
            warnings,
        }
    }

    /// Lets the active rate come in the active years of the solar cycle, and nothing in the others.
    pub fn follow_solar_cycle(&mut self) {
        self.windows.clone_from(&self.cycle);
        self.active_share = 1.0;
    }

    /// Dose since launch, MeV/g, at a time in years since launch.
    pub fn dose_mev_g(&self, t_yr: f64) -> f64 {
        self.dose_with_steps(t_yr, |step_yr| step_yr <= t_yr)
    }

    fn dose_with_steps(&self, t_yr: f64, counts: impl Fn(f64) -> bool) -> f64 {
        let streamed = if self.rate_laws.is_empty() {
            self.active_rate_mev_g_yr * self.active_years(t_yr) + self.floor_mev_g_yr * t_yr
        } else {
            self.integral(t_yr, 0.0, |_| 1.0)
        };
        let steps = self.steps.iter().filter(|(step_yr, _)| counts(*step_yr));
        let dose = steps.fold(streamed, |dose, (_, step)| dose + step);
        self.dose_laws.iter().fold(dose, |dose, Law(law)| law(t_yr, dose))
    }

    /// Dose rate, MeV/g/yr, at a time in years since launch, without what comes at once.
    fn rate_mev_g_yr(&self, t_yr: f64) -> f64 {
        let active = self.windows.iter().any(|(start, end)| (*start..*end).contains(&t_yr));
        let active_rate = if active { self.active_share * self.active_rate_mev_g_yr } else { 0.0 };
        self.rate_laws.iter().fold(active_rate + self.floor_mev_g_yr, |rate, Law(law)| law(t_yr, rate))
    }

    /// ∫ w(made) dD(made) over the dose (MeV/g) that came up to `t_yr`, weighted with a function of the time it came.
    ///
    /// The weight may change by steps at `breaks_yr`, and in between as fast as a function of the age, t − made, can that
    /// has the same shape at all scales.
    pub fn weighted_dose_mev_g(&self, t_yr: f64, breaks_yr: &[f64], weight: impl Fn(f64) -> f64) -> f64 {
        let mut breaks: Vec<f64> = breaks_yr.iter().copied().filter(|at| *at > 0.0 && *at < t_yr).collect();
        breaks.extend(self.steps.iter().map(|(step_yr, _)| *step_yr).filter(|at| *at > 0.0 && *at < t_yr));
        breaks.extend([0.0, t_yr]);
        breaks.sort_by(f64::total_cmp);
        let streamed: f64 = if self.dose_laws.is_empty() {
            breaks.windows(2).map(|piece| self.integral(piece[1], piece[0], &weight)).sum()
        } else {
            // Only the dose itself is known: pieces short enough for the weight to be the same within.
            let total =
                |at: f64, after: bool| self.dose_with_steps(at, |step| if after { step <= at } else { step < at });
            let mut sum = 0.0;
            for piece in breaks.windows(2) {
                let times: Vec<f64> =
                    (0..=PIECES).map(|i| piece[0] + (piece[1] - piece[0]) * i as f64 / PIECES as f64).collect();
                for pair in times.windows(2) {
                    sum += weight(0.5 * (pair[0] + pair[1])) * (total(pair[1], false) - total(pair[0], true));
                }
            }
            sum
        };
        let jump = |step_yr: f64| {
            let before = self.dose_with_steps(step_yr, |other| other < step_yr);
            self.dose_with_steps(step_yr, |other| other <= step_yr) - before
        };
        let mut steps: Vec<f64> = self.steps.iter().map(|(at, _)| *at).filter(|at| *at <= t_yr).collect();
        steps.sort_by(f64::total_cmp);
        steps.dedup();
        steps.iter().fold(streamed, |dose, &at| dose + weight(at) * jump(at))
    }

    /// ∫ w(s) rate(s) ds between two times (years since launch), step by step towards the later one: each as far from it as
    /// it is long, so that no age is passed over.
    fn integral(&self, until_yr: f64, from_yr: f64, weight: impl Fn(f64) -> f64) -> f64 {
        let mut ends = self.changes_yr(until_yr);
        ends.retain(|at| *at > from_yr);
        ends.push(until_yr);
        let rule = GaussLegendre::new(NODES);
        let mut sum = 0.0;
        let mut start = from_yr;
        for end in ends {
            while start < end {
                let age = until_yr - start;
                // The last thousandth of a second is one step.
                let step = if age > 1e-10 { (0.5 * age).min(end - start).min(LONGEST_STEP_YR) } else { end - start };
                // So that the end is met.
                let stop = if end - start - step < 1e-11 { end } else { start + step };
                sum += rule.integrate(start, stop, |at| weight(at) * self.rate_mev_g_yr(at));
                start = stop;
            }
        }
        sum
    }

    /// Times (years since launch) up to `t_yr` at which the dose rate changes, in order.
    pub fn changes_yr(&self, t_yr: f64) -> Vec<f64> {
        let windows = self.windows.iter().flat_map(|(start, end)| [*start, *end]);
        let mut changes: Vec<f64> = windows.chain(self.steps.iter().map(|(at, _)| *at)).collect();
        changes.retain(|t| *t > 0.0 && *t < t_yr);
        changes.sort_by(f64::total_cmp);
        changes
    }

    /// Years since launch between which the Sun is active, whether the dose follows it or not.
    pub fn active_windows(&self) -> &[(f64, f64)] {
        &self.cycle
    }

    /// Active years among the first `t_yr` since launch; 7/11 of them with a constant dose rate.
    pub fn active_years(&self, t_yr: f64) -> f64 {
        self.active_share * years_within(&self.windows, t_yr)
    }
}

/// Longest step of an integral over time, yr: a law of the dose rate may follow the seasons.
const LONGEST_STEP_YR: f64 = 0.5;

/// Nodes of a step.
const NODES: std::num::NonZeroUsize = std::num::NonZeroUsize::new(12).expect("above 0");

/// Pieces into which the time between two breaks is cut where only the dose itself is known.
const PIECES: usize = 2000;

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
