//! Linear least squares for columns of very different size, or with linear dependences.

use nalgebra::{DMatrix, DVector};

/// The span of columns, and their decomposition.
///
/// A QR decomposition with pivoting (Golub & Van Loan 2013, Matrix Computations, section 5.4.2) of the columns scaled to length 1.
/// It ends after as many steps as there are columns; the iteration for singular values does not always converge.
pub(crate) struct Span {
    /// Orthonormal directions, `[(row, direction)]`.
    directions: DMatrix<f64>,
    /// Coefficients of the columns used: upper triangle.
    triangle: DMatrix<f64>,
    /// The columns used, by their indices, in the order of the triangle's.
    used: Vec<usize>,
    /// Lengths of these columns.
    lengths: Vec<f64>,
    columns: usize,
}

impl Span {
    /// The span of columns, `[(row, column)]`. A column whose component orthogonal to the others is below `flat` of its length adds
    /// nothing; neither does one of zero or NaN length.
    pub fn of(columns: &DMatrix<f64>, flat: f64) -> Span {
        let norms: Vec<f64> = columns.column_iter().map(|column| column.norm()).collect();
        let alive: Vec<usize> =
            (0..norms.len()).filter(|&place| norms[place] > 0.0 && norms[place].is_finite()).collect();
        let scaled = DMatrix::from_fn(columns.nrows(), alive.len(), |row, column| {
            columns[(row, alive[column])] / norms[alive[column]]
        });
        let most = columns.nrows().min(alive.len());
        let qr = scaled.col_piv_qr();
        let mut order = DMatrix::from_fn(1, alive.len(), |_, column| alive[column]);
        qr.p().permute_columns(&mut order);
        let (directions, triangle) = (qr.q(), qr.r());
        let rank = (0..most).take_while(|&place| triangle[(place, place)].abs() > flat).count();
        let used: Vec<usize> = order.iter().take(rank).copied().collect();
        Span {
            directions: directions.columns(0, rank).into_owned(),
            triangle: triangle.view((0, 0), (rank, rank)).into_owned(),
            lengths: used.iter().map(|&place| norms[place]).collect(),
            used,
            columns: columns.ncols(),
        }
    }

    /// Orthonormal directions, `[(row, direction)]`.
    pub fn directions(&self) -> &DMatrix<f64> {
        &self.directions
    }

    /// Coefficients of the columns closest to a vector; 0 for those that add nothing.
    pub fn solve(&self, vector: &DVector<f64>) -> DVector<f64> {
        let along = self.directions.transpose() * vector;
        let scaled = self.triangle.solve_upper_triangular(&along).expect("no zero on the diagonal");
        let mut found = DVector::zeros(self.columns);
        for ((&place, length), scaled) in self.used.iter().zip(&self.lengths).zip(scaled.iter()) {
            found[place] = scaled / length;
        }
        found
    }

    /// Covariance of the result of [`Span::solve`], for vectors with errors of 1.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.covariance_with(&DMatrix::identity(self.used.len(), self.used.len()))
    }

    /// The same for vectors whose errors have a covariance V, given DᵀVD along the directions D.
    pub fn covariance_with(&self, along: &DMatrix<f64>) -> DMatrix<f64> {
        let rank = self.used.len();
        let inverse = self.triangle.solve_upper_triangular(&DMatrix::identity(rank, rank)).expect("likewise");
        let scaled = &inverse * along * inverse.transpose();
        let mut covariance = DMatrix::zeros(self.columns, self.columns);
        for (i, &row) in self.used.iter().enumerate() {
            for (j, &column) in self.used.iter().enumerate() {
                covariance[(row, column)] = scaled[(i, j)] / (self.lengths[i] * self.lengths[j]);
            }
        }
        covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of sizes from 1e-9 to 1e9: a parabola and its parts, one of them twice, one of zeros, and one of NaN.
    fn columns() -> DMatrix<f64> {
        DMatrix::from_fn(7, 6, |row, column| {
            let x = row as f64 - 2.0;
            [1e9, x, 1e-9 * x * x, 2.0 * x, 0.0, f64::NAN][column]
        })
    }

    #[test]
    fn what_a_sum_of_columns_consists_of_is_found() {
        let span = Span::of(&columns(), 1e-5);
        assert_eq!(span.directions().ncols(), 3);
        let unit = span.directions().transpose() * span.directions() - DMatrix::<f64>::identity(3, 3);
        assert!(unit.norm() < 1e-14);
        let parabola = DVector::from_fn(7, |row, _| {
            let x = row as f64 - 2.0;
            3.0 - 4.0 * x + 5.0 * x * x
        });
        let found = span.solve(&parabola);
        assert!((found[0] - 3e-9).abs() < 1e-20 && (found[2] - 5e9).abs() < 1e-2);
        assert!((found[1] + 2.0 * found[3] + 4.0).abs() < 1e-12 && found[1] * found[3] == 0.0);
        assert_eq!([found[4], found[5]], [0.0, 0.0]);
    }

    #[test]
    fn errors_of_a_straight_line_are_those_on_paper() {
        // Five points at x = -2 .. 2: 1/sqrt(5) for the constant, 1/sqrt(10) for the slope.
        let line = DMatrix::from_fn(5, 2, |row, column| if column == 0 { 1.0 } else { row as f64 - 2.0 });
        let covariance = Span::of(&line, 1e-5).covariance();
        assert!((covariance - DMatrix::from_row_slice(2, 2, &[0.2, 0.0, 0.0, 0.1])).norm() < 1e-15);
    }

    #[test]
    fn nothing_spans_nothing() {
        for columns in [DMatrix::zeros(4, 0), DMatrix::zeros(4, 2), DMatrix::zeros(0, 0)] {
            let span = Span::of(&columns, 1e-5);
            assert_eq!(span.directions().shape(), (columns.nrows(), 0));
            assert_eq!(span.solve(&DVector::from_element(columns.nrows(), 1.0)), DVector::zeros(columns.ncols()));
        }
    }
}
