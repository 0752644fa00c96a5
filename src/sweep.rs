//! Any keys of a mission over lists, ranges and distributions: thousands of points, that outlive a kill and spread over
//! machines.
//!
//! A grid file ([`Grid`]) says which missions, which keys, and what is recorded. A point is a function of the grid file and
//! its number alone, so that it does not matter who computes it, in which order, or how often. Points are computed in
//! chunks, and each chunk is a file of its own ([`Parts`]) that is there whole or not at all: what is missing is known by
//! looking at the files. When all are there they become one table, Parquet or CSV.

mod distribution;
mod grid;
mod merge;
mod output;
mod parts;
mod point;
mod run;
mod slurm;
mod write;

pub use crate::numeric::sample_points::{Sample, Sampling};
pub use distribution::Distribution;
pub use grid::{Axis, Grid, Holds, MOST_POINTS, Values};
pub use merge::{Merged, Spread, collect};
pub use output::Output;
pub use parts::Parts;
pub use run::{Done, run};
pub(crate) use slurm::quoted;
pub use slurm::{Shard, indices, missing, script};
