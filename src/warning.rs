//! Things seen that are not errors: what was seen, why it matters, what to try.

use std::fmt;

/// Something doubtful about a result.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// The mission lasts longer than the list of solar maxima tells.
    BeyondSolarMaxima {
        /// Last maximum of the list, decimal year.
        last: f64,
        /// Until when the list tells what is active, decimal year.
        known_until: f64,
    },
    /// A species holds charge for longer than the whole readout takes.
    NeverReleases {
        /// Name of the species.
        species: String,
        /// Its release time over the time of all transfers.
        over_readout: f64,
    },
    /// The accuracy of the readout is coarser than the requirement can bear.
    CoarseAccuracy {
        /// `[accuracy] relative`.
        relative: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::BeyondSolarMaxima { last, known_until } => write!(
                out,
                "the last solar maximum in the list is {last:.1}: years after {known_until:.1} count as quiet; add later \
                 maxima to environment.solar_maximum"
            ),
            Warning::NeverReleases { species, over_readout } => write!(
                out,
                "{species} releases after {over_readout:.1} readouts: its traps stay filled from one exposure to the \
                 next, which is not modelled (traps start empty)"
            ),
            Warning::CoarseAccuracy { relative } => {
                write!(out, "accuracy.relative = {relative} may show in the shapes: 1e-6 costs little more")
            }
        }
    }
}
