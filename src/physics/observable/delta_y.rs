//! Change of a galaxy's centroid along y, positive away from the register.

use super::{Card, Probe};

pub(super) const CARD: Card = Card {
    name: "delta_y",
    unit: "px",
    label: "Δy [px]",
    requires: &["galaxy"],
    conditions: &["transfers", "background_e", "t_yr", "dose_mev_g", "temperature_k", "line_time_ms"],
    probe: Probe::Galaxy(|change| &mut change.delta_y_px),
    least_sigma: 1e-3,
    most: None,
    more: "model's change of shape too small",
    less: "model's change of shape too large",
};
