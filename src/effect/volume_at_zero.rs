//! Part of the well that any charge fills.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::keys::{FRACTION, Key, Need::Required, key, percentage};
use crate::mission::{Detector, Mission};

/// `[effects.volume-at-zero]`
#[derive(Debug, Deserialize)]
pub struct VolumeAtZero {
    fraction: f64,
}

impl Catalogued for VolumeAtZero {
    const CARD: Card = Card {
        kind: "volume-at-zero",
        adds: "a fraction of the well that any charge fills, however small the packet",
        physics: "h(n) = a + (1 − a) ((n − d)/(w − d))^α for n > 0 with a = fraction: h = a at and below the notch d, and 0 \
                  without charge. It replaces detector.volume_at_zero.",
        source: "Clarke et al. 2012: the volume of the cloud is V = a + c n^β, with a = 0.89, 0.09 and 0.51 of the well in \
                 three directions of clocking",
        holds: "The same for all species. Traps in that part of the well are always full behind a background.",
        residuals: "Without background, the model's losses and trails are too small, most of all at small signal_e. With \
                    background they are too large by the same factor at every signal_e, as with fewer traps.",
        keys: &[Key {
            help: percentage,
            ..key("fraction", "fraction of the well that any charge fills", "", FRACTION, Required)
        }],
    };

    const REPLACES: bool = true;

    fn nothing(mission: &Mission) -> toml::Table {
        numbers(&[("fraction", mission.detector.volume_at_zero)])
    }

    fn example(mission: &Mission) -> toml::Table {
        more(mission, 0.1)
    }

    fn trials(mission: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        [0.01, 0.3].map(|share| vec![more(mission, share)]).into()
    }
}

/// A further share of the rest of the well.
fn more(mission: &Mission, share: f64) -> toml::Table {
    let known = mission.detector.volume_at_zero;
    numbers(&[("fraction", known + share * (0.999 - known))])
}

impl Effect for VolumeAtZero {
    fn detector(&self, detector: &mut Detector) {
        detector.volume_at_zero = self.fraction;
    }
}
