//! Isolated pixels with large charge, and the trails behind them.

use std::collections::HashSet;

use ndarray::s;

use super::super::Found;
use super::super::exposure::Exposure;
use super::super::statistic::{median, robust_scatter};
use super::Pixel;

/// Pixels in front of a warm one count as another source above this number of sigma of the frame's noise.
const SOURCE_SIGMA: f64 = 6.0;
/// Halo: maximum share of a pixel's charge in its neighbours, up to a distance in pixels, and beside it.
const HALO: f64 = 0.05;
const HALO_PX: usize = 2;
const BESIDE: f64 = 0.2;
/// A pixel behind with more than this share of the charge is another source.
const BEHIND: f64 = 0.5;
/// Columns on each side, starting with the second, from which the background is estimated.
const NEAR_COLUMNS: std::ops::RangeInclusive<usize> = 2..=9;

/// Search criteria.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Length of a trail, px.
    pub trail_px: usize,
    /// Minimum charge of a pixel above the background, e-.
    pub threshold_e: f64,
}

/// A trail extracted from an exposure.
#[derive(Clone, Debug)]
pub(super) struct Cut {
    /// Position: HDU, amplifier, row, column. The same in all exposures.
    pub place: (usize, usize, usize, usize),
    /// Parallel transfers of the pixel.
    pub transfers: f64,
    /// Charge read in the pixel, above the background, e-.
    pub signal_e: f64,
    /// Background near it, e-.
    pub background_e: f64,
    /// Charge behind it minus that in front of it, e-; NaN if a pixel is missing.
    pub trail_e: Vec<f64>,
    /// Step of the values, e-.
    pub quantum_e: f64,
}

impl Search {
    /// Candidate warm pixels.
    pub fn candidates(&self, exposure: &Exposure, found: &mut Found) -> HashSet<Pixel> {
        let Some((level_e, noise_e)) = level_and_noise(exposure) else { return HashSet::new() };
        let mut pixels = HashSet::new();
        // Near the ends there is no room for a trail, or for the pixels in front.
        for row in self.trail_px..exposure.rows.saturating_sub(self.trail_px) {
            for column in exposure.columns.clone() {
                // The background near a pixel takes longer to estimate than that of the frame.
                if exposure.charge_e[[row, column]] - level_e < 0.5 * self.threshold_e {
                    continue;
                }
                let Some(signal_e) = self.signal(exposure, (row, column)).filter(|signal| *signal >= self.threshold_e)
                else {
                    continue;
                };
                if self.is_isolated(exposure, (row, column), signal_e, noise_e) {
                    pixels.insert((row, column));
                } else {
                    found.count("not_isolated", 1);
                }
            }
        }
        found.count("candidates", pixels.len());
        pixels
    }

    /// Charge of a pixel above the background near it, e-.
    fn signal(&self, exposure: &Exposure, (row, column): Pixel) -> Option<f64> {
        Some(exposure.charge_e[[row, column]] - self.background(exposure, (row, column))?)
    }

    /// Background near a pixel, e-: the median of the columns beside it, over the rows of its trail and as many in front.
    fn background(&self, exposure: &Exposure, (row, column): Pixel) -> Option<f64> {
        let rows = row - self.trail_px..row + self.trail_px + 1;
        median(
            near(exposure, column).flat_map(|near| exposure.charge_e.slice(s![rows.clone(), near]).to_vec()).collect(),
        )
    }

    /// Whether a pixel is brighter than all around it, and isolated except for its trail.
    ///
    /// There is no condition on faint pixels behind it: that would bias trails low.
    fn is_isolated(&self, exposure: &Exposure, (row, column): Pixel, signal_e: f64, noise_e: f64) -> bool {
        let Some(background_e) = self.background(exposure, (row, column)) else { return false };
        let above = |row: usize, column: usize| exposure.charge_e[[row, column]] - background_e;
        let columns = column.saturating_sub(1).max(exposure.columns.start)..(column + 2).min(exposure.columns.end);
        let beside = columns.filter(|near| *near != column).all(|near| {
            (row - 1..=row + 1)
                .all(|row| above(row, near).is_nan() || above(row, near) < BESIDE * signal_e + SOURCE_SIGMA * noise_e)
        });
        // Further than the pixels compared: sources there trail into them, from afar if they are bright.
        let in_front = (1..=(3 * self.trail_px).min(row)).all(|distance| {
            let limit_e = match distance {
                _ if distance <= HALO_PX => HALO * signal_e + SOURCE_SIGMA * noise_e,
                _ if distance <= 2 * self.trail_px => SOURCE_SIGMA * noise_e,
                _ => self.threshold_e.max(SOURCE_SIGMA * noise_e),
            };
            let charge_e = above(row - distance, column);
            charge_e.is_nan() || charge_e < limit_e
        });
        let behind = (1..=self.trail_px).all(|distance| {
            let charge_e = above(row + distance, column);
            charge_e.is_nan() || charge_e < BEHIND * signal_e
        });
        beside && in_front && behind
    }

    /// The trail behind a pixel; None if the pixel or the background has no value.
    pub fn cut(&self, exposure: &Exposure, (row, column): Pixel) -> Option<Cut> {
        let background_e = self.background(exposure, (row, column))?;
        let difference = |distance: usize, column: usize| {
            exposure.charge_e[[row + distance, column]] - exposure.charge_e[[row - distance, column]]
        };
        let trail_e = (1..=self.trail_px).map(|distance| {
            let beside = near(exposure, column).map(|near| difference(distance, near)).collect();
            difference(distance, column) - median(beside).unwrap_or(f64::NAN)
        });
        let about = &exposure.about;
        Some(Cut {
            place: (about.hdu, about.amplifier, row, column),
            transfers: (row + 1) as f64 + f64::from(about.rows_before()),
            signal_e: exposure.charge_e[[row, column]] - background_e,
            background_e,
            trail_e: trail_e.collect(),
            quantum_e: about.quantum_e,
        })
    }
}

/// Columns of the image near a column, without it and its neighbours.
fn near(exposure: &Exposure, column: usize) -> impl Iterator<Item = usize> {
    let columns = exposure.columns.clone();
    let sides = NEAR_COLUMNS.flat_map(move |distance| [column.checked_sub(distance), Some(column + distance)]);
    sides.flatten().filter(move |near| columns.contains(near))
}

/// Median of the image and noise of a pixel (from the differences of successive pixels in a column), e-.
fn level_and_noise(exposure: &Exposure) -> Option<(f64, f64)> {
    let image = exposure.charge_e.slice(s![..exposure.rows, exposure.columns.clone()]);
    let level_e = median(image.iter().copied().collect())?;
    let (below, above) = (image.slice(s![..-1, ..]), image.slice(s![1.., ..]));
    let differences = below.iter().zip(above).map(|(below, above)| above - below).collect::<Vec<f64>>();
    let noise_e = robust_scatter(&differences)? / 2_f64.sqrt();
    Some((level_e, noise_e.max(exposure.about.quantum_e)))
}
