//! Charge read in a lone packet's own pixel, minus the trailed background.

use super::{Card, Probe};

pub(super) const CARD: Card = Card {
    name: "packet_charge",
    unit: "e-",
    label: "charge read [e⁻]",
    requires: &["signal_e"],
    conditions: &[
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
    probe: Probe::Packet(|charge_e, _| charge_e[0]),
    least_sigma: 2.0,
    most: None,
    more: "model loses too much charge",
    less: "model loses too little charge",
};
