//! Height of a packet's charge cloud among the traps.

use std::sync::Arc;

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

use super::power::power;
use super::simd::{LANES, Packets, Vector};

/// The volume-driven model of a pixel's potential well: a cloud of n electrons fills the well up to a height h(n), in
/// units of the full well's height, and meets every trap below it.
///
/// ```text
/// h(n) = a + (1 − a) ((n − d) / (w − d))^α,   a at and below the notch d, 0 without charge, never above 1
/// ```
///
/// Rhodes et al. 2010, equation 1, with the volume at zero charge a of Clarke et al. 2012 (V = a + c n^β). A notch (supplementary
/// buried channel) is taken to have no traps except those in a, which any charge reaches.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    notch_e: f64,
    per_full_well: f64,
    power: f64,
    volume_at_zero: f64,
    law: Law,
}

#[derive(Clone, Debug, PartialEq)]
enum Law {
    /// α = ½: sqrt is several times cheaper than powf, and most detectors are described by ½.
    SquareRoot,
    Power,
    Table(Arc<Table>),
}

impl Cloud {
    /// A well of `full_well_e` electrons (w) with a notch of `notch_e` (d, below w) and fill power `power` (α > 0).
    ///
    /// # Panics
    /// If the full well is not above the notch.
    pub fn new(full_well_e: f64, notch_e: f64, power: f64) -> Cloud {
        assert!(full_well_e > notch_e, "full well {full_well_e} e- must be above the notch {notch_e} e-");
        let law = if power == 0.5 { Law::SquareRoot } else { Law::Power };
        Cloud { notch_e, per_full_well: 1.0 / (full_well_e - notch_e), power, volume_at_zero: 0.0, law }
    }

    /// The same well, with the fraction `volume_at_zero` (a, from 0 to below 1) filled by any charge.
    pub fn with_volume_at_zero(self, volume_at_zero: f64) -> Cloud {
        Cloud { volume_at_zero, ..self }
    }

    /// The same well with another fill power; a cloud of another law is unchanged.
    pub fn with_power(&self, power: f64) -> Cloud {
        match self.law {
            Law::Table(_) => self.clone(),
            _ if power == 0.5 => Cloud { power, law: Law::SquareRoot, ..self.clone() },
            _ => Cloud { power, law: Law::Power, ..self.clone() },
        }
    }

    /// The same well above a level (e-, below the full well): the volume filled by a packet above the level, in units of that
    /// filled by a full well. This is the cloud seen by traps at the surface.
    ///
    /// ```text
    /// h(n) = ((n − level) / (w − level))^α, 0 below the level
    /// ```
    ///
    /// For a tabulated cloud h it is (h(n) − h(level)) / (1 − h(level)).
    ///
    /// # Panics
    /// If the full well is not above the level.
    pub fn above_level(&self, level_e: f64) -> Cloud {
        if let Law::Table(table) = &self.law {
            let law = Law::Table(Arc::new(table.above(table.height(level_e))));
            return Cloud { law, volume_at_zero: 0.0, ..self.clone() };
        }
        let full_well_e = self.notch_e + 1.0 / self.per_full_well;
        Cloud::new(full_well_e, level_e, self.power)
    }

    /// The fraction of the well that any charge fills, a.
    pub fn volume_at_zero(&self) -> f64 {
        self.volume_at_zero
    }

    /// A cloud of another law, given as height against charge (e-) and stored as a table (see [`Cloud::height`]). The height is 0
    /// without charge, and is limited to 0 to 1.
    ///
    /// # Errors
    /// If the law has no value at some charge.
    pub fn tabulated<E>(height: impl Fn(f64) -> Result<f64, E>) -> Result<Cloud, E> {
        let law = Law::Table(Arc::new(Table::of(height)?));
        Ok(Cloud { notch_e: 0.0, per_full_well: 1.0, power: 1.0, volume_at_zero: 0.0, law })
    }

    /// Height of a cloud of `charge_e` electrons, 0 to 1. A tabulated one has a relative error of 1e-6 if the law is as smooth as a
    /// power (a kink is smoothed over 0.2 % of its charge); it is constant above 1e9 e-.
    #[inline]
    pub fn height(&self, charge_e: f64) -> f64 {
        // Written so that NaN gives height 0, here and below.
        if charge_e > 0.0 {
            self.volume_at_zero + (1.0 - self.volume_at_zero) * self.height_above_notch(charge_e)
        } else {
            0.0
        }
    }

    /// Electrons in a cloud per volume that it fills, n/h(n), in units of e- per full well's volume; 0 if the cloud has no height
    /// and reaches no trap. The whole charge counts: a notch has no volume of its own except the volume at zero charge. With a
    /// notch and no such volume, the density diverges towards the notch, while the number of traps reached vanishes.
    pub fn density_e(&self, charge_e: f64) -> f64 {
        let height = self.height(charge_e);
        if height > 0.0 { charge_e / height } else { 0.0 }
    }

    /// ((n − d) / (w − d))^α, 0 to 1.
    #[inline]
    fn height_above_notch(&self, charge_e: f64) -> f64 {
        let filled = (charge_e - self.notch_e) * self.per_full_well;
        if filled > 0.0 {
            let height = match &self.law {
                Law::SquareRoot => filled.sqrt(),
                Law::Power => power(filled, self.power),
                Law::Table(table) => table.height(charge_e),
            };
            height.min(1.0)
        } else {
            0.0
        }
    }

    /// Heights of several clouds at once.
    #[inline(always)]
    pub(super) fn heights<S: Simd>(&self, simd: S, charge_e: Vector<S>) -> Vector<S> {
        let (zero, one) = (Vector::all(simd, 0.0), Vector::all(simd, 1.0));
        let filled = (charge_e + -self.notch_e) * self.per_full_well;
        let tiny = Vector::all(simd, TINY);
        let heights = match self.law {
            // The root of a tiny number replaces that of 0.
            Law::SquareRoot => filled.max(tiny).sqrt(),
            _ => {
                let mut heights = [0.0; LANES];
                charge_e.store(&mut heights);
                self.each_height(&mut heights);
                Vector::load(simd, &heights)
            }
        };
        let above_notch = tiny.below(filled).select(heights.min(one), zero);
        if self.volume_at_zero == 0.0 {
            return above_notch;
        }
        let all = above_notch * (1.0 - self.volume_at_zero) + self.volume_at_zero;
        zero.below(charge_e).select(all, zero)
    }

    /// Replaces charges (e-) by heights.
    pub(super) fn heights_in_place(&self, numbers: &mut [Packets]) {
        dispatch!(Level::new(), simd => {
            for row in numbers {
                self.heights(simd, Vector::load(simd, row)).store(row);
            }
        });
    }

    /// Replaces charges (e-) by heights, one by one; below the notch or above the full well they may have any value.
    // Not inlined into the caller, whose most common case must not be slowed down by this one.
    #[inline(never)]
    fn each_height(&self, numbers: &mut Packets) {
        match &self.law {
            Law::Table(table) => numbers.iter_mut().for_each(|number| *number = table.height(*number)),
            _ => dispatch!(Level::new(), _simd => {
                for number in &mut *numbers {
                    let filled = (*number - self.notch_e) * self.per_full_well;
                    *number = power(if filled > TINY { filled } else { TINY }, self.power);
                }
            }),
        }
    }

    /// Steepest slopes dh/dn (per electron) between two charges each (e-); infinite if unlimited or unknown.
    #[inline(always)]
    pub(super) fn steepest<S: Simd>(&self, simd: S, from_e: Vector<S>, to_e: Vector<S>) -> Vector<S> {
        let (zero, unlimited) = (Vector::all(simd, 0.0), Vector::all(simd, f64::INFINITY));
        if matches!(self.law, Law::Table(_)) {
            return unlimited;
        }
        let (lower_e, upper_e) = (from_e.min(to_e), from_e.max(to_e));
        // A power below 1 is steepest at the lower end.
        let nearest_e = if self.power < 1.0 { lower_e } else { upper_e };
        let above_e = nearest_e + -self.notch_e;
        let steep = (self.heights(simd, nearest_e) + -self.volume_at_zero) * self.power / above_e;
        let steep = zero.below(above_e).select(steep, unlimited);
        let steep = Vector::all(simd, self.notch_e).below(upper_e).select(steep, zero);
        if self.volume_at_zero == 0.0 {
            return steep;
        }
        // The height jumps where charge begins.
        zero.below(lower_e).select(steep, zero.below(upper_e).select(unlimited, zero))
    }

    /// The steepest slope of the height (per electron) for packets of at least this charge (e-), between charges of 1, 1.01, 2.02,
    /// 4.04 ... times that charge.
    pub(super) fn steepest_from(&self, charge_e: f64) -> f64 {
        let slope = |low_e: f64, high_e: f64| (self.height(high_e) - self.height(low_e)) / (high_e - low_e);
        let mut steepest = 0.0;
        let [mut low_e, mut high_e] = [charge_e, 1.01 * charge_e];
        while high_e > low_e && low_e < LARGEST_E && self.height(low_e) < 1.0 {
            steepest = f64::max(steepest, slope(low_e, high_e));
            [low_e, high_e] = [high_e, 2.0 * high_e];
        }
        steepest
    }
}

/// Largest charge for which a well is evaluated, e-.
const LARGEST_E: f64 = 1e9;

/// Share of the full well below which clouds have no height in the vector code: far less than one electron of any well.
const TINY: f64 = 1e-30;

/// Heights at charges evenly spaced in their logarithm.
#[derive(Debug, PartialEq)]
struct Table(Vec<f64>);

/// Logarithm of the smallest and of the largest charge of a table, and knots per unit of it.
const LN_LEAST: f64 = -14.0;
const LN_LARGEST: f64 = 20.75;
const KNOTS_PER_E: f64 = 512.0;

impl Table {
    fn of<E>(height: impl Fn(f64) -> Result<f64, E>) -> Result<Table, E> {
        let knots = ((LN_LARGEST - LN_LEAST) * KNOTS_PER_E) as usize;
        let at = |knot: usize| height((LN_LEAST + knot as f64 / KNOTS_PER_E).exp());
        // NaN has no height.
        let cut = |height: f64| if height.is_nan() { 0.0 } else { height.clamp(0.0, 1.0) };
        Ok(Table((0..=knots).map(|knot| at(knot).map(cut)).collect::<Result<_, E>>()?))
    }

    /// Heights above a level, in units of the range above it.
    fn above(&self, level: f64) -> Table {
        let left = 1.0 - level;
        let above = |height: &f64| if left > 0.0 { (height - level).max(0.0) / left } else { 0.0 };
        Table(self.0.iter().map(above).collect())
    }

    fn height(&self, charge_e: f64) -> f64 {
        let Table(heights) = self;
        let place = (charge_e.ln() - LN_LEAST) * KNOTS_PER_E;
        if place <= 0.0 {
            // Below a millionth of an electron: proportional to the charge.
            return heights[0] * charge_e / LN_LEAST.exp();
        }
        let knot = (place as usize).min(heights.len() - 2);
        let share = (place - knot as f64).min(1.0);
        heights[knot] + share * (heights[knot + 1] - heights[knot])
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

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

    #[test]
    fn any_charge_fills_the_volume_at_zero() {
        let cloud = Cloud::new(1000.0, 100.0, 0.7).with_volume_at_zero(0.3);
        for nothing in [-5.0, 0.0, f64::NAN] {
            assert_eq!(cloud.height(nothing), 0.0);
        }
        for within_the_notch in [1e-20, 50.0, 100.0] {
            assert_eq!(cloud.height(within_the_notch), 0.3);
        }
        assert!((cloud.height(550.0) - (0.3 + 0.7 * 0.5_f64.powf(0.7))).abs() < 1e-15);
        assert_eq!(cloud.height(1e9), 1.0);
    }

    #[test]
    fn clouds_side_by_side_are_as_high_as_alone_and_the_same_by_all_instructions() {
        let laws = [
            Cloud::new(1e5, 0.0, 0.5),
            Cloud::new(1e5, 90.0, 0.5),
            Cloud::new(1e5, 90.0, 0.31),
            Cloud::new(1e5, 0.0, 0.5).with_volume_at_zero(0.09),
            Cloud::new(1e5, 90.0, 0.31).with_volume_at_zero(0.51),
            Cloud::tabulated(|charge_e| Ok::<_, Infallible>((charge_e / 1e5).powf(0.4))).unwrap(),
        ];
        let charge_e: Packets = std::array::from_fn(|lane| [-3.0, 0.0, 1e-9, 0.7, 90.0, 90.1, 4e4, 3e5][lane % 8]);
        for cloud in laws {
            let heights = |level| {
                let mut heights = [0.0; LANES];
                dispatch!(level, simd => cloud.heights(simd, Vector::load(simd, &charge_e)).store(&mut heights));
                heights
            };
            let found = heights(Level::new());
            assert_eq!(found, heights(Level::baseline()));
            for (height, charge_e) in found.into_iter().zip(charge_e) {
                let alone = cloud.height(charge_e);
                assert!((height - alone).abs() <= 1e-13 * alone, "{charge_e} e-: {height}, {alone}");
            }
        }
    }

    #[test]
    fn a_table_of_a_power_law_is_that_law() {
        for power in [0.3, 0.5, 1.0, 2.0] {
            let law = Cloud::new(1e5, 0.0, power);
            let table = Cloud::tabulated(|charge_e| Ok::<_, Infallible>((charge_e / 1e5).powf(power))).unwrap();
            for charge_e in [-1.0, 0.0, 1e-3, 0.77, 1.0, 123.4, 5e4, 9.9e4, 1e7, 1e12] {
                let (table, law) = (table.height(charge_e), law.height(charge_e));
                assert!((table - law).abs() <= 2e-6 * law, "{power}, {charge_e} e-: {table}, {law}");
            }
        }
    }
}
