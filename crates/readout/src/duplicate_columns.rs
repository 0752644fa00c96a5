//! Identical columns are read out only once: flat fields, blocks, and the two halves of a galaxy that is centred on a pixel.

use ndarray::{Array2, ArrayView2};

use super::simd;

/// Rows compared before whole columns are: columns of a noisy sky already differ there.
const LOOKED_AT: usize = 4;

/// The distinct columns of an image, and which of them each column equals.
pub(super) struct DuplicateColumns {
    /// The first of each set of equal columns, by its index in the image, ascending.
    pub distinct: Vec<usize>,
    /// For each column the index of its equal in `distinct`.
    place: Vec<usize>,
}

impl DuplicateColumns {
    /// The columns of an image (`[[row, column]]`, e-) with what lies downstream of each (e-).
    pub fn of(image: ArrayView2<f64>, downstream_e: &[f64]) -> DuplicateColumns {
        let (rows, columns) = image.dim();
        let looked_at = (0..LOOKED_AT).map(|n| (2 * n + 1) * rows / (2 * LOOKED_AT));
        let all: Vec<usize> = (0..columns).collect();
        // For each column the first that equals it.
        let mut first = all.clone();
        let mut find = |marked: &[(u64, usize)]| {
            let same_mark =
                |some: &[(u64, usize)]| some[1..].iter().map(|&(_, column)| [some[0].1, column]).collect::<Vec<_>>();
            let pairs: Vec<[usize; 2]> = marked.chunk_by(|a, b| a.0 == b.0).flat_map(same_mark).collect();
            for ([one, column], same) in pairs.iter().zip(same(image, downstream_e, &pairs)) {
                first[*column] = if same { *one } else { *column };
            }
            // Columns that agree in these rows but differ elsewhere are compared again in all rows.
            let differ = |some: &&[(u64, usize)]| some[1..].iter().any(|&(_, column)| first[column] == column);
            let some = marked.chunk_by(|a, b| a.0 == b.0).filter(differ).flatten();
            some.map(|(_, column)| *column).collect::<Vec<_>>()
        };
        let perhaps = find(&marked(image, downstream_e, looked_at, &all));
        if !perhaps.is_empty() {
            find(&marked(image, downstream_e, 0..rows, &perhaps));
        }
        let mut found = DuplicateColumns { distinct: Vec::with_capacity(columns), place: Vec::with_capacity(columns) };
        for (column, &first) in first.iter().enumerate() {
            let place = if first == column { found.distinct.len() } else { found.place[first] };
            if first == column {
                found.distinct.push(column);
            }
            found.place.push(place);
        }
        found
    }

    /// All columns again, from the distinct ones.
    pub fn spread(&self, distinct: Array2<f64>) -> Array2<f64> {
        if self.distinct.len() == self.place.len() {
            return distinct;
        }
        let mut all = Vec::with_capacity(distinct.nrows() * self.place.len());
        for charge_e in distinct.as_standard_layout().as_slice().expect("row after row").chunks_exact(distinct.ncols())
        {
            all.extend(self.place.iter().map(|&place| charge_e[place]));
        }
        Array2::from_shape_vec((distinct.nrows(), self.place.len()), all).expect("as many as there are pixels")
    }
}

/// Some columns, each with a hash of its charges in some rows and of what lies downstream, sorted by hash.
fn marked(
    image: ArrayView2<f64>,
    downstream_e: &[f64],
    rows: impl Iterator<Item = usize>,
    columns: &[usize],
) -> Vec<(u64, usize)> {
    let mut marked: Vec<(u64, usize)> =
        columns.iter().map(|&column| (downstream_e[column].to_bits(), column)).collect();
    for row in rows {
        let charge_e: &[f64] = &simd::in_one_piece(image.row(row));
        for (mark, column) in &mut marked {
            // Any odd number that mixes the bits well.
            *mark = (mark.rotate_left(17) ^ charge_e[*column].to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    }
    marked.sort_unstable();
    marked
}

/// Whether two columns are equal to the bit, for each pair; row by row, as charges are stored in memory.
fn same(image: ArrayView2<f64>, downstream_e: &[f64], pairs: &[[usize; 2]]) -> Vec<bool> {
    let equal = |a: f64, b: f64| a.to_bits() == b.to_bits();
    let mut same: Vec<bool> = pairs.iter().map(|&[one, other]| equal(downstream_e[one], downstream_e[other])).collect();
    for charge_e in image.rows() {
        let charge_e: &[f64] = &simd::in_one_piece(charge_e);
        for (same, &[one, other]) in same.iter_mut().zip(pairs) {
            *same &= equal(charge_e[one], charge_e[other]);
        }
    }
    same
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Axis;

    #[test]
    fn columns_are_alike_if_every_charge_is_and_what_lies_downstream() {
        let image = Array2::from_shape_fn((40, 6), |(row, column)| match column {
            0 | 2 | 5 => row as f64,
            // Differs in the last row only.
            3 if row == 39 => -1.0,
            3 => row as f64,
            _ => 7.0,
        });
        let distinct = DuplicateColumns::of(image.view(), &[0.0, 1.0, 0.0, 0.0, 1.0, 2.0]);
        assert_eq!(
            (distinct.distinct.as_slice(), distinct.place.as_slice()),
            (&[0, 1, 3, 5][..], &[0, 1, 0, 2, 1, 3][..])
        );
        assert_eq!(distinct.spread(image.select(Axis(1), &distinct.distinct)), image);
        let different = Array2::from_shape_fn((9, 5), |(row, column)| (row * 5 + column) as f64);
        let distinct = DuplicateColumns::of(different.view(), &[0.0; 5]);
        assert_eq!(distinct.distinct, [0, 1, 2, 3, 4]);
        assert_eq!(distinct.spread(different.clone()), different);
    }
}
