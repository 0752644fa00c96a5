//! Clock phases: electrons that return to the packet that has just left.

use serde::Deserialize;

use super::{Card, Catalogued, Effect, Reach, Refusal, numbers};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission::keys::{Allowed::Number, Key, Need::Required, key};
use crate::physics::conditions::Conditions;
use crate::readout::Clock;

/// `[effects.clocking]`
#[derive(Debug, Deserialize)]
pub struct Clocking {
    return_share: f64,
}

impl Catalogued for Clocking {
    const CARD: Card = Card {
        kind: "clocking",
        adds: "clock phases: part of the released electrons return to their own packet",
        physics: "A trap that releases within return_share of a line time after its packet has left gives the electron back to \
                  that packet; later, to the next one. So 1 − exp(−return_share · line_time_ms/τ) of a species leaves no trail. \
                  A pixel of P phases that hold the packet in turn has return_share = (1 − 1/P)/2: 1/3 for three phases. The \
                  share is taken from the time that a packet is over a trap, of the clock in [readout.clock] if there is one.",
        source: "geometry of the clock phases, derived for ctiplan and compared with a program that follows every step of the clock",
        holds: "The same for traps below all phases. To first order each species acts as if it had fewer traps, by the factor \
                exp(−return_share · line_time_ms/τ): data of one line time and one temperature do not distinguish that from other \
                densities. If the phases are known, give them in [readout.clock].",
        residuals: "Losses and trails are too large for the species with the shortest release times, and more so at a longer \
                    line_time_ms and a higher temperature_k.",
        keys: &[Key {
            help: |share| (share > 0.5).then(|| "half of the line time at most: (1 − 1/P)/2 for P phases".into()),
            ..key(
                "return_share",
                "share of the line time in which released electrons return to their packet",
                "",
                Number(0.0, 0.5),
                Required,
            )
        }],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("return_share", 0.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("return_share", 1.0 / 3.0)])
    }

    fn check(&self, mission: &Mission) -> Result<(), Refusal> {
        if self.return_share == 0.0 || mission.persistence().is_none() {
            return Ok(());
        }
        Err(Refusal {
            key: "return_share".into(),
            problem: "traps that keep charge into the next exposure are modelled in a clock of one phase".into(),
            help: Some("remove [survey.persistence], or set return_share = 0".into()),
        })
    }

    fn trials(_: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        // Species much faster than the line vanish at once; others change gradually.
        [0.02, 0.2].map(|share| vec![numbers(&[("return_share", share)])]).into()
    }
}

impl Effect for Clocking {
    fn clock(&self, clock: &mut Clock, _: &Conditions) -> Result<(), InputError> {
        *clock = clock.with_return(self.return_share);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;

    #[test]
    fn a_third_of_the_line_is_a_clock_of_three_phases() {
        let plain = include_str!("../../missions/snap_l2.toml");
        let after = |text: &str| {
            let mission = Mission::parse(&format!("{plain}\n{text}")).unwrap();
            Model::new(&mission).change(0, 5.0).unwrap().unwrap().delta_e1
        };
        let [none, phases, effect] =
            ["", "[readout.clock]\nphases = 3", "[effects.clocking]\nreturn_share = 0.3333333333"].map(after);
        assert!((effect - phases).abs() < 1e-8 * phases.abs(), "{effect}, {phases}");
        assert!(phases.abs() < 0.95 * none.abs(), "{phases}, {none}");
    }
}
