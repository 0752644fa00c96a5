//! Smooth components of the residuals of a file: everything that effects can do, and any other function of its conditions.

use nalgebra::{DMatrix, DVector};

use crate::analysis::measurement::DataSet;
use crate::numeric::least_squares::Span;

/// Highest power of a condition.
const DEGREE: usize = 3;

/// Columns of every file, regardless of its conditions.
const CONSTANTS: usize = 2;

/// Share of a column beyond the others, below which it adds nothing: a hundred sigma of an effect leave two.
const FLAT: f64 = 0.02;

/// Share of the directions of the rows that may be smooth.
const MOST: f64 = 0.4;

/// The condition whose values are epochs.
const EPOCH: &str = "t_yr";

/// Rows per word of a column, on average, from which each word has its own constant.
const ROWS_OF_A_WORD: usize = 4;

/// Polynomials in every condition, products of two conditions, and a constant for every word, each alone and times the model; and for
/// every epoch the change of the model with a temperature that no column records. In quoted errors.
pub(super) fn columns(set: &DataSet, model: &[f64], per_kelvin: Option<&[f64]>) -> Vec<DVector<f64>> {
    let rows = set.rows.len();
    let mut shapes: Vec<Vec<f64>> = vec![vec![1.0; rows]];
    let mut places: Vec<Vec<f64>> = Vec::new();
    let mut epochs: Vec<Vec<f64>> = Vec::new();
    for name in &set.varying {
        let values = set.against(name);
        if set.is_words(name) {
            shapes.extend(of_words(&values));
            continue;
        }
        let (ranks, distinct) = ranks(&values);
        let last = (distinct.max(2) - 1) as f64;
        // Ranks scaled from −1 to 1; 0 for values that are not finite.
        let place: Vec<f64> =
            ranks.iter().map(|rank| rank.map_or(0.0, |rank| 2.0 * rank as f64 / last - 1.0)).collect();
        let power = |power: usize| place.iter().map(|place| place.powi(power as i32)).collect();
        shapes.extend((1..=DEGREE.min(distinct.saturating_sub(1))).map(power));
        // What all rows of one epoch (or pixel, ...) have in common need not be smooth, and is no scatter of single rows.
        let constants = of_words(&ranks.iter().map(|rank| rank.map_or(-1.0, |rank| rank as f64)).collect::<Vec<f64>>());
        if name == EPOCH {
            epochs.clone_from(&constants);
        }
        shapes.extend(constants);
        places.push(place);
    }
    for (index, one) in places.iter().enumerate() {
        for other in &places[index + 1..] {
            shapes.push(one.iter().zip(other).map(|(one, other)| one * other).collect());
        }
    }
    let over_sigma =
        |shape: &[f64], factor: &[f64]| DVector::from_fn(rows, |row, _| shape[row] * factor[row] / set.rows[row].sigma);
    let alone = vec![1.0; rows];
    let of_shapes = shapes.iter().flat_map(|shape| [over_sigma(shape, &alone), over_sigma(shape, model)]);
    let of_epochs = epochs.iter().filter_map(|epoch| Some(over_sigma(epoch, per_kelvin?)));
    of_shapes.chain(of_epochs).collect()
}

/// The rank of each value among the distinct ones, None for values that are not finite; and the number of distinct values.
fn ranks(values: &[f64]) -> (Vec<Option<usize>>, usize) {
    let mut distinct: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup();
    // −0 and 0 are one value, and NaN equals none.
    let rank = |value: &f64| {
        let rank = distinct.partition_point(|known| known < value);
        (distinct.get(rank) == Some(value)).then_some(rank)
    };
    (values.iter().map(rank).collect(), distinct.len())
}

/// One column for every word (words are numbered); none if there are too many words.
fn of_words(words: &[f64]) -> Vec<Vec<f64>> {
    let count = words.iter().copied().fold(-1.0, f64::max) as i64 + 1;
    if count as usize * ROWS_OF_A_WORD > words.len() {
        return Vec::new();
    }
    (0..count).map(|word| words.iter().map(|other| f64::from(u8::from(*other == word as f64))).collect()).collect()
}

/// Orthonormal basis of the columns, the most important directions first. The first columns, a constant alone and times the model,
/// are always included: files have pedestals and gains.
pub(super) fn directions(smooth: Vec<DVector<f64>>, signatures: Vec<DVector<f64>>) -> DMatrix<f64> {
    let first = Span::of(&DMatrix::from_columns(&smooth[..CONSTANTS]), 1e-6).directions().clone();
    let most = (MOST * first.nrows() as f64) as usize;
    // As a share of a unit vector, so that a nearly constant column counts little.
    let beyond = |column: &DVector<f64>| {
        let column = column / column.norm().max(f64::MIN_POSITIVE);
        &column - &first * first.tr_mul(&column)
    };
    let others: Vec<DVector<f64>> =
        smooth[CONSTANTS..].iter().chain(&signatures).map(beyond).filter(|left| left.norm() > FLAT).collect();
    if others.is_empty() || first.ncols() >= most {
        return first;
    }
    let others = Span::of(&DMatrix::from_columns(&others), FLAT).directions().clone();
    let count = others.ncols().min(most - first.ncols());
    DMatrix::from_columns(&first.column_iter().chain(others.columns(0, count).column_iter()).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::ranks;

    #[test]
    fn equal_values_have_one_rank_and_values_that_are_not_finite_none() {
        let (ranks, distinct) = ranks(&[5.0, -0.0, f64::NAN, 0.0, -1.0, f64::INFINITY, 5.0]);
        assert_eq!(ranks, [Some(2), Some(1), None, Some(1), Some(0), None, Some(2)]);
        assert_eq!(distinct, 3);
    }
}
