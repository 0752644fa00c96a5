//! Dose rate and steps of dose over time → dose since launch.

use std::f64::consts::PI;
use std::fmt;
use std::iter;
use std::sync::{Arc, LazyLock};

use gauss_quad::GaussLegendre;

use crate::environment::cosmic_rays;
use crate::environment::secondaries::{self, Secondaries};
use crate::environment::solar_cycle::{self, ACTIVE_AFTER_YR, ACTIVE_BEFORE_YR, ActiveYears, Maximum, Phase};
use crate::environment::source::{When, on_line};
use crate::environment::spectrum::Spectrum;
use crate::error::InputError;
use crate::mission::{Accumulate, DoseModel, Mission, SecondariesCounted};
use crate::numeric::calendar::decimal_year;
use crate::physics::dose_warnings;
use crate::physics::source_dose::{SourceDose, on_common_years, source_doses};
use crate::warning::Warning;

/// Dose rate over time.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseHistory {
    /// Active years of the Sun (in years since launch), whether the dose model follows them or not.
    cycle: Vec<ActiveYears>,
    /// Intervals (years since launch) with solar protons, in order.
    windows: Vec<(f64, f64)>,
    /// Active fraction of those intervals: 1, or 7/11 if the intervals cover all years.
    active_share: f64,
    /// Dose rate in active years, MeV/g/yr.
    pub active_rate_mev_g_yr: f64,
    /// Dose rate in every year, MeV/g/yr.
    pub floor_mev_g_yr: f64,
    /// Dose rates that follow the phase of the solar cycle.
    cyclic: Vec<Cyclic>,
    /// Factors on the dose rate.
    pub modulations: Vec<Modulation>,
    /// Dose since launch (MeV/g) against years since launch, from a file, of a drawn Sun, or of the Sun as it was.
    table: Vec<(f64, f64)>,
    /// The part of it from a file or of a drawn Sun.
    imported: Vec<(f64, f64)>,
    /// Instantaneous doses (MeV/g), each with its time in years since launch.
    pub steps: Vec<(f64, f64)>,
    /// Laws applied to the dose rate (MeV/g/yr), in order.
    pub rate_laws: Vec<Law>,
    /// Laws applied to the dose (MeV/g), in order.
    pub dose_laws: Vec<Law>,
    /// Origin of the active dose rate.
    pub origin: RateOrigin,
    /// If the dose is derived: the sources, each with its dose.
    pub sources: Vec<Arc<SourceDose>>,
    /// The mission from which it is derived; None if the mission gives its dose.
    derived: Option<Arc<Mission>>,
    /// Dose at which trap densities are quoted, MeV/g.
    pub reference_dose_mev_g: f64,
    /// Decimal year.
    launch: f64,
    /// Time in which the Sun is taken as it was, years since launch.
    observed_yr: Option<[f64; 2]>,
    /// Modulation of cosmic rays (GV) at decimal years, where it was observed.
    modulation_gv: Vec<(f64, f64)>,
    /// Future maxima of the Sun, after launch, that are extrapolated.
    extrapolated: Vec<Maximum>,
}

/// A dose rate that follows the phase x of the solar cycle: Σ c_k cos 2πkx, MeV/g/yr.
#[derive(Clone, Debug, PartialEq)]
struct Cyclic {
    phase: Phase,
    /// Years in which it is 0.
    except: [f64; 2],
    cosines: Vec<f64>,
}

impl Cyclic {
    /// Its law of time.
    fn when(&self) -> When {
        When::Cycle { cosines: self.cosines.clone(), phase: self.phase, except: self.except }
    }

    /// Its rate at a decimal year, MeV/g/yr.
    fn rate_mev_g_yr(&self, year: f64) -> f64 {
        if self.except[0] <= year && year < self.except[1] { 0.0 } else { self.phase.value(&self.cosines, year) }
    }
}

/// A factor on the dose rate, 1 + A cos(2π (t − t_peak)/P).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulation {
    /// A, from 0 to 1.
    pub amplitude: f64,
    /// P, yr.
    pub period_yr: f64,
    /// t_peak, decimal year.
    pub peak: f64,
}

impl Modulation {
    /// 2π (t − t_peak)/P at a decimal year.
    fn angle(&self, year: f64) -> f64 {
        2.0 * PI * (year - self.peak) / self.period_yr
    }

    fn factor(&self, year: f64) -> f64 {
        1.0 + self.amplitude * self.angle(year).cos()
    }

    /// The factor integrated between two times (years since launch, a decimal year), yr.
    fn integral_yr(&self, launch: f64, from_yr: f64, to_yr: f64) -> f64 {
        let sine = |t_yr: f64| self.angle(launch + t_yr).sin();
        to_yr - from_yr + self.amplitude * self.period_yr / (2.0 * PI) * (sine(to_yr) - sine(from_yr))
    }
}

/// The new value of a quantity, from the time (years since launch) and its previous value.
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

/// Origin of an active dose rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RateOrigin {
    /// The mission file gives it.
    Given,
    /// Derived from the ESP model for all active years together.
    Esp {
        /// Active years in the quantile of the sum.
        active_years: f64,
    },
    /// Derived from all sources of the orbit, solar protons for all active years together.
    Sources {
        /// Active years in the quantile of the sum.
        active_years: f64,
    },
    /// Derived from spectra of other programs.
    Spectra,
    /// From a dose-depth curve of another program.
    DoseDepth,
    /// From a dose history.
    History,
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
        let (windows, active_share) = match (environment.active_years, environment.model) {
            // One unlimited interval with a fraction of the rate.
            (Some(years), _) => (vec![(0.0, f64::INFINITY)], years / duration_yr),
            (None, DoseModel::Constant) => (vec![(0.0, f64::INFINITY)], solar_cycle::ACTIVE_SHARE),
            (None, DoseModel::SolarCycle | DoseModel::Derived | DoseModel::History) => (windows(&cycle), 1.0),
        };
        let windows = match mission.observed_sun() {
            Some(sun) => outside(&windows, sun.span().map(|year| year - launch)),
            None => windows,
        };
        let ahead = |maximum: &Maximum| maximum.cycles_ahead > 0 && maximum.year + ACTIVE_AFTER_YR > launch;
        let extrapolated = maxima.into_iter().filter(ahead).collect();
        let given_rate = match &mission.imported.sun {
            Some(_) => 0.0,
            None => environment.active_dose_rate_mev_g_yr.unwrap_or(0.0),
        };
        let table = mission.imported.sun.as_ref().unwrap_or(&mission.imported.history);
        let gives = environment.active_dose_rate_mev_g_yr.is_some() || environment.model == DoseModel::History;
        let imported: Vec<(f64, f64)> =
            table.iter().map(|(t_yr, dose)| (*t_yr, environment.dose_factor * dose)).collect();
        let mut history = DoseHistory {
            cycle,
            windows,
            active_share,
            active_rate_mev_g_yr: environment.dose_factor * given_rate,
            floor_mev_g_yr: environment.dose_factor * environment.cosmic_ray_floor_mev_g_yr,
            cyclic: Vec::new(),
            modulations: Vec::new(),
            table: imported.clone(),
            imported,
            steps: Vec::new(),
            rate_laws: Vec::new(),
            dose_laws: Vec::new(),
            origin: if environment.model == DoseModel::History { RateOrigin::History } else { RateOrigin::Given },
            sources: Vec::new(),
            derived: (!gives).then(|| Arc::new(mission.clone())),
            reference_dose_mev_g: mission.reference_dose_mev_g(),
            launch,
            observed_yr: mission.observed_sun().map(|sun| sun.span().map(|year| year - launch)),
            modulation_gv: mission.observed_sun().map_or(Vec::new(), |sun| sun.modulation_gv()),
            extrapolated,
        };
        history.derive();
        history
    }

    /// Applies the active rate in the active years of the solar cycle, and none in the others.
    pub fn follow_solar_cycle(&mut self) {
        if self.averages_the_cycle() {
            self.windows = windows(&self.cycle);
            self.active_share = 1.0;
            // The quantile of a sum depends on the number of active years in it.
            self.derive();
        }
    }

    /// Derives the rates of all sources, unless the mission gives its dose.
    fn derive(&mut self) {
        let Some(mission) = self.derived.clone() else { return };
        let environment = &mission.environment;
        let active_years = self.active_years(mission.mission.duration_yr);
        self.sources = source_doses(&mission, active_years);
        self.active_rate_mev_g_yr = 0.0;
        self.floor_mev_g_yr = environment.dose_factor * environment.cosmic_ray_floor_mev_g_yr;
        self.cyclic.clear();
        let sources = self.sources.clone();
        for dosed in sources.iter().flat_map(|source| &source.streams) {
            let rate = environment.dose_factor * dosed.dose_mev_g_yr;
            match &dosed.stream.when {
                When::ActiveYears => self.active_rate_mev_g_yr += rate,
                When::Always => self.floor_mev_g_yr += rate,
                When::Cycle { cosines, phase, except } => self.add_cyclic(*phase, *except, cosines, rate),
                When::Series(_) | When::Event { .. } => {}
            }
        }
        self.add_observed(environment.dose_factor);
        let quantile_years = match environment.accumulate() {
            Accumulate::Mission if active_years > 0.0 => active_years.max(1.0),
            Accumulate::Mission | Accumulate::Yearly => 1.0,
        };
        self.origin = match environment.model {
            _ if environment.dose_depth.is_some() => RateOrigin::DoseDepth,
            _ if environment.spectra.is_some() => RateOrigin::Spectra,
            DoseModel::Derived => RateOrigin::Sources { active_years: quantile_years },
            DoseModel::Constant | DoseModel::SolarCycle => RateOrigin::Esp { active_years: quantile_years },
            DoseModel::History => unreachable!("a history is not derived"),
        };
    }

    /// Makes the table anew from what is imported and what was observed, times a factor.
    fn add_observed(&mut self, factor: f64) {
        let since_launch = |source: &Arc<SourceDose>| {
            let points = source.observed().iter();
            let (launch, before) = (self.launch, on_line(source.observed(), self.launch));
            let after =
                points.filter(|point| point.0 > launch).map(|(year, dose)| (year - launch, factor * (dose - before)));
            iter::once((0.0, 0.0)).chain(after).collect::<Vec<_>>()
        };
        let observed = self.sources.iter().filter(|source| !source.observed().is_empty()).map(since_launch);
        let mut lines: Vec<Vec<(f64, f64)>> = observed.filter(|line| line.len() > 1).collect();
        if lines.is_empty() {
            self.table.clone_from(&self.imported);
            return;
        }
        lines.push(self.imported.clone());
        self.table = on_common_years(&lines);
    }

    fn add_cyclic(&mut self, phase: Phase, except: [f64; 2], cosines: &[f64], rate: f64) {
        let same = |known: &Cyclic| known.phase == phase && known.except == except;
        let index = self.cyclic.iter().position(same).unwrap_or_else(|| {
            self.cyclic.push(Cyclic { phase, except, cosines: Vec::new() });
            self.cyclic.len() - 1
        });
        let known = &mut self.cyclic[index].cosines;
        known.resize(known.len().max(cosines.len()), 0.0);
        for (sum, cosine) in known.iter_mut().zip(cosines) {
            *sum += rate * cosine;
        }
    }

    /// Dose (MeV/g) of each source between two times (years since launch), before effects.
    pub fn of_source_mev_g(&self, source: &SourceDose, from_yr: f64, to_yr: f64) -> f64 {
        let active = self.active_years(to_yr) - self.active_years(from_yr);
        self.dose_factor() * source.dose_mev_g(self.launch, from_yr, to_yr, active)
    }

    /// Dose (MeV/g) of all cosmic rays up to a time (years since launch), at times that were not observed, before effects.
    pub(crate) fn cosmic_rays_mev_g(&self, until_yr: f64) -> f64 {
        let modulated = self.sources.iter().filter(|source| source.is_modulated());
        let dose = |source: &Arc<SourceDose>| source.unobserved_mev_g(self.launch, 0.0, until_yr, 0.0);
        self.dose_factor() * modulated.map(dose).sum::<f64>()
    }

    /// Rate of cosmic rays at a time (years since launch) over that of a mean cycle: of the month where it was observed, of the phase
    /// of the cycle otherwise.
    pub fn cosmic_ray_rate(&self, t_yr: f64) -> f64 {
        let year = self.launch + t_yr;
        let months = &self.modulation_gv;
        let observed = months.first().zip(months.last()).is_some_and(|(first, last)| first.0 <= year && year <= last.0);
        cosmic_rays::relative_rate(match observed {
            // Values hold for the middle of their month.
            true => on_line(months, year - HALF_MONTH_YR),
            false => cosmic_rays::modulation_gv(Phase { lag_yr: 0.0 }.at(year)),
        })
    }

    /// Dose since launch (MeV/g) of an imported history, before effects.
    pub fn imported_mev_g(&self, t_yr: f64) -> f64 {
        tabulated(&self.imported, t_yr).0
    }

    /// Factor on the whole dose.
    fn dose_factor(&self) -> f64 {
        self.derived.as_ref().map_or(1.0, |mission| mission.environment.dose_factor)
    }

    /// Spectra of a source with their equivalent years up to a time (years since launch): the sum over the terms is its fluence.
    pub fn terms(&self, source: &SourceDose, until_yr: f64) -> Vec<(f64, Spectrum)> {
        source.terms(self.launch, 0.0, until_yr, self.active_years(until_yr))
    }

    /// A linear function of the spectrum of a source, such as the fluence above an energy, up to a time (years since launch).
    pub fn of_spectrum(&self, source: &SourceDose, until_yr: f64, of: impl Fn(&Spectrum) -> f64) -> f64 {
        source.total(self.launch, 0.0, until_yr, self.active_years(until_yr), of)
    }

    /// Protons lost and secondaries added by nuclear reactions in the shield up to a time (years since launch), counted or not.
    pub fn secondaries(&self, until_yr: f64) -> Secondaries {
        let active = self.active_years(until_yr);
        let mut sum = Secondaries::default();
        for source in self.sources.iter() {
            let one = source.secondaries(self.launch, 0.0, until_yr, active);
            sum.lost_mev_g += one.lost_mev_g;
            sum.neutrons_mev_g += one.neutrons_mev_g;
        }
        sum
    }

    /// Extrapolated maxima of the Sun on which the dose up to a time (years since launch) depends.
    pub fn extrapolated(&self, until_yr: f64) -> Vec<Maximum> {
        let begun = |maximum: &&Maximum| maximum.year - ACTIVE_BEFORE_YR < self.launch + until_yr;
        if self.averages_the_cycle() { Vec::new() } else { self.extrapolated.iter().filter(begun).copied().collect() }
    }

    /// Warnings about the dose up to a time (years since launch).
    pub fn warnings(&self, until_yr: f64) -> Vec<Warning> {
        let maxima = self.extrapolated(until_yr);
        let sun = (!maxima.is_empty() && self.follows_active_years()).then_some(Warning::SunExtrapolated { maxima });
        let shield = self.derived.as_ref().and_then(|mission| self.secondaries_warning(mission, until_yr));
        let orbit = self.derived.as_ref().map_or(Vec::new(), |mission| dose_warnings::of(mission));
        let part = self.derived.as_ref().and_then(|mission| self.part_of_an_active_year(mission, until_yr));
        sun.into_iter().chain(part).chain(shield).chain(orbit).collect()
    }

    /// Active years of which the dose of solar protons is the quantile of the sum. None if there are no solar protons, or if each
    /// year has the quantile of a year.
    pub(crate) fn quantile_active_years(&self) -> Option<f64> {
        let mission = self.derived.as_ref().filter(|_| self.follows_active_years())?;
        let of_sum = mission.environment.accumulate() == Accumulate::Mission;
        of_sum.then(|| self.active_years(mission.mission.duration_yr))
    }

    /// A dose of solar protons of less than the year that is the shortest time of their model.
    fn part_of_an_active_year(&self, mission: &Mission, until_yr: f64) -> Option<Warning> {
        let active_years = self.quantile_active_years().filter(|_| self.active_years(until_yr) > 0.0)?;
        let confidence = mission.environment.confidence;
        (active_years < 1.0).then_some(Warning::PartOfAnActiveYear { active_years, confidence })
    }

    /// Whether a mission sets a phase of the solar cycle although none of its sources is derived.
    pub(crate) fn idle_phase(&self, mission: &Mission) -> Option<Warning> {
        (mission.environment.solar_phase.is_some() && self.sources.is_empty()).then_some(Warning::IdlePhase)
    }

    /// Whether part of the dose comes only in active years.
    fn follows_active_years(&self) -> bool {
        self.active_rate_mev_g_yr > 0.0
    }

    fn secondaries_warning(&self, mission: &Mission, until_yr: f64) -> Option<Warning> {
        let sum = self.secondaries(until_yr);
        let slowed: f64 = self.sources.iter().map(|source| self.of_source_mev_g(source, 0.0, until_yr)).sum::<f64>()
            / mission.environment.dose_factor.max(f64::MIN_POSITIVE);
        let counted =
            mission.shielding.as_ref().is_some_and(|shield| shield.secondaries == SecondariesCounted::Estimated);
        let slowed = if counted { slowed + sum.lost_mev_g - sum.neutrons_mev_g } else { slowed };
        let (lost, neutrons) = (sum.lost_mev_g / slowed, sum.neutrons_mev_g / slowed);
        let matters = lost.max(neutrons) > secondaries::MATTERS && slowed > 0.0;
        matters.then_some(Warning::Secondaries { lost, neutrons, counted })
    }

    /// Dose since launch, MeV/g, at a time in years since launch.
    ///
    /// # Errors
    /// If a law has no value, here and below.
    pub(crate) fn dose_mev_g(&self, t_yr: f64) -> Result<f64, InputError> {
        self.dose_with_steps(t_yr, |step_yr| step_yr <= t_yr)
    }

    fn dose_with_steps(&self, t_yr: f64, counts: impl Fn(f64) -> bool) -> Result<f64, InputError> {
        let streamed = match &self.modulations[..] {
            [] if self.rate_laws.is_empty() => {
                self.active_rate_mev_g_yr * self.active_years(t_yr)
                    + self.floor_mev_g_yr * t_yr
                    + self.cyclic_mev_g(t_yr)
                    + tabulated(&self.table, t_yr).0
            }
            [modulation] if self.rate_laws.is_empty() && self.cyclic.is_empty() => {
                self.modulated_mev_g(modulation, t_yr)
            }
            _ => self.integral(t_yr, 0.0, |_| 1.0)?,
        };
        let steps = self.steps.iter().filter(|(step_yr, _)| counts(*step_yr));
        let dose = steps.fold(streamed, |dose, (_, step)| dose + step);
        self.dose_laws.iter().try_fold(dose, |dose, Law(law)| law(t_yr, dose))
    }

    /// Dose (MeV/g) from rates that follow the phase of the solar cycle.
    fn cyclic_mev_g(&self, t_yr: f64) -> f64 {
        let of = |cyclic: &Cyclic| cyclic.when().years(self.launch, self.launch + t_yr, 0.0);
        self.cyclic.iter().map(of).sum()
    }

    /// Dose (MeV/g) from piecewise constant rates, times a modulation.
    fn modulated_mev_g(&self, modulation: &Modulation, t_yr: f64) -> f64 {
        let mean = |from: f64, to: f64| modulation.integral_yr(self.launch, from, to);
        let windows = self.windows.iter().take_while(|(start, _)| *start < t_yr);
        let active: f64 = windows.map(|(start, end)| mean(*start, end.min(t_yr))).sum();
        let segments = self.table.windows(2).take_while(|pair| pair[0].0 < t_yr);
        let tabulated: f64 = segments
            .map(|pair| {
                let ((from, low), (to, high)) = (pair[0], pair[1]);
                (high - low) / (to - from) * mean(from, to.min(t_yr))
            })
            .sum();
        let always = if self.floor_mev_g_yr > 0.0 { self.floor_mev_g_yr * mean(0.0, t_yr) } else { 0.0 };
        self.active_rate_mev_g_yr * self.active_share * active + always + tabulated
    }

    /// Dose rate, MeV/g/yr, at a time in years since launch, without instantaneous doses.
    fn rate_mev_g_yr(&self, t_yr: f64) -> Result<f64, InputError> {
        let after = self.windows.partition_point(|(start, _)| *start <= t_yr);
        let active = after > 0 && t_yr < self.windows[after - 1].1;
        let active_rate = if active { self.active_share * self.active_rate_mev_g_yr } else { 0.0 };
        let cyclic: f64 = self.cyclic.iter().map(|cyclic| cyclic.rate_mev_g_yr(self.launch + t_yr)).sum();
        let rate = active_rate + self.floor_mev_g_yr + cyclic + tabulated(&self.table, t_yr).1;
        let factors = self.modulations.iter().map(|modulation| modulation.factor(self.launch + t_yr));
        let rate = rate * factors.product::<f64>();
        self.rate_laws.iter().try_fold(rate, |rate, Law(law)| law(t_yr, rate))
    }

    /// ∫ w(made) dD(made) over the dose (MeV/g) up to `t_yr`, weighted with a function of the time of the dose.
    ///
    /// The weight may jump at `breaks_yr`. In between it may vary as fast as a scale-free function of the age, t − made.
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
            // Only the dose itself is known: pieces are short enough for a constant weight.
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

    /// ∫ w(s) rate(s) ds between two times (years since launch), in steps towards the later one. Each step ends as far from it as
    /// the step is long, so that no age is missed.
    fn integral(&self, until_yr: f64, from_yr: f64, weight: impl Fn(f64) -> f64) -> Result<f64, InputError> {
        let mut ends = self.changes_yr(until_yr);
        ends.retain(|at| *at > from_yr);
        ends.push(until_yr);
        let longest_yr = self.modulations.iter().fold(LONGEST_STEP_YR, |step, wave| step.min(0.25 * wave.period_yr));
        let piece = |start: f64, stop: f64| -> Result<f64, InputError> {
            let (middle, half) = (0.5 * (start + stop), 0.5 * (stop - start));
            RULE.iter().try_fold(0.0, |sum, (node, share)| {
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
                let step = if age > 1e-10 { (0.5 * age).min(end - start).min(longest_yr) } else { end - start };
                // So that the end is reached exactly.
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
        let steps = self.steps.iter().chain(&self.table).map(|(at, _)| *at);
        let ends = self.cyclic.iter().flat_map(|cyclic| cyclic.except).map(|year| year - self.launch);
        let mut changes: Vec<f64> = windows.chain(steps).chain(ends).collect();
        changes.retain(|t| *t > 0.0 && *t < t_yr);
        changes.sort_by(f64::total_cmp);
        changes
    }

    /// Times (years since launch) up to `t_yr` at which the dose rate changes so much that straight lines between them have the
    /// dose, to a share of that up to `t_yr`, in order: of hundreds of months and small events few matter.
    pub fn bends_yr(&self, t_yr: f64) -> Vec<f64> {
        if self.sources.iter().all(|source| source.observed().is_empty()) {
            return self.changes_yr(t_yr);
        }
        let windows = self.windows.iter().flat_map(|(start, end)| [*start, *end]);
        let ends = self.cyclic.iter().flat_map(|cyclic| cyclic.except).map(|year| year - self.launch);
        let mut bends: Vec<f64> = windows.chain(ends).chain(self.steps.iter().map(|(at, _)| *at)).collect();
        let within: Vec<(f64, f64)> = self.table.iter().copied().filter(|point| point.0 <= t_yr).collect();
        let greatest = within.last().map_or(0.0, |point| point.1);
        bends.extend(corners(&within, BENT * greatest).into_iter().map(|point| point.0));
        bends.retain(|t| *t > 0.0 && *t < t_yr);
        bends.sort_by(f64::total_cmp);
        bends
    }

    /// Times (years since launch) up to `t_yr` between which the modulation of the dose rate is smooth: eighths of the shortest
    /// period, up to a useful number.
    pub fn turns_yr(&self, t_yr: f64) -> Vec<f64> {
        let Some(shortest_yr) = self.modulations.iter().map(|wave| wave.period_yr).min_by(f64::total_cmp) else {
            return Vec::new();
        };
        let count = (8.0 * t_yr / shortest_yr).ceil().min(MOST_TURNS);
        (1..count as u32).map(|turn| t_yr * f64::from(turn) / count).collect()
    }

    /// Whether the dose comes at the mean rate of a solar cycle, 7/11 of that of an active year, in every year.
    pub fn averages_the_cycle(&self) -> bool {
        self.active_share != 1.0
    }

    /// Start and end (years since launch) of the time in which the Sun is taken as it was; None if it is drawn at all times.
    pub fn observed_yr(&self) -> Option<[f64; 2]> {
        self.observed_yr
    }

    /// Years between two times (years since launch) in which the Sun is taken as it was.
    pub fn observed_years(&self, from_yr: f64, to_yr: f64) -> f64 {
        self.observed_yr.map_or(0.0, |[start, end]| (to_yr.min(end) - from_yr.max(start)).max(0.0))
    }

    /// Active years of the Sun, in years since launch, whether the dose follows them or not.
    pub fn active_stretches(&self) -> &[ActiveYears] {
        &self.cycle
    }

    /// Active years among the first `t_yr` since launch; 7/11 of them with a constant dose rate.
    pub fn active_years(&self, t_yr: f64) -> f64 {
        // What rounding leaves of an active year that begins as a mission ends (30 ms) would get the fluence of a whole one.
        Some(self.active_share * years_within(&self.windows, t_yr)).filter(|years| *years > 1e-9).unwrap_or(0.0)
    }
}

/// Longest step of an integral over time, yr: a law of the dose rate may have a yearly period.
const LONGEST_STEP_YR: f64 = 0.5;

/// Half of a month, yr.
const HALF_MONTH_YR: f64 = 1.0 / 24.0;

/// Maximum number of times at which a modulated dose rate is evaluated.
const MOST_TURNS: f64 = 240.0;

/// Nodes and weights of a step.
static RULE: LazyLock<GaussLegendre> =
    LazyLock::new(|| GaussLegendre::new(std::num::NonZeroUsize::new(12).expect("above 0")));

/// Number of intervals between two breaks if only the dose itself is known.
const PIECES: usize = 2000;

/// Years after launch up to which the Sun is followed: beyond any time that can be requested.
const REACH_YR: f64 = 1100.0;

/// Share of the dose that straight lines between [`DoseHistory::bends_yr`] may miss: a date shifts by less than two days in ten years.
const BENT: f64 = 5e-4;

/// Points of a line between which straight lines miss no other point by more than a tolerance (Douglas & Peucker 1973).
fn corners(line: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let [first, inside @ .., last] = line else { return line.to_vec() };
    let slope = (last.1 - first.1) / (last.0 - first.0);
    let miss = |point: &(f64, f64)| (point.1 - first.1 - slope * (point.0 - first.0)).abs();
    let worst = (0..inside.len()).max_by(|a, b| miss(&inside[*a]).total_cmp(&miss(&inside[*b])));
    match worst.filter(|worst| miss(&inside[*worst]) > tolerance) {
        None => vec![*first, *last],
        Some(worst) => {
            let mut left = corners(&line[..=worst + 1], tolerance);
            left.pop();
            left.extend(corners(&line[worst + 1..], tolerance));
            left
        }
    }
}

/// Parts of intervals (in order) outside another.
fn outside(windows: &[(f64, f64)], [from, to]: [f64; 2]) -> Vec<(f64, f64)> {
    let parts = windows.iter().flat_map(|(start, end)| [(*start, end.min(from)), (start.max(to), *end)]);
    parts.filter(|(start, end)| start < end).collect()
}

fn windows(cycle: &[ActiveYears]) -> Vec<(f64, f64)> {
    cycle.iter().map(|stretch| (stretch.from, stretch.to)).collect()
}

/// Total time of the intervals (in order) between 0 and `t_yr`.
fn years_within(windows: &[(f64, f64)], t_yr: f64) -> f64 {
    let begun = windows.iter().take_while(|(start, _)| *start < t_yr);
    // Starting from 0: an empty sum would be −0.
    begun.fold(0.0, |sum, (start, end)| sum + (end.min(t_yr) - start.max(0.0)).max(0.0))
}

/// Dose (MeV/g) and dose rate (MeV/g/yr) of a table at a time, by linear interpolation; constant dose after its end.
fn tabulated(table: &[(f64, f64)], t_yr: f64) -> (f64, f64) {
    let after = table.partition_point(|(at, _)| *at <= t_yr);
    match (after.checked_sub(1).map(|before| table[before]), table.get(after)) {
        (None, _) => (0.0, 0.0),
        (Some((_, dose)), None) => (dose, 0.0),
        (Some((from, low)), Some((to, high))) => {
            let rate = (high - low) / (to - from);
            (low + rate * (t_yr - from), rate)
        }
    }
}
