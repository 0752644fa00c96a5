//! Any keys of a mission over lists, ranges and distributions: thousands of points, computed on several machines and resumed after
//! an interruption.
//!
//! A grid file ([`Grid`]) states the missions, the keys, and the recorded quantities. A point is a function of the grid file and
//! its number only, so it does not matter who computes it, in which order, or how often. Points are computed in chunks, and each
//! chunk is a separate file ([`Parts`]) that is written completely or not at all: the missing ones are known from the files. When
//! all are present they become one table, Parquet or CSV.

mod distribution;
mod grid;
mod merge;
mod output;
#[cfg(feature = "parquet")]
mod parquet;
mod parts;
mod point;
mod run;
mod slurm;
mod write;

pub use crate::numeric::sample_points::{Sample, Sampling};
pub use distribution::Distribution;
pub use grid::{Axis, Grid, Holds, MOST_POINTS, Values};
pub use merge::{Merged, Spread, collect};
pub use output::{Output, Undefined};
pub use parts::Parts;
pub use run::{Done, run};
#[cfg(feature = "cli")]
pub(crate) use slurm::quoted;
pub use slurm::{Shard, indices, missing, script};
