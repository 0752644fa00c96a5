//! Charge transfer inefficiency: the fraction of charge lost in a transfer.
//!
//! For a lone packet with charge S before and S' after n transfers: 1 − (S'/S)^(1/n), as measured with X-ray lines of known energy.
//! For an edge (a row gives `block_px`, `first_px` and `last_px`): the charge in those pixels behind it, over n S, as measured by
//! the extended pixel edge response (Janesick 2001, Scientific Charge-Coupled Devices, section 5.2).

use super::{Card, Probe};
use crate::physics::conditions::Conditions;

pub(super) const CARD: Card = Card {
    name: "cti",
    unit: "",
    label: "CTI per transfer",
    requires: &["signal_e"],
    conditions: &[
        "signal_e",
        "background_e",
        "transfers",
        "block_px",
        "first_px",
        "last_px",
        "t_yr",
        "dose_mev_g",
        "temperature_k",
        "line_time_ms",
        "preceding_e",
        "preceding_px",
    ],
    probe: Probe::PacketOrBlock { packet: of_packet, block: of_edge },
    least_sigma: 1e-7,
    most: Some(0.5),
    more: "model loses too little charge",
    less: "model loses too much charge",
};

fn of_packet(charge_e: &[f64], at: &Conditions) -> f64 {
    let signal_e = at.signal_e.expect("a packet has a charge");
    1.0 - (charge_e[0].max(0.0) / signal_e).powf(1.0 / f64::from(at.transfers))
}

fn of_edge(charge_e: &[f64], at: &Conditions) -> f64 {
    let (first, last) = (at.first_px.expect("a first pixel") as usize, at.last_px.expect("a last pixel") as usize);
    let signal_e = at.signal_e.expect("a block has a charge");
    charge_e[first..=last].iter().sum::<f64>() / (signal_e * f64::from(at.transfers))
}
