//! Errors of linear theory, and directions that the data do not constrain.

use nalgebra::DMatrix;

/// Errors of linear theory.
pub(super) struct Errors {
    /// Error of each parameter; None if the data do not constrain it.
    pub sigmas: Vec<Option<f64>>,
    pub correlation: Vec<Vec<f64>>,
    /// Directions (in units of each parameter's own error if it were alone) along which chi2 does not change.
    pub flat: Vec<Vec<f64>>,
}

/// Eigenvalue of the scaled normal matrix, of trace n, below which a direction counts as flat: a combination with an error ten
/// thousand times larger than those of its members alone.
const FLAT: f64 = 1e-8;

impl Errors {
    pub fn of(jacobian: &DMatrix<f64>) -> Errors {
        let n = jacobian.ncols();
        let norms: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
        let alive: Vec<usize> = (0..n).filter(|&index| norms[index] > 0.0).collect();
        let mut sigmas = vec![None; n];
        let mut correlation = vec![vec![0.0; n]; n];
        for (index, row) in correlation.iter_mut().enumerate() {
            row[index] = 1.0;
        }
        if alive.is_empty() {
            return Errors { sigmas, correlation, flat: Vec::new() };
        }
        let scaled = DMatrix::from_fn(jacobian.nrows(), alive.len(), |row, column| {
            jacobian[(row, alive[column])] / norms[alive[column]]
        });
        let eigen = (scaled.transpose() * &scaled).symmetric_eigen();
        let mut covariance = DMatrix::zeros(alive.len(), alive.len());
        let mut flat = Vec::new();
        let mut loose = vec![false; alive.len()];
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > FLAT {
                covariance += vector * vector.transpose() / *value;
                continue;
            }
            let mut direction = vec![0.0; n];
            for (place, &index) in alive.iter().enumerate() {
                direction[index] = vector[place];
                loose[place] |= vector[place].abs() > 0.01;
            }
            flat.push(direction);
        }
        for (a, &index) in alive.iter().enumerate() {
            let sigma = covariance[(a, a)].sqrt();
            sigmas[index] = (!loose[a] && sigma > 0.0).then(|| sigma / norms[index]);
            for (b, &other) in alive.iter().enumerate() {
                let both = (covariance[(a, a)] * covariance[(b, b)]).sqrt();
                if both > 0.0 {
                    correlation[index][other] = (covariance[(a, b)] / both).clamp(-1.0, 1.0);
                }
            }
        }
        Errors { sigmas, correlation, flat }
    }
}
