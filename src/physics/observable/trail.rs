//! Charge in a pixel behind a lone packet, minus the trailed background, over the packet's charge before transfer.

use super::{Card, Probe, behind};

pub(super) const CARD: Card = Card {
    name: "trail",
    unit: "",
    label: "trail, fraction of the packet",
    requires: &["trail_px", "signal_e"],
    conditions: &[
        "trail_px",
        "signal_e",
        "background_e",
        "transfers",
        "t_yr",
        "dose_mev_g",
        "temperature_k",
        "line_time_ms",
        "preceding_e",
        "preceding_px",
    ],
    probe: Probe::Packet(|charge_e, at| behind(charge_e, at) / at.signal_e.expect("a packet has a charge")),
    least_sigma: 3e-4,
    most: None,
    more: "model's trail too faint",
    less: "model's trail too bright",
};
