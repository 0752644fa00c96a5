//! Change of a galaxy's weighted flux, as a fraction of it.

use super::{Card, Probe};

pub(super) const CARD: Card = Card {
    name: "delta_flux",
    unit: "",
    label: "ΔF/F",
    requires: &["galaxy"],
    conditions: &["transfers", "background_e", "t_yr", "dose_mev_g", "temperature_k", "line_time_ms"],
    probe: Probe::Galaxy(|change| &mut change.delta_flux),
    least_sigma: 3e-5,
    most: None,
    more: "model's change of shape too small",
    less: "model's change of shape too large",
};
