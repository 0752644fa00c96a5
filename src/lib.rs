#![doc = include_str!("../README.md")]
#![warn(missing_docs)]

// Left does not know right: a module uses those above it, never those below. `tests/suite/architecture.rs` sees to it, and the
// compiler for the first, a crate of its own.
pub use ctiplan_readout as readout;
pub mod analysis;
pub mod cli;
pub mod effect;
pub mod environment;
pub mod error;
pub mod image;
pub mod io;
pub mod mission;
pub mod mission_file;
pub mod model;
pub mod numeric;
pub mod physics;
pub mod plan;
pub mod report;
pub mod study;
pub mod sweep;
pub mod warning;

pub use plan::evaluate::evaluate;
