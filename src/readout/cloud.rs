//! How high a packet's charge cloud reaches among the traps.

/// The volume-driven model of a pixel's potential well: a cloud of n electrons fills the well up to a height h(n), in
/// units of the full well's height, and meets every trap below it.
///
/// ```text
/// h(n) = ((n − d) / (w − d))^α,   0 at and below the notch d, never above 1
/// ```
///
/// Rhodes et al. 2010, equation 1. A notch (supplementary buried channel) is taken to be free of traps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloud {
    notch_e: f64,
    per_full_well: f64,
    power: f64,
    square_root: bool,
}

impl Cloud {
    /// A well of `full_well_e` electrons (w) with a notch of `notch_e` (d, below w) and fill power `power` (α > 0).
    ///
    /// # Panics
    /// Where the full well is not above the notch.
    pub fn new(full_well_e: f64, notch_e: f64, power: f64) -> Cloud {
        assert!(full_well_e > notch_e, "full well {full_well_e} e- must be above the notch {notch_e} e-");
        Cloud { notch_e, per_full_well: 1.0 / (full_well_e - notch_e), power, square_root: power == 0.5 }
    }

    /// Height of a cloud of `charge_e` electrons, 0 to 1.
    #[inline]
    pub fn height(&self, charge_e: f64) -> f64 {
        let filled = (charge_e - self.notch_e) * self.per_full_well;
        // Written so that NaN has no height.
        if filled > 0.0 {
            // sqrt is several times cheaper than powf, and 0.5 is what most detectors are described by.
            let height = if self.square_root { filled.sqrt() } else { filled.powf(self.power) };
            height.min(1.0)
        } else {
            0.0
        }
    }

    /// Steepest slope dh/dn (per electron) of packets between two charges (e-); infinite where it has no limit.
    pub(super) fn steepest(&self, low_e: f64, high_e: f64) -> f64 {
        let slope = |charge_e: f64| {
            let filled = (charge_e - self.notch_e) * self.per_full_well;
            if filled <= 0.0 {
                if self.power < 1.0 && high_e > self.notch_e { f64::INFINITY } else { 0.0 }
            } else {
                self.power * filled.powf(self.power - 1.0) * self.per_full_well
            }
        };
        slope(low_e).max(slope(high_e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_is_flat_below_the_notch_and_full_at_the_full_well() {
        let cloud = Cloud::new(1000.0, 100.0, 0.7);
        assert_eq!(cloud.height(-5.0), 0.0);
        assert_eq!(cloud.height(100.0), 0.0);
        assert_eq!(cloud.height(f64::NAN), 0.0);
        assert_eq!(cloud.height(1000.0), 1.0);
        assert_eq!(cloud.height(1e9), 1.0);
        assert!((cloud.height(550.0) - 0.5_f64.powf(0.7)).abs() < 1e-15);
        assert!((Cloud::new(1000.0, 0.0, 0.5).height(250.0) - 0.5).abs() < 1e-15);
    }
}
