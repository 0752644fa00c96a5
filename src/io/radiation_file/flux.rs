//! Units of fluxes and fluences.

use std::f64::consts::PI;

use super::{Quantity, Time};
use crate::io::unit::Unit;

impl Unit {
    /// For the unit of a flux or a fluence: the quantity, the time, and the factor to omnidirectional values in cm, s and MeV. An
    /// isotropic flux per steradian is 1/(4 pi) of the omnidirectional one.
    pub(super) fn flux(self) -> Option<(Quantity, Time, f64)> {
        let [cm, s, angle, mev, others @ ..] = self.powers;
        let quantity = match mev {
            0 => Quantity::Integral,
            -1 => Quantity::Differential,
            _ => return None,
        };
        let time = match s {
            0 => Time::Mission,
            -1 => Time::PerSecond,
            _ => return None,
        };
        let sphere = match angle {
            0 => 1.0,
            -2 => 4.0 * PI,
            _ => return None,
        };
        (cm == -2 && others.iter().all(|power| *power == 0)).then_some((quantity, time, self.factor * sphere))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fluxes_become_omnidirectional_in_cm_s_and_mev() {
        let flux = |text| Unit::parse(text).unwrap().flux();
        assert_eq!(flux("cm!u-2!n"), Some((Quantity::Integral, Time::Mission, 1.0)));
        assert_eq!(flux("1/(cm2 s keV)"), Some((Quantity::Differential, Time::PerSecond, 1000.0)));
        let (quantity, time, factor) = flux("m-2 sr-1 s-1 MeV-1").unwrap();
        assert_eq!((quantity, time), (Quantity::Differential, Time::PerSecond));
        assert!((factor / (4.0 * PI * 1e-4) - 1.0).abs() < 1e-14);
        for other in ["MeV", "MeV.cm2.g-1", "mm", "cm-2 s-2", "cm-3", "electron cm-2"] {
            assert_eq!(flux(other), None, "{other}");
        }
    }
}
