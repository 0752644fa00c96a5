//! Sources of protons: each has a card and a law, one file and one line.
//!
//! ```text
//! orbit, Sun, date → source → streams: a spectrum for each law of time → shield → dose rate
//! ```

mod cosmic_ray_nuclei;
mod cosmic_rays;
mod solar_protons;
mod trapped_protons;

pub use solar_protons::Arrival;
pub use trapped_protons::averaged;

use std::f64::consts::PI;
use std::sync::Arc;

use ctiplan_magnetosphere::{Activity, Elements};

use super::observed_sun::{Event, Observed};
use super::solar_cycle::Phase;
use super::spectrum::Spectrum;

/// All sources, in the order of the output.
pub static SOURCES: [&dyn Source; 4] = [
    &solar_protons::SolarProtons,
    &trapped_protons::TrappedProtons,
    &cosmic_rays::CosmicRays,
    &cosmic_ray_nuclei::CosmicRayNuclei,
];

/// Description of a source.
#[derive(Debug, PartialEq)]
pub struct Card {
    /// Name in mission files.
    pub name: &'static str,
    /// Meaning.
    pub what: &'static str,
    /// The law, in one sentence.
    pub law: &'static str,
    /// Range of validity, and accuracy.
    pub range: &'static str,
    /// Papers and standards.
    pub citation: &'static str,
}

/// A source of protons.
pub trait Source: Sync {
    /// Its description.
    fn card(&self) -> &'static Card;

    /// Whether its protons reach a place.
    fn reaches(&self, place: &Place) -> bool;

    /// Its spectra, each with its time dependence.
    fn streams(&self, setting: &Setting) -> Vec<Stream>;

    /// Whether its spectra depend on confidence and active years.
    fn depends_on_events(&self) -> bool {
        false
    }

    /// Whether its spectra depend on the modulation of cosmic rays.
    fn is_modulated(&self) -> bool {
        false
    }

    /// Neutrons per nuclear reaction of one of its protons.
    fn neutrons(&self) -> f64 {
        2.0
    }
}

/// Location of a mission, for protons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Around the Sun at 1 AU, or far enough from the Earth.
    Interplanetary,
    /// Around the Earth.
    Earth(Elements),
}

/// Inputs of the sources.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Location.
    pub place: Place,
    /// Decimal year of the middle of the mission: the epoch of the magnetic field.
    pub middle: f64,
    /// Probability that the fluence of solar protons is not exceeded.
    pub confidence: f64,
    /// Active years of the quantile of the sum, above 0.
    pub active_years: f64,
    /// Modulation of cosmic rays relative to a mean cycle, at each phase that was not observed.
    pub modulation: f64,
    /// Dose of helium and heavier nuclei of cosmic rays relative to that of the protons.
    pub nuclei_over_protons: f64,
    /// The Sun as it was; None if it is drawn, or a quantile, at all times.
    pub observed: Option<Observed>,
    /// Elements of an orbit that changes, each at its year, from launch on; empty if it is that of `place` at all times.
    pub orbits: Vec<(f64, Elements)>,
}

impl Setting {
    /// The same for sources that do not depend on events: all such settings are equal.
    pub(crate) fn without_events(&self) -> Setting {
        Setting { confidence: 0.5, active_years: 1.0, ..self.clone() }
    }
}

/// A spectrum and its time dependence.
#[derive(Clone, Debug, PartialEq)]
pub struct Stream {
    /// Omnidirectional fluence per year, cm⁻².
    pub yearly: Spectrum,
    /// Its time dependence.
    pub when: When,
}

/// Time dependence of a stream.
#[derive(Clone, Debug, PartialEq)]
pub enum When {
    /// All in the active years of the Sun, none in the others.
    ActiveYears,
    /// Σ c_k cos 2πkx with the phase x of the solar cycle.
    Cycle {
        /// c_k.
        cosines: Vec<f64>,
        /// The phase.
        phase: Phase,
        /// Years, from the first to the second, in which it is 0: another stream has them.
        except: [f64; 2],
    },
    /// As it was: equivalent years since the first point, against years, with straight lines between the points.
    Series(Arc<[(f64, f64)]>),
    /// One equivalent year, evenly spread over an observed event from one year to another.
    Event {
        /// Start.
        from: f64,
        /// End.
        to: f64,
        /// The event.
        event: Arc<Event>,
    },
    /// Constant.
    Always,
}

/// Years that no year is in.
pub(crate) const NEVER: [f64; 2] = [0.0, 0.0];

impl When {
    /// Equivalent years from a year to another, of which `active` are active years of the Sun.
    pub fn years(&self, from: f64, to: f64, active: f64) -> f64 {
        match self {
            When::ActiveYears => active,
            When::Always => to - from,
            When::Cycle { cosines, phase, except: [start, end] } => {
                let within = |from: f64, to: f64| if from < to { phase.integral(cosines, from, to) } else { 0.0 };
                within(from, to) - within(from.max(*start), to.min(*end))
            }
            When::Series(points) => on_line(points, to) - on_line(points, from),
            When::Event { from: start, to: end, .. } => (to.min(*end) - from.max(*start)).max(0.0) / (end - start),
        }
    }

    /// Whether it is as observed, rather than a law for all times.
    pub fn is_observed(&self) -> bool {
        matches!(self, When::Series(_) | When::Event { .. })
    }

    /// Years at which it bends, with equivalent years since the first; empty for laws of all times.
    pub(crate) fn points(&self) -> Vec<(f64, f64)> {
        match self {
            When::Series(points) => points.to_vec(),
            When::Event { from, to, .. } => vec![(*from, 0.0), (*to, 1.0)],
            _ => Vec::new(),
        }
    }
    /// The same with the Sun fixed at a phase of its cycle.
    pub fn held(&self, activity: Activity) -> When {
        match self {
            When::Cycle { cosines, phase, except } => {
                let sign = |k: usize| if activity == Activity::Maximum && k % 2 == 1 { -1.0 } else { 1.0 };
                let share = cosines.iter().enumerate().map(|(k, cosine)| sign(k) * cosine).sum();
                When::Cycle { cosines: vec![share], phase: *phase, except: *except }
            }
            other => other.clone(),
        }
    }
}

/// Value of straight lines between points at a year; constant beyond the ends.
pub(crate) fn on_line(points: &[(f64, f64)], year: f64) -> f64 {
    let after = points.partition_point(|point| point.0 <= year);
    match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
        (None, next) => next.map_or(0.0, |point| point.1),
        (Some(last), None) => last.1,
        (Some(last), Some(next)) => last.1 + (next.1 - last.1) * (year - last.0) / (next.0 - last.0),
    }
}

/// A rate given at years, with straight lines between them, as a law of time: equivalent years since the first.
pub(crate) fn series(rates: &[(f64, f64)]) -> When {
    const PIECES: u32 = 4;
    let mut points = vec![(rates[0].0, 0.0)];
    for pair in rates.windows(2) {
        let ((from, rate), (to, next)) = (pair[0], pair[1]);
        let before = points[points.len() - 1].1;
        // The years are a parabola: several lines, unless the rate is constant.
        let pieces = if rate == next { 1 } else { PIECES };
        points.extend((1..=pieces).map(|piece| {
            let share = f64::from(piece) / f64::from(pieces);
            let mean = rate + 0.5 * share * (next - rate);
            (from + share * (to - from), before + mean * share * (to - from))
        }));
    }
    When::Series(points.into())
}

/// For each of `nodes` phases from minimum to maximum, the cosine coefficients of the weight that interpolates between spectra
/// there: a quantity that is even in the phase is exact at all of them.
pub(crate) fn interpolation(nodes: usize) -> Vec<Vec<f64>> {
    let last = nodes - 1;
    let half = |index: usize| if index == 0 || index == last { 0.5 } else { 1.0 };
    let cosine =
        |node: usize, k: usize| 2.0 / last as f64 * half(node) * half(k) * (PI * (node * k) as f64 / last as f64).cos();
    (0..nodes).map(|node| (0..nodes).map(|k| cosine(node, k)).collect()).collect()
}

/// The source with this name.
pub fn source(name: &str) -> Option<&'static dyn Source> {
    SOURCES.into_iter().find(|source| source.card().name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_interpolate_at_their_phases() {
        let all = interpolation(5);
        for node in 0..5 {
            for (other, cosines) in all.iter().enumerate() {
                let angle = PI * f64::from(node) / 4.0;
                let share: f64 = cosines.iter().enumerate().map(|(k, c)| c * (k as f64 * angle).cos()).sum();
                assert!((share - if other == node as usize { 1.0 } else { 0.0 }).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn cards_have_different_names() {
        let mut names: Vec<&str> = SOURCES.iter().map(|source| source.card().name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), SOURCES.len());
        assert!(names.iter().all(|name| source(name).is_some()) && source("neutrons").is_none());
    }
}
