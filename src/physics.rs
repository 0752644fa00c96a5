//! The elements of the chain: conditions, dose over time, damage, galaxies and their shapes. [`crate::model`] combines them; each
//! effect ([`crate::effect`]) changes one of them.

pub mod accuracy;
pub mod conditions;
pub mod damage;
pub mod dose_history;
mod dose_warnings;
pub mod galaxy;
pub mod observable;
pub mod shape;
pub mod solar_event_dose;
pub mod source_dose;

pub use damage::{BOLTZMANN_EV_K, Damage, Loss, SpeciesState, release_factor};
pub use dose_history::{DoseHistory, Law, Modulation, RateOrigin};
pub use solar_event_dose::SolarEventDoses;
pub use source_dose::SourceDose;
