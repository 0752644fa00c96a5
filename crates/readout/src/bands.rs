//! Columns whose pixels have more traps in some rows than in others.
//!
//! In each pixel the packets pass one after another, and the effect of a pixel on them depends only on the charges with which they
//! arrive from the pixels farther away. So a readout is a composition of readouts, the farthest pixels first, and each of them may
//! have densities of its own:
//!
//! ```text
//! register │ band 0, f₀ ρ │ band 1, f₁ ρ │ … │ band N, f_N ρ
//!          ◀─── last ──── ◀───────────── … ◀───── first ────
//! ```
//!
//! In a band, packets pass only the pixels of the band; these are all packets that start in it or farther away. This is exact for
//! every clock and every capture time in this crate, but not for [`super::Method::CarriedTraps`], whose pixels start in the state
//! of their neighbours.

use std::ops::Range;

use ndarray::{Array2, Axis};

use super::equal_blocks::{Allowed, Towards};
use super::{Downstream, Method, Readout};

/// Rows of pixels with a common factor on their trap densities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Its first row of the image. It ends where the next band starts.
    pub first_row: usize,
    /// Factor on the densities of all species.
    pub density_factor: f64,
}

/// The pixels that the columns pass.
#[derive(Clone, Copy)]
pub(super) struct Journey {
    /// Rows downstream.
    pub rows: i64,
    /// The first of the pixels, counted from the register.
    nearest: i64,
    /// The first pixel beyond them.
    end: i64,
    /// Whether packets downstream started in pixels with empty traps, and have filled them.
    pub fill_their_own: bool,
}

impl Journey {
    /// Through all pixels, with `rows` rows downstream.
    pub fn of(rows: i64) -> Journey {
        Journey { rows, nearest: 0, end: i64::MAX, fill_their_own: true }
    }

    /// Through `pixels` pixels in which no packet starts, which `rows` packets have passed before.
    pub fn passed_by_all(rows: i64, pixels: i64) -> Journey {
        Journey { rows: rows + pixels, nearest: 0, end: pixels, fill_their_own: false }
    }

    /// The pixels passed by columns of `packets` packets.
    pub fn pixels(&self, packets: usize) -> Range<i64> {
        let nearest = self.nearest.max(0);
        nearest..self.end.min(packets as i64 + self.rows).max(nearest)
    }
}

impl Readout {
    /// [`Readout::parallel`] of an image whose pixels have more traps in some rows than in others. `allowed`: the allowed error, if
    /// any; see [`Readout::parallel_within`].
    ///
    /// Bands are sorted by row. The first one also applies to all rows between the image and the register.
    ///
    /// # Panics
    /// As [`Readout::parallel`], and for several bands with [`Method::CarriedTraps`].
    pub fn parallel_in_bands(
        &self,
        image: &Array2<f64>,
        downstream: Downstream,
        bands: &[Band],
        allowed: Option<Allowed>,
    ) -> Array2<f64> {
        assert!(bands.len() < 2 || self.method != Method::CarriedTraps, "traps are carried through equal pixels only");
        let parts = self.in_parts(downstream.rows, bands);
        let allowed = allowed.map(|allowed| allowed.of_one(parts.len()));
        parts.into_iter().rev().fold(image.clone(), |image, (readout, journey)| {
            let within = |allowed| readout.within(&image, (journey, downstream.charge_e), Axis(0), allowed);
            let background_e = || vec![downstream.charge_e; image.ncols()];
            allowed.and_then(within).unwrap_or_else(|| readout.along(&image, journey, &background_e(), Axis(0)))
        })
    }

    /// The image before [`Readout::parallel_in_bands`]: see [`Readout::parallel_reversed`].
    ///
    /// # Panics
    /// As [`Readout::parallel_reversed`].
    pub fn parallel_in_bands_reversed(
        &self,
        read: &Array2<f64>,
        downstream: Downstream,
        bands: &[Band],
        allowed: Allowed,
    ) -> Option<Array2<f64>> {
        let parts = self.in_parts(downstream.rows, bands);
        let course = (Towards::Light, allowed.of_one(parts.len()));
        parts.into_iter().try_fold(read.clone(), |image, (readout, journey)| {
            readout.in_blocks(&image, (journey, downstream.charge_e), Axis(0), course)
        })
    }

    /// The readout and the pixels of each band that has traps, from the register on.
    fn in_parts(&self, rows_downstream: i64, bands: &[Band]) -> Vec<(Readout, Journey)> {
        let part = |(place, band): (usize, &Band)| {
            let place_of = |band: &Band| rows_downstream + band.first_row as i64;
            let nearest = if place == 0 { 0 } else { place_of(band) };
            let end = bands.get(place + 1).map_or(i64::MAX, place_of);
            let journey = Journey { nearest, end, ..Journey::of(rows_downstream) };
            let mut readout = self.clone();
            readout.traps.iter_mut().for_each(|trap| trap.density_per_px *= band.density_factor);
            (band.density_factor > 0.0).then_some((readout, journey))
        };
        bands.iter().enumerate().filter_map(part).collect()
    }
}

impl Allowed {
    /// The error allowed for each of `bands` bands, if all errors have the same sign.
    fn of_one(self, bands: usize) -> Allowed {
        Allowed { error_e: self.error_e / bands.max(1) as f64, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Clock, Cloud, Trap};

    const BANDS: [Band; 4] = [
        Band { first_row: 0, density_factor: 0.5 },
        Band { first_row: 9, density_factor: 3.0 },
        Band { first_row: 24, density_factor: 0.0 },
        Band { first_row: 31, density_factor: 1.0 },
    ];

    fn factor_of(row: i64) -> f64 {
        BANDS.iter().rev().find(|band| band.first_row as i64 <= row.max(0)).map_or(0.0, |band| band.density_factor)
    }

    /// Sky with shot noise, two stars, and a row without charge.
    fn image() -> Array2<f64> {
        Array2::from_shape_fn((48, 3), |(row, column)| match (row, column) {
            (22, 1) | (40, _) => 30_000.0,
            (30, 2) => 0.0,
            _ => 60.0 + 17.0 * ((row * 37 + column * 11) % 23) as f64,
        })
    }

    fn readout(method: Method) -> Readout {
        Readout {
            traps: vec![Trap::new(0.4, 0.9), Trap::new(0.6, 7.0)],
            cloud: Cloud::new(80_000.0, 0.0, 0.58),
            method,
        }
    }

    /// Levels of a cloud in which the traps of a pixel are counted in the reference.
    const LEVELS: usize = 20_000;

    /// Every transfer of every packet, with fractions filled at fixed heights: the contract of the crate, pixel by pixel.
    fn by_hand(readout: &Readout, image: &Array2<f64>, rows_downstream: i64) -> Array2<f64> {
        let mut read = image.clone();
        for mut column in read.columns_mut() {
            for pixel in (0..column.len() as i64 + rows_downstream).rev() {
                let mut filled = vec![[0.0; LEVELS]; readout.traps.len()];
                for charge_e in column.iter_mut().skip((pixel - rows_downstream).max(0) as usize) {
                    let per_level =
                        |trap: &Trap| factor_of(pixel - rows_downstream) * trap.density_per_px / LEVELS as f64;
                    for (trap, filled) in readout.traps.iter().zip(&mut filled) {
                        let kept = (-1.0 / trap.release_transfers).exp();
                        *charge_e += per_level(trap) * (1.0 - kept) * filled.iter().sum::<f64>();
                        filled.iter_mut().for_each(|filled| *filled *= kept);
                    }
                    let reached = (readout.cloud.height(*charge_e) * LEVELS as f64).round() as usize;
                    for (trap, filled) in readout.traps.iter().zip(&mut filled) {
                        for filled in &mut filled[..reached] {
                            *charge_e -= per_level(trap) * (1.0 - *filled);
                            *filled = 1.0;
                        }
                    }
                }
            }
        }
        read
    }

    fn farthest(one: &Array2<f64>, other: &Array2<f64>) -> f64 {
        (one - other).iter().fold(0.0, |most, difference| difference.abs().max(most))
    }

    #[test]
    fn bands_are_pixels_with_densities_of_their_own() {
        let image = image();
        let exact = readout(Method::Exact);
        for rows in [0, 7] {
            let downstream = Downstream { rows, charge_e: 0.0 };
            let wanted = by_hand(&exact, &image, rows);
            let moved_e = farthest(&wanted, &image);
            let by_every_transfer = exact.parallel_in_bands(&image, downstream, &BANDS, None);
            // Error of the levels of the reference: half a level of one or two traps per pixel, in 55 pixels.
            let error_e = farthest(&by_every_transfer, &wanted);
            assert!(error_e < 2e-3 && moved_e > 10.0, "{error_e:e} of {moved_e}");
            for method in [Method::Fast { relative: 1e-6 }, Method::Fractional { levels: LEVELS }] {
                let error_e =
                    farthest(&readout(method).parallel_in_bands(&image, downstream, &BANDS, None), &by_every_transfer);
                assert!(
                    error_e < if method == (Method::Fast { relative: 1e-6 }) { 1e-4 } else { 2e-3 },
                    "{method:?} {error_e:e}"
                );
            }
        }
    }

    #[test]
    fn bands_of_equal_pixels_are_one() {
        let image = image();
        let downstream = Downstream { rows: 20, charge_e: 50.0 };
        let equal = BANDS.map(|band| Band { density_factor: 1.0, ..band });
        let slow = vec![Trap { capture_transfers: 0.3, ..Trap::new(0.5, 4.0) }];
        let two_clouds = vec![Trap { well_fill_power: Some(0.8), ..Trap::new(0.5, 4.0) }, Trap::new(0.7, 1.5)];
        let phases = Clock::of_phases(3).spread(&[Trap::new(0.8, 2.0)]);
        for traps in [readout(Method::Exact).traps, slow, two_clouds, phases] {
            for method in [Method::Exact, Method::Fractional { levels: 300 }, Method::Fast { relative: 1e-6 }] {
                let readout = Readout { traps: traps.clone(), method, ..readout(method) };
                let error_e = farthest(
                    &readout.parallel_in_bands(&image, downstream, &equal, None),
                    &readout.parallel(&image, downstream),
                );
                let allowed_e = if matches!(method, Method::Fast { .. }) { 1e-3 } else { 1e-9 };
                assert!(error_e < allowed_e, "{method:?} {traps:?} {error_e:e}");
            }
        }
    }

    #[test]
    fn real_traps_of_bands_have_the_same_mean() {
        let image = image();
        let wanted = readout(Method::Exact).parallel_in_bands(&image, Downstream::NONE, &BANDS, None);
        const SAMPLES: u64 = 400;
        let mut sum = Array2::<f64>::zeros(image.raw_dim());
        let mut squares = sum.clone();
        for seed in 0..SAMPLES {
            let read = readout(Method::MonteCarlo { seed }).parallel_in_bands(&image, Downstream::NONE, &BANDS, None);
            sum += &read;
            squares += &(&read * &read);
        }
        let mean = sum / SAMPLES as f64;
        let variance = squares / SAMPLES as f64 - &mean * &mean;
        // Over all pixels: 144 independent normal deviates would give 1 +- 0.06; those within a column are not independent. Where
        // few traps are met, whole electrons are lost from a small mean.
        let deviations = (&mean - &wanted) / variance.mapv(|variance| (variance.max(0.05) / SAMPLES as f64).sqrt());
        let rms = (deviations.mapv(|deviation| deviation * deviation).mean().unwrap()).sqrt();
        assert!(rms < 1.4, "{rms}");
    }

    #[test]
    fn a_reversed_readout_of_bands_finds_the_image() {
        let image = image();
        for charge_e in [0.0, 60.0] {
            let (readout, downstream) = (readout(Method::Exact), Downstream { rows: 30, charge_e });
            let read = readout.parallel_in_bands(&image, downstream, &BANDS, None);
            let allowed = Allowed { relative: 1e-3, error_e: 0.0 };
            let found = readout.parallel_in_bands_reversed(&read, downstream, &BANDS, allowed).unwrap();
            let rms = |difference: Array2<f64>| (difference.mapv(|e| e * e).mean().unwrap()).sqrt();
            let (error_e, moved_e) = (rms(&found - &image), rms(&read - &image));
            assert!(error_e < 5e-3 * moved_e, "{error_e:e} of {moved_e}");
            let fast = Readout { method: Method::Fast { relative: 1e-6 }, ..readout.clone() };
            let allowed = Allowed { relative: 0.0, error_e: 0.01 };
            let error_e = rms(fast.parallel_in_bands(&image, downstream, &BANDS, Some(allowed)) - &read);
            assert!(error_e < 0.01, "{error_e:e}");
        }
    }

    #[test]
    fn rows_in_front_of_the_image_have_the_traps_of_its_first_band() {
        // The sky packets in front, as part of an image that touches the register.
        let image = image();
        let rows = 40;
        let longer = Array2::from_shape_fn((rows + image.nrows(), 3), |(row, column)| {
            if row < rows { 60.0 } else { image[[row - rows, column]] }
        });
        let all =
            BANDS.map(|band| Band { first_row: if band.first_row == 0 { 0 } else { rows + band.first_row }, ..band });
        let readout = readout(Method::Exact);
        let wanted = readout.parallel_in_bands(&longer, Downstream::NONE, &all, None);
        let downstream = Downstream { rows: rows as i64, charge_e: 60.0 };
        let read = readout.parallel_in_bands(&image, downstream, &BANDS, None);
        let error_e = farthest(&read, &wanted.slice(ndarray::s![rows.., ..]).to_owned());
        // The packets in front have not yet lost charge to pixels that only few of them have passed.
        assert!(error_e < 5e-3, "{error_e:e}");
    }
}
