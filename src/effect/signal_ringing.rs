//! The amplifier's ringing behind a packet.

use ndarray::Array2;
use serde::Deserialize;

use super::reach::ratios;
use super::signal_bounce::add_trail;
use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission::keys::{self, Allowed::Number, Key, Need::Required, key};
use crate::physics::conditions::Conditions;

/// `[effects.signal-ringing]`
#[derive(Debug, Deserialize)]
pub struct SignalRinging {
    fraction: f64,
    length_px: f64,
    period_px: f64,
}

impl Catalogued for SignalRinging {
    const CARD: Card = Card {
        kind: "signal-ringing",
        adds: "a damped oscillation of the amplifier behind every packet, independent of the number of transfers",
        physics: "Pixel k behind a packet shows, in addition, fraction exp(−(k − 1)/length_px) cos(2 pi (k − 1)/period_px) times \
                  the packet. Blocks and images are sums of packets. The charge of a packet is that before transfer.",
        source: "the step response of an underdamped output stage, of second order (Janesick 2001, Scientific Charge-Coupled \
                 Devices, chapter 6, on the bandwidth of output amplifiers)",
        holds: "Linear in the signal, in the direction of the parallel trail, without loss of the packet's own charge. A \
                negative fraction starts with an undershoot. Periods below 2 px cannot be distinguished from longer ones; what swings more \
                slowly than in 30 px is a trail (signal-bounce), no ringing of an output stage that settles within pixels.",
        residuals: "The measured trail is brighter and fainter than the model's in turn, by a fraction that does not depend on \
                    transfers, signal, time or temperature and falls with trail_px.",
        keys: &[
            key("fraction", "fraction of the packet in the next pixel", "", Number(-1.0, 1.0), Required),
            key(
                "length_px",
                "length over which the oscillation falls to 1/e",
                "px",
                keys::Allowed::Positive(0.0, 1e4),
                Required,
            ),
            Key {
                help: |value| (value > 0.0 && value < 2.0).then(|| "pixels show no period below 2 px".into()),
                ..key("period_px", "period of the oscillation", "px", Number(2.0, 30.0), Required)
            },
        ],
    };

    const GENERALISES: &'static [&'static str] = &["signal-bounce"];

    fn nothing(_: &Mission) -> toml::Table {
        table(0.0, 4.0, 5.0)
    }

    fn example(_: &Mission) -> toml::Table {
        table(0.005, 4.0, 5.0)
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        let longest_px = f64::from(reach.trail_px.max(6));
        let mut ways = Vec::new();
        for length_px in ratios(1.0, longest_px, 3) {
            for period_px in ratios(2.5, (1.5 * longest_px).min(25.0), 4) {
                ways.extend([1e-3, -1e-3].map(|fraction| vec![table(fraction, length_px, period_px)]));
            }
        }
        ways
    }
}

fn table(fraction: f64, length_px: f64, period_px: f64) -> toml::Table {
    numbers(&[("fraction", fraction), ("length_px", length_px), ("period_px", period_px)])
}

impl Effect for SignalRinging {
    fn read(&self, before_e: &Array2<f64>, read_e: &mut Array2<f64>, _: &Conditions) -> Result<(), InputError> {
        add_trail(self.fraction, self.length_px, self.period_px, before_e, read_e);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_rings_as_its_formula_says_and_packets_add_up() {
        let ringing = |k: f64| 0.02 * (-(k - 1.0) / 6.0).exp() * (2.0 * std::f64::consts::PI * (k - 1.0) / 4.5).cos();
        let mut before_e = Array2::zeros((40, 1));
        (before_e[[2, 0]], before_e[[7, 0]]) = (1000.0, 300.0);
        let mut read_e = before_e.clone();
        add_trail(0.02, 6.0, 4.5, &before_e, &mut read_e);
        for row in 0..40 {
            let behind =
                |packet: usize| if row > packet { before_e[[packet, 0]] * ringing((row - packet) as f64) } else { 0.0 };
            let expected = before_e[[row, 0]] + behind(2) + behind(7);
            assert!((read_e[[row, 0]] - expected).abs() < 1e-10, "{row}: {}, {expected}", read_e[[row, 0]]);
        }
    }
}
