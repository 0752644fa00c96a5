//! How far into a flat field its first row is felt.
//!
//! A trap forgets what the first rows did to it within a few release times (finite capture shortens its memory). What it took from a
//! packet is missing in that packet, which then fills less of the next pixels, and leaves more to be filled by the one behind: a
//! difference between rows travels backwards, by N ρ h'(n) rows in N transfers through ρ traps per pixel, and spreads by the root of
//! that. (Where whole packets are emptied, h(n)/n stands for the slope.) All rows behind both distances are equal.

use super::{Cloud, Method, Readout, Trap};

/// The share of a difference that counts as forgotten, as a share of the accuracy of the readout, and without such an accuracy.
const OF_READOUT: f64 = 1e-3;
const FORGOTTEN: f64 = 1e-14;

/// Standard deviations of ln τ beyond which there are no traps, to the same precision as their resolved sum.
const WIDEST_SIGMA: f64 = 6.0;

/// Step for the slope of a well's height, relative to the charge.
const STEP: f64 = 1e-4;

impl Readout {
    /// Rows of a flat field (`charge_e` per pixel on a background of `background_e`, e-) after which all are read equal, if they
    /// make `transfers` transfers.
    pub fn rows_until_flat(&self, charge_e: f64, background_e: f64, transfers: f64) -> f64 {
        let forgotten = match self.method {
            Method::Fast { relative } => (OF_READOUT * relative).max(FORGOTTEN),
            _ => FORGOTTEN,
        };
        let e_folds = -forgotten.ln();
        let longest = self.traps.iter().map(Trap::longest_release_transfers).fold(0.0, f64::max);
        let slope = |trap: &Trap| trap.steepest(&self.cloud, charge_e, background_e);
        let travelled = transfers * self.traps.iter().map(slope).sum::<f64>();
        // The tail of a Poisson distribution beyond its mean.
        e_folds * longest + travelled + (2.0 * e_folds * travelled).sqrt() + e_folds
    }
}

impl Trap {
    /// The longest release time of these traps, in units of one transfer.
    fn longest_release_transfers(&self) -> f64 {
        if self.density_per_px > 0.0 { self.release_transfers * (WIDEST_SIGMA * self.release_sigma).exp() } else { 0.0 }
    }

    /// Upper limit of the change of the charge in these traps with that of equal packets that pass, per pixel.
    fn steepest(&self, cloud: &Cloud, charge_e: f64, background_e: f64) -> f64 {
        let cloud = self.well_fill_power.map_or_else(|| cloud.clone(), |power| cloud.with_power(power));
        let cloud = self.surface_level_e.map_or_else(|| cloud.clone(), |level_e| cloud.above_level(level_e));
        let packet_e = charge_e + background_e;
        let height = cloud.height(packet_e);
        let local = (height - cloud.height((1.0 - STEP) * packet_e)) / (STEP * packet_e);
        let longest = self.longest_release_transfers();
        // The smaller packets of the front may capture faster if capture depends on their density.
        let filled = if self.capture_transfers > 0.0 && self.capture_density.is_none() {
            longest / (longest + self.capture_transfers)
        } else {
            1.0
        };
        self.density_per_px * filled * local.max(height / charge_e)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, s};

    use crate::{Cloud, Downstream, Method, Readout, Trap};

    const TRANSFERS: i64 = 500;

    /// The last of `rows` rows of light, and its trail, e-.
    fn end(readout: &Readout, charge_e: f64, rows: usize, ahead_e: f64) -> Vec<f64> {
        let mut image = Array2::zeros((rows + 8, 1));
        image.slice_mut(s![..rows, ..]).fill(charge_e);
        let read = readout.parallel(&image, Downstream { rows: TRANSFERS - rows as i64, charge_e: ahead_e });
        read.column(0).iter().skip(rows - 1).copied().collect()
    }

    #[test]
    fn a_flat_field_is_flat_behind_the_rows_that_feel_its_front() {
        let mut shortened = 0;
        for density_per_px in [0.02, 1.0, 8.0, 40.0] {
            for release_transfers in [0.2, 3.0, 9.0] {
                for charge_e in [60.0, 3e4] {
                    for capture_transfers in [0.0, 2.0, 60.0] {
                        let slow = Trap { capture_transfers, ..Trap::new(density_per_px, release_transfers) };
                        let readout = Readout {
                            traps: vec![Trap::new(0.5 * density_per_px, 0.7), slow],
                            cloud: Cloud::new(1e5, 0.0, 0.5),
                            method: Method::Exact,
                        };
                        let until = readout.rows_until_flat(charge_e, 0.0, TRANSFERS as f64).ceil() as usize;
                        if until >= 480 {
                            continue;
                        }
                        shortened += 1;
                        let whole = end(&readout, charge_e, 490, 0.0);
                        for ahead_e in [0.0, charge_e] {
                            let short = end(&readout, charge_e, until, ahead_e);
                            for (short, whole) in short.iter().zip(&whole) {
                                assert!(
                                    (short - whole).abs() < 1e-9 * charge_e,
                                    "{short} of a short field, {whole} of a long one: {readout:?}"
                                );
                            }
                        }
                    }
                }
            }
        }
        assert!(shortened > 20, "{shortened}");
    }
}
