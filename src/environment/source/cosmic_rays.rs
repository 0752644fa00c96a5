//! Protons of galactic cosmic rays.

use ctiplan_magnetosphere::Exposure;

use super::{Card, Place, Setting, Source, Stream, When, interpolation};
use crate::environment::cosmic_rays::{modulation_gv, yearly};
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
        let stream = |(node, cosines): (usize, Vec<f64>)| {
            let phase = 0.5 * node as f64 / (PHASES - 1) as f64;
            let outside = yearly(setting.modulation * modulation_gv(phase));
            let yearly = match &exposure {
                None => outside,
                Some(exposure) => outside.attenuated(|energy_mev| exposure.at(energy_mev)),
            };
            Stream { yearly, when: When::Cycle { cosines, phase: Phase { lag_yr: 0.0 } } }
        };
        interpolation(PHASES).into_iter().enumerate().map(stream).collect()
    }

    fn is_modulated(&self) -> bool {
        true
    }

    fn neutrons(&self) -> f64 {
        5.5
    }
}
