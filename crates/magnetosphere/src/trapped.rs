//! Orbit → mean spectrum of trapped protons.

use std::ops::Range;

use rayon::prelude::*;

use crate::belt::Activity;
use crate::drift_shell::shell;
use crate::field::length;
use crate::orbit::Elements;

/// Mean flux of trapped protons along an orbit.
#[derive(Clone, Debug, PartialEq)]
pub struct TrappedProtons {
    /// Energies of the map, MeV, ascending.
    pub energies_mev: Vec<f64>,
    /// Omnidirectional flux above each, cm⁻² s⁻¹.
    pub flux_cm2_s: Vec<f64>,
    /// Estimated relative error of the flux above 1 MeV.
    pub relative_error: f64,
    /// Number of places averaged.
    pub places: usize,
}

/// Estimated relative error at which the mean has converged.
const CONVERGED: f64 = 0.005;

/// Energy (MeV) above which the flux must have converged: slower protons are stopped by 0.015 mm of aluminium.
const FROM_MEV: f64 = 1.0;

/// Flux (cm⁻² s⁻¹) below which errors are relative to it: 1 % of that of cosmic-ray protons.
const SMALL_FLUX: f64 = 0.03;

/// Initial and maximum number of places, doubled in each step; the error is always reported.
const PLACES: (usize, usize) = (2048, 131_072);

/// Distance from the centre (RE) beyond which no map has protons: excludes field lines that leave the maps.
const FARTHEST: f64 = 7.5;

/// Mean over an orbit, in the field in which the map was made: the number of places is doubled until the flux above 1 MeV has
/// converged to 0.5 % by its own estimate.
pub fn trapped_protons(elements: &Elements, activity: Activity) -> TrappedProtons {
    let energies_mev = activity.map().energies_mev();
    let mut sums = vec![0.0; energies_mev.len()];
    let mut means: Vec<Vec<f64>> = Vec::new();
    let (mut done, mut places) = (0, PLACES.0);
    loop {
        for (sum, more) in sums.iter_mut().zip(visited(elements, activity, done..places)) {
            *sum += more;
        }
        means.push(sums.iter().map(|sum| sum / places as f64).collect());
        let relative_error = error(&means, &energies_mev);
        if relative_error < CONVERGED || places >= PLACES.1 {
            let flux_cm2_s = means.pop().expect("a mean");
            return TrappedProtons { energies_mev, flux_cm2_s, relative_error, places };
        }
        (done, places) = (places, 2 * places);
    }
}

/// Relative error of the last mean: the change by the last doubling, or half of that by the previous one.
fn error(means: &[Vec<f64>], energies_mev: &[f64]) -> f64 {
    let change = |back: usize| {
        let [.., before, after] = &means[..means.len() - back] else { return f64::INFINITY };
        let pairs = before.iter().zip(after).zip(energies_mev).filter(|(_, energy)| **energy >= FROM_MEV);
        pairs.map(|((before, after), _)| (before - after).abs() / after.max(SMALL_FLUX)).fold(0.0, f64::max)
    };
    if means.len() < 3 { f64::INFINITY } else { change(0).max(0.5 * change(1)) }
}

/// Sum of the fluxes at places of an orbit, by their numbers.
fn visited(elements: &Elements, activity: Activity, numbers: Range<usize>) -> Vec<f64> {
    const AT_ONCE: usize = 64;
    let (map, field) = (activity.map(), activity.field());
    let chunks: Vec<Range<usize>> =
        numbers.clone().step_by(AT_ONCE).map(|start| start..(start + AT_ONCE).min(numbers.end)).collect();
    let part = |chunk: &Range<usize>| {
        let mut sums = vec![0.0; map.energies_mev().len()];
        for visit in chunk.clone().map(|number| elements.visit(number, FARTHEST)) {
            let empty = || {
                let dipole_l = activity.dipole().l(visit.place);
                !map.may_have_protons(length(field.at(visit.place)), dipole_l)
            };
            if visit.weight == 0.0 || empty() {
                continue;
            }
            let Some(shell) = shell(field, visit.place) else { continue };
            for (sum, flux) in sums.iter_mut().zip(map.fluxes(shell.l, shell.b_over_b0)) {
                *sum += visit.weight * flux;
            }
        }
        sums
    };
    // The order of the sum does not depend on the number of threads.
    let parts: Vec<Vec<f64>> = chunks.par_iter().map(part).collect();
    let energies = map.energies_mev().len();
    (0..energies).map(|index| parts.iter().map(|part| part[index]).sum()).collect()
}
