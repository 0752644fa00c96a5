//! Traps per pixel: for the species named in a row, or for all together.

use super::{Card, Probe};

pub(super) const CARD: Card = Card {
    name: "trap_density",
    unit: "",
    label: "traps per pixel ρ",
    requires: &[],
    conditions: &["t_yr", "dose_mev_g", "temperature_k"],
    probe: Probe::Traps,
    least_sigma: 1e-3,
    most: None,
    more: "model has too few traps",
    less: "model has too many traps",
};
