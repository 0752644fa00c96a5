//! Place → McIlwain's L and B/B0, the coordinates of a proton's drift shell.
//!
//! McIlwain 1961 (J. Geophys. Res. 66, 3681): I = ∫ √(1 − B(s)/B) ds along the field line between the mirror points of protons
//! that mirror at the place; L of I and B by the formula of Hilton 1971 (J. Geophys. Res. 76, 6952).

use std::f64::consts::PI;

use crate::field::{Field, length};

/// Magnetic moment of the Earth in the definition of L, nT RE³: a constant, not the dipole of the field used.
pub const MOMENT: f64 = 31_165.3;

/// Step along a field line over its distance from the centre.
const STEP: f64 = 0.1;

/// Minimum number of steps between mirror points: shorter lines are traced again with shorter steps.
const FEWEST: usize = 6;

/// Shortest step, over the distance from the centre: a place is then on the magnetic equator.
const SHORTEST: f64 = 1e-4;

/// Distance (RE) beyond which lines are not traced: no map extends that far.
const FARTHEST: f64 = 12.0;

/// Number of angles for the integral.
const ANGLES: usize = 24;

/// A drift shell, and the place on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell {
    /// Field at the place, nT.
    pub b_nt: f64,
    /// McIlwain's L, RE.
    pub l: f64,
    /// B/B0 = B L³/M, at least 1.
    pub b_over_b0: f64,
}

/// Drift shell of a geocentric place (RE). None if the line leaves 12 RE.
pub fn shell(field: &Field, place: [f64; 3]) -> Option<Shell> {
    let b_nt = length(field.at(place));
    let integral = invariant(field, place, b_nt)?;
    let x = integral.powi(3) * b_nt / MOMENT;
    // Hilton: L³ B/M = 1 + a1 X^⅓ + a2 X^⅔ + a3 X
    let cube_root = x.cbrt();
    let l3 = MOMENT / b_nt * (1.0 + 1.35047 * cube_root + 0.465380 * cube_root * cube_root + 0.0475455 * x);
    Some(Shell { b_nt, l: l3.cbrt(), b_over_b0: (b_nt * l3 / MOMENT).max(1.0) })
}

/// McIlwain's I (RE) of a place with a field (nT).
fn invariant(field: &Field, place: [f64; 3], b_nt: f64) -> Option<f64> {
    let mut step = STEP;
    while step > SHORTEST {
        for sign in [1.0, -1.0] {
            match line(field, place, b_nt, sign * step) {
                Line::Rises => {}
                Line::Leaves => return None,
                Line::Bounces(samples) if samples.len() > FEWEST => return Some(integral(&samples)),
                Line::Bounces(_) => break,
            }
        }
        step /= 4.0;
    }
    Some(0.0)
}

/// A field line starting at a place.
enum Line {
    /// The field increases from the start.
    Rises,
    /// It leaves the region of the maps.
    Leaves,
    /// Distance (RE) from the start and field over that at the start, up to the first place where it is exceeded.
    Bounces(Vec<(f64, f64)>),
}

/// Traces a line by the classical Runge-Kutta method, in steps of `step` times the distance from the centre.
fn line(field: &Field, start: [f64; 3], b_nt: f64, step: f64) -> Line {
    let mut samples = vec![(0.0, 1.0)];
    let (mut place, mut travelled) = (start, 0.0);
    let mut here = field.at(place);
    loop {
        let distance = step * length(place);
        place = advance(field, place, here, distance);
        if length(place) > FARTHEST {
            return Line::Leaves;
        }
        here = field.at(place);
        travelled += distance.abs();
        samples.push((travelled, length(here) / b_nt));
        if samples[samples.len() - 1].1 >= 1.0 {
            return if samples.len() == 2 { Line::Rises } else { Line::Bounces(samples) };
        }
    }
}

fn advance(field: &Field, place: [f64; 3], b: [f64; 3], distance: f64) -> [f64; 3] {
    let unit = |vector: [f64; 3]| {
        let scale = 1.0 / length(vector);
        vector.map(|component| component * scale)
    };
    let shifted = |direction: [f64; 3], by: f64| [0, 1, 2].map(|axis| place[axis] + by * direction[axis]);
    let first = unit(b);
    let second = unit(field.at(shifted(first, 0.5 * distance)));
    let third = unit(field.at(shifted(second, 0.5 * distance)));
    let fourth = unit(field.at(shifted(third, distance)));
    let mean = [0, 1, 2].map(|axis| (first[axis] + 2.0 * (second[axis] + third[axis]) + fourth[axis]) / 6.0);
    shifted(mean, distance)
}

/// ∫ √(1 − B(s)/B) ds from the start to where B has returned to its value.
fn integral(samples: &[(f64, f64)]) -> f64 {
    let end = mirror(samples);
    // s = S (1 − cos θ)/2 turns the square roots at both ends into a smooth, periodic function of θ, for which the midpoint
    // rule converges faster than any power.
    let root = |index: usize| {
        let angle = PI * (index as f64 + 0.5) / ANGLES as f64;
        let at = 0.5 * end * (1.0 - angle.cos());
        (1.0 - interpolated(samples, at)).max(0.0).sqrt() * angle.sin()
    };
    (0..ANGLES).map(root).sum::<f64>() * 0.5 * end * PI / ANGLES as f64
}

/// Distance at which the field has returned to its value at the start, within the last step.
fn mirror(samples: &[(f64, f64)]) -> f64 {
    let (mut low, mut high) = (samples[samples.len() - 2].0, samples[samples.len() - 1].0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if interpolated(samples, middle) < 1.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The field (over that at the start) between samples: Lagrange's polynomial through the nearest six.
fn interpolated(samples: &[(f64, f64)], at: f64) -> f64 {
    const POINTS: usize = 6;
    let after = samples.partition_point(|sample| sample.0 <= at);
    let first = after.saturating_sub(POINTS / 2).min(samples.len() - POINTS);
    let near = &samples[first..first + POINTS];
    let weight = |index: usize| {
        let others = near.iter().enumerate().filter(|(other, _)| *other != index);
        others.map(|(_, sample)| (at - sample.0) / (near[index].0 - sample.0)).product::<f64>()
    };
    (0..POINTS).map(|index| near[index].1 * weight(index)).sum()
}
