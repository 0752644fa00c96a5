//! Smooth components of the residuals of a file: everything that effects can do, and any other function of its conditions.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::analysis::measurement::DataSet;
use crate::numeric::least_squares::Span;

/// Highest power of a condition.
const DEGREE: usize = 3;

/// Columns of every file, regardless of its conditions.
const CONSTANTS: usize = 2;

/// Share of a column beyond the others, below which it adds nothing: a hundred sigma of an effect leave two.
const FLAT: f64 = 0.02;

/// Share of the directions of the rows that may be smooth, and with drifts from epoch to epoch.
const MOST: f64 = 0.4;
const MOST_WITH_DRIFTS: f64 = 0.5;

/// The condition whose values are epochs.
const EPOCH: &str = "t_yr";

/// Rows per word of a column, on average, from which each word has its own constant.
const ROWS_OF_A_WORD: usize = 4;

/// Polynomials in every condition, products of two conditions, and a constant for every word, each alone and times the model; in
/// quoted errors without the common ones.
pub(super) fn columns(set: &DataSet, model: &[f64]) -> Vec<DVector<f64>> {
    let rows = set.rows.len();
    let mut shapes: Vec<Vec<f64>> = vec![vec![1.0; rows]];
    let mut places: Vec<Vec<f64>> = Vec::new();
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
        shapes.extend(of_ranks(&ranks));
        places.push(place);
    }
    for (index, one) in places.iter().enumerate() {
        for other in &places[index + 1..] {
            shapes.push(one.iter().zip(other).map(|(one, other)| one * other).collect());
        }
    }
    let alone = vec![1.0; rows];
    shapes.iter().flat_map(|shape| [over_sigma(set, shape, &alone), over_sigma(set, shape, model)]).collect()
}

/// The known errors in common of each group of rows, in quoted errors without them.
pub(super) fn of_groups(set: &DataSet) -> Vec<DVector<f64>> {
    let mut groups: BTreeMap<usize, DVector<f64>> = BTreeMap::new();
    for (place, row) in set.rows.iter().enumerate().filter(|(_, row)| row.common.sigma > 0.0) {
        let column = groups.entry(row.common.group).or_insert_with(|| DVector::zeros(set.rows.len()));
        column[place] = row.common.sigma / row.own_sigma();
    }
    groups.into_values().collect()
}

/// A change of the model with something that differs from epoch to epoch, for every epoch; in quoted errors.
pub(super) fn of_epochs(set: &DataSet, change: &[f64]) -> Vec<DVector<f64>> {
    if !set.varies_in(EPOCH) {
        return Vec::new();
    }
    of_ranks(&ranks(&set.against(EPOCH)).0).iter().map(|epoch| over_sigma(set, epoch, change)).collect()
}

/// A shape times a factor of each row, over quoted errors.
fn over_sigma(set: &DataSet, shape: &[f64], factor: &[f64]) -> DVector<f64> {
    DVector::from_fn(shape.len(), |row, _| shape[row] * factor[row] / set.rows[row].own_sigma())
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

/// One column for every rank, as for words.
fn of_ranks(ranks: &[Option<usize>]) -> Vec<Vec<f64>> {
    of_words(&ranks.iter().map(|rank| rank.map_or(-1.0, |rank| rank as f64)).collect::<Vec<f64>>())
}

/// One column for every word (words are numbered); none if there are too many words.
fn of_words(words: &[f64]) -> Vec<Vec<f64>> {
    let count = words.iter().copied().fold(-1.0, f64::max) as i64 + 1;
    if count as usize * ROWS_OF_A_WORD > words.len() {
        return Vec::new();
    }
    (0..count).map(|word| words.iter().map(|other| f64::from(u8::from(*other == word as f64))).collect()).collect()
}

/// Orthonormal basis of the columns, the most important directions first. Errors in common and the first smooth columns, a constant alone
/// and times the model, are always included: files have pedestals and gains. What drifts from epoch to epoch comes last.
pub(super) fn directions(
    in_common: Vec<DVector<f64>>,
    smooth: Vec<DVector<f64>>,
    signatures: Vec<DVector<f64>>,
    drifts: Vec<DVector<f64>>,
) -> DMatrix<f64> {
    let always: Vec<DVector<f64>> = in_common.into_iter().chain(smooth[..CONSTANTS].iter().cloned()).collect();
    let first = Span::of(&DMatrix::from_columns(&always), 1e-6).directions().clone();
    let others = smooth.into_iter().skip(CONSTANTS).chain(signatures);
    let all = extended(first, others, MOST);
    extended(all, drifts.into_iter(), MOST_WITH_DRIFTS)
}

/// Orthonormal directions, and those of further columns up to a share of the directions of the rows.
fn extended(known: DMatrix<f64>, columns: impl Iterator<Item = DVector<f64>>, most: f64) -> DMatrix<f64> {
    let most = (most * known.nrows() as f64) as usize;
    // As a share of a unit vector, so that a nearly constant column counts little.
    let beyond = |column: DVector<f64>| {
        let column = &column / column.norm().max(f64::MIN_POSITIVE);
        &column - &known * known.tr_mul(&column)
    };
    let others: Vec<DVector<f64>> = columns.map(beyond).filter(|left| left.norm() > FLAT).collect();
    if others.is_empty() || known.ncols() >= most {
        return known;
    }
    let others = Span::of(&DMatrix::from_columns(&others), FLAT).directions().clone();
    let count = others.ncols().min(most - known.ncols());
    DMatrix::from_columns(&known.column_iter().chain(others.columns(0, count).column_iter()).collect::<Vec<_>>())
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
