#![doc = include_str!("../README.md")]
#![warn(missing_docs)]

// In the order of the chain: left does not know right.
pub mod accuracy;
pub mod calendar;
pub mod conditions;
pub mod effect;
pub mod environment;
pub mod error;
pub mod evaluate;
pub mod expression;
pub mod galaxy;
pub mod mission;
pub mod model;
pub mod observable;
pub mod predict;
pub mod readout;
pub mod requirement;
pub mod shape;
pub mod warning;
// What stands on the chain.
pub mod cli;
pub mod course;
pub mod diagnose;
pub mod dose;
pub mod file_argument;
pub mod fit;
pub mod image;
pub mod measurement;
pub mod noise;
pub mod output;
pub mod plot;
pub mod report;
pub mod scenario;
pub mod sources;
pub mod study;
pub mod sweep;
pub mod table;
pub mod validate;

mod input;
mod least_squares;
mod root;

pub use evaluate::evaluate;
