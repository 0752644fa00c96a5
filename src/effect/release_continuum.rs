//! Distributions of release times.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Need::Required, key};
use crate::physics::SpeciesState;
use crate::physics::conditions::Conditions;

/// `[effects.release-continuum]`
#[derive(Debug, Deserialize)]
pub struct ReleaseContinuum {
    sigma: f64,
}

impl Catalogued for ReleaseContinuum {
    const CARD: Card = Card {
        kind: "release-continuum",
        adds: "a log-normal distribution of release times about the median of each species",
        physics: "ln τ is normally distributed about ln τ_i with standard deviation sigma. Each trap keeps its release time.",
        source: "Hall et al. 2014 (IEEE TNS 61, 1826): spread of the divacancy's release time from pocket pumping; Nightingale et \
                 al. 2024 (ArCTIc's continuum species)",
        holds: "The same sigma for all species. The spread comes from electric fields and stress, not from temperature.",
        residuals: "The model's trails are too faint both next to the packet and far behind it, and too bright near the \
                    release time. The measured trail is smoother in log-log than a sum of exponentials.",
        keys: &[key(
            "sigma",
            "standard deviation of the logarithm of the release time",
            "",
            Number(0.0, 4.0),
            Required,
        )],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("sigma", 0.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("sigma", 0.5)])
    }

    fn trials(_: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        [0.3, 1.0].map(|sigma| vec![numbers(&[("sigma", sigma)])]).into()
    }
}

impl Effect for ReleaseContinuum {
    fn traps(&self, traps: &mut [SpeciesState], _: &Conditions) -> Result<(), InputError> {
        for species in traps {
            // Independent spreads add in quadrature.
            species.release_sigma = species.release_sigma.hypot(self.sigma);
        }
        Ok(())
    }
}
