//! Extended pixel edge response: charge in a pixel behind a flat block, minus the trailed background.

use super::{Card, Probe, behind};

pub(super) const CARD: Card = Card {
    name: "eper",
    unit: "e-",
    label: "charge behind the block [e⁻]",
    requires: &["trail_px", "signal_e", "block_px"],
    conditions: &[
        "trail_px",
        "signal_e",
        "background_e",
        "block_px",
        "transfers",
        "t_yr",
        "dose_mev_g",
        "temperature_k",
        "line_time_ms",
        "preceding_e",
        "preceding_px",
    ],
    probe: Probe::Block(behind),
    least_sigma: 2.0,
    most: None,
    more: "model's trail too faint",
    less: "model's trail too bright",
};
