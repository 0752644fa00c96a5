#![doc = include_str!("../README.md")]

// A module uses those above it, never those below. `tests/suite/architecture.rs` checks this, and for the readout, a crate of its own,
// the compiler does. See docs/architecture.md.

// Image and traps → image with trails.
pub use ctiplan_readout as readout;

// General tools: error messages, numerics and dates, files.
pub mod error;

pub mod numeric;

pub mod io;

// The Sun, the shield, damage by protons; warnings.
pub mod environment;

pub mod warning;

// The content of a mission file; dose, traps, galaxies and shapes; what effects change in them; reading the file.
pub mod mission;

pub mod physics;

pub mod effect;

pub mod mission_file;

// The whole chain, assembled in one place; the planner's questions to it.
pub mod model;

pub mod plan;

// Measurements → residuals → fit → the missing effect.
pub mod analysis;

// Applications of the chain: frames, measurements on them, trade studies, sweeps.
pub mod image;

pub mod measure;

pub mod study;

pub mod sweep;

// Text, tables and figures; the command line.
pub mod report;

#[cfg(feature = "cli")]
pub mod cli;

pub use plan::evaluate::evaluate;
