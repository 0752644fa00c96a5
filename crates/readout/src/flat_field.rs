//! How far into a flat field its first row is felt.
//!
//! What a trap took from a packet is missing in that packet, which then fills less of the next pixels, and leaves more to be filled
//! by the one behind: a difference between rows travels backwards, by N ρ h'(n) rows in N transfers through ρ traps per pixel, and
//! spreads by the root of that. (Where whole packets are emptied, h(n)/n stands for the slope.)
//!
//! How long a trap remembers what the rows ahead did to it depends on the side of the cloud on which it lies. Inside, traps that
//! capture at once are full after each packet, and the others approach their equilibrium by exp(−1/τc − 1/τ) with each. Above the
//! clouds, they release for a release time. If rows ahead are brighter, much is released there. If not, a packet has only filled the
//! few traps above the next one's cloud, which has lost more on its way: with a loss of δ per transfer ρ h' δ of them, a share
//! ρ h' of that loss. All rows behind these distances are equal.

use super::{Cloud, Method, Readout, Trap};

/// The share of a difference that counts as forgotten, as a share of the accuracy of the readout, and without such an accuracy.
const OF_READOUT: f64 = 1e-2;
const FORGOTTEN: f64 = 1e-14;

/// Step for the slope of a well's height, relative to the charge.
const STEP: f64 = 1e-4;

impl Readout {
    /// Rows of a flat field (`charge_e` per pixel on a background of `background_e`, e-) after which all are read equal, if they
    /// make `transfers` transfers behind the background alone, or behind brighter rows too.
    pub fn rows_until_flat(&self, charge_e: f64, background_e: f64, transfers: f64, behind_brighter: bool) -> f64 {
        let forgotten = match self.method {
            Method::Fast { relative } => (OF_READOUT * relative).max(FORGOTTEN),
            _ => FORGOTTEN,
        };
        let e_folds = -forgotten.ln();
        let packet_e = charge_e + background_e;
        let sum = |of: &dyn Fn(&Trap) -> f64| self.traps.iter().map(of).sum::<f64>();
        let most = |of: &dyn Fn(&Trap) -> f64| self.traps.iter().map(of).fold(0.0, f64::max);
        let traps_met = sum(&|trap| transfers * trap.density_per_px * trap.own_cloud(&self.cloud).height(packet_e));
        let left_e = (packet_e - traps_met).max(0.0);
        let inside = most(&|trap| trap.rows_remembered_inside(&self.cloud, [left_e, packet_e], e_folds));
        let slope = sum(&|trap| trap.steepest(&self.cloud, charge_e, background_e));
        let released = if behind_brighter { 1.0 } else { slope.min(1.0) };
        let above = most(&|trap| trap.rows_remembered(trap.release_transfers, (released / forgotten).max(1.0).ln()));
        let travelled = transfers * slope;
        // The tail of a Poisson distribution beyond its mean.
        inside.max(above) + travelled + (2.0 * e_folds * travelled).sqrt() + e_folds
    }
}

impl Trap {
    /// Rows after which these traps have forgotten by some factors of e, if those of the median release time forget one in
    /// `memory_transfers`, and the others in proportion to their release times: the most rows for any of them. Less than exp(−z²/2)
    /// of all lie z standard deviations beyond the median, and need not forget as much: z e^σz/σ rows, with σ (e_folds − z²/2) = z.
    fn rows_remembered(&self, memory_transfers: f64, e_folds: f64) -> f64 {
        let sigma = self.release_sigma;
        if self.density_per_px == 0.0 {
            return 0.0;
        }
        // z/σ, without a difference of nearly equal numbers.
        let z_per_sigma = 2.0 * e_folds / (1.0 + (1.0 + 2.0 * sigma * sigma * e_folds).sqrt());
        memory_transfers * (sigma * sigma * z_per_sigma).exp() * z_per_sigma
    }

    /// The same of traps inside the clouds of equal packets, which have from the first to the second charge: they approach their
    /// equilibrium.
    fn rows_remembered_inside(&self, cloud: &Cloud, charge_e: [f64; 2], e_folds: f64) -> f64 {
        if self.capture_transfers == 0.0 {
            return 0.0;
        }
        let [one, other] = charge_e.map(|charge_e| self.capture_of(cloud, charge_e));
        let capture_rate = self.phase.over / one.max(other);
        let together = self.rows_remembered(1.0 / (capture_rate + 1.0 / self.release_transfers), e_folds);
        together.min(e_folds / capture_rate)
    }

    /// Upper limit of the change of the charge in these traps with that of equal packets that pass, per pixel.
    fn steepest(&self, cloud: &Cloud, charge_e: f64, background_e: f64) -> f64 {
        let cloud = self.own_cloud(cloud);
        let packet_e = charge_e + background_e;
        let height = cloud.height(packet_e);
        let local = (height - cloud.height((1.0 - STEP) * packet_e)) / (STEP * packet_e);
        // The smaller packets of the front may capture faster if capture depends on their density.
        let is_one_rate = self.capture_transfers > 0.0 && self.capture_density.is_none() && self.release_sigma == 0.0;
        let (release, capture) = (self.release_transfers, self.capture_transfers);
        let filled = if is_one_rate { release / (release + capture) } else { 1.0 };
        self.density_per_px * filled * local.max(height / charge_e)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, s};

    use crate::{CaptureDensity, Clock, Cloud, Downstream, Method, Readout, Trap};

    const TRANSFERS: i64 = 500;

    /// The last of `rows` rows of light, and its trail, e-.
    fn end(readout: &Readout, charge_e: f64, rows: usize, ahead_e: f64) -> Vec<f64> {
        let mut image = Array2::zeros((rows + 8, 1));
        image.slice_mut(s![..rows, ..]).fill(charge_e);
        let read = readout.parallel(&image, Downstream { rows: TRANSFERS - rows as i64, charge_e: ahead_e });
        read.column(0).iter().skip(rows - 1).copied().collect()
    }

    /// Traps that capture at once or not, with one release time or many, below one phase or three.
    fn kinds(density_per_px: f64, release_transfers: f64) -> Vec<Vec<Trap>> {
        let median = Trap::new(density_per_px, release_transfers);
        let by_density = Some(CaptureDensity { power: 0.5, at_e: 1000.0 });
        let slow = [
            median,
            Trap { release_sigma: 0.8, ..median },
            Trap { capture_transfers: 2.0, ..median },
            Trap { capture_transfers: 60.0, ..median },
            Trap { capture_transfers: 2.0, release_sigma: 0.8, ..median },
            Trap { capture_transfers: 2.0, capture_density: by_density, ..median },
        ];
        let clocked = |slow| [1, 3].map(|phases| Clock::of_phases(phases).spread(&[Trap::new(0.5, 0.7), slow]));
        slow.into_iter().flat_map(clocked).collect()
    }

    #[test]
    fn a_flat_field_is_flat_behind_the_rows_that_feel_its_front() {
        let (mut shortened, mut tried) = (0, 0);
        for density_per_px in [0.02, 1.0, 40.0] {
            for release_transfers in [0.2, 9.0, 60.0] {
                for traps in kinds(density_per_px, release_transfers) {
                    let readout = Readout { traps, cloud: Cloud::new(1e5, 0.0, 0.5), method: Method::Exact };
                    for (charge_e, relative) in [(60.0, 1e-4), (3e4, 1e-4), (3e4, 1e-10)] {
                        shortened += usize::from(is_flat(&readout, charge_e, relative));
                        tried += 1;
                    }
                }
            }
        }
        assert!(2 * shortened > tried, "{shortened} of {tried}");
    }

    /// Whether the rows that feel the front are few; the last of them is as if there were many.
    fn is_flat(readout: &Readout, charge_e: f64, relative: f64) -> bool {
        let fast = Readout { method: Method::Fast { relative }, ..readout.clone() };
        let until = fast.rows_until_flat(charge_e, 0.0, TRANSFERS as f64, false).ceil() as usize;
        if until >= 480 {
            return false;
        }
        let whole = end(readout, charge_e, 490, 0.0);
        // A tenth of the error that the readout itself may make.
        let allowed_e = 0.1 * relative * (charge_e - whole[0]);
        for ahead_e in [0.0, charge_e] {
            let short = end(readout, charge_e, until, ahead_e);
            for (short, whole) in short.iter().zip(&whole) {
                assert!((short - whole).abs() < allowed_e, "{short} of {until} rows, {whole} of 490: {readout:?}");
            }
        }
        true
    }
}
