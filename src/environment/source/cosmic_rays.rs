//! Protons of galactic cosmic rays.

use ctiplan_magnetosphere::Exposure;

use std::f64::consts::PI;

use super::{Card, NEVER, Place, Setting, Source, Stream, When, interpolation};
use crate::environment::cosmic_rays::{modulation_gv, yearly};
use crate::environment::observed_sun::Observed;
use crate::environment::solar_cycle::Phase;

pub(super) struct CosmicRays;

/// Number of phases from minimum to maximum at which the spectrum is computed; the dose between them has an error of 1e-4.
const PHASES: usize = 5;

impl Source for CosmicRays {
    fn card(&self) -> &'static Card {
        &Card {
            name: "cosmic-rays",
            what: "protons of galactic cosmic rays",
            law: "local interstellar spectrum, modulated by a force field of 0.40 GV at solar minimum to 0.85 GV at maximum; around \
                  the Earth behind cutoff and shadow as solar protons",
            range: "in all years, on all orbits; error 10 % between 0.1 and 5 GeV at solar minimum; at maximum the modulation differs between \
                    cycles (0.7 to 1.1 GV)",
            citation: "Gleeson & Axford 1968 (ApJ 154, 1011); Burger et al. 2000 (J. Geophys. Res. 105, 27447); Usoskin et al. 2005 \
                       (J. Geophys. Res. 110, A12108)",
        }
    }

    fn reaches(&self, _: &Place) -> bool {
        true
    }

    fn streams(&self, setting: &Setting) -> Vec<Stream> {
        let exposure = match &setting.place {
            Place::Interplanetary => None,
            Place::Earth(elements) => Some(Exposure::along(elements, setting.middle)),
        };
        let arriving = |modulation_gv: f64| {
            let outside = yearly(modulation_gv);
            match &exposure {
                None => outside,
                Some(exposure) => outside.attenuated(|energy_mev| exposure.at(energy_mev)),
            }
        };
        let months = setting.observed.as_ref().map(Observed::modulation_gv);
        let except = months.as_ref().map_or(NEVER, |months| [months[0].0, months[months.len() - 1].0]);
        let of_phase = |(node, cosines): (usize, Vec<f64>)| {
            let phase = 0.5 * node as f64 / (PHASES - 1) as f64;
            let when = When::Cycle { cosines, phase: Phase { lag_yr: 0.0 }, except };
            Stream { yearly: arriving(setting.modulation * modulation_gv(phase)), when }
        };
        let of_level = |node: usize| {
            let when = by_month(months.as_ref()?, |modulation_gv| level_weight(node, modulation_gv));
            Some(Stream { yearly: arriving(level_gv(node)), when })
        };
        let of_phases = interpolation(PHASES).into_iter().enumerate().map(of_phase);
        of_phases.chain((0..LEVELS).filter_map(of_level)).collect()
    }

    fn is_modulated(&self) -> bool {
        true
    }

    fn neutrons(&self) -> f64 {
        5.5
    }
}

/// Number of modulations at which the spectrum of observed months is computed, and their range, GV: that of the months is 0.25 to
/// 2.02. Between them the flux has an error of 1e-3 (a test).
const LEVELS: usize = 7;
const LEVELS_GV: (f64, f64) = (0.22, 2.2);

/// The modulation (GV) of a node: Chebyshev's, in the logarithm.
fn level_gv(node: usize) -> f64 {
    let (least, greatest) = (LEVELS_GV.0.ln(), LEVELS_GV.1.ln());
    let place = (PI * (node as f64 + 0.5) / LEVELS as f64).cos();
    (0.5 * (least + greatest) + 0.5 * (greatest - least) * place).exp()
}

/// Lagrange's weight of a node at a modulation, GV.
fn level_weight(node: usize, modulation_gv: f64) -> f64 {
    let others = (0..LEVELS).filter(|other| *other != node);
    others.map(|other| (modulation_gv / level_gv(other)).ln() / (level_gv(node) / level_gv(other)).ln()).product()
}

/// A weight that depends on the modulation (GV) of each month as a law of time.
fn by_month(months: &[(f64, f64)], weight: impl Fn(f64) -> f64) -> When {
    let mut years = 0.0;
    let mut points = vec![(months[0].0, 0.0)];
    for pair in months.windows(2) {
        years += weight(pair[0].1) * (pair[1].0 - pair[0].0);
        points.push((pair[1].0, years));
    }
    When::Series(points.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fluxes_of_observed_months_are_interpolated_well() {
        let nodes: Vec<_> = (0..LEVELS).map(|node| yearly(level_gv(node))).collect();
        for modulation_gv in [0.255, 0.33, 0.47, 0.7, 1.1, 1.5, 2.016] {
            let exact = yearly(modulation_gv);
            for energy_mev in [30.0, 100.0, 1000.0] {
                let sum: f64 =
                    (0..LEVELS).map(|node| level_weight(node, modulation_gv) * nodes[node].above(energy_mev)).sum();
                assert!((sum / exact.above(energy_mev) - 1.0).abs() < 1e-3, "{modulation_gv} GV, {energy_mev} MeV");
            }
        }
    }
}
