//! Helium and heavier nuclei of galactic cosmic rays: an allowance.

use super::cosmic_rays::CosmicRays;
use super::{Card, Place, Setting, Source, Stream};

pub(super) struct CosmicRayNuclei;

impl Source for CosmicRayNuclei {
    fn card(&self) -> &'static Card {
        &Card {
            name: "cosmic-ray-nuclei",
            what: "helium and heavier nuclei of galactic cosmic rays, as protons that do the same damage",
            law: "0.75 times the protons of cosmic rays, unless environment.nuclei_over_protons says otherwise",
            range: "estimated as 0.5 to 1 times the dose of the protons",
            citation: "an estimate of this project from the share of the flux (12 % helium, 1 % heavier) and damage in proportion to \
                       the square of the charge; abundances: Simpson 1983 (Ann. Rev. Nucl. Part. Sci. 33, 323)",
        }
    }

    fn reaches(&self, place: &Place) -> bool {
        CosmicRays.reaches(place)
    }

    fn streams(&self, setting: &Setting) -> Vec<Stream> {
        let protons = CosmicRays.streams(setting).into_iter();
        protons.map(|stream| Stream { yearly: stream.yearly.times(setting.nuclei_over_protons), ..stream }).collect()
    }

    fn is_modulated(&self) -> bool {
        true
    }

    fn neutrons(&self) -> f64 {
        CosmicRays.neutrons()
    }
}
