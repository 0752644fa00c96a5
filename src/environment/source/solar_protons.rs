//! Protons of solar events.

use ctiplan_magnetosphere::Exposure;

use super::{Card, Place, Setting, Source, Stream, When};
use std::iter;
use std::sync::Arc;

use crate::environment::esp;
use crate::environment::observed_sun::{Event, Observed};
use crate::environment::solar_cycle::ACTIVE_SHARE;
use crate::environment::spectrum::Spectrum;

pub(super) struct SolarProtons;

impl Source for SolarProtons {
    fn card(&self) -> &'static Card {
        &Card {
            name: "solar-protons",
            what: "protons of solar events",
            law: "ESP fluence at the mission's confidence, in the seven active years of each cycle; around the Earth times the \
                  share that passes the geomagnetic cutoff (quiet field, eccentric dipole of the date) and the Earth's shadow",
            range: "1 to 300 MeV at 1 AU; uncertain by a factor of 2 at 95 % confidence; none in quiet years",
            citation: "Xapsos et al. 1999, 2000 (IEEE Trans. Nucl. Sci. 46, 1481; 47, 486); ECSS-E-ST-10-04C (2008), tables B-7 and \
                       B-8; cutoff: Stassinopoulos & King 1974, Smart & Shea 2005, Fraser-Smith 1987",
        }
    }

    fn reaches(&self, _: &Place) -> bool {
        true
    }

    fn depends_on_events(&self) -> bool {
        true
    }

    fn streams(&self, setting: &Setting) -> Vec<Stream> {
        let years = setting.active_years.max(1.0);
        // Less than one active year counts as one, and all of it arrives within the available active time.
        let outside = esp::fluence(setting.confidence, years).times(1.0 / setting.active_years);
        let yearly = Arrival::at(&setting.place, setting.middle).of(outside);
        let drawn = Stream { yearly, when: When::ActiveYears };
        let observed = setting.observed.iter().flat_map(|sun| events(setting, sun));
        iter::once(drawn).chain(observed).collect()
    }
}

/// Events of an observed Sun, and what its gaps hold on average.
fn events(setting: &Setting, sun: &Observed) -> Vec<Stream> {
    let arrivals: Vec<(f64, Arrival)> = match &setting.orbits[..] {
        [] => vec![(0.0, Arrival::at(&setting.place, setting.middle))],
        orbits => orbits.iter().map(|(year, elements)| (*year, Arrival::at(&Place::Earth(*elements), *year))).collect(),
    };
    let nearest = |year: f64| {
        let distance = |arrival: &&(f64, Arrival)| (arrival.0 - year).abs();
        let nearest = arrivals.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        &nearest.expect("at least one").1
    };
    let event = |(from, to, event): (f64, f64, &Arc<Event>)| Stream {
        yearly: nearest(from).of(event.spectrum(0.0)),
        when: When::Event { from, to, event: Arc::clone(event) },
    };
    let mut streams: Vec<Stream> = sun.events().map(event).collect();
    // Too short for a quantile: the mean of all years.
    let mean = esp::mean().times(ACTIVE_SHARE);
    streams.extend(sun.gaps().map(|[from, to]| Stream {
        yearly: nearest(from).of(mean.clone()),
        when: When::Series([(from, 0.0), (to, to - from)].into()),
    }));
    streams
}

/// The part of the protons of solar events that arrives at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival(Option<Exposure>);

impl Arrival {
    /// At a place, in the magnetic field at a decimal year.
    pub fn at(place: &Place, year: f64) -> Arrival {
        match place {
            Place::Interplanetary => Arrival(None),
            Place::Earth(elements) => Arrival(Some(Exposure::along(elements, year))),
        }
    }

    /// From an interplanetary spectrum.
    pub fn of(&self, outside: Spectrum) -> Spectrum {
        match &self.0 {
            None => outside,
            Some(exposure) => outside.attenuated(|energy_mev| exposure.at(energy_mev)),
        }
    }
}
