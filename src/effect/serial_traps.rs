//! Trailing along the serial register.

use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, SerialRegister, numbers};
use crate::mission::keys::{self, Allowed::Integer, Allowed::Number, Need::Optional, Need::Required, key};
use crate::mission::{Mission, Species};

/// `[effects.serial-traps]`
#[derive(Debug, Deserialize)]
pub struct SerialTraps {
    traps: Vec<Species>,
    pixel_time_ms: f64,
    transfers: u32,
}

impl Catalogued for SerialTraps {
    const CARD: Card = Card {
        kind: "serial-traps",
        adds: "trailing along the serial register, by the same physics with the axes exchanged",
        physics: "After the parallel transfers each row makes `transfers` transfers of pixel_time_ms through the species of \
                  [[effects.serial-traps.traps]]. Their densities increase with dose like those of the pixels. Packets are \
                  alone in their rows, blocks fill their rows evenly, and galaxies are read out as they are.",
        source: "Rhodes et al. 2010, section 3 (rotate and repeat); Massey et al. 2014 on serial CTI in ACS",
        holds: "The wells of the serial register are as deep as those of the pixels. Charge trailed across columns is lost \
                from a packet and from its parallel trail. Data determine only the density times the number of transfers. A \
                search assumes 1000 transfers, each with a thousandth of the line time.",
        residuals: "Measured values of packet_charge are smaller than the model's, at all numbers of (parallel) transfers. \
                    Measured shapes are elongated along x, which makes delta_e1 more positive.",
        keys: &[
            key(
                "pixel_time_ms",
                "time between two serial transfers",
                "ms",
                keys::Allowed::Positive(0.0, 1e7),
                Required,
            ),
            key("transfers", "number of serial transfers", "", Integer(1, 100_000), Required),
            key("traps[].name", "name of the species", "", keys::Allowed::Text, Required),
            key(
                "traps[].density_per_px",
                "trap density at the reference dose",
                "per pixel",
                Number(0.0, 1e4),
                Required,
            ),
            key("traps[].release_ms", "release time", "ms", keys::Allowed::Positive(0.0, 1e12), Required),
            key("traps[].energy_ev", "energy level below the band", "eV", Number(0.0, 1.2), Required),
            key(
                "traps[].well_fill_power",
                "well fill power of this species, in place of the detector's",
                "",
                keys::Allowed::Positive(0.0, 5.0),
                Optional,
            ),
        ],
    };

    fn nothing(mission: &Mission) -> toml::Table {
        with(mission, 0.0, 0.003 * mission.readout.line_time_ms)
    }

    fn example(mission: &Mission) -> toml::Table {
        with(mission, 0.5, 0.003 * mission.readout.line_time_ms)
    }

    fn trials(mission: &Mission, _: &Reach) -> Vec<Vec<toml::Table>> {
        let pixel_time_ms = mission.readout.line_time_ms / 1000.0;
        let slow = ratios(0.3, 3000.0, 6).map(|transfers| transfers * pixel_time_ms);
        slow.map(|release_ms| vec![with(mission, 0.5, release_ms)]).collect()
    }

    fn held(_: &Reach) -> &'static [&'static str] {
        &["pixel_time_ms", "energy_ev"]
    }
}

fn with(mission: &Mission, density_per_px: f64, release_ms: f64) -> toml::Table {
    let pixel_time_ms = mission.readout.line_time_ms / 1000.0;
    let mut table = numbers(&[("pixel_time_ms", pixel_time_ms)]);
    table.insert("transfers".into(), 1000.into());
    let mut species = numbers(&[("density_per_px", density_per_px), ("release_ms", release_ms), ("energy_ev", 0.2)]);
    species.insert("name".into(), "serial".into());
    table.insert("traps".into(), vec![toml::Value::Table(species)].into());
    table
}

impl Effect for SerialTraps {
    fn serial(&self) -> Option<SerialRegister> {
        Some(SerialRegister { traps: self.traps.clone(), pixel_time_ms: self.pixel_time_ms, transfers: self.transfers })
    }
}
