//! Frames of a pumping series whose dipoles are not those of the others: not pumped, pumped otherwise than their header says, or of
//! another detector. One of them moves a fitted release time by any factor, since its dipoles seem to have faded.
//!
//! A dipole has two unknowns, its trap's efficiency a and release time τ:
//!
//! ```text
//! I(t) = a N (exp(−t/τ) − exp(−2t/τ))        t phase time, N cycles
//! ```
//!
//! They are fitted to all frames of a series (χ²), and to all but one (χ² without it). If that one belongs to the series, χ² falls by
//! about the number n of dipoles measured in it, ± √(2n); in units of the reduced χ² of the others, where the model or the errors are
//! not exact. A frame is left out if χ² falls by more than n + 5 √(2n), and if its dipoles are s times those that the others predict,
//! with s nearer (in ratio) to a half or to twice than to 1: then no pumping by its header's number of cycles made them. The first
//! condition says that s is certain; the second one keeps frames that a small fault of the model makes significant.

use crate::numeric::parallel;
use crate::physics::observable::dipole_e;

/// Release times of the fits, over a factor of 10 to each side of the phase times: steps of some 10 %, a fraction of the width of the
/// peak of I(t), which is a factor of 6.
const RELEASE_TIMES: usize = 80;
const BEYOND: f64 = 10.0;

/// Significance of a frame that is left out, in standard deviations: that of outliers in all means.
const SIGMAS: f64 = super::CLIP_SIGMA;

/// Fewest frames that judge another one: one more than the unknowns of a dipole.
const FEWEST: usize = 3;

/// A dipole in the frames of a series: intensity and 1-sigma error, e-, where it was measured.
pub(super) type Dipole = Vec<Option<(f64, f64)>>;

/// A frame that is not of the series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stranger {
    /// Its place among the frames.
    pub frame: usize,
    /// Its dipoles over those that the other frames predict.
    pub times: f64,
}

/// Frames that are not of the series, most certain first. `pumped[frame]` has phase time (ms) and cycles.
///
/// At least half of the frames, and [`FEWEST`], are always kept: fewer cannot tell who is the stranger.
pub(super) fn strangers(pumped: &[(f64, f64)], dipoles: &[Dipole]) -> Vec<Stranger> {
    let mut left: Vec<bool> = vec![true; pumped.len()];
    let mut found = Vec::new();
    let curves = curves(pumped);
    while left.iter().filter(|left| **left).count() > FEWEST.max(pumped.len().div_ceil(2)) {
        let Some(stranger) = stranger(&curves, dipoles, &left) else { break };
        left[stranger.frame] = false;
        found.push(stranger);
    }
    found
}

/// Intensities for each release time of the fits, in each frame, of a trap with efficiency 1.
fn curves(pumped: &[(f64, f64)]) -> Vec<Vec<f64>> {
    let times = || pumped.iter().map(|(time, _)| *time);
    let (least, most) = (times().fold(f64::INFINITY, f64::min) / BEYOND, times().fold(0.0, f64::max) * BEYOND);
    let release_ms = |step: usize| least * (most / least).powf(step as f64 / (RELEASE_TIMES - 1) as f64);
    let curve =
        |release_ms: f64| pumped.iter().map(|(time, cycles)| dipole_e(*cycles, 1.0, *time, release_ms)).collect();
    (0..RELEASE_TIMES).map(release_ms).map(curve).collect()
}

/// What one dipole says of a frame.
#[derive(Clone, Copy, Default)]
struct Said {
    /// χ² of the fit without the frame.
    chi2: f64,
    /// Products of the intensity with the prediction of the others, and of that with itself, over the variance.
    with: f64,
    own: f64,
}

/// The frame without which the others agree best, if it is not of their series.
fn stranger(curves: &[Vec<f64>], dipoles: &[Dipole], left: &[bool]) -> Option<Stranger> {
    let of_dipole = |dipole: &Dipole| -> (f64, Vec<Said>) {
        let all = fitted(curves, dipole, left, None).0;
        let without = |frame: usize| match dipole[frame].filter(|_| left[frame]) {
            None => Said { chi2: all, ..Said::default() },
            Some((value, sigma)) => {
                let (chi2, predicted) = fitted(curves, dipole, left, Some(frame));
                let weight = 1.0 / (sigma * sigma);
                Said { chi2, with: weight * value * predicted, own: weight * predicted * predicted }
            }
        };
        (all, (0..left.len()).map(without).collect())
    };
    let said: Vec<(f64, Vec<Said>)> = parallel::map(0..dipoles.len(), |index| of_dipole(&dipoles[index]));
    let all: f64 = said.iter().map(|(all, _)| all).sum();
    let measured = |frame: usize| dipoles.iter().filter(|dipole| left[frame] && dipole[frame].is_some()).count() as f64;
    let values: f64 = (0..left.len()).map(measured).sum();
    let judged = (0..left.len()).filter(|frame| measured(*frame) > 0.0).filter_map(|frame| {
        let sum = |part: fn(&Said) -> f64| said.iter().map(|(_, said)| part(&said[frame])).sum::<f64>();
        let n = measured(frame);
        let (chi2, freedom) = (sum(|said| said.chi2), values - n - 2.0 * dipoles.len() as f64);
        let fall = (all - chi2) / (chi2 / freedom).max(1.0);
        let own = sum(|said| said.own);
        let times = if own > 0.0 { sum(|said| said.with) / own } else { f64::INFINITY };
        let is_other = !(0.5_f64.sqrt()..=2.0_f64.sqrt()).contains(&times);
        (freedom > 0.0 && is_other && fall > n + SIGMAS * (2.0 * n).sqrt()).then_some((fall, Stranger { frame, times }))
    });
    judged.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, stranger)| stranger)
}

/// χ² of the best trap for a dipole in the frames that are left, but for one, and its prediction (e-) for that one.
fn fitted(curves: &[Vec<f64>], dipole: &Dipole, left: &[bool], but: Option<usize>) -> (f64, f64) {
    let mut best = (f64::INFINITY, 0.0);
    for curve in curves {
        let (mut squares, mut with, mut own) = (0.0, 0.0, 0.0);
        for (frame, measured) in dipole.iter().enumerate() {
            let Some((value, sigma)) = measured.filter(|_| left[frame] && but != Some(frame)) else { continue };
            let weight = 1.0 / (sigma * sigma);
            squares += weight * value * value;
            with += weight * value * curve[frame];
            own += weight * curve[frame] * curve[frame];
        }
        let efficiency = if own > 0.0 { (with / own).max(0.0) } else { 0.0 };
        let chi2 = squares - efficiency * (2.0 * with - efficiency * own);
        if chi2 < best.0 {
            best = (chi2, but.map_or(0.0, |frame| efficiency * curve[frame]));
        }
    }
    best
}
