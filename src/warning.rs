//! Things seen that are not errors: what was seen, why it matters, what to try.

use std::fmt;

use serde::ser::{Serialize, Serializer};

use crate::environment::solar_cycle::{CYCLE_YR, Maximum};

/// Release times below so many line times are released in place ([`Warning::ReleasesInPlace`]).
///
/// A packet leaves a pixel by way of the pixel's phases, three of them in most CCDs, one in each third of a line time Δt. An
/// electron that its trap releases meanwhile falls back into the packet: of a species with release time τ the share
/// 1 − exp(−Δt/3τ), 96 % at τ = Δt/10. A transfer that is one step gives all of them to the packet behind instead.
pub const RELEASED_IN_PLACE_LINES: f64 = 0.1;

/// Something doubtful about a result.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// The mission flies through active years of the Sun that are not known yet.
    SunExtrapolated {
        /// Maxima that are assumed.
        maxima: Vec<Maximum>,
    },
    /// A species holds charge for longer than the whole readout takes.
    NeverReleases {
        /// Name of the species.
        species: String,
        /// Its release time over the time of all transfers.
        over_readout: f64,
    },
    /// A species releases long before the packet moves on.
    ReleasesInPlace {
        /// Name of the species.
        species: String,
        /// Its release time over the time between two transfers.
        over_line: f64,
    },
    /// A pixel holds more than the full well.
    Saturated {
        /// What it is a pixel of.
        name: String,
        /// Its charge, e-.
        peak_e: f64,
    },
    /// The dose of solar protons is shown for an orbit that they do not reach unhindered.
    ShieldedByField,
    /// The readout has random traps, and this is one set of them.
    OneSetOfTraps,
    /// The accuracy of the readout is coarser than the requirement can bear.
    CoarseAccuracy {
        /// `[accuracy] relative`.
        relative: f64,
    },
    /// A frame's header says that the same was done to it before.
    DoneBefore {
        /// The frame.
        name: String,
        /// What was done.
        task: &'static str,
    },
    /// A FITS file goes on after its last HDU.
    AfterLastHdu {
        /// Bytes that were copied.
        bytes: u64,
    },
    /// Packets were emptied on the way, and a correction cannot tell what they held.
    UncertainPixels {
        /// The frame.
        name: String,
        /// Number of pixels.
        pixels: usize,
        /// Error that they may have more than, e-.
        error_e: f64,
        /// The extension in which they are marked.
        marked: String,
    },
    /// A correction has left more than was asked for.
    NotCorrected {
        /// The frame.
        name: String,
        /// Largest residual that is left, e-.
        max_e: f64,
        /// Largest residual before the correction, e-.
        of_e: f64,
    },
}

/// Warnings of several missions, each said once; what is extrapolated for any of them is said together.
pub fn together<'a>(warnings: impl IntoIterator<Item = &'a Warning>) -> Vec<Warning> {
    let mut maxima: Vec<Maximum> = Vec::new();
    let mut others: Vec<Warning> = Vec::new();
    for warning in warnings {
        match warning {
            Warning::SunExtrapolated { maxima: more } => maxima.extend(more),
            other if !others.contains(other) => others.push(other.clone()),
            _ => {}
        }
    }
    maxima.sort_by(|a, b| a.year.total_cmp(&b.year));
    maxima.dedup();
    let sun = (!maxima.is_empty()).then_some(Warning::SunExtrapolated { maxima });
    sun.into_iter().chain(others).collect()
}

/// As people read it.
impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::SunExtrapolated { maxima } => {
                let years: Vec<String> =
                    maxima.iter().map(|maximum| format!("{:.1} +- {:.1}", maximum.year, maximum.sigma_yr())).collect();
                let (be, s) = if years.len() == 1 { ("is", "um") } else { ("are", "a") };
                write!(
                    out,
                    "the solar maxim{s} {} {be} extrapolated at the mean cycle of {CYCLE_YR} yr: the dose then is that of a Sun \
                     that nobody knows yet; better dates go into environment.solar_maximum",
                    years.join(", ")
                )
            }
            Warning::Saturated { name, peak_e } => write!(
                out,
                "{name} puts {peak_e:.3e} e- into a pixel, more than the full well: a cloud is then as high as it gets, and \
                 what overflows is not modelled"
            ),
            Warning::ShieldedByField => write!(
                out,
                "solar protons do not reach a low Earth orbit unhindered: the ESP figures hold outside the magnetosphere"
            ),
            Warning::OneSetOfTraps => write!(
                out,
                "accuracy.readout = \"monte-carlo\" reads out through one set of random traps: its scatter is in every \
                 figure, the verdict's too; compare several values of accuracy.seed"
            ),
            Warning::NeverReleases { species, over_readout } => write!(
                out,
                "{species} releases after {over_readout:.3e} readouts: its traps stay filled from one exposure to the \
                 next, which is not modelled (traps start empty)"
            ),
            Warning::ReleasesInPlace { species, over_line } => write!(
                out,
                "{species} releases after {over_line:.3e} line times, before its packet has left the pixel: in a CCD nearly \
                 all of these electrons return to their own packet; here, where a transfer is one step, they go to the \
                 packet behind, which makes the trail of {species} too strong: leave the species out"
            ),
            Warning::DoneBefore { name, task } => {
                write!(out, "the header of {name} says that `ctiplan {task}` was done to it before: it is done again")
            }
            Warning::AfterLastHdu { bytes } => write!(
                out,
                "{bytes} bytes after the last HDU do not start with XTENSION: they are copied, and no image is looked for there"
            ),
            Warning::UncertainPixels { name, pixels, error_e, marked } => write!(
                out,
                "{pixels} pixels of {name} are uncertain by more than {error_e:.3e} e-: their packets, or some ahead of them, \
                 were emptied into traps, and the frame does not tell what those held; they are marked in the extension \
                 {marked}"
            ),
            Warning::NotCorrected { name, max_e, of_e } => write!(
                out,
                "the correction of {name} leaves up to {max_e:.3e} e- of {of_e:.3e} e- that the forward model moves: allow \
                 more --iterations, compute finer with --relative, or ask for less with --tolerance; faint pixels without \
                 a sky settle slowly"
            ),
            Warning::CoarseAccuracy { relative } => {
                write!(out, "accuracy.relative = {relative} may show in the shapes: 1e-6 costs little more")
            }
        }
    }
}
