//! Pixels without a measured charge: missing ones, and saturated ones.
//!
//! A missing pixel (NaN, infinite, or BLANK) held charge when it was clocked, so the readout needs a value: the median of the
//! nearby pixels in its column, the direction of transfer. It remains missing in the output.
//!
//! A saturated pixel holds at least a full well, or more than the range of the converter. The effect of a full well on the traps is
//! known, regardless of its charge; its own charge is not, so a correction leaves it unchanged.

use ndarray::{Array1, Array2, ArrayView1, Axis};

use crate::readout::Cloud;

/// Rows on each side of a missing pixel in the median.
const NEAR_ROWS: usize = 5;

/// Sets a charge in every pixel without a finite one, and returns the mask of these.
///
/// `charge_e[[row, column]]`. The charge is the median of the finite pixels of the column within five rows; if there are none, of
/// the column; if there are none, of the image; and 0 if nothing is finite.
pub fn fill(charge_e: &mut Array2<f64>) -> Array2<bool> {
    let missing = charge_e.mapv(|charge| !charge.is_finite());
    if !missing.iter().any(|missing| *missing) {
        return missing;
    }
    let seen = charge_e.clone();
    let everywhere = std::cell::OnceCell::new();
    for (column, mut filled) in charge_e.axis_iter_mut(Axis(1)).enumerate() {
        let lane: ArrayView1<f64> = seen.column(column);
        for row in (0..lane.len()).filter(|row| missing[[*row, column]]) {
            let near = row.saturating_sub(NEAR_ROWS)..(row + NEAR_ROWS + 1).min(lane.len());
            filled[row] = median(near.map(|row| lane[row]))
                .or_else(|| median(lane.iter().copied()))
                .or_else(|| *everywhere.get_or_init(|| median(seen.iter().copied())))
                .unwrap_or(0.0);
        }
    }
    missing
}

/// Pixels whose charge clouds have the maximum height, and those of at least `from_e` (e-).
pub fn saturated(charge_e: &Array2<f64>, cloud: &Cloud, from_e: f64) -> Array2<bool> {
    charge_e.mapv(|charge| charge >= from_e || cloud.height(charge) >= 1.0)
}

/// Largest number of pixels from which a level is estimated: a fraction of millions is sufficient.
const LEVEL_PX: usize = 100_000;

/// Median charges of pixels that are read but hold no light, and of those that do. None if there are none of either.
pub fn levels_e(charge_e: &Array2<f64>, covered: &Array2<bool>, lit: &Array2<bool>) -> Option<(f64, f64)> {
    let level_e = |wanted: bool| {
        let is_wanted = |(_, (covered, lit)): &(&f64, (&bool, &bool))| **covered && **lit == wanted;
        let charges = || charge_e.iter().zip(covered.iter().zip(lit)).filter(is_wanted).map(|(charge, _)| *charge);
        median(charges().step_by(charges().count().div_ceil(LEVEL_PX).max(1)))
    };
    Some((level_e(false)?, level_e(true)?))
}

/// Median of the finite values, the mean of the two middle ones if their number is even.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let middle = Array1::from_vec(values[(values.len() - 1) / 2..=values.len() / 2].to_vec());
    middle.mean()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn a_missing_pixel_gets_the_median_of_its_column_nearby() {
        let mut charge_e = array![[1.0, 100.0], [f64::NAN, 200.0], [3.0, f64::INFINITY], [9.0, 300.0]];
        let missing = fill(&mut charge_e);
        assert_eq!(charge_e, array![[1.0, 100.0], [3.0, 200.0], [3.0, 200.0], [9.0, 300.0]]);
        assert_eq!(missing.iter().filter(|missing| **missing).count(), 2);
    }

    #[test]
    fn far_neighbours_do_not_count_and_an_empty_column_takes_the_image() {
        let mut charge_e = Array2::from_elem((20, 2), 5.0);
        charge_e[[0, 0]] = f64::NAN;
        charge_e[[6, 0]] = 1e9;
        charge_e.column_mut(1).fill(f64::NAN);
        fill(&mut charge_e);
        assert_eq!((charge_e[[0, 0]], charge_e[[10, 1]]), (5.0, 5.0));
        let mut nothing = Array2::from_elem((2, 2), f64::NAN);
        fill(&mut nothing);
        assert_eq!(nothing, Array2::<f64>::zeros((2, 2)));
    }

    #[test]
    fn a_full_well_is_saturated() {
        let cloud = Cloud::new(1000.0, 10.0, 0.5);
        let charge_e = array![[899.0, 999.0, 1000.0, -5.0, 2000.0]];
        assert_eq!(saturated(&charge_e, &cloud, f64::INFINITY), array![[false, false, true, false, true]]);
        assert_eq!(saturated(&charge_e, &cloud, 900.0), array![[false, true, true, false, true]]);
    }
}
