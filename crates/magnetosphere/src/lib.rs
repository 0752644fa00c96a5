//! Orbit around the Earth → mean spectrum of trapped protons, and the fraction of solar and cosmic protons that arrives.
//!
//! ```text
//! [`orbit`] places and their weights → [`field`] B → [`drift_shell`] (L, B/B0) → [`belt`] AP-8 flux → [`trapped`] mean
//!                                    → [`dipole`] L → [`cutoff`] exposure to solar and cosmic protons
//! ```
//!
//! Lengths are in Earth radii of 6371.2 km, fields in nT, energies in MeV; fluxes are omnidirectional, in cm⁻² s⁻¹. Places are
//! geocentric and rotate with the Earth. The crate imports nothing from the program, as the compiler ensures.

#![forbid(unsafe_code)]

pub mod belt;
pub mod cutoff;
pub mod dipole;
pub mod drift_shell;
pub mod field;
pub mod orbit;
pub mod trapped;

pub use belt::Activity;
pub use cutoff::Exposure;
pub use orbit::Elements;
pub use trapped::{TrappedProtons, trapped_protons};

/// Reference radius (km) of the field models, and unit of length of this crate.
pub const EARTH_RADIUS_KM: f64 = 6371.2;

/// Rows of numbers of a CSV table whose comment lines start with `#` and whose next line names the columns.
fn rows(table: &'static str) -> impl Iterator<Item = Vec<&'static str>> {
    table.lines().filter(|line| !line.starts_with('#')).skip(1).map(|line| line.split(',').collect())
}

/// A number in one of this crate's own tables.
fn number(cell: &str) -> f64 {
    cell.parse().expect("the tables of this crate hold numbers")
}
