//! Numbers and dates: general numerical tools, independent of CCDs.

pub mod aliases;
pub(crate) mod autocorrelation;
pub mod calendar;
pub mod estimate;
pub mod expression;
pub(crate) mod least_squares;
pub(crate) mod minimum;
pub mod parallel;
pub(crate) mod polynomial;
pub mod range;
pub(crate) mod recent;
pub(crate) mod root_finding;
pub mod sample_points;
