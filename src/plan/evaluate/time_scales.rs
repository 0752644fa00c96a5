//! Warnings about times that do not go together: release times of traps, the line time, and the whole readout.

use crate::error::InputError;
use crate::mission::Mission;
use crate::model::{Device, Model};
use crate::physics::SpeciesState;
use crate::physics::damage::release_factor;
use crate::readout::Clock;
use crate::warning::{RELEASED_IN_PLACE_LINES, Warning};

/// Time of a readout (ms) above which the line time is doubted: an hour. Full frames of slow cameras take some minutes.
const LONG_READOUT_MS: f64 = 3.6e6;

/// Pixels per second that the fastest amplifiers of CCDs read, those with electron multiplication, in millions. The detector's columns are
/// not known: a frame as wide as the transfers are many stands for it.
const FASTEST_MEGA_PX_S: f64 = 30.0;

/// Factor beyond the line time and the readout at which a release time has no effect: a trap that is emptied in a hundredth of a
/// line time, or by one percent in a whole readout, trails less than that share of its charge.
const FAR: f64 = 100.0;

/// Change of a release time with temperature that is doubted: it takes 25 K and more in published detectors, and an error of the
/// energy by 5 % changes it by another quarter.
const LARGE_FACTOR: f64 = 100.0;

/// Release time (ms) that nobody has measured: a year.
const YEAR_MS: f64 = 1e3 * crate::environment::SECONDS_PER_YEAR;

/// Warnings about the times of a mission's readout at its end.
pub(super) fn warnings(model: &Model) -> Result<Vec<Warning>, InputError> {
    let mission = &model.mission;
    let device = model.device_at(mission.mission.duration_yr)?;
    let line_ms = mission.readout.line_time_ms;
    let readout_ms = line_ms * f64::from(mission.readout.transfers);
    let present: Vec<&SpeciesState> = device.traps.iter().filter(|species| species.density_per_px > 0.0).collect();
    let one_step = device.clock == Clock::single();
    let mut warnings = Vec::new();
    for species in &present {
        let (over_readout, over_line) = (species.release_ms / readout_ms, species.release_ms / line_ms);
        if over_readout > 1.0 && mission.persistence().is_none() {
            warnings.push(Warning::NeverReleases { species: species.name.clone(), over_readout });
        }
        if one_step && over_line < RELEASED_IN_PLACE_LINES {
            warnings.push(Warning::ReleasesInPlace { species: species.name.clone(), over_line });
        }
    }
    if readout_ms > LONG_READOUT_MS {
        warnings.push(Warning::LongReadout { line_time_ms: line_ms, hours: readout_ms / LONG_READOUT_MS });
    }
    let mega_px_s = 1e-3 * f64::from(mission.readout.transfers) / line_ms;
    if mega_px_s > FASTEST_MEGA_PX_S {
        let transfers = mission.readout.transfers;
        warnings.push(Warning::FastReadout { line_time_ms: line_ms, transfers, mega_px_s });
    }
    let unnoticed =
        |species: &&SpeciesState| species.release_ms < line_ms / FAR || species.release_ms > FAR * readout_ms;
    if !present.is_empty() && present.iter().all(unnoticed) && mission.persistence().is_none() {
        let times_ms = present.iter().map(|species| species.release_ms);
        let (least_ms, most_ms) = (times_ms.clone().fold(f64::INFINITY, f64::min), times_ms.fold(0.0, f64::max));
        warnings.push(Warning::NothingToNotice { release_ms: (least_ms, most_ms), line_time_ms: line_ms, readout_ms });
    }
    warnings.extend(far_from_reference(mission, &device));
    Ok(warnings)
}

/// The species whose release time the way from its reference temperature to that of the detector changes most, if by far.
fn far_from_reference(mission: &Mission, device: &Device) -> Option<Warning> {
    let (reference_k, operating_k) = (mission.detector.reference_temperature_k, device.at.temperature_k);
    let changed = mission.detector.traps.iter().filter(|species| species.density_per_px > 0.0).map(|species| {
        let factor = release_factor(species.energy_ev, operating_k, reference_k);
        (species, factor)
    });
    let (species, factor) = changed.max_by(|a, b| a.1.ln().abs().total_cmp(&b.1.ln().abs()))?;
    let (quoted_ms, release_ms) = (species.release_ms, factor * species.release_ms);
    let absurd = factor.ln().abs() > LARGE_FACTOR.ln() || (factor != 1.0 && quoted_ms.max(release_ms) > YEAR_MS);
    absurd.then(|| Warning::FarFromReference {
        species: species.name.clone(),
        temperatures_k: (reference_k, operating_k),
        release_ms: (quoted_ms, release_ms),
    })
}
