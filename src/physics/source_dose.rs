//! Orbit, Sun, shield and NIEL of a mission → dose rate of each of its sources.

use std::sync::Arc;

use ctiplan_magnetosphere::Activity;

use crate::environment::secondaries::Secondaries;
use crate::environment::shielding::Shield;
use crate::environment::source::{self, Card, Place, SOURCES, Setting, Source, Stream, When};
use crate::environment::spectrum::{self, Law, Spectrum};
use crate::environment::{Niel, SECONDS_PER_YEAR};
use crate::mission::{Accumulate, DoseModel, Environment, ImportedSpectrum, Mission, SecondariesCounted, SolarPhase};
use crate::numeric::calendar::decimal_year;
use crate::numeric::parallel;
use crate::numeric::recent::Recent;
use crate::physics::DoseHistory;

/// A source of protons, and its dose.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceDose {
    /// Name: that of its card, or the imported file.
    pub name: String,
    /// Its card; None for an imported source.
    pub card: Option<&'static Card>,
    /// Its spectra, each with its law of time and its dose behind the shield.
    pub streams: Vec<StreamDose>,
    /// Dose (MeV/g) since the first point, against years: the sum of the streams that were observed.
    observed: Vec<(f64, f64)>,
}

/// A stream of a source behind the shield.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamDose {
    /// Spectrum and law of time.
    pub stream: Stream,
    /// Dose of one year of it, MeV/g, as counted by the mission.
    pub dose_mev_g_yr: f64,
    /// Protons lost and secondaries added by nuclear reactions in one year of it, counted or not.
    pub secondaries: Secondaries,
}

impl SourceDose {
    /// Whether it depends on the modulation of cosmic rays.
    pub(crate) fn is_modulated(&self) -> bool {
        self.card.is_some() && source::source(&self.name).is_some_and(|source| source.is_modulated())
    }

    /// A source of these streams.
    fn new(name: String, card: Option<&'static Card>, streams: Vec<StreamDose>) -> SourceDose {
        let of_stream = |dosed: &StreamDose| {
            let points = dosed.stream.when.points();
            points.into_iter().map(|(year, years)| (year, years * dosed.dose_mev_g_yr)).collect::<Vec<_>>()
        };
        let observed = on_common_years(&streams.iter().map(of_stream).collect::<Vec<_>>());
        SourceDose { name, card, streams, observed }
    }

    /// Dose (MeV/g) since the first point, against years: the sum of the streams that were observed.
    pub(crate) fn observed(&self) -> &[(f64, f64)] {
        &self.observed
    }

    /// The same with the protons multiplied by a factor at all times that were not observed.
    fn times(&self, factor: f64) -> SourceDose {
        let stream = |dosed: &StreamDose| {
            if dosed.stream.when.is_observed() {
                dosed.clone()
            } else {
                StreamDose {
                    stream: Stream { yearly: dosed.stream.yearly.times(factor), when: dosed.stream.when.clone() },
                    dose_mev_g_yr: factor * dosed.dose_mev_g_yr,
                    secondaries: Secondaries {
                        lost_mev_g: factor * dosed.secondaries.lost_mev_g,
                        neutrons_mev_g: factor * dosed.secondaries.neutrons_mev_g,
                    },
                }
            }
        };
        SourceDose { streams: self.streams.iter().map(stream).collect(), ..self.clone() }
    }

    /// Equivalent years of each stream between two times (years since launch), of which `active` are active years of the Sun.
    fn weights(&self, launch: f64, from_yr: f64, to_yr: f64, active: f64) -> impl Iterator<Item = (&StreamDose, f64)> {
        let years = move |dosed: &StreamDose| dosed.stream.when.years(launch + from_yr, launch + to_yr, active);
        self.streams.iter().map(move |dosed| (dosed, years(dosed)))
    }

    /// Dose (MeV/g) between two times.
    pub fn dose_mev_g(&self, launch: f64, from_yr: f64, to_yr: f64, active: f64) -> f64 {
        // Starting from 0: an empty sum would be −0.
        self.weights(launch, from_yr, to_yr, active).fold(0.0, |sum, (dosed, years)| sum + years * dosed.dose_mev_g_yr)
    }

    /// Protons lost and secondaries added by nuclear reactions between two times.
    pub fn secondaries(&self, launch: f64, from_yr: f64, to_yr: f64, active: f64) -> Secondaries {
        let mut sum = Secondaries::default();
        for (dosed, years) in self.weights(launch, from_yr, to_yr, active) {
            sum.lost_mev_g += years * dosed.secondaries.lost_mev_g;
            sum.neutrons_mev_g += years * dosed.secondaries.neutrons_mev_g;
        }
        sum
    }

    /// A linear function of the spectrum, such as the fluence above an energy, summed between two times.
    pub fn total(&self, launch: f64, from_yr: f64, to_yr: f64, active: f64, of: impl Fn(&Spectrum) -> f64) -> f64 {
        let terms = self.terms(launch, from_yr, to_yr, active);
        terms.iter().fold(0.0, |sum, (years, spectrum)| sum + years * of(spectrum))
    }

    /// Spectra with their equivalent years between two times. What was observed, often hundreds of events, is one of them.
    pub(crate) fn terms(&self, launch: f64, from_yr: f64, to_yr: f64, active: f64) -> Vec<(f64, Spectrum)> {
        let weights = self.weights(launch, from_yr, to_yr, active);
        let (observed, laws): (Vec<_>, Vec<_>) = weights.partition(|(dosed, _)| dosed.stream.when.is_observed());
        let flown: Vec<(f64, &Spectrum)> = (observed.iter().filter(|(_, years)| *years != 0.0))
            .map(|(dosed, years)| (*years, &dosed.stream.yearly))
            .collect();
        let flown = (!flown.is_empty()).then(|| (1.0, spectrum::sum(&flown)));
        laws.into_iter().map(|(dosed, years)| (years, dosed.stream.yearly.clone())).chain(flown).collect()
    }

    /// Dose (MeV/g) between two times from its laws of all times, for times that were not observed.
    pub(crate) fn unobserved_mev_g(&self, launch: f64, from_yr: f64, to_yr: f64, active: f64) -> f64 {
        let weights = self.weights(launch, from_yr, to_yr, active);
        let laws = weights.filter(|(dosed, _)| !dosed.stream.when.is_observed());
        laws.fold(0.0, |sum, (dosed, years)| sum + years * dosed.dose_mev_g_yr)
    }
}

/// Inputs on which the dose of a source depends.
#[derive(Clone, Debug, PartialEq)]
struct Inputs {
    source: &'static str,
    setting: Setting,
    shield: Shield,
    niel: Niel,
    secondaries: SecondariesCounted,
    phase: Option<SolarPhase>,
}

/// Sources of a mission with this number of active years, and their doses behind its shield; empty if it gives its dose.
pub(crate) fn source_doses(mission: &Mission, active_years: f64) -> Vec<Arc<SourceDose>> {
    let environment = &mission.environment;
    let (Some(shield), Some(shielding)) = (mission.shield(), &mission.shielding) else { return Vec::new() };
    if environment.active_dose_rate_mev_g_yr.is_some() || environment.model == DoseModel::History {
        return Vec::new();
    }
    if !mission.imported.dose_depth.is_empty() {
        return vec![Arc::new(of_depth(mission, &shield))];
    }
    if !mission.imported.spectra.is_empty() {
        return of_spectra(mission, &shield, shielding.secondaries);
    }
    let Some(place) = mission.place() else { return Vec::new() };
    let setting = setting(mission, place, active_years);
    let inputs = |source: &dyn Source| Inputs {
        source: source.card().name,
        setting: if source.depends_on_events() { setting.clone() } else { setting.without_events() },
        shield: shield.clone(),
        niel: environment.niel,
        secondaries: shielding.secondaries,
        phase: environment.solar_phase,
    };
    // A drawn Sun replaces the quantile of its fluence.
    let counted = |source: &&dyn Source| mission.imported.sun.is_none() || !source.depends_on_events();
    let of = |source: &'static dyn Source| {
        let dose = known(source, inputs(source));
        match mission.imported.cosmic_rays.filter(|_| source.is_modulated()) {
            Some(level) => Arc::new(dose.times(level)),
            None => dose,
        }
    };
    sources(environment, &place).into_iter().filter(counted).map(of).collect()
}

/// Inputs of the sources of a mission with this number of active years, with cosmic rays of a mean cycle.
fn setting(mission: &Mission, place: Place, active_years: f64) -> Setting {
    Setting {
        place,
        middle: decimal_year(mission.mission.launch.0) + 0.5 * mission.mission.duration_yr,
        confidence: mission.environment.confidence,
        active_years: match mission.environment.accumulate() {
            Accumulate::Mission if active_years > 0.0 => active_years,
            _ => 1.0,
        },
        modulation: 1.0,
        nuclei_over_protons: mission.environment.nuclei_over_protons,
        observed: mission.observed_sun(),
        orbits: mission.orbits(),
    }
}

/// The sum of straight lines between points, each constant beyond its ends.
pub(crate) fn on_common_years(lines: &[Vec<(f64, f64)>]) -> Vec<(f64, f64)> {
    // Changes of the slope, in order; those of one year together.
    let mut changes: Vec<(f64, f64)> = Vec::new();
    for pair in lines.iter().flat_map(|points| points.windows(2)) {
        let slope = (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0);
        changes.extend([(pair[0].0, slope), (pair[1].0, -slope)]);
    }
    changes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut sum, mut value, mut slope) = (Vec::<(f64, f64)>::new(), 0.0, 0.0);
    for (year, change) in changes {
        match sum.last() {
            Some(last) if year - last.0 < SAME_YR => {}
            Some(last) => {
                value += slope * (year - last.0);
                sum.push((year, value));
            }
            None => sum.push((year, 0.0)),
        }
        slope += change;
    }
    sum
}

/// Years that are equal but for rounding: a tenth of a second.
const SAME_YR: f64 = 3e-9;

/// Dose (MeV/g, before the mission's factor on all doses) of cosmic-ray protons behind the shield over the mission, for a multiple
/// of the modulation of a mean cycle. None if there are no cosmic rays among its sources, which `history` lists.
pub(crate) fn cosmic_ray_dose_mev_g(mission: &Mission, history: &DoseHistory, modulation: f64) -> Option<f64> {
    let is_modulated = |dose: &&Arc<SourceDose>| dose.is_modulated();
    let name = history.sources.iter().find(is_modulated)?.name.clone();
    let (source, shielding) = (source::source(&name)?, mission.shielding.as_ref()?);
    let inputs = Inputs {
        source: source.card().name,
        setting: Setting { modulation, ..setting(mission, mission.place()?, 1.0).without_events() },
        shield: mission.shield()?,
        niel: mission.environment.niel,
        secondaries: shielding.secondaries,
        phase: mission.environment.solar_phase,
    };
    let launch = decimal_year(mission.mission.launch.0);
    Some(known(source, inputs).unobserved_mev_g(launch, 0.0, mission.mission.duration_yr, 0.0))
}

/// The dose of a source. It takes milliseconds to seconds, and every fit and study needs it, usually for the same mission.
fn known(source: &'static dyn Source, inputs: Inputs) -> Arc<SourceDose> {
    static KNOWN: Recent<Inputs, Arc<SourceDose>> = Recent::new(64);
    KNOWN.get(inputs, |inputs| {
        let streams = source.streams(&inputs.setting);
        let dosed = parallel::map(streams, |stream| behind(stream, source, inputs));
        Arc::new(SourceDose::new(source.card().name.to_string(), Some(source.card()), dosed))
    })
}

/// The sources counted by a mission: those it names, or all that reach it; in the models of the paper only solar protons.
pub(crate) fn sources(environment: &Environment, place: &Place) -> Vec<&'static dyn Source> {
    if environment.model != DoseModel::Derived {
        return vec![SOURCES[0]];
    }
    match &environment.sources {
        Some(names) => names.iter().filter_map(|name| source::source(name)).collect(),
        None => SOURCES.into_iter().filter(|source| source.reaches(place)).collect(),
    }
}

/// A stream behind the shield.
fn behind(stream: Stream, source: &dyn Source, inputs: &Inputs) -> StreamDose {
    let when = match inputs.phase {
        None => stream.when,
        Some(SolarPhase::Min) => stream.when.held(Activity::Minimum),
        Some(SolarPhase::Max) => stream.when.held(Activity::Maximum),
    };
    dosed(Stream { when, ..stream }, source.neutrons(), &inputs.shield, inputs.niel, inputs.secondaries)
}

/// A stream behind a shield, whose nuclear reactions are counted or not.
pub(crate) fn dosed(
    stream: Stream,
    neutrons: f64,
    shield: &Shield,
    niel: Niel,
    counted: SecondariesCounted,
) -> StreamDose {
    let slowed = shield.dose(&stream.yearly, niel.curve());
    let secondaries = Secondaries::of(shield, &stream.yearly, slowed, neutrons);
    let dose_mev_g_yr = match counted {
        SecondariesCounted::Estimated => slowed - secondaries.lost_mev_g + secondaries.neutrons_mev_g,
        SecondariesCounted::Neglected => slowed,
    };
    StreamDose { stream, dose_mev_g_yr, secondaries }
}

/// Spectra of other programs, without time dependence: spread evenly over the mission.
fn of_spectra(mission: &Mission, shield: &Shield, counted: SecondariesCounted) -> Vec<Arc<SourceDose>> {
    let of = |imported: &ImportedSpectrum| {
        let per_year = if imported.per_second { SECONDS_PER_YEAR } else { 1.0 / mission.mission.duration_yr };
        let stream = Stream { yearly: imported.spectrum.times(per_year), when: When::Always };
        let dosed = dosed(stream, 2.0, shield, mission.environment.niel, counted);
        Arc::new(SourceDose::new(imported.file.clone(), None, vec![dosed]))
    };
    mission.imported.spectra.iter().map(of).collect()
}

/// A dose-depth curve of another program, for the mission: spread evenly over it.
fn of_depth(mission: &Mission, shield: &Shield) -> SourceDose {
    let curve = &mission.imported.dose_depth;
    let total = shield.mean(|direction| interpolated(curve, direction.aluminium_g_cm2));
    let stream = Stream { yearly: Spectrum::of([], Law::Power), when: When::Always };
    let dose_mev_g_yr = total / mission.mission.duration_yr;
    let dosed = StreamDose { stream, dose_mev_g_yr, secondaries: Secondaries::default() };
    SourceDose::new(mission.environment.dose_depth.clone().unwrap_or_default(), None, vec![dosed])
}

/// Log-log linear interpolation in a curve; beyond its ends, extrapolation from the end pair.
fn interpolated(curve: &[(f64, f64)], at: f64) -> f64 {
    let after = curve.partition_point(|point| point.0 <= at).clamp(1, curve.len() - 1);
    let ((from, low), (to, high)) = (curve[after - 1], curve[after]);
    if low <= 0.0 || high <= 0.0 || from <= 0.0 {
        return (low + (high - low) * (at - from) / (to - from)).max(0.0);
    }
    low * (high / low).powf((at / from).ln() / (to / from).ln())
}
