//! A mission's plan: dose year by year, change of shape against time, when the requirement is exceeded, and a comparison of
//! missions. All of it is computed with a [`Model`](crate::model::Model).

pub mod assessment;
pub mod catalogue;
pub mod compliance;
pub mod curve;
pub mod date_distribution;
pub mod dose;
pub mod draws;
pub mod evaluate;
pub mod flown;
pub mod judgement;
pub mod mission_sample;
pub mod noise;
pub mod population;
pub mod progress;
pub mod scenario;
pub mod sources;
pub mod time_series;
pub mod verdict;
