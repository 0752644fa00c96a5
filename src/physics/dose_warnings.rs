//! Warnings about a derived dose: the mean over the orbit, the sources counted, the ends of imported files.

use ctiplan_magnetosphere::Activity;

use crate::environment::proton::RANGE_ALUMINIUM;
use crate::environment::source::{Place, Source, averaged};
use crate::mission::Mission;
use crate::physics::source_dose::sources;
use crate::warning::Warning;

/// Warnings about the sources and the orbit's trapped protons.
pub(super) fn of(mission: &Mission) -> Vec<Warning> {
    /// Altitude (km) below which the belt ends in the atmosphere.
    const LOW_KM: f64 = 500.0;
    /// Altitude (km) of an apogee above which Sun and Moon perturb the orbit.
    const HIGH_KM: f64 = 50_000.0;
    if mission.environment.spectra.is_some() || mission.environment.dose_depth.is_some() {
        return import_warnings(mission);
    }
    let Some(place) = mission.place() else { return Vec::new() };
    let mut warnings = source_warnings(mission, &place);
    let Place::Earth(elements) = place else { return warnings };
    let counts = sources(&mission.environment, &Place::Earth(elements)).iter().any(|one| one.card().name == TRAPPED);
    if !counts {
        return warnings;
    }
    let means = [Activity::Minimum, Activity::Maximum].map(|activity| averaged(&elements, activity));
    let relative_error = means.iter().map(|mean| mean.relative_error).fold(0.0, f64::max);
    let empty = means.iter().all(|mean| mean.yearly.above(0.0) == 0.0);
    let held = elements.argument_of_perigee_deg.is_some();
    let reached = elements.perigee_km < 20_000.0;
    let repeats = elements.repeats_longitudes(mission.mission.duration_yr);
    let long = elements.apogee_km > HIGH_KM && elements.eccentricity() > 0.3;
    let of_orbit = [
        (empty && reached).then(|| Warning::NoTrappedProtons { orbit: mission.orbit_name() }),
        repeats.filter(|_| reached).map(|revolutions| Warning::RepeatsLongitudes { revolutions }),
        (relative_error > 0.005).then_some(Warning::OrbitMean { relative_error }),
        (elements.perigee_km < LOW_KM).then_some(Warning::LowAltitude { perigee_km: elements.perigee_km }),
        (long && reached && mission.imported.orbits.is_empty()).then_some(Warning::PerigeeMoves { held }),
    ];
    warnings.extend(of_orbit.into_iter().flatten());
    warnings
}

/// Warnings about imported spectra and dose-depth curves: doses beyond their ends.
fn import_warnings(mission: &Mission) -> Vec<Warning> {
    /// Ratio of a spectrum's last energy to the energy stopped by the shield, below which most of the dose is extrapolated.
    const ENOUGH: f64 = 1.5;
    let Some(shield) = mission.shield() else { return Vec::new() };
    let open = || shield.directions.iter().map(|direction| direction.aluminium_g_cm2);
    let (thinnest, thickest) = (open().fold(f64::INFINITY, f64::min), open().fold(0.0, f64::max));
    let stopped_mev = RANGE_ALUMINIUM.inverse(thinnest);
    let ends = mission.imported.spectra.iter().filter_map(|imported| {
        let (last_mev, file) = (imported.last_mev, imported.file.clone());
        (last_mev < ENOUGH * stopped_mev).then_some(Warning::SpectrumEnds { file, last_mev, stopped_mev })
    });
    let curve = &mission.imported.dose_depth;
    let beyond = curve.first().zip(curve.last()).and_then(|(first, last)| {
        let outside = thinnest < 0.999 * first.0 || thickest > 1.001 * last.0;
        let file = mission.environment.dose_depth.clone().unwrap_or_default();
        outside.then_some(Warning::BeyondDepths { file, depths_g_cm2: (first.0, last.0) })
    });
    ends.chain(beyond).collect()
}

/// Warnings about the sources counted.
fn source_warnings(mission: &Mission, place: &Place) -> Vec<Warning> {
    let counted = sources(&mission.environment, place);
    let name = |source: &&dyn Source| source.card().name;
    let unreached: Vec<&'static str> = counted.iter().filter(|source| !source.reaches(place)).map(name).collect();
    let floor_mev_g_yr = mission.environment.cosmic_ray_floor_mev_g_yr;
    let twice = floor_mev_g_yr > 0.0 && counted.iter().any(|source| name(source) == "cosmic-rays");
    let unreached =
        (!unreached.is_empty()).then(|| Warning::DoesNotReach { sources: unreached, orbit: mission.orbit_name() });
    unreached.into_iter().chain(twice.then_some(Warning::CosmicRaysTwice { floor_mev_g_yr })).collect()
}

/// The source that depends most on the orbit.
const TRAPPED: &str = "trapped-protons";
