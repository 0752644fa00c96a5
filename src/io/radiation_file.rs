//! Output of other programs: proton spectra, dose histories, dose-depth curves, shielding by sectors, temperatures, solar events,
//! orbits.
//!
//! The program is recognised by the content of its file, never by the file's name. All files may have Windows line ends, a byte
//! order mark and up to 100 MiB; every error is one message with file, line, column and value. Supported are:
//!
//! * SPENVIS: orbit-averaged fluxes of trapped protons (`spenvis_tri.txt`), mission fluences of solar protons
//!   (`spenvis_sef.txt`), cosmic rays (`spenvis_gcf.txt`);
//! * OMERE: spectra under a header of comments, and the input fluences in its outputs of displacement damage;
//! * CREME96 and CREME-MC: `.flx`, `.tfx` and `.trp`;
//! * ECSV and CSV with columns named here; the only formats for both histories, dose-depth curves and sectors.
//!
//! Not supported are quantities without a mean over the mission (worst days and weeks), other damage than displacement (ionising
//! dose in rad or Gy), and quantities behind other material (LET spectra, equivalent fluences).

mod columns;
mod creme;
mod dose_depth;
mod dose_history;
mod flux;
mod omere;
mod orbit_history;
mod sectors;
mod solar_events;
mod spectrum;
mod spenvis;
mod temperature_history;
mod text;

pub use dose_depth::{DoseDepth, read_dose_depth};
pub use dose_history::{DoseHistoryFile, Times, read_dose_history};
pub use orbit_history::{ElementsRow, OrbitHistoryFile, read_orbit_history};
pub use sectors::{Sectors, read_sectors};
pub(crate) use solar_events::parse_solar_events;
pub use solar_events::{SolarEventRow, SolarEventsFile, read_solar_events};
pub use spectrum::{Program, Quantity, SpectrumFile, Time, read_spectrum};
pub use temperature_history::{TemperatureHistoryFile, read_temperature_history};

/// Displacement damage dose, row by row; not negative.
#[derive(Clone, Debug, PartialEq)]
pub enum Doses {
    /// In MeV/g: since launch in a history, over the mission in a dose-depth curve.
    Total(Vec<f64>),
    /// In MeV/g/yr.
    Rate(Vec<f64>),
}

impl Doses {
    /// The values, in MeV/g or MeV/g/yr.
    pub fn values(&self) -> &[f64] {
        match self {
            Doses::Total(values) | Doses::Rate(values) => values,
        }
    }
}

/// Material in front, row by row; not negative.
#[derive(Clone, Debug, PartialEq)]
pub enum Depths {
    /// Thickness in mm, of a material chosen by the reader of the file.
    ThicknessMm(Vec<f64>),
    /// Areal density in g/cm2.
    ArealDensityGCm2(Vec<f64>),
}

impl Depths {
    /// The values, in mm or g/cm2.
    pub fn values(&self) -> &[f64] {
        match self {
            Depths::ThicknessMm(values) | Depths::ArealDensityGCm2(values) => values,
        }
    }
}
