//! Gauss coefficients → eccentric dipole, and L in it.
//!
//! Fraser-Smith 1987 (Rev. Geophys. 25, 1): the dipole whose centre minimises the quadrupole.

use crate::field::{Coefficients, length};

/// An eccentric dipole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dipole {
    /// Centre, geocentric, RE.
    pub centre: [f64; 3],
    /// Unit vector towards the magnetic pole in the north.
    pub axis: [f64; 3],
}

impl Dipole {
    /// The eccentric dipole of a field.
    pub fn of(field: &Coefficients) -> Dipole {
        let ((g10, _), (g11, h11)) = (field.at(1, 0), field.at(1, 1));
        let ((g20, _), (g21, h21), (g22, h22)) = (field.at(2, 0), field.at(2, 1), field.at(2, 2));
        let square = g10 * g10 + g11 * g11 + h11 * h11;
        let root3 = 3_f64.sqrt();
        let l0 = 2.0 * g10 * g20 + root3 * (g11 * g21 + h11 * h21);
        let l1 = -g11 * g20 + root3 * (g10 * g21 + g11 * g22 + h11 * h22);
        let l2 = -h11 * g20 + root3 * (g10 * h21 - h11 * g22 + g11 * h22);
        let k = (l0 * g10 + l1 * g11 + l2 * h11) / (4.0 * square);
        let centre = [l1 - g11 * k, l2 - h11 * k, l0 - g10 * k].map(|component| component / (3.0 * square));
        let strength = square.sqrt();
        Dipole { centre, axis: [g11, h11, g10].map(|component| -component / strength) }
    }

    /// L (RE) of a geocentric place: where its field line crosses the dipole's equator.
    pub fn l(&self, place: [f64; 3]) -> f64 {
        let from_centre = [0, 1, 2].map(|axis| place[axis] - self.centre[axis]);
        let distance = length(from_centre);
        let sin = (0..3).map(|axis| from_centre[axis] * self.axis[axis]).sum::<f64>() / distance;
        distance / (1.0 - sin * sin)
    }
}
