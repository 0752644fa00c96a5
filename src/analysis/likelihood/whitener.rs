//! Errors of rows made independent and equal to 1: where the likelihood is Gaussian, −2 ln L is the sum of squares of what comes
//! out.

use nalgebra::{DMatrix, DVector};

use super::Errors;
use super::file::File;

/// The transformation for the errors of all files.
pub(crate) struct Whitener {
    files: Vec<OfFile>,
}

struct OfFile {
    first: usize,
    rows: Vec<Factors>,
    /// Orthonormal directions of the common errors, and by how much each is shortened.
    directions: DMatrix<f64>,
    shortened: Vec<f64>,
}

/// Factor of a row, and its neighbour before it with the neighbour's factor.
type Factors = (f64, Option<(usize, f64)>);

/// Share of the largest eigenvalue below which a direction of common errors changes nothing.
const FLAT: f64 = 1e-12;

impl Whitener {
    pub(super) fn of<'a>(files: impl Iterator<Item = (&'a File, &'a Errors)>) -> Whitener {
        Whitener { files: files.map(|(file, errors)| OfFile::of(file, errors)).collect() }
    }

    /// A change of the values, in their units, as it enters the likelihood.
    pub fn apply(&self, values: &[f64]) -> DVector<f64> {
        let mut white = Vec::with_capacity(values.len());
        for file in &self.files {
            file.apply(values, &mut white);
        }
        DVector::from_vec(white)
    }
}

impl OfFile {
    fn of(file: &File, errors: &Errors) -> OfFile {
        let row = |row: usize| {
            let (share, right) = match file.before[row] {
                Some((before, apart)) if errors.correlation > 0.0 => {
                    (errors.correlation.powf(apart), Some((before, errors.right[before])))
                }
                _ => (0.0, None),
            };
            let d = 1.0 - right.map_or(0.0, |(_, right)| share * share * right);
            let weight = (errors.right[row] / d).sqrt() / errors.scale;
            let before = right.map(|(before, right)| (before, -weight * share * right / file.sigma[before]));
            (weight / file.sigma[row], before)
        };
        let rows: Vec<_> = (0..file.sigma.len()).map(row).collect();
        // The covariance is 1 + U U' with the whitened columns U; along its eigenvectors it is divided by the root.
        let columns = file.whitened_common(errors);
        let (mut directions, mut shortened) = (Vec::new(), Vec::new());
        if columns.ncols() > 0 {
            let eigen = columns.tr_mul(&columns).symmetric_eigen();
            let largest = eigen.eigenvalues.max();
            for (place, &value) in eigen.eigenvalues.iter().enumerate() {
                if value > FLAT * largest {
                    directions.push(&columns * eigen.eigenvectors.column(place) / value.sqrt());
                    shortened.push(1.0 / (1.0 + value).sqrt() - 1.0);
                }
            }
        }
        let directions =
            if directions.is_empty() { DMatrix::zeros(rows.len(), 0) } else { DMatrix::from_columns(&directions) };
        OfFile { first: file.rows.start, rows, directions, shortened }
    }

    fn apply(&self, values: &[f64], white: &mut Vec<f64>) {
        let here = &values[self.first..self.first + self.rows.len()];
        let one = |(row, (own, before)): (usize, &Factors)| {
            own * here[row] + before.map_or(0.0, |(before, factor)| factor * here[before])
        };
        let mut all = DVector::from_vec(self.rows.iter().enumerate().map(one).collect());
        if !self.shortened.is_empty() {
            let along = self.directions.tr_mul(&all).component_mul(&DVector::from_column_slice(&self.shortened));
            all += &self.directions * along;
        }
        white.extend_from_slice(all.as_slice());
    }
}
