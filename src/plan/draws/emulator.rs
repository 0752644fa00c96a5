//! The change of shape as a smooth function of a few numbers: fitted to some readouts, and compared with others.
//!
//! The effect of a device on a galaxy depends on its densities ρ_s, release times, wells, background, and on the galaxy's flux and
//! size. With ρ = Σ ρ_s, and x for ln(1 + ρ/median), the shares ρ_s/ρ and the logarithms of the others,
//!
//! ```text
//! Δe = ρ P(x) + Q(x)
//! ```
//!
//! where P is a polynomial of degree 2 (3 if ρ is involved, 5 in ρ alone). A general emulator also has Q, of degree 1, for changes
//! without traps; then time and dose are among its x. Coefficients are fitted by least squares.

use nalgebra::{DMatrix, DVector};

use crate::mission::Mission;
use crate::model::Device;
use crate::numeric::least_squares::Span;
use crate::physics::galaxy::snr;

/// The coordinates on which a change of shape depends.
#[derive(Clone, Debug)]
pub struct Place {
    /// Traps per pixel of all species, ρ.
    total_per_px: f64,
    numbers: Vec<f64>,
}

impl Place {
    /// For a device that reads the first galaxy of a mission, with or without the coordinates of a general emulator. `others`:
    /// drawn numbers that the device does not depend on.
    pub fn of(mission: &Mission, device: &Device, others: &[f64], general: bool) -> Place {
        let densities: Vec<f64> = device.species().map(|species| species.density_per_px).collect();
        let total_per_px: f64 = densities.iter().sum();
        let share = |density: f64| if total_per_px > 0.0 { density / total_per_px } else { 0.0 };
        let mut numbers = vec![total_per_px];
        numbers.extend(densities.iter().skip(1).map(|density| share(*density)));
        for species in device.species() {
            numbers.extend([species.release_ms.ln(), species.release_sigma, species.capture_ms]);
            numbers.push(species.well_fill_power.unwrap_or(0.0));
            // A capture time common to all clouds has neither.
            if species.capture_density_power > 0.0 {
                numbers.extend([species.capture_density_power, species.capture_at_e.ln()]);
            }
        }
        let (detector, galaxy) = (&mission.detector, &mission.galaxies[0]);
        numbers.extend([
            detector.full_well_e.ln(),
            detector.notch_e,
            detector.well_fill_power.ln(),
            detector.volume_at_zero,
            device.at.background_e,
            device.at.line_time_ms.ln(),
            snr::flux_e(mission, galaxy).ln(),
            galaxy.half_light_px.ln(),
        ]);
        if general {
            numbers.extend([device.at.t_yr, device.at.dose_mev_g.unwrap_or(0.0)]);
        }
        numbers.extend(others);
        Place { total_per_px, numbers }
    }
}

/// Coordinates with their change of shape: Δe1 and Δe2; None if no shape is left.
pub type Example = (Place, Option<[f64; 2]>);

/// A fitted function of places, with two values: Δe1 and Δe2.
#[derive(Clone, Debug)]
pub struct Emulator {
    /// Coordinates that differ between the examples, by their index, each with its mean and standard deviation.
    varying: Vec<(usize, f64, f64)>,
    /// Median of ρ over the examples, 1/px.
    median_per_px: f64,
    /// Whether it includes changes without traps, and time and dose.
    pub general: bool,
    /// Traps per pixel from which no shape is left: the fewest with which none was; infinite if all were measured.
    lost_per_px: f64,
    coefficients: [DVector<f64>; 2],
}

impl Emulator {
    /// Fitted to the changes at some places. Their relative errors count, but less for |Δe| outside the range `counted`. None if
    /// there are fewer measured places than coefficients.
    pub fn fitted(known: &[Example], counted: [f64; 2], general: bool) -> Option<Emulator> {
        let lost = known.iter().filter(|(_, change)| change.is_none()).map(|(place, _)| place.total_per_px);
        let lost_per_px = lost.fold(f64::INFINITY, f64::min);
        let measured = known.iter().filter(|(place, _)| place.total_per_px < lost_per_px);
        let known: Vec<(&Place, [f64; 2])> = measured.filter_map(|(place, change)| Some((place, (*change)?))).collect();
        let mut emulator = Emulator::unfitted(known.iter().map(|(place, _)| *place).collect(), general);
        emulator.lost_per_px = lost_per_px;
        let rows: Vec<Vec<f64>> = known.iter().map(|(place, _)| emulator.terms(place)).collect();
        let terms = rows.first()?.len();
        if rows.len() < terms {
            return None;
        }
        let [least, most] = counted;
        let weight = |row: usize| {
            let magnitude = known[row].1[0].hypot(known[row].1[1]);
            (most / magnitude.max(most)) / (magnitude + least)
        };
        let design = DMatrix::from_fn(rows.len(), terms, |row, term| weight(row) * rows[row][term]);
        let span = Span::of(&design, 1e-7);
        let solved =
            |which: usize| span.solve(&DVector::from_fn(rows.len(), |row, _| weight(row) * known[row].1[which]));
        emulator.coefficients = [solved(0), solved(1)];
        Some(emulator)
    }

    /// Number of coefficients of a fit at some places.
    pub fn coefficients(places: &[Place], general: bool) -> usize {
        let emulator = Emulator::unfitted(places.iter().collect(), general);
        places.first().map_or(0, |place| emulator.terms(place).len())
    }

    fn unfitted(places: Vec<&Place>, general: bool) -> Emulator {
        let mut totals: Vec<f64> = places.iter().map(|place| place.total_per_px).collect();
        totals.sort_by(f64::total_cmp);
        let median_per_px = totals.get(totals.len() / 2).copied().filter(|median| *median > 0.0).unwrap_or(1.0);
        let scaled: Vec<Vec<f64>> = places.iter().map(|place| scaled(place, median_per_px)).collect();
        let coefficients = [DVector::zeros(0), DVector::zeros(0)];
        Emulator { varying: varying(&scaled), median_per_px, general, lost_per_px: f64::INFINITY, coefficients }
    }

    /// Δe1 and Δe2 at a place; None if no shape is left.
    pub fn at(&self, place: &Place) -> Option<[f64; 2]> {
        let terms = self.terms(place);
        let value =
            |which: usize| terms.iter().zip(self.coefficients[which].iter()).map(|(term, share)| term * share).sum();
        (place.total_per_px < self.lost_per_px).then(|| [0, 1].map(value))
    }

    /// Relative error of |Δe| at known places, as root mean square over those in the range `counted`, but not over fewer than a
    /// fifth of all. Values outside the range are replaced by its ends: errors there count if they reach into it.
    pub fn error(&self, known: &[Example], counted: [f64; 2]) -> f64 {
        let [least, most] = counted;
        let magnitude = |change: Option<[f64; 2]>| change.map_or(most, |[e1, e2]| e1.hypot(e2).clamp(least, most));
        let squared = |(place, expected): &Example| {
            let expected = magnitude(*expected);
            ((magnitude(self.at(place)) - expected) / expected).powi(2)
        };
        let is_inside =
            |example: &&Example| (least..most).contains(&magnitude(example.1)) && magnitude(example.1) > least;
        let inside = known.iter().filter(is_inside).count().max(known.len() / 5).max(1);
        (known.iter().map(squared).sum::<f64>() / inside as f64).sqrt()
    }

    fn terms(&self, place: &Place) -> Vec<f64> {
        let numbers = scaled(place, self.median_per_px);
        let x: Vec<f64> = self.varying.iter().map(|(index, mean, sigma)| (numbers[*index] - mean) / sigma).collect();
        let mut polynomial = vec![1.0];
        polynomial.extend(&x);
        for (index, one) in x.iter().enumerate() {
            polynomial.extend(x[index..].iter().map(|other| one * other));
        }
        if self.varying.first().is_some_and(|(index, ..)| *index == 0) {
            // If many traps are met, the packets arrive late.
            polynomial.extend(x.iter().map(|other| x[0] * x[0] * other));
            polynomial.extend([4, 5].map(|power| x[0].powi(power)));
        }
        let mut terms: Vec<f64> = polynomial.iter().map(|value| place.total_per_px * value).collect();
        if self.general {
            terms.push(1.0);
            terms.extend(x);
        }
        terms
    }
}

/// The numbers of a place; ln(1 + ρ/median) replaces ρ, whose largest values are far above its median.
fn scaled(place: &Place, median_per_px: f64) -> Vec<f64> {
    let mut numbers = place.numbers.clone();
    numbers[0] = (place.total_per_px / median_per_px).ln_1p();
    numbers
}

/// Numbers that differ between places by more than rounding, each with its mean and standard deviation.
fn varying(places: &[Vec<f64>]) -> Vec<(usize, f64, f64)> {
    let count = places.len() as f64;
    let numbers = places.first().map_or(0, Vec::len);
    let one = |index: usize| {
        let values = || places.iter().map(|numbers| numbers[index]);
        let mean = values().sum::<f64>() / count;
        let sigma = (values().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
        (index, mean, sigma)
    };
    (0..numbers).map(one).filter(|(_, mean, sigma)| *sigma > 1e-9 * mean.abs().max(1e-3)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_of_its_kind_is_met() {
        let law = |numbers: &[f64], median: f64| {
            let [rho, share, log] = numbers[..] else { panic!() };
            let q = (rho / median).ln_1p();
            rho * (0.3 - 0.1 * share + 0.2 * log - 0.5 * q + 0.05 * q * q + 0.1 * share * log)
        };
        let place = |index: usize| {
            let x = |step: f64| (index as f64 * step).fract();
            Place { total_per_px: x(0.618), numbers: vec![x(0.618), x(0.414), x(0.732)] }
        };
        let mut totals: Vec<f64> = (0..61).map(|index| place(index).total_per_px).collect();
        totals.sort_by(f64::total_cmp);
        let median = totals[30];
        let known = (0..61).map(|index| {
            let place = place(index);
            let value = law(&place.numbers, median);
            (place, Some([value, -value]))
        });
        let mut known: Vec<Example> = known.collect();
        let emulator = Emulator::fitted(&known, [1e-3, 1e3], false).unwrap();
        for index in 100..120 {
            let place = place(index);
            let [e1, e2] = emulator.at(&place).unwrap();
            assert!((e1 - law(&place.numbers, median)).abs() < 1e-10 && (e1 + e2).abs() < 1e-12);
        }
        assert!(Emulator::fitted(&known[..5], [1e-3, 1e3], false).is_none());
        // From the fewest traps that leave no shape on, there is none.
        let most =
            (0..known.len()).max_by(|a, b| known[*a].0.total_per_px.total_cmp(&known[*b].0.total_per_px)).unwrap();
        known[most].1 = None;
        let emulator = Emulator::fitted(&known, [1e-3, 1e3], false).unwrap();
        assert!(emulator.at(&known[most].0).is_none() && emulator.at(&known[most - 1].0).is_some());
    }
}
