//! An observed solar proton event → its fluence spectrum at 1 AU.
//!
//! Between the energies of the list the fluence is a power of the energy, and below the first one with the slope of ESP. Above the
//! last one it is a power of the rigidity, the upper branch of the Band function that Tylka & Dietrich 2009 (31st ICRC, Lodz, paper
//! 273) fit to events up to 10 GV:
//!
//! ```text
//! F(>R) ∝ R^−γ        R = √(T (T + 2m))        γ: the slope between the last two energies, at least 3.8
//! ```
//!
//! The last energy is the last with a fluence: none was seen above the background beyond it, which is no proof that there was none.
//!
//! The least slope is that of E^−2 between 60 and 100 MeV; γ of Tylka & Dietrich is 4 to 9. It keeps backgrounds of small events
//! from being continued to high energies. With a power of the energy instead, the dose of all events differs by less than 3 %
//! behind 30 mm of aluminium and 8 % behind 80 mm (a test).

use chrono::NaiveDateTime;

use crate::environment::cosmic_rays::rigidity_gv;
use crate::environment::spectrum::{Law, Spectrum};
use crate::io::radiation_file::SolarEventRow;

/// A solar proton event.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Its start.
    pub start: NaiveDateTime,
    /// Its end.
    pub end: NaiveDateTime,
    /// The satellite that measured it: events of one have their calibration error in common.
    pub satellite: String,
    /// Energy (MeV, ascending) and omnidirectional fluence above it (cm⁻², never rising, above zero).
    above_cm2: Vec<(f64, f64)>,
}

/// Lowest energy of a spectrum, MeV, and slope of the fluence with energy below the first one of the list: that of ESP's mean year
/// from 1 to 5 MeV. Two micrometres of aluminium stop 0.2 MeV, 0.2 mm stop 5 MeV.
const LOWEST_MEV: f64 = 0.1;
const SLOPE_BELOW: f64 = 0.93;

/// Least slope of the fluence with rigidity above the last energy.
const LEAST_SLOPE: f64 = 3.8;

/// Energies (MeV) above those of a list at which its spectrum has nodes.
const BEYOND_MEV: [f64; 8] = [100.0, 130.0, 170.0, 230.0, 300.0, 500.0, 1000.0, 3000.0];

/// Energy (MeV) and relative error (1 sigma) of the fluence above it: `sep_events` of this project, from two ways of calibration.
const ERRORS: [(f64, f64); 4] = [(10.0, 0.10), (30.0, 0.15), (60.0, 0.25), (100.0, 0.35)];

/// Relative calibration error (1 sigma) of the fluence above an energy (MeV), common to all events of a satellite: linear in ln E,
/// constant beyond the ends.
pub fn relative_error(energy_mev: f64) -> f64 {
    let after = ERRORS.partition_point(|known| known.0 <= energy_mev).clamp(1, ERRORS.len() - 1);
    let ((from, low), (to, high)) = (ERRORS[after - 1], ERRORS[after]);
    let place = (energy_mev / from).ln() / (to / from).ln();
    low + place.clamp(0.0, 1.0) * (high - low)
}

impl Event {
    /// From a row of a file. Where a fluence rises with energy, background was counted: it is lowered to the one before. From the
    /// first without fluence on, nothing is known.
    pub(super) fn of(row: SolarEventRow) -> Event {
        let mut above_cm2 = never_rising(row.above_cm2);
        above_cm2.retain(|node| node.1 > 0.0);
        Event { start: row.start, end: row.end, satellite: row.satellite, above_cm2 }
    }

    /// Its spectrum, with the calibration of its satellite off by a number of standard deviations.
    pub fn spectrum(&self, deviation: f64) -> Spectrum {
        let mut nodes: Vec<(f64, f64)> = self.below().into_iter().collect();
        nodes.extend(&self.above_cm2);
        nodes.extend(self.beyond());
        nodes.iter_mut().for_each(|(mev, cm2)| *cm2 *= (deviation * relative_error(*mev)).exp());
        // A flat spectrum would rise, as the error does with energy.
        Spectrum::of(never_rising(nodes), Law::Power)
    }

    /// Fluence above 0.1 MeV.
    fn below(&self) -> Option<(f64, f64)> {
        let (mev, cm2) = *self.above_cm2.first()?;
        (mev > LOWEST_MEV).then(|| (LOWEST_MEV, cm2 * (LOWEST_MEV / mev).powf(-SLOPE_BELOW)))
    }

    /// Fluences above the last energy.
    fn beyond(&self) -> Vec<(f64, f64)> {
        let Some((last, before)) = self.above_cm2.split_last() else { return Vec::new() };
        let slope = before.last().map_or(LEAST_SLOPE, |before| {
            (before.1 / last.1).ln() / (rigidity_gv(last.0) / rigidity_gv(before.0)).ln()
        });
        let fall = |mev: f64| (rigidity_gv(mev) / rigidity_gv(last.0)).powf(-slope.max(LEAST_SLOPE));
        BEYOND_MEV.into_iter().filter(|mev| *mev > last.0).map(|mev| (mev, last.1 * fall(mev))).collect()
    }
}

/// Fluences above energies, each at most that above the energy before.
fn never_rising(mut above_cm2: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut least = f64::INFINITY;
    for (_, fluence) in &mut above_cm2 {
        least = least.min(*fluence);
        *fluence = least;
    }
    above_cm2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::observed_sun::Record;
    use crate::environment::shielding::{Geometry, Shield};

    #[test]
    fn fluences_are_those_of_the_list_and_fall_beyond_it() {
        for event in &Record::built_in().events {
            let spectrum = event.spectrum(0.0);
            for (mev, fluence) in &event.above_cm2 {
                assert!((spectrum.above(*mev) / fluence - 1.0).abs() < 1e-9, "{event:?}");
            }
            let tail = [100.0, 150.0, 400.0, 2000.0].map(|mev| spectrum.above(mev));
            assert!(tail.windows(2).all(|pair| pair[1] < pair[0]), "{event:?}");
        }
    }

    /// Where the error of a flat spectrum would make it rise, it is cut off; some dose is left behind every shield.
    #[test]
    fn a_calibration_changes_every_dose_by_about_its_error() {
        let niel = crate::environment::Niel::Sr.curve();
        for mm in [5.0, 15.0, 40.0, 80.0] {
            let shield = Shield::aluminium(Geometry::Sphere, mm);
            for event in &Record::built_in().events {
                let dose = |deviation: f64| shield.dose(&event.spectrum(deviation), niel).ln();
                let change = 0.5 * (dose(1.0) - dose(-1.0));
                assert!((0.0..0.6).contains(&change), "{mm} mm: {change} {event:?}");
            }
        }
    }

    #[test]
    fn errors_are_those_of_the_list() {
        for (mev, error) in [(5.0, 0.10), (10.0, 0.10), (30.0, 0.15), (60.0, 0.25), (100.0, 0.35), (500.0, 0.35)] {
            assert!((relative_error(mev) - error).abs() < 1e-12, "{mev}");
        }
    }

    /// The statement of the head of this file.
    #[test]
    fn the_form_above_100_mev_matters_little() {
        let niel = crate::environment::Niel::Sr.curve();
        for (mm, greatest) in [(30.0, 0.03), (80.0, 0.08)] {
            let shield = Shield::aluminium(Geometry::Sphere, mm);
            let (mut rigidity, mut energy) = (0.0, 0.0);
            for event in &Record::built_in().events {
                rigidity += shield.dose(&event.spectrum(0.0), niel);
                let [before, last] = event.above_cm2.last_chunk::<2>().unwrap();
                let slope = ((before.1 / last.1).ln() / (last.0 / before.0).ln()).max(2.0);
                let far = (1e4, last.1 * (1e4 / last.0).powf(-slope));
                let nodes = event.above_cm2.iter().copied().chain((last.1 > 0.0).then_some(far));
                energy += shield.dose(&Spectrum::of(nodes, Law::Power), niel);
            }
            assert!((energy / rigidity - 1.0).abs() < greatest, "{mm} mm: {rigidity:e} {energy:e}");
        }
    }
}
