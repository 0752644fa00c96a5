//! Cumulative dose since launch, as measured by a monitor beside the detector.

use super::{Card, Probe};

pub(super) const CARD: Card = Card {
    name: "dose",
    unit: "MeV/g",
    label: "dose D [MeV/g]",
    requires: &["t_yr"],
    conditions: &["t_yr"],
    probe: Probe::Dose,
    least_sigma: 2e4,
    most: None,
    more: "model's dose too small",
    less: "model's dose too large",
};
