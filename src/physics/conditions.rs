//! Conditions of a measurement or a prediction.

mod stated;

use crate::mission::Mission;
pub use stated::{Stated, UnderMission};

/// Conditions of one value: those given in a row of a measurement file, otherwise those of the mission.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditions {
    /// Years since launch; since the irradiation if a dose was given in a laboratory.
    pub t_yr: f64,
    /// Dose given at once at t = 0 (MeV/g), in place of the mission's D(t).
    pub dose_mev_g: Option<f64>,
    /// Temperature of the detector, K.
    pub temperature_k: f64,
    /// Time between two parallel transfers, ms.
    pub line_time_ms: f64,
    /// Background, e- per pixel.
    pub background_e: f64,
    /// Parallel transfers of the packet, of the last row of a block, or of the galaxy's central row.
    pub transfers: u32,
    /// Charge of the packet, or of each row of a block, above the background before transfer, e-.
    pub signal_e: Option<f64>,
    /// The same as read, e-, if only that is known: the charge before transfer follows from the model.
    pub signal_read_e: Option<f64>,
    /// Charge of another packet nearer to the register, above the background before transfer, e-.
    pub preceding_e: Option<f64>,
    /// Rows by which that packet precedes the packet, or the first row of the block.
    pub preceding_px: Option<u32>,
    /// Pixel behind the packet or block; 1 is next to it.
    pub trail_px: Option<u32>,
    /// Rows of a block.
    pub block_px: Option<u32>,
    /// First of several pixels behind a block; 1 is next to it.
    pub first_px: Option<u32>,
    /// Last of them.
    pub last_px: Option<u32>,
    /// Time of one phase of trap pumping, ms.
    pub phase_time_ms: Option<f64>,
    /// Cycles of trap pumping.
    pub pumping_cycles: Option<f64>,
    /// Numeric columns unknown to the model, by name; formulas may use them.
    pub covariates: Vec<(String, f64)>,
}

/// Names of the numeric conditions.
pub const NAMES: [&str; 16] = [
    "t_yr",
    "dose_mev_g",
    "temperature_k",
    "line_time_ms",
    "background_e",
    "transfers",
    "signal_e",
    "signal_read_e",
    "preceding_e",
    "preceding_px",
    "trail_px",
    "block_px",
    "first_px",
    "last_px",
    "phase_time_ms",
    "pumping_cycles",
];

/// Conditions that are those of the mission unless a row states them, each with the key that it mirrors.
pub const MIRRORED: [(&str, &str); 4] = [
    ("temperature_k", "detector.temperature_k"),
    ("line_time_ms", "readout.line_time_ms"),
    ("background_e", "sky.background_e"),
    ("transfers", "readout.transfers"),
];

impl Conditions {
    /// The same without time, dose and covariates.
    pub fn but_for_dose(&self) -> Conditions {
        Conditions { t_yr: 0.0, dose_mev_g: None, covariates: Vec::new(), ..self.clone() }
    }

    /// The conditions of a mission's own exposures at a time (years since launch).
    pub fn of(mission: &Mission, t_yr: f64) -> Conditions {
        Conditions {
            t_yr,
            dose_mev_g: None,
            temperature_k: mission.temperature_k(t_yr),
            line_time_ms: mission.readout.line_time_ms,
            background_e: mission.sky.background_e,
            transfers: mission.readout.transfers,
            signal_e: None,
            signal_read_e: None,
            preceding_e: None,
            preceding_px: None,
            trail_px: None,
            block_px: None,
            first_px: None,
            last_px: None,
            phase_time_ms: None,
            pumping_cycles: None,
            covariates: Vec::new(),
        }
    }

    /// Whether a condition is a number of pixels or transfers.
    pub fn is_whole(name: &str) -> bool {
        name == "transfers" || name.ends_with("_px")
    }

    /// The same with one condition changed; None if there is no such condition.
    pub fn with(&self, name: &str, value: f64) -> Option<Conditions> {
        let mut other = self.clone();
        other.set(name, value).then_some(other)
    }

    /// Changes one condition; false if there is no such condition.
    fn set(&mut self, name: &str, value: f64) -> bool {
        let whole = Some(value.round() as u32);
        match name {
            "t_yr" => self.t_yr = value,
            "dose_mev_g" => self.dose_mev_g = Some(value),
            "temperature_k" => self.temperature_k = value,
            "line_time_ms" => self.line_time_ms = value,
            "background_e" => self.background_e = value,
            "transfers" => self.transfers = value.round() as u32,
            "signal_e" => self.signal_e = Some(value),
            "signal_read_e" => self.signal_read_e = Some(value),
            "preceding_e" => self.preceding_e = Some(value),
            "preceding_px" => self.preceding_px = whole,
            "trail_px" => self.trail_px = whole,
            "block_px" => self.block_px = whole,
            "first_px" => self.first_px = whole,
            "last_px" => self.last_px = whole,
            "phase_time_ms" => self.phase_time_ms = Some(value),
            "pumping_cycles" => self.pumping_cycles = Some(value),
            _ => return false,
        }
        true
    }

    /// A condition or a covariate by its name.
    pub fn get(&self, name: &str) -> Option<f64> {
        match name {
            "t_yr" => Some(self.t_yr),
            "dose_mev_g" => self.dose_mev_g,
            "temperature_k" => Some(self.temperature_k),
            "line_time_ms" => Some(self.line_time_ms),
            "background_e" => Some(self.background_e),
            "transfers" => Some(f64::from(self.transfers)),
            "signal_e" => self.signal_e,
            "signal_read_e" => self.signal_read_e,
            "preceding_e" => self.preceding_e,
            "preceding_px" => self.preceding_px.map(f64::from),
            "trail_px" => self.trail_px.map(f64::from),
            "block_px" => self.block_px.map(f64::from),
            "first_px" => self.first_px.map(f64::from),
            "last_px" => self.last_px.map(f64::from),
            "phase_time_ms" => self.phase_time_ms,
            "pumping_cycles" => self.pumping_cycles,
            _ => self.covariates.iter().find(|(known, _)| known == name).map(|(_, value)| *value),
        }
    }
}
