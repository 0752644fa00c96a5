//! A supplementary buried channel.

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, Refusal, numbers};
use crate::mission::keys::{self, Allowed::Number, Need::Required, key};
use crate::mission::{Detector, Mission};

/// `[effects.notch]`
#[derive(Debug, Deserialize)]
pub struct Notch {
    notch_e: f64,
}

/// Capacity of a channel that nearly holds a background, relative to that background.
const NEARLY: f64 = 0.97;

impl Catalogued for Notch {
    const CARD: Card = Card {
        kind: "notch",
        adds: "a supplementary buried channel, in which small packets reach no traps",
        physics: "h(n) = ((n − notch_e)/(w − notch_e))^α, and 0 at and below notch_e. It replaces detector.notch_e.",
        source: "Rhodes et al. 2010, equation 1; Seabroke et al. 2013 (MNRAS 430, 3155): Gaia's supplementary buried channels",
        holds: "The channel itself is free of traps.",
        residuals: "The model's losses and trails are too large at small signal_e and small background_e, and correct for \
                    large packets.",
        keys: &[key("notch_e", "charge that the channel holds", "e-", Number(0.0, 1e9), Required)],
    };

    const REPLACES: bool = true;

    fn nothing(mission: &Mission) -> toml::Table {
        numbers(&[("notch_e", mission.detector.notch_e)])
    }

    fn example(mission: &Mission) -> toml::Table {
        numbers(&[("notch_e", mission.detector.notch_e + 60.0)])
    }

    fn trials(mission: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        // From below the background, which behaves differently when it sinks into the channel, to half of the brightest.
        let [least_e, brightest_e] = reach.charge_e.unwrap_or([mission.sky.background_e, 1e4]);
        let highest_e = (0.5 * brightest_e).min(0.5 * mission.detector.full_well_e);
        let lowest_e = (0.25 * least_e).max(0.3).min(0.5 * highest_e);
        let count = (highest_e / lowest_e).log(2.5).ceil() as usize + 1;
        let deeper = ratios(lowest_e, highest_e, count).map(|notch_e| mission.detector.notch_e + notch_e);
        // A channel that nearly holds a background affects its small packets far more than a slightly smaller or larger one.
        let own_e = mission.detector.notch_e;
        let nearly =
            reach.backgrounds_e.iter().map(|background_e| NEARLY * background_e).filter(|notch_e| *notch_e > own_e);
        deeper.chain(nearly).map(|notch_e| vec![numbers(&[("notch_e", notch_e)])]).collect()
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        let full_well_e = mission.detector.full_well_e;
        if self.notch_e < full_well_e {
            return Ok(());
        }
        let [notch, well] = [self.notch_e, full_well_e].map(keys::plain);
        let problem = format!("the notch ({notch} e-) must be below the full well ({well} e-)");
        Err(Refusal { key: "notch_e".into(), problem, help: None })
    }
}

impl Effect for Notch {
    fn detector(&self, detector: &mut Detector) {
        detector.notch_e = self.notch_e;
    }
}
