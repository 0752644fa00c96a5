//! One galaxy at many doses: its change of shape interpolated between a few.
//!
//! While only the densities of traps differ, and all along one line (as they do where a dose grows), the change of shape is
//! a smooth function of the place on that line, close to a straight one. It is computed at Chebyshev's points, which are
//! doubled until the interpolating polynomial of half as many foretells the new ones, and is evaluated by the barycentric
//! formula (Berrut & Trefethen 2004, SIAM Review 46, 501).

use rayon::prelude::*;

use super::{Kind, Reading};
use crate::conditions::Conditions;
use crate::device::Device;
use crate::mission::ReadoutMethod;
use crate::model::Model;
use crate::shape::ShapeChange;

/// Intervals between Chebyshev's points to start with, and at most.
const FIRST: usize = 2;
const LAST: usize = 32;

/// Galaxies fewer than this are computed one by one.
const FEW: usize = 7;

/// A place so close to a point is that point: what rounding makes of 0 or of a half.
const BESIDE: f64 = 1e-14;

/// How far the polynomial may be from a new point, in units of the largest change on the line. Twice as many points are
/// some four times closer: the curve has small kinks, where packets begin to meet one another's levels.
const FORETOLD: f64 = 2e-4;

/// Accuracy of the readout for a shape that is measured, over the mission's: errors of single packets average out in a change
/// of shape, to a few millionths of it at the usual 1e-4 of the packets, far below what any shape is measured to.
pub(super) const READOUT: f64 = 100.0;

/// Changes of shape of those readings that lie on a line with enough others; None for all else.
pub(super) fn interpolated(model: &Model, readings: &[Reading], devices: &[Device]) -> Vec<Option<ShapeChange>> {
    let mut found = vec![None; readings.len()];
    // Random traps are no smooth function of anything; nor need formulas be.
    if model.mission.accuracy.readout == ReadoutMethod::MonteCarlo || !model.depends_on().is_empty() {
        return found;
    }
    let mut lines: Vec<(Conditions, Vec<usize>)> = Vec::new();
    for (index, reading) in readings.iter().enumerate() {
        if !matches!(reading.kind, Kind::Galaxy(_)) {
            continue;
        }
        let at = but_for_dose(&devices[index].at);
        let same = |(known, members): &&mut (Conditions, Vec<usize>)| {
            readings[members[0]].kind == reading.kind
                && *known == at
                && same_species(&devices[members[0]], &devices[index])
        };
        match lines.iter_mut().find(same) {
            Some((_, members)) => members.push(index),
            None => lines.push((at, vec![index])),
        }
    }
    for (_, members) in lines.into_iter().filter(|(_, members)| members.len() >= FEW) {
        let Kind::Galaxy(galaxy) = readings[members[0]].kind else { continue };
        let Some(scene) = model.scene(galaxy) else { continue };
        let Some(places) = places(devices, &members) else { continue };
        let ends = [0.0, 1.0].map(|end| members[places.iter().position(|place| *place == end).expect("both ends")]);
        let (low, high) = (devices[ends[0]].coarser(READOUT), devices[ends[1]].coarser(READOUT));
        let change = |place: f64| scene.change_by(&between(&low, &high, place));
        if let Some(curve) = Curve::of(change) {
            for (&member, &place) in members.iter().zip(&places) {
                found[member] = Some(curve.at(place));
            }
        }
    }
    found
}

/// Conditions that must be the same along a line.
fn but_for_dose(at: &Conditions) -> Conditions {
    Conditions { t_yr: 0.0, dose_mev_g: None, covariates: Vec::new(), ..at.clone() }
}

fn same_species(a: &Device, b: &Device) -> bool {
    // Serial registers have densities of their own, which need not lie on the same line.
    a.serial.is_empty()
        && a.traps.len() == b.traps.len()
        && a.traps.iter().zip(&b.traps).all(|(a, b)| {
            (a.release_ms, a.release_sigma, a.capture_ms) == (b.release_ms, b.release_sigma, b.capture_ms)
        })
}

/// Places of devices on the line through the two whose densities differ most, from 0 to 1. None where they are not on one
/// line, or all alike.
fn places(devices: &[Device], members: &[usize]) -> Option<Vec<f64>> {
    let density = |member: usize| devices[member].traps.iter().map(|species| species.density_per_px);
    let sum = |member: usize| density(member).sum::<f64>();
    let by_sum = |a: &&usize, b: &&usize| sum(**a).total_cmp(&sum(**b));
    let (low, high) = (*members.iter().min_by(by_sum)?, *members.iter().max_by(by_sum)?);
    let span = sum(high) - sum(low);
    if span <= 0.0 {
        return None;
    }
    let place = |member: usize| {
        // Exactly 0 and 1 at the ends.
        let place = (sum(member) - sum(low)) / span;
        let off = |((here, low), high): ((f64, f64), f64)| (here - low - place * (high - low)).abs() > 1e-9 * span;
        let on_line = !density(member).zip(density(low)).zip(density(high)).any(off);
        on_line.then_some(place)
    };
    members.iter().map(|&member| place(member)).collect()
}

/// The device at a place on the line between two.
fn between(low: &Device, high: &Device, place: f64) -> Device {
    let mut device = low.clone();
    for (index, high) in high.traps.iter().enumerate() {
        let low = low.traps[index].density_per_px;
        let density_per_px = low + place * (high.density_per_px - low);
        device.traps[index].density_per_px = density_per_px;
        device.readout.traps[index].density_per_px = density_per_px;
    }
    device
}

/// A polynomial through values at Chebyshev's points.
struct Curve {
    places: Vec<f64>,
    values: Vec<ShapeChange>,
}

impl Curve {
    /// None where a shape is lost, or no polynomial is good enough.
    fn of(change: impl Fn(f64) -> Option<ShapeChange> + Sync) -> Option<Curve> {
        let point =
            |index: usize, intervals: usize| 0.5 - 0.5 * (std::f64::consts::PI * index as f64 / intervals as f64).cos();
        let places: Vec<f64> = (0..=FIRST).map(|index| point(index, FIRST)).collect();
        let values = places.par_iter().map(|&place| change(place)).collect::<Option<Vec<_>>>()?;
        let mut curve = Curve { places, values };
        let mut intervals = FIRST;
        while intervals < LAST {
            intervals *= 2;
            // The new points lie between the old ones.
            let new: Vec<(f64, ShapeChange)> = (1..intervals)
                .into_par_iter()
                .step_by(2)
                .map(|index| Some((point(index, intervals), change(point(index, intervals))?)))
                .collect::<Option<_>>()?;
            let good = new.iter().all(|(place, value)| curve.foretells(*place, value));
            let (mut places, mut values) = (Vec::new(), Vec::new());
            for index in 0..=intervals {
                let (place, value) = match index % 2 {
                    0 => (curve.places[index / 2], curve.values[index / 2]),
                    _ => new[index / 2],
                };
                places.push(place);
                values.push(value);
            }
            curve = Curve { places, values };
            if good {
                return Some(curve);
            }
        }
        None
    }

    /// Whether the polynomial is close to a value; that of twice as many points is then much closer.
    fn foretells(&self, place: f64, value: &ShapeChange) -> bool {
        let found = self.at(place);
        let members: [fn(&ShapeChange) -> f64; 4] = [
            |change| change.delta_e1,
            |change| change.delta_y_px,
            |change| change.delta_flux,
            |change| change.delta_size,
        ];
        members.iter().all(|member| {
            let largest = self.values.iter().map(|value| member(value).abs()).fold(0.0, f64::max);
            (member(&found) - member(value)).abs() <= FORETOLD * largest
        })
    }

    fn at(&self, place: f64) -> ShapeChange {
        let last = self.places.len() - 1;
        let (mut sum, mut total) = (ShapeChange::default(), 0.0);
        for (index, (known, value)) in self.places.iter().zip(&self.values).enumerate() {
            if (place - known).abs() < BESIDE {
                return *value;
            }
            let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
            let weight = if index == 0 || index == last { 0.5 * sign } else { sign } / (place - known);
            total += weight;
            sum = sum.plus(value, weight);
        }
        ShapeChange::default().plus(&sum, 1.0 / total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_the_same_right_beside_its_points() {
        let change = |place: f64| Some(ShapeChange { delta_e1: 1.0 + place * place, ..ShapeChange::default() });
        let curve = Curve::of(change).unwrap();
        for &known in &curve.places {
            for place in [known.next_down(), known, known.next_up()] {
                let expected = 1.0 + place * place;
                assert!((curve.at(place).delta_e1 - expected).abs() < 1e-12, "{place}: {:?}", curve.at(place));
            }
        }
    }
}
