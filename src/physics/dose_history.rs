//! Dose rate and steps of dose over time → dose since launch.

use std::fmt;
use std::sync::Arc;

use gauss_quad::GaussLegendre;

use crate::environment::solar_cycle::{self, ACTIVE_AFTER_YR, ACTIVE_BEFORE_YR, ActiveYears, Maximum};
use crate::environment::{esp, shielding};
use crate::error::InputError;
use crate::mission::{Accumulate, DoseModel, Environment, Mission, Shielding};
use crate::numeric::calendar::decimal_year;
use crate::warning::Warning;

/// Dose rate over time.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseHistory {
    /// Active years of the Sun (in years since launch), whether the model follows them or not.
    cycle: Vec<ActiveYears>,
    /// Years since launch between which solar protons come, in order.
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
    /// What the rate is derived from; None if the mission gives it.
    derived: Option<Derived>,
    /// Decimal year.
    launch: f64,
    /// Maxima of the Sun after launch that are not known yet.
    extrapolated: Vec<Maximum>,
}

/// What a quantity becomes, from the time (years since launch) and what it was.
#[derive(Clone)]
pub struct Law(Arc<dyn Fn(f64, f64) -> Result<f64, InputError> + Send + Sync>);

impl Law {
    /// A law.
    pub fn new(law: impl Fn(f64, f64) -> Result<f64, InputError> + Send + Sync + 'static) -> Law {
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

impl DoseHistory {
    /// Dose history of a mission.
    pub(crate) fn of(mission: &Mission) -> DoseHistory {
        let environment = &mission.environment;
        let launch = decimal_year(mission.mission.launch.0);
        let duration_yr = mission.mission.duration_yr;
        let maxima = solar_cycle::maxima(&environment.solar_maximum, launch + REACH_YR);
        let since_launch = |stretch: &ActiveYears| ActiveYears {
            from: (stretch.from - launch).max(0.0),
            to: stretch.to - launch,
            extrapolated: stretch.extrapolated,
        };
        let cycle: Vec<ActiveYears> = solar_cycle::active_years(&maxima).iter().map(since_launch).collect();
        let cycle: Vec<ActiveYears> = cycle.into_iter().filter(|stretch| stretch.to > 0.0).collect();
        let (windows, active_share) = match environment.model {
            // One endless stretch at 7/11 of the rate.
            DoseModel::Constant => (vec![(0.0, f64::INFINITY)], solar_cycle::ACTIVE_SHARE),
            DoseModel::SolarCycle => (windows(&cycle), 1.0),
        };
        let ahead = |maximum: &Maximum| maximum.cycles_ahead > 0 && maximum.year + ACTIVE_AFTER_YR > launch;
        let extrapolated = maxima.into_iter().filter(ahead).collect();
        let derived = match environment.active_dose_rate_mev_g_yr {
            Some(_) => None,
            None => mission.shielding.clone().map(|shield| Derived {
                environment: environment.clone(),
                shield,
                duration_yr,
            }),
        };
        let mut history = DoseHistory {
            cycle,
            windows,
            active_share,
            active_rate_mev_g_yr: environment.active_dose_rate_mev_g_yr.unwrap_or(0.0),
            floor_mev_g_yr: environment.cosmic_ray_floor_mev_g_yr,
            steps: Vec::new(),
            rate_laws: Vec::new(),
            dose_laws: Vec::new(),
            origin: RateOrigin::Given,
            derived,
            launch,
            extrapolated,
        };
        history.derive_rate();
        history
    }

    /// Lets the active rate come in the active years of the solar cycle, and nothing in the others.
    pub fn follow_solar_cycle(&mut self) {
        if self.averages_the_cycle() {
            self.windows = windows(&self.cycle);
            self.active_share = 1.0;
            // The quantile of a sum depends on the active years that are summed.
            self.derive_rate();
        }
    }

    /// Derives the active rate, unless the mission gives it.
    fn derive_rate(&mut self) {
        if let Some(derived) = &self.derived {
            (self.active_rate_mev_g_yr, self.origin) = derived.rate(self.active_years(derived.duration_yr));
        }
    }

    /// Maxima of the Sun that are not known yet and on which the dose up to a time (years since launch) depends.
    pub fn extrapolated(&self, until_yr: f64) -> Vec<Maximum> {
        let begun = |maximum: &&Maximum| maximum.year - ACTIVE_BEFORE_YR < self.launch + until_yr;
        if self.averages_the_cycle() { Vec::new() } else { self.extrapolated.iter().filter(begun).copied().collect() }
    }

    /// What is doubtful about the dose up to a time (years since launch).
    pub fn warnings(&self, until_yr: f64) -> Vec<Warning> {
        let maxima = self.extrapolated(until_yr);
        if maxima.is_empty() { Vec::new() } else { vec![Warning::SunExtrapolated { maxima }] }
    }

    /// Dose since launch, MeV/g, at a time in years since launch.
    ///
    /// # Errors
    /// Where a law has no value, here and below.
    pub(crate) fn dose_mev_g(&self, t_yr: f64) -> Result<f64, InputError> {
        self.dose_with_steps(t_yr, |step_yr| step_yr <= t_yr)
    }

    fn dose_with_steps(&self, t_yr: f64, counts: impl Fn(f64) -> bool) -> Result<f64, InputError> {
        let streamed = if self.rate_laws.is_empty() {
            self.active_rate_mev_g_yr * self.active_years(t_yr) + self.floor_mev_g_yr * t_yr
        } else {
            self.integral(t_yr, 0.0, |_| 1.0)?
        };
        let steps = self.steps.iter().filter(|(step_yr, _)| counts(*step_yr));
        let dose = steps.fold(streamed, |dose, (_, step)| dose + step);
        self.dose_laws.iter().try_fold(dose, |dose, Law(law)| law(t_yr, dose))
    }

    /// Dose rate, MeV/g/yr, at a time in years since launch, without what comes at once.
    fn rate_mev_g_yr(&self, t_yr: f64) -> Result<f64, InputError> {
        let after = self.windows.partition_point(|(start, _)| *start <= t_yr);
        let active = after > 0 && t_yr < self.windows[after - 1].1;
        let active_rate = if active { self.active_share * self.active_rate_mev_g_yr } else { 0.0 };
        self.rate_laws.iter().try_fold(active_rate + self.floor_mev_g_yr, |rate, Law(law)| law(t_yr, rate))
    }

    /// ∫ w(made) dD(made) over the dose (MeV/g) that came up to `t_yr`, weighted with a function of the time it came.
    ///
    /// The weight may change by steps at `breaks_yr`, and in between as fast as a function of the age, t − made, can that
    /// has the same shape at all scales.
    ///
    /// # Errors
    /// As [`DoseHistory::dose_mev_g`].
    pub(crate) fn weighted_dose_mev_g(
        &self,
        t_yr: f64,
        breaks_yr: &[f64],
        weight: impl Fn(f64) -> f64,
    ) -> Result<f64, InputError> {
        let mut breaks: Vec<f64> = breaks_yr.iter().copied().filter(|at| *at > 0.0 && *at < t_yr).collect();
        breaks.extend(self.steps.iter().map(|(step_yr, _)| *step_yr).filter(|at| *at > 0.0 && *at < t_yr));
        breaks.extend([0.0, t_yr]);
        breaks.sort_by(f64::total_cmp);
        let streamed: f64 = if self.dose_laws.is_empty() {
            let pieces = breaks.windows(2).map(|piece| self.integral(piece[1], piece[0], &weight));
            pieces.sum::<Result<f64, InputError>>()?
        } else {
            // Only the dose itself is known: pieces short enough for the weight to be the same within.
            let total =
                |at: f64, after: bool| self.dose_with_steps(at, |step| if after { step <= at } else { step < at });
            let mut sum = 0.0;
            for piece in breaks.windows(2) {
                let times: Vec<f64> =
                    (0..=PIECES).map(|i| piece[0] + (piece[1] - piece[0]) * i as f64 / PIECES as f64).collect();
                for pair in times.windows(2) {
                    sum += weight(0.5 * (pair[0] + pair[1])) * (total(pair[1], false)? - total(pair[0], true)?);
                }
            }
            sum
        };
        let jump = |step_yr: f64| -> Result<f64, InputError> {
            let before = self.dose_with_steps(step_yr, |other| other < step_yr)?;
            Ok(self.dose_with_steps(step_yr, |other| other <= step_yr)? - before)
        };
        let mut steps: Vec<f64> = self.steps.iter().map(|(at, _)| *at).filter(|at| *at <= t_yr).collect();
        steps.sort_by(f64::total_cmp);
        steps.dedup();
        steps.iter().try_fold(streamed, |dose, &at| Ok(dose + weight(at) * jump(at)?))
    }

    /// ∫ w(s) rate(s) ds between two times (years since launch), step by step towards the later one: each as far from it as
    /// it is long, so that no age is passed over.
    fn integral(&self, until_yr: f64, from_yr: f64, weight: impl Fn(f64) -> f64) -> Result<f64, InputError> {
        let mut ends = self.changes_yr(until_yr);
        ends.retain(|at| *at > from_yr);
        ends.push(until_yr);
        let rule = GaussLegendre::new(NODES);
        let piece = |start: f64, stop: f64| -> Result<f64, InputError> {
            let (middle, half) = (0.5 * (start + stop), 0.5 * (stop - start));
            rule.iter().try_fold(0.0, |sum, (node, share)| {
                let at = middle + half * node;
                Ok(sum + half * share * weight(at) * self.rate_mev_g_yr(at)?)
            })
        };
        let mut sum = 0.0;
        let mut start = from_yr;
        for end in ends {
            while start < end {
                let age = until_yr - start;
                // The last thousandth of a second is one step.
                let step = if age > 1e-10 { (0.5 * age).min(end - start).min(LONGEST_STEP_YR) } else { end - start };
                // So that the end is met.
                let stop = if end - start - step < 1e-11 { end } else { start + step };
                sum += piece(start, stop)?;
                start = stop;
            }
        }
        Ok(sum)
    }

    /// Times (years since launch) up to `t_yr` at which the dose rate changes, in order.
    pub fn changes_yr(&self, t_yr: f64) -> Vec<f64> {
        let windows = self.windows.iter().flat_map(|(start, end)| [*start, *end]);
        let mut changes: Vec<f64> = windows.chain(self.steps.iter().map(|(at, _)| *at)).collect();
        changes.retain(|t| *t > 0.0 && *t < t_yr);
        changes.sort_by(f64::total_cmp);
        changes
    }

    /// Whether the dose comes at the mean rate of a solar cycle, 7/11 of that of an active year, in every year.
    pub fn averages_the_cycle(&self) -> bool {
        self.active_share < 1.0
    }

    /// Active years of the Sun, in years since launch, whether the dose follows them or not.
    pub fn active_stretches(&self) -> &[ActiveYears] {
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

/// Years after launch up to which the Sun is followed: beyond any time that can be asked for.
const REACH_YR: f64 = 1100.0;

fn windows(cycle: &[ActiveYears]) -> Vec<(f64, f64)> {
    cycle.iter().map(|stretch| (stretch.from, stretch.to)).collect()
}

/// Time that windows (in order) cover between 0 and `t_yr`.
fn years_within(windows: &[(f64, f64)], t_yr: f64) -> f64 {
    let begun = windows.iter().take_while(|(start, _)| *start < t_yr);
    // From 0 on: the sum of nothing would be −0.
    begun.fold(0.0, |sum, (start, end)| sum + (end.min(t_yr) - start.max(0.0)).max(0.0))
}

/// What an active dose rate is derived from.
#[derive(Clone, Debug, PartialEq)]
struct Derived {
    environment: Environment,
    shield: Shielding,
    duration_yr: f64,
}

impl Derived {
    /// Dose rate of an active year behind the shield, MeV/g/yr. `active_years` of the mission are those whose quantile is taken at
    /// once with `accumulate = "mission"`.
    fn rate(&self, active_years: f64) -> (f64, RateOrigin) {
        let (environment, shield) = (&self.environment, &self.shield);
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
}
