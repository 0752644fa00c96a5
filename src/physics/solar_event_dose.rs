//! Solar events, orbit, shield and NIEL of a mission → the dose of each event.
//!
//! The dose d(z) of an event behind cutoff and shield, and ESP's dose D(T, p) of T active years at a confidence p, are tabulated
//! once; a sample of the Sun is then a sum. Event i in the active years of a sample gives
//!
//! ```text
//! D(T, p) · d(z_i)/Σ d(z)
//! ```
//!
//! The sum over a mission is exactly the dose of ESP's spectrum at the sample's confidence. Within a mission, events share it in
//! proportion to their own doses. ESP scales each energy separately, which would change these shares if events of different
//! hardness occur. Events of quiet years keep their own dose.

use std::ops::RangeInclusive;

use statrs::distribution::{ContinuousCDF, Normal};

use crate::environment::Niel;
use crate::environment::esp;
use crate::environment::shielding::Shield;
use crate::environment::solar_cycle::{self, ACTIVE_YR};
use crate::environment::solar_events::{Activity, SolarEvents, Sun};
use crate::environment::source::{Arrival, Source, Stream, When, source};
use crate::environment::spectrum::Spectrum;
use crate::error::InputError;
use crate::mission::{DoseModel, Mission, SecondariesCounted};
use crate::numeric::calendar::decimal_year;
use crate::numeric::parallel;
use crate::physics::DoseHistory;
use crate::physics::source_dose::{StreamDose, dosed, sources};

/// Name of the source whose events are drawn.
pub const SOLAR_PROTONS: &str = "solar-protons";

/// Samples of the Sun over a mission, with the dose of each event behind its shield.
#[derive(Clone, Debug)]
pub struct SolarEventDoses {
    /// The samples, of the time after the Sun was observed.
    pub events: SolarEvents,
    /// When that time begins, years since launch: 0 if the Sun is drawn at all times.
    pub drawn_from_yr: f64,
    /// Events before it.
    observed: Vec<ObservedDose>,
    /// ln d of an event, against its size z.
    active: Curve,
    quiet: Curve,
    totals: Totals,
    /// Active years of the mission with the expected maxima.
    active_years: f64,
    /// The mission's factor on all doses.
    factor: f64,
}

impl SolarEventDoses {
    /// `samples` samples of a mission with a known dose history.
    ///
    /// # Errors
    /// If its dose is not derived from solar protons.
    pub fn of(
        mission: &Mission,
        history: &DoseHistory,
        samples: u32,
        seed: u64,
    ) -> Result<SolarEventDoses, InputError> {
        let behind = Behind::of(mission)?;
        let active_years = history.active_years(mission.mission.duration_yr);
        let duration_yr = mission.mission.duration_yr;
        let launch = decimal_year(mission.mission.launch.0);
        let observed_to = mission.observed_sun().map_or(launch, |sun| sun.span()[1]);
        let drawn_from_yr = (observed_to - launch).clamp(0.0, duration_yr);
        let sun = sun(mission, history, active_years, drawn_from_yr);
        let events = SolarEvents::new(sun, duration_yr - drawn_from_yr, samples, seed);
        let event = |activity: Activity| Curve::of(SIZES, SIZE_NODES, |z| behind.log_dose(activity.event(z)));
        let (least, most) = events.active_years().unwrap_or((1.0, 1.0));
        // With the expected number among them.
        let expected = active_years.max(1.0);
        Ok(SolarEventDoses {
            active: event(Activity::Active),
            quiet: event(Activity::Quiet),
            totals: Totals::of(&behind, least.min(expected)..=most.max(expected)),
            events,
            drawn_from_yr,
            observed: observed(&behind, history, launch),
            active_years,
            factor: mission.environment.dose_factor,
        })
    }

    /// Instantaneous doses (MeV/g) in a sample, each with its time in years since launch: first those of active years, then those
    /// of quiet ones, then observed ones, with the calibration errors of the sample.
    ///
    /// # Panics
    /// If there are not that many samples.
    pub fn steps(&self, index: usize) -> Vec<(f64, f64)> {
        let sample = self.events.sample(index);
        let own = |activity: Activity, z: f64| match activity {
            Activity::Active => self.active.at(z).exp(),
            Activity::Quiet => self.quiet.at(z).exp(),
        };
        let since_launch = |t_yr: f64| self.drawn_from_yr + t_yr;
        let mut steps: Vec<(f64, f64)> =
            sample.events.iter().map(|event| (since_launch(event.t_yr), own(event.activity, event.z))).collect();
        let active = sample.events.iter().take_while(|event| event.activity == Activity::Active).count();
        let sum: f64 = steps[..active].iter().map(|(_, dose)| dose).sum();
        let total = self.totals.at(sample.active_years, normal_quantile(sample.confidence));
        steps[..active].iter_mut().for_each(|(_, dose)| *dose *= total / sum);
        steps.extend(self.observed.iter().map(|event| (event.t_yr, event.dose_mev_g(&self.events, index))));
        steps.iter_mut().for_each(|(_, dose)| *dose *= self.factor);
        steps
    }

    /// ESP's dose (MeV/g) of the mission's active years, with the expected maxima, at a confidence; and that of observed events.
    pub fn esp_mev_g(&self, confidence: f64) -> f64 {
        let observed: f64 = self.observed.iter().map(|event| event.mean_mev_g).sum();
        let drawn = match self.active_years {
            years if years > 0.0 => self.totals.at(years.max(1.0), normal_quantile(confidence)),
            _ => 0.0,
        };
        self.factor * (observed + drawn)
    }
}

/// Observed dose (MeV/g) of solar protons of a mission with this history up to a time (years since launch), and its error (1 sigma)
/// from calibration: that of a satellite is common to its events. Zero if its Sun is drawn at all times, or solar protons are not
/// among its sources.
pub(crate) fn observed_mev_g(mission: &Mission, history: &DoseHistory, until_yr: f64) -> (f64, f64) {
    let Ok(behind) = Behind::of(mission) else { return (0.0, 0.0) };
    let (mut sum, mut errors) = (0.0, Vec::<f64>::new());
    let events = observed(&behind, history, decimal_year(mission.mission.launch.0));
    for event in events.iter().filter(|event| event.t_yr <= until_yr) {
        sum += event.mean_mev_g;
        errors.resize(errors.len().max(event.satellite + 1), 0.0);
        errors[event.satellite] += event.mean_mev_g * event.sensitivity;
    }
    let error = errors.iter().map(|error| error * error).sum::<f64>().sqrt();
    let factor = mission.environment.dose_factor;
    (factor * sum, factor * error)
}

/// The dose of an observed event.
#[derive(Clone, Debug)]
struct ObservedDose {
    /// Its start, years since launch.
    t_yr: f64,
    /// Its dose as calibrated, MeV/g.
    mean_mev_g: f64,
    /// Change of ln dose if the calibration of its satellite is off by one standard deviation.
    sensitivity: f64,
    /// Index of the satellite.
    satellite: usize,
}

impl ObservedDose {
    /// Its dose in a sample, MeV/g.
    fn dose_mev_g(&self, samples: &SolarEvents, index: usize) -> f64 {
        let deviation = if self.sensitivity == 0.0 { 0.0 } else { samples.calibration(index, self.satellite) };
        self.mean_mev_g * (deviation * self.sensitivity).exp()
    }
}

/// Observed doses of solar protons in a history; empty if the Sun is drawn at all times.
fn observed(behind: &Behind, history: &DoseHistory, launch: f64) -> Vec<ObservedDose> {
    let streams =
        history.sources.iter().filter(|source| source.name == SOLAR_PROTONS).flat_map(|source| &source.streams);
    let streams: Vec<_> = streams.filter(|dosed| dosed.stream.when.is_observed()).collect();
    let mut satellites: Vec<&str> = Vec::new();
    for dosed in &streams {
        if let When::Event { event, .. } = &dosed.stream.when
            && !satellites.contains(&event.satellite.as_str())
        {
            satellites.push(&event.satellite);
        }
    }
    let of = |dosed: &&StreamDose| {
        let when = &dosed.stream.when;
        let mean_mev_g = dosed.dose_mev_g_yr * when.years(launch, f64::INFINITY, 0.0);
        let start = when.points().first().map_or(launch, |point| point.0);
        let (sensitivity, satellite) = match when {
            When::Event { event, .. } => {
                let log = |deviation: f64| behind.log_dose(event.spectrum(deviation));
                let place = satellites.iter().position(|known| *known == event.satellite);
                (0.5 * (log(1.0) - log(-1.0)), place.unwrap_or(0))
            }
            _ => (0.0, 0),
        };
        ObservedDose { t_yr: (start - launch).max(0.0), mean_mev_g, sensitivity, satellite }
    };
    let mut observed = parallel::map(&streams, of);
    // Those that ended before the launch have none.
    observed.retain(|event| event.mean_mev_g > 0.0);
    observed
}

/// The Sun over a mission, from a time (years since launch) on.
fn sun(mission: &Mission, history: &DoseHistory, active_yr: f64, from_yr: f64) -> Sun {
    let environment = &mission.environment;
    if environment.active_years.is_some() || history.averages_the_cycle() {
        return Sun::Mean { active_yr };
    }
    let launch = decimal_year(mission.mission.launch.0);
    // Those whose active years may begin before the end.
    let maxima = solar_cycle::maxima(&environment.solar_maximum, launch + mission.mission.duration_yr + ACTIVE_YR);
    Sun::Cycle { maxima, launch: launch + from_yr }
}

fn normal_quantile(probability: f64) -> f64 {
    Normal::standard().inverse_cdf(probability)
}

/// Conversion of an interplanetary spectrum to a dose.
struct Behind {
    shield: Shield,
    secondaries: SecondariesCounted,
    niel: Niel,
    arrival: Arrival,
    source: &'static dyn Source,
}

impl Behind {
    fn of(mission: &Mission) -> Result<Behind, InputError> {
        let refuse = |problem: &str, help: &str| {
            let refused = format!("cannot draw the Sun of mission \"{}\"", mission.mission.name);
            Err(InputError::new(refused, problem).with_help(help))
        };
        let environment = &mission.environment;
        if environment.active_dose_rate_mev_g_yr.is_some() {
            return refuse(
                "environment.active_dose_rate_mev_g_yr gives its dose: events are drawn where the dose is derived",
                "remove active_dose_rate_mev_g_yr and give a [shielding] table, or leave out --samples",
            );
        }
        let imported = environment.spectra.is_some() || environment.dose_depth.is_some();
        if environment.model == DoseModel::History || imported {
            return refuse(
                "its dose is imported, which says nothing of single events",
                "remove history, spectra and dose_depth from [environment], or leave out --samples",
            );
        }
        let (Some(place), Some(shield), Some(shielding)) = (mission.place(), mission.shield(), &mission.shielding)
        else {
            return refuse(
                "it has no shield or no orbit to derive a dose from",
                "give [shielding] and [orbit], or leave out --samples",
            );
        };
        let counted = sources(environment, &place).into_iter().any(|source| source.card().name == SOLAR_PROTONS);
        let Some(source) = source(SOLAR_PROTONS).filter(|_| counted) else {
            return refuse(
                "environment.sources has no \"solar-protons\", whose events are drawn",
                "add \"solar-protons\" to environment.sources, or leave out --samples",
            );
        };
        let middle = decimal_year(mission.mission.launch.0) + 0.5 * mission.mission.duration_yr;
        Ok(Behind {
            shield,
            secondaries: shielding.secondaries,
            niel: environment.niel,
            arrival: Arrival::at(&place, middle),
            source,
        })
    }

    /// ln of the dose (MeV/g) of an interplanetary spectrum.
    fn log_dose(&self, outside: Spectrum) -> f64 {
        let stream = Stream { yearly: self.arrival.of(outside), when: When::ActiveYears };
        let dosed = dosed(stream, self.source.neutrons(), &self.shield, self.niel, self.secondaries);
        dosed.dose_mev_g_yr.max(f64::MIN_POSITIVE).ln()
    }
}

/// Range of sizes z for which events are tabulated, and of quantiles z of totals.
const SIZES: RangeInclusive<f64> = -5.0..=5.0;

/// Nodes of a table against z: the logarithm of a dose has little curvature.
const SIZE_NODES: usize = 21;

/// Nodes of a table against the logarithm of active years.
const YEAR_NODES: usize = 5;

/// ln of ESP's dose against active years and the quantile z.
#[derive(Clone, Debug)]
struct Totals {
    /// Logarithms of active years, each with its curve; only one if they are the same in all samples.
    curves: Vec<Curve>,
    log_years: RangeInclusive<f64>,
}

impl Totals {
    fn of(behind: &Behind, years: RangeInclusive<f64>) -> Totals {
        let log_years = years.start().ln()..=years.end().ln();
        let nodes = if log_years.end() - log_years.start() < 1e-9 { 1 } else { YEAR_NODES };
        let curve = |node: usize| {
            let years = place(&log_years, nodes, node).exp();
            Curve::of(SIZES, SIZE_NODES, |z| behind.log_dose(esp::fluence_at(z, years)))
        };
        Totals { curves: parallel::map(0..nodes, curve), log_years }
    }

    /// Dose (MeV/g) of at least 1 active year, at a quantile z.
    fn at(&self, years: f64, z: f64) -> f64 {
        let values: Vec<f64> = self.curves.iter().map(|curve| curve.at(z)).collect();
        match &values[..] {
            [only] => only.exp(),
            values => cubic(values, &self.log_years, years.ln()).exp(),
        }
    }
}

/// A smooth function between evenly spaced nodes.
#[derive(Clone, Debug)]
struct Curve {
    range: RangeInclusive<f64>,
    values: Vec<f64>,
}

impl Curve {
    fn of(range: RangeInclusive<f64>, nodes: usize, value: impl Fn(f64) -> f64 + Sync) -> Curve {
        let values = parallel::map(0..nodes, |node| value(place(&range, nodes, node)));
        Curve { range, values }
    }

    fn at(&self, x: f64) -> f64 {
        cubic(&self.values, &self.range, x)
    }
}

/// The position of a node in a range of evenly spaced nodes.
fn place(range: &RangeInclusive<f64>, nodes: usize, node: usize) -> f64 {
    let step = (range.end() - range.start()) / (nodes.max(2) - 1) as f64;
    range.start() + step * node as f64
}

/// Cubic interpolation in the four nearest of at least four evenly spaced values.
fn cubic(values: &[f64], range: &RangeInclusive<f64>, x: f64) -> f64 {
    let place = (x - range.start()) / (range.end() - range.start()) * (values.len() - 1) as f64;
    let first = (place.floor() - 1.0).clamp(0.0, (values.len() - 4) as f64);
    let at = place - first;
    let [a, b, c, d] = [0, 1, 2, 3].map(|node| values[first as usize + node]);
    let [u, v, w, t] = [at, at - 1.0, at - 2.0, at - 3.0];
    -a * v * w * t / 6.0 + b * u * w * t / 2.0 - c * u * v * t / 2.0 + d * u * v * w / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_met() {
        let cubic = |x: f64| 0.3 * x.powi(3) - x * x + 2.0 * x - 5.0;
        let curve = Curve::of(-2.0..=4.0, 7, cubic);
        for x in [-2.5, -2.0, -1.3, 0.0, 2.2, 4.0, 4.5] {
            assert!((curve.at(x) - cubic(x)).abs() < 1e-9, "{x}");
        }
    }

    /// At nodes of the tables, and between them.
    #[test]
    fn tables_are_as_good_as_what_they_hold() {
        let mission = Mission::parse(include_str!("../../missions/snap_l2_shielded.toml")).unwrap();
        let behind = Behind::of(&mission).unwrap();
        let totals = Totals::of(&behind, 1.0..=7.0);
        for (years, z) in [(1.0, 0.0), (1.2, 1.6449), (3.3, -1.3), (6.5, 3.09)] {
            let direct = behind.log_dose(esp::fluence_at(z, years));
            assert!(
                (totals.at(years, z).ln() - direct).abs() < 1e-4,
                "{years} {z}: {} {direct}",
                totals.at(years, z).ln()
            );
        }
        let events = Curve::of(SIZES, SIZE_NODES, |z| behind.log_dose(Activity::Active.event(z)));
        for z in [-3.77, -0.26, 0.6, 1.9, 4.2] {
            let direct = behind.log_dose(Activity::Active.event(z));
            assert!((events.at(z) - direct).abs() < 1e-4, "{z}: {} {direct}", events.at(z));
        }
    }
}
