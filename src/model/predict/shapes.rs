//! Changes of shape of one galaxy at many doses: interpolated between a few.
//!
//! If only the densities of traps differ, and all lie on one line (as for a growing dose), the change of shape is a smooth, nearly
//! linear function of the place on that line. It is computed at Chebyshev points. Their number is doubled until the interpolating
//! polynomial of half as many predicts the new values. It is evaluated by the barycentric formula (Berrut & Trefethen 2004, SIAM
//! Review 46, 501).

use super::{Probed, Reading};
use crate::error::InputError;
use crate::mission::ReadoutMethod;
use crate::model::{Device, Model};
use crate::numeric::parallel;
use crate::physics::accuracy::Purpose;
use crate::physics::conditions::Conditions;
use crate::physics::damage::SpeciesState;
use crate::physics::shape::ShapeChange;

/// Intervals between Chebyshev points to start with.
const FIRST: usize = 2;

/// Largest number of points of a curve: one that needs more is not smooth.
const MOST: usize = 33;

/// Galaxies fewer than this are computed one by one.
const FEW: usize = 7;

/// A place this close to a point equals the point: 0 or a half up to rounding.
const BESIDE: f64 = 1e-14;

/// Largest error of the polynomial at a new point, in units of the largest change on the line. Doubling the points reduces it some
/// four times: the curve has small kinks, where packets begin to meet one another's watermarks.
const TOLERANCE: f64 = 2e-4;

/// Share of that error from which the points after the new ones count, gradually up to full weight. Otherwise the derivatives of a
/// fit would jump where the number of points is doubled.
const GOOD: f64 = 0.7;

/// Changes of shape of the readings of galaxies: interpolated if they lie on a line with enough others. None for other readings,
/// and if the shape is lost.
///
/// # Errors
/// If an effect has no value.
pub(super) fn changes(
    model: &Model,
    readings: &[Reading],
    devices: &[Device],
) -> Result<Vec<Option<ShapeChange>>, InputError> {
    let interpolated = interpolated(model, readings, devices)?;
    let all = readings.iter().zip(devices).zip(interpolated);
    parallel::try_map(all, |((reading, device), interpolated)| match (reading.kind, interpolated) {
        (Probed::Galaxy(galaxy), None) => model.trailed(galaxy, &device.fit_for(Purpose::Measurement)),
        (_, interpolated) => Ok(interpolated),
    })
}

fn interpolated(
    model: &Model,
    readings: &[Reading],
    devices: &[Device],
) -> Result<Vec<Option<ShapeChange>>, InputError> {
    let mut found = vec![None; readings.len()];
    // Random traps give no smooth function, and formulas may not either.
    if model.mission.accuracy.readout == ReadoutMethod::MonteCarlo || !model.depends_on().is_empty() {
        return Ok(found);
    }
    let mut lines: Vec<(Conditions, Vec<usize>)> = Vec::new();
    for (index, reading) in readings.iter().enumerate() {
        if !matches!(reading.kind, Probed::Galaxy(_)) {
            continue;
        }
        let at = devices[index].at.but_for_dose();
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
        let Probed::Galaxy(galaxy) = readings[members[0]].kind else { continue };
        let Some(places) = places(devices, &members) else { continue };
        let ends = [0.0, 1.0].map(|end| members[places.iter().position(|place| *place == end).expect("both ends")]);
        let [low, high] = ends.map(|end| devices[end].fit_for(Purpose::Measurement));
        let change = |place: f64| model.trailed(galaxy, &between(&low, &high, place));
        // Interpolation is not worthwhile with more points than galaxies.
        if let Some(curve) = Curve::of(change, members.len().min(MOST))? {
            for (&member, &place) in members.iter().zip(&places) {
                found[member] = Some(curve.at(place));
            }
        }
    }
    Ok(found)
}

fn same_species(a: &Device, b: &Device) -> bool {
    // Serial registers have densities of their own, which may not lie on the same line.
    !a.has_serial_traps()
        && !b.has_serial_traps()
        && a.traps.len() == b.traps.len()
        && a.traps.iter().zip(&b.traps).all(|(a, b)| {
            let capture =
                |species: &SpeciesState| (species.capture_ms, species.capture_density_power, species.capture_at_e);
            (a.release_ms, a.release_sigma, capture(a)) == (b.release_ms, b.release_sigma, capture(b))
        })
}

/// Places of devices on the line through the two with the most different densities, from 0 to 1. None if they are not on one line,
/// or all equal.
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
        device.traps[index].density_per_px = low + place * (high.density_per_px - low);
    }
    device
}

/// A polynomial through values at Chebyshev points.
#[derive(Clone)]
struct Curve {
    places: Vec<f64>,
    values: Vec<ShapeChange>,
}

impl Curve {
    /// None if a shape is lost, or no polynomial through at most `most` points is accurate enough.
    fn of(
        change: impl Fn(f64) -> Result<Option<ShapeChange>, InputError> + Sync,
        most: usize,
    ) -> Result<Option<Curve>, InputError> {
        let at_all = |places: &[f64]| -> Result<Option<Vec<ShapeChange>>, InputError> {
            Ok(parallel::try_map(places, |&place| change(place))?.into_iter().collect())
        };
        let point =
            |index: usize, intervals: usize| 0.5 - 0.5 * (std::f64::consts::PI * index as f64 / intervals as f64).cos();
        let places: Vec<f64> = (0..=FIRST).map(|index| point(index, FIRST)).collect();
        let Some(values) = at_all(&places)? else { return Ok(None) };
        let mut known = Curve { places, values };
        let (mut curve, mut weight) = (known.clone(), 1.0);
        let mut intervals = FIRST;
        while 2 * intervals < most {
            intervals *= 2;
            // The new points lie between the old ones.
            let between: Vec<f64> = (1..intervals).step_by(2).map(|index| point(index, intervals)).collect();
            let Some(values) = at_all(&between)? else { return Ok(None) };
            let new: Vec<(f64, ShapeChange)> = between.into_iter().zip(values).collect();
            let missed = new.iter().map(|(place, value)| known.missed(*place, value)).fold(0.0, f64::max);
            let weighed = new.iter().map(|(place, value)| {
                let predicted = curve.at(*place);
                (*place, predicted.plus(&value.plus(&predicted, -1.0), weight))
            });
            curve = curve.with_between(weighed);
            known = known.with_between(new.iter().copied());
            weight *= ((missed / TOLERANCE - GOOD) / (1.0 - GOOD)).clamp(0.0, 1.0);
            if weight == 0.0 {
                return Ok(Some(curve));
            }
        }
        // Accepted if the curve came within the tolerance on the way.
        Ok((weight < 1.0).then_some(curve))
    }

    /// The curve with a new point between each two.
    fn with_between(&self, mut new: impl Iterator<Item = (f64, ShapeChange)>) -> Curve {
        let mut all = Vec::new();
        for known in self.places.iter().copied().zip(self.values.iter().copied()) {
            all.push(known);
            all.extend(new.next());
        }
        let (places, values) = all.into_iter().unzip();
        Curve { places, values }
    }

    /// Distance of the polynomial from a value, in units of the largest change on the line.
    fn missed(&self, place: f64, value: &ShapeChange) -> f64 {
        let found = self.at(place);
        let members: [fn(&ShapeChange) -> f64; 4] = [
            |change| change.delta_e1,
            |change| change.delta_y_px,
            |change| change.delta_flux,
            |change| change.delta_size,
        ];
        let missed = members.iter().map(|member| {
            let largest = self.values.iter().map(|value| member(value).abs()).fold(0.0, f64::max);
            let missed = (member(&found) - member(value)).abs();
            if missed == 0.0 { 0.0 } else { missed / largest }
        });
        missed.fold(0.0, f64::max)
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
        let change = |place: f64| Ok(Some(ShapeChange { delta_e1: 1.0 + place * place, ..ShapeChange::default() }));
        let curve = Curve::of(change, MOST).unwrap().unwrap();
        for &known in &curve.places {
            for place in [known.next_down(), known, known.next_up()] {
                let expected = 1.0 + place * place;
                assert!((curve.at(place).delta_e1 - expected).abs() < 1e-12, "{place}: {:?}", curve.at(place));
            }
        }
    }
}
