#![doc = include_str!("../README.md")]
#![warn(missing_docs)]

// Left does not know right: a module uses those above it, never those below. `tests/suite/architecture.rs` sees to it, and for
// the readout the compiler, since it is a crate of its own. See docs/architecture.md.

// Image and traps → image with trails.
pub use ctiplan_readout as readout;

// What any program needs: refusals, numbers and dates, files.
pub mod error;

pub mod numeric;

pub mod io;

// The Sun, the shield, damage by protons; what is doubtful about results.
pub mod environment;

pub mod warning;

// What a mission file says; dose, traps, galaxies and shapes; what effects change of them; reading the file.
pub mod mission;

pub mod physics;

pub mod effect;

pub mod mission_file;

// The chain, put together in one place; what a planner asks it.
pub mod model;

pub mod plan;

// Measurements → residuals → fit → the effect that is missing.
pub mod analysis;

// What stands on the chain: frames, measurements on them, trade studies, sweeps.
pub mod image;

pub mod measure;

pub mod study;

pub mod sweep;

// Words, tables, figures; the command line.
pub mod report;

pub mod cli;

pub use plan::evaluate::evaluate;
