//! A different exponent of the charge cloud's height.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::mission::keys::{self, Need::Required, key};
use crate::mission::{Detector, Mission};

/// `[effects.well-fill]`
#[derive(Debug, Deserialize)]
pub struct WellFill {
    well_fill_power: f64,
}

impl Catalogued for WellFill {
    const CARD: Card = Card {
        kind: "well-fill",
        adds: "a different well fill power of the charge cloud",
        physics: "h(n) = ((n − d)/(w − d))^well_fill_power. It replaces detector.well_fill_power.",
        source: "Rhodes et al. 2010, equation 1; Massey et al. 2010 (MNRAS 401, 371), equation 1",
        holds: "The same for all species. An incomplete model mimics it: separate exponents for each species seem \
                significant if recapture is neglected.",
        residuals: "Losses and trails have a residual trend against signal_e at every trail_px: the model is too small at \
                    one end and too large at the other.",
        keys: &[key("well_fill_power", "well fill power", "", keys::Allowed::Positive(0.0, 5.0), Required)],
    };

    const REPLACES: bool = true;

    fn nothing(mission: &Mission) -> toml::Table {
        numbers(&[("well_fill_power", mission.detector.well_fill_power)])
    }

    fn example(mission: &Mission) -> toml::Table {
        numbers(&[("well_fill_power", 1.3 * mission.detector.well_fill_power)])
    }

    fn trials(mission: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        let power = mission.detector.well_fill_power;
        [0.97, 1.03].map(|factor| vec![numbers(&[("well_fill_power", (factor * power).min(5.0))])]).into()
    }
}

impl Effect for WellFill {
    fn detector(&self, detector: &mut Detector) {
        detector.well_fill_power = self.well_fill_power;
    }
}
