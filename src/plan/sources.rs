//! Sources of the models used for a mission.

use crate::effect::CATALOGUE;
use crate::environment::Niel;
use crate::environment::source::Place;
use crate::mission::{DoseModel, Mission, ReadoutMethod};
use crate::physics::source_dose;

/// A model and its source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The modelled quantity, and the method.
    pub model: String,
    /// Papers, standards, tables; or the mission file.
    pub from: String,
}

impl Source {
    /// A model and its source.
    pub fn new(model: impl Into<String>, from: impl Into<String>) -> Source {
        Source { model: model.into(), from: from.into() }
    }
}

/// The whole chain of a mission, with its effects.
pub fn of(mission: &Mission) -> Vec<Source> {
    let mut sources = match mission.environment.active_dose_rate_mev_g_yr {
        Some(_) => vec![over_time(mission), Source::new("Dose rate of an active year", "given by the mission file")],
        None => of_dose(mission),
    };
    sources.extend(of_traps());
    sources.extend(of_readout(mission));
    sources.extend(of_shapes());
    sources.extend(of_effects(mission));
    sources
}

/// Traps, and the charge that they meet.
fn of_traps() -> [Source; 3] {
    [
        Source::new(
            "Traps: linear in displacement damage dose",
            "Rhodes et al. 2010 (PASP 122, 439), section 4.1; densities, release times and levels from the mission file",
        ),
        Source::new(
            "Release times against temperature: Shockley-Read-Hall",
            "Shockley & Read 1952 (Phys. Rev. 87, 835); Hall 1952 (Phys. Rev. 87, 387)",
        ),
        Source::new(
            "Height of charge clouds: power law above a notch",
            "Rhodes et al. 2010, equation 1; Massey et al. 2010 (MNRAS 401, 371)",
        ),
    ]
}

/// The readout, with options from the mission file.
fn of_readout(mission: &Mission) -> Vec<Source> {
    let mut sources = vec![readout(mission.accuracy.readout)];
    if mission.readout.clock.is_some() {
        sources.push(Source::new(
            "Clock phases: what a trap releases joins the nearest packet",
            "derived for ctiplan from the geometry of the phases",
        ));
    }
    if mission.readout.store.is_some() {
        sources.push(Source::new(
            "Frame transfer: image in a burst, store in a burst and at the line time",
            "derived for ctiplan as a composition of readouts",
        ));
    }
    if mission.persistence().is_some() {
        sources.push(Source::new(
            "Persistence: traps that are still filled from exposures before",
            "derived for ctiplan from release times and the cadence of exposures",
        ));
    }
    let temperatures = mission.detector.temperature_history.iter();
    sources.extend(temperatures.map(|file| Source::new("Temperature over time, imported", file.as_str())));
    if mission.readout.noise.is_some() {
        sources.push(Source::new(
            "Read noise against pixel rate",
            "Janesick 2001, Scientific Charge-Coupled Devices (SPIE); values from the mission file",
        ));
    }
    sources
}

/// Galaxies, their shapes, and the requirement.
fn of_shapes() -> [Source; 3] {
    [
        Source::new(
            "Galaxies: Sersic profiles through a Moffat PSF, as sums of Gaussians",
            "Ciotti & Bertin 1999 (A&A 352, 447); Kanter 1975 (Ann. Probab. 3, 697); Moffat 1969 (A&A 3, 455)",
        ),
        Source::new(
            "Shapes: moments under a Gaussian weight",
            "Rhodes, Refregier & Groth 2000 (ApJ 536, 79); Rhodes et al. 2010, section 5",
        ),
        Source::new(
            "Budget, and software correction by a factor",
            "the mission file; Rhodes et al. 2010, section 6, after Amara & Refregier 2008 (a budget of 0.001, their limit on \
             multiplicative errors) and Massey et al. 2009 (a factor of 10)",
        ),
    ]
}

/// Solar protons, shield and damage.
pub fn of_dose(mission: &Mission) -> Vec<Source> {
    let mut all = vec![over_time(mission)];
    let environment = &mission.environment;
    if environment.model == DoseModel::History {
        return all;
    }
    let place = mission.place().unwrap_or(Place::Interplanetary);
    let imports = environment.spectra.is_some() || environment.dose_depth.is_some();
    all.extend(
        environment.spectra.iter().flatten().map(|file| Source::new("Proton spectrum, imported", file.as_str())),
    );
    all.extend(
        environment.dose_depth.iter().map(|file| Source::new("Dose against thickness, imported", file.as_str())),
    );
    for source in source_dose::sources(environment, &place).iter().filter(|_| !imports) {
        let card = source.card();
        let mut what: String = card.what.into();
        what[..1].make_ascii_uppercase();
        all.push(Source::new(format!("{what}: {}", card.law), card.citation));
    }
    all.extend([
        Source::new(
            "Shielding: protons slow down continuously, straight through aluminium; other materials by their areal density",
            "ranges: NIST PSTAR; equivalences: docs/physics.md, section 4",
        ),
        Source::new(
            "Displacement damage in silicon: NIEL of protons",
            match environment.niel {
                Niel::Sr => "SR-NIEL, displacement threshold 21 eV",
                Niel::Rd50 => "compilation of the RD50 collaboration",
            },
        ),
    ]);
    all
}

/// The effects of a mission.
fn of_effects(mission: &Mission) -> impl Iterator<Item = Source> {
    let cards = CATALOGUE.iter().map(|entry| entry.card).filter(|card| mission.effects.contains_key(card.kind));
    cards.map(|card| Source::new(format!("Effect {}: {}", card.kind, card.adds), card.source))
}

/// Removes duplicates, keeping the order of first appearance.
pub fn once(sources: impl IntoIterator<Item = Source>) -> Vec<Source> {
    let mut seen: Vec<Source> = Vec::new();
    for source in sources {
        if !seen.contains(&source) {
            seen.push(source);
        }
    }
    seen
}

/// The dose over time.
pub fn over_time(mission: &Mission) -> Source {
    match mission.environment.model {
        DoseModel::SolarCycle => Source::new(
            "Dose over time: seven active years of each solar cycle, four quiet ones",
            "ECSS-E-ST-10-04C (2008), annex B.1; Rhodes et al. 2010 (PASP 122, 439), section 4.1",
        ),
        DoseModel::Constant => Source::new(
            "Dose over time: 7/11 of the rate of active years, always",
            "Rhodes et al. 2010 (PASP 122, 439), section 4.1",
        ),
        DoseModel::Derived => Source::new(
            "Dose over time: each source by its own law of the solar cycle",
            "active years: ECSS-E-ST-10-04C (2008), annex B.1; minima: 13-month smoothed sunspot number (NOAA/SWPC)",
        ),
        DoseModel::History => {
            Source::new("Dose over time, imported", mission.environment.history.as_deref().unwrap_or("a file"))
        }
    }
}

fn readout(method: ReadoutMethod) -> Source {
    match method {
        ReadoutMethod::Fast => Source::new(
            "Readout: capture at once, exponential release, many transfers at a time",
            "Rhodes et al. 2010, section 3; a multirevolution method, Calvo, Jay, Montijano & Rández 2004 (Numer. Math. 97, 635)",
        ),
        ReadoutMethod::Exact => Source::new(
            "Readout: capture at once, exponential release, every transfer",
            "Rhodes et al. 2010, section 3",
        ),
        ReadoutMethod::Fractional => {
            Source::new("Readout: fractional traps at fixed heights", "Rhodes et al. 2010, section 3")
        }
        ReadoutMethod::MonteCarlo => {
            Source::new("Readout: whole traps at random places", "Rhodes et al. 2010, section 3")
        }
    }
}
