//! 1-sigma errors of a corrected frame, given those of the observed one.
//!
//! ```text
//! image = P⁻¹ S⁻¹ observed        P, S: the parallel and the serial readout, linearised at the corrected image
//! σ²ᵢ   = Σⱼ (P⁻¹)²ᵢⱼ Σₖ (S⁻¹)²ⱼₖ σ²ₖ
//! ```
//!
//! A packet affects itself and those behind it, so P is triangular within a column. Its band is measured: eight readouts, each with
//! every eighth packet changed by its error (with a random sign), give ∂read/∂packet for the packet itself and the seven behind it.
//! The band is inverted column by column. S is the same along rows. Errors of neighbours are correlated afterwards; only their
//! variances are kept.
//!
//! Approximations: errors of the observed pixels are independent. The change of packets further behind is neglected; it is of
//! second order in the fraction of charge that a packet loses, and spread over many pixels. Shot noise precedes the transfers and
//! is neither amplified nor reduced, so if the read noise is known, only that is propagated.
//! `tests/suite/companions.rs` compares both with corrections of many noisy frames.

use ndarray::{Array2, ArrayView1, Axis, Zip};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::amplifier::{Amplifier, Amplifiers};
use super::frame::{self, Geometry, Transfers};
use super::trap_map::Factors;
use crate::error::InputError;
use crate::numeric::parallel;

/// Number of packets in the band: one, and those behind it.
const LAGS: usize = 8;

/// Minimum share of its own change that a packet is assumed to keep: below that, it is nearly emptied, and its charge is uncertain.
const LEAST_KEPT: f64 = 0.5;

/// Minimum change of a packet for measuring derivatives, e-.
const LEAST_STEP_E: f64 = 1.0;

/// Errors (e-, `[[row, column]]`) of the corrected frame, given those of the observed one. Pixels that are `held` keep theirs, and
/// so do those without an error (not finite, or negative).
///
/// # Errors
/// Those of the readout.
pub fn propagated(
    amplifiers: &Amplifiers,
    corrected_e: &Array2<f64>,
    held: &Array2<bool>,
    sigma_e: &Array2<f64>,
) -> Result<Array2<f64>, InputError> {
    let mut all = sigma_e.clone();
    for amplifier in &amplifiers.0 {
        let [corrected, sigma] = [corrected_e, sigma_e].map(|frame| amplifier.part(frame).to_owned());
        let held = amplifier.part(held).to_owned();
        amplifier.put(&of_amplifier(amplifier, &corrected, &held, &sigma)?, &mut all);
    }
    Zip::from(&mut all).and(sigma_e).and(held).for_each(|after, before, held| {
        if *held || !before.is_finite() || *before < 0.0 {
            *after = *before;
        }
    });
    Ok(all)
}

fn of_amplifier(
    amplifier: &Amplifier,
    corrected_e: &Array2<f64>,
    held: &Array2<bool>,
    sigma_e: &Array2<f64>,
) -> Result<Array2<f64>, InputError> {
    let variance = sigma_e.mapv(|sigma_e| if sigma_e.is_finite() { sigma_e * sigma_e } else { 0.0 });
    let of_noise = |variance: f64| amplifier.read_noise_e.map_or(variance, |noise_e| variance.min(noise_e * noise_e));
    let geometry = &amplifier.geometry;
    let mut parts = Vec::new();
    for ((((corrected, factors), held), variance), noise) in geometry
        .amplifiers(corrected_e)
        .iter()
        .zip(geometry.factors(amplifier.factors.as_ref()))
        .zip(geometry.amplifiers(held))
        .zip(geometry.amplifiers(&variance))
        .zip(geometry.amplifiers(&variance.mapv(of_noise)))
    {
        let after = part(amplifier, corrected, factors.as_ref(), &held, &noise)?;
        parts.push((variance - noise + after).mapv(f64::sqrt));
    }
    let mut all = sigma_e.clone();
    geometry.put_back(&parts, &mut all);
    Ok(all)
}

/// Variances (e-²) of the part read by one amplifier, in the order of readout.
fn part(
    amplifier: &Amplifier,
    corrected_e: &Array2<f64>,
    factors: Option<&Factors>,
    held: &Array2<bool>,
    noise: &Array2<f64>,
) -> Result<Array2<f64>, InputError> {
    let along = |transfers: Transfers| {
        let geometry = Geometry { transfers, ..amplifier.geometry };
        move |image: &Array2<f64>| frame::clocked(&amplifier.device, &geometry, image.view(), factors, None)
    };
    let (parallel, serial) = (along(Transfers::Parallel), along(Transfers::Serial));
    let mut variance = noise.clone();
    if amplifier.geometry.transfers.serial() {
        let in_register = match amplifier.geometry.transfers.parallel() {
            true => parallel(corrected_e)?,
            false => corrected_e.clone(),
        };
        variance = inverted(&serial, &in_register, held, &variance, Axis(1))?;
    }
    if amplifier.geometry.transfers.parallel() {
        variance = inverted(&parallel, corrected_e, held, &variance, Axis(0))?;
    }
    Ok(variance)
}

/// Variances before a readout along an axis, given those after it.
fn inverted(
    read: &impl Fn(&Array2<f64>) -> Result<Array2<f64>, InputError>,
    image: &Array2<f64>,
    held: &Array2<bool>,
    variance: &Array2<f64>,
    along: Axis,
) -> Result<Array2<f64>, InputError> {
    let band = band(read, image, variance, along)?;
    let across = Axis(1 - along.index());
    let lines: Vec<Vec<f64>> = parallel::map(0..image.len_of(across), |line| {
        let band: Vec<ArrayView1<f32>> = band.iter().map(|lag| lag.index_axis(across, line)).collect();
        line_inverted(&band, held.index_axis(across, line), variance.index_axis(across, line))
    });
    let mut before = Array2::zeros(image.raw_dim());
    for (mut line, values) in before.axis_iter_mut(across).zip(lines) {
        line.assign(&ArrayView1::from(&values));
    }
    Ok(before)
}

/// ∂read/∂packet, by lag: `band[lag][index of the packet]`, for the packet `lag` behind it.
fn band(
    read: &impl Fn(&Array2<f64>) -> Result<Array2<f64>, InputError>,
    image: &Array2<f64>,
    variance: &Array2<f64>,
    along: Axis,
) -> Result<Vec<Array2<f32>>, InputError> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let place = |(row, column): (usize, usize)| if along == Axis(0) { row } else { column };
    let at = |packet: usize, line: usize| if along == Axis(0) { [packet, line] } else { [line, packet] };
    let (length, lines) = (image.len_of(along), image.len_of(Axis(1 - along.index())));
    let unchanged = read(image)?;
    let mut band = vec![Array2::<f32>::zeros(image.raw_dim()); LAGS];
    for phase in 0..LAGS {
        let step = Array2::from_shape_fn(image.raw_dim(), |at| {
            let size_e = variance[at].sqrt().max(LEAST_STEP_E);
            if place(at) % LAGS != phase {
                0.0
            } else if random.random() {
                size_e
            } else {
                -size_e
            }
        });
        let change = read(&(image + &step))? - &unchanged;
        for (lag, band) in band.iter_mut().enumerate() {
            for packet in (phase..length.saturating_sub(lag)).step_by(LAGS) {
                for line in 0..lines {
                    band[at(packet, line)] = (change[at(packet + lag, line)] / step[at(packet, line)]) as f32;
                }
            }
        }
    }
    Ok(band)
}

/// One column or row: Σⱼ (T⁻¹)²ᵢⱼ σ²ⱼ, with T the band. A held pixel keeps its observed value.
fn line_inverted(band: &[ArrayView1<f32>], held: ArrayView1<bool>, variance: ArrayView1<f64>) -> Vec<f64> {
    let length = variance.len();
    let of = |packet: usize, lag: usize| f64::from(band[lag][packet]);
    let mut before = vec![0.0; length];
    for packet in 0..length {
        // The column of T⁻¹, by forward substitution.
        let mut column = [0.0; LAGS];
        for lag in 0..LAGS.min(length - packet) {
            let at = packet + lag;
            column[lag] = match (held[at], lag) {
                (true, 0) => 1.0,
                (true, _) => 0.0,
                (false, _) => {
                    let others: f64 =
                        (0..lag).map(|earlier| of(packet + earlier, lag - earlier) * column[earlier]).sum();
                    let own = if lag == 0 { 1.0 } else { 0.0 };
                    (own - others) / of(at, 0).max(LEAST_KEPT)
                }
            };
            before[at] += column[lag] * column[lag] * variance[packet];
        }
    }
    before
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_is_inverted() {
        // Each packet keeps 0.9 of a change, and 0.1 goes to the next.
        let image = Array2::from_elem((4, 1), 10.0);
        let read = |image: &Array2<f64>| {
            let mut read = image * 0.9;
            (1..4).for_each(|row| read[[row, 0]] += 0.1 * image[[row - 1, 0]]);
            Ok(read)
        };
        let nothing = Array2::from_elem((4, 1), false);
        let variance = inverted(&read, &image, &nothing, &Array2::from_elem((4, 1), 4.0), Axis(0)).unwrap();
        // T⁻¹ has 1/0.9 (−1/9)^lag.
        let mut expected = 0.0;
        for row in 0..4 {
            expected += 4.0 / 0.81 * (1.0_f64 / 81.0).powi(row);
            assert!((variance[[row as usize, 0]] - expected).abs() < 1e-5, "{variance}");
        }
    }
}
