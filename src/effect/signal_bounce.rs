//! The amplifier's own trail.

use std::f64::consts::PI;

use ndarray::{Array2, Axis};
use serde::Deserialize;

use super::reach::ratios;
use super::{Card, Catalogued, Effect, Reach, numbers};
use crate::error::InputError;
use crate::mission::Mission;
use crate::mission::keys::{self, Allowed::Number, Need::Required, key};
use crate::physics::conditions::Conditions;

/// `[effects.signal-bounce]`
#[derive(Debug, Deserialize)]
pub struct SignalBounce {
    fraction: f64,
    length_px: f64,
}

impl Catalogued for SignalBounce {
    const CARD: Card = Card {
        kind: "signal-bounce",
        adds: "the trail of the amplifier, independent of the number of transfers",
        physics: "Pixel k behind a packet shows, in addition, fraction exp(−(k − 1)/length_px) times the packet. Blocks and \
                  images are sums of packets. The charge of a packet is that before transfer.",
        source: "Toyozumi & Ashley 2005 (PASA 22, 257) on the slow response of output stages",
        holds: "Linear in the signal, in the direction of the parallel trail, without loss of the packet's own charge. A \
                negative fraction is an undershoot. The loss of charge during transfer is a correction of second order.",
        residuals: "The measured trail is brighter than the model's in the first pixels, by a fraction that does not depend \
                    on transfers, signal, time or temperature.",
        keys: &[
            key("fraction", "fraction of the packet in the next pixel", "", Number(-1.0, 1.0), Required),
            key("length_px", "length of the trail", "px", keys::Allowed::Positive(0.0, 1e4), Required),
        ],
    };

    fn nothing(_: &Mission) -> toml::Table {
        numbers(&[("fraction", 0.0), ("length_px", 2.0)])
    }

    fn example(_: &Mission) -> toml::Table {
        numbers(&[("fraction", 0.005), ("length_px", 2.0)])
    }

    fn trials(_: &Mission, reach: &Reach) -> Vec<Vec<toml::Table>> {
        let longest_px = f64::from(reach.trail_px.max(3));
        let way =
            |(length_px, fraction): (f64, f64)| vec![numbers(&[("fraction", fraction), ("length_px", length_px)])];
        let lengths = ratios(0.4, longest_px, 5);
        lengths.flat_map(|length_px| [(length_px, 1e-3), (length_px, -1e-3)]).map(way).collect()
    }
}

impl Effect for SignalBounce {
    fn read(&self, before_e: &Array2<f64>, read_e: &mut Array2<f64>, _: &Conditions) -> Result<(), InputError> {
        add_trail(self.fraction, self.length_px, f64::INFINITY, before_e, read_e);
        Ok(())
    }
}

/// Adds a trail behind each packet to the charges read (e-): fraction exp(−(k − 1)/length) cos(2π (k − 1)/period) of it in pixel k
/// behind it. Lengths and periods are in pixels; an infinite period means no oscillation.
pub(super) fn add_trail(
    fraction: f64,
    length_px: f64,
    period_px: f64,
    before_e: &Array2<f64>,
    read_e: &mut Array2<f64>,
) {
    let keep = (-1.0 / length_px).exp();
    let (sine, cosine) = (2.0 * PI / period_px).sin_cos();
    for (before_e, mut read_e) in before_e.axis_iter(Axis(1)).zip(read_e.axis_iter_mut(Axis(1))) {
        // Σ_j exp(−(k − j − 1)/length) exp(2πi (k − j − 1)/period) n_j over the packets j in front of pixel k: its real part is
        // read.
        let (mut real_e, mut imaginary_e) = (0.0, 0.0);
        for (before, read) in before_e.iter().zip(&mut read_e) {
            *read += fraction * real_e;
            let turned_e = cosine * imaginary_e + sine * real_e;
            real_e = (cosine * real_e - sine * imaginary_e) * keep + before;
            imaginary_e = turned_e * keep;
        }
    }
}
