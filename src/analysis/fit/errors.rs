//! Errors of linear theory, and directions that the data do not constrain.

use nalgebra::{DMatrix, DVector};

/// Errors of the parameters.
pub(super) struct Errors {
    /// Covariance of the parameters with an error; 0 for all others.
    covariance: DMatrix<f64>,
    /// Whether the data give a parameter an error.
    has_error: Vec<bool>,
    /// Parameters of which only combinations are constrained.
    pub degenerate: Vec<Degeneracy>,
}

/// Parameters that can be changed together without a change of chi2.
pub(super) struct Degeneracy {
    /// By their indices, the most important ones first.
    pub members: Vec<usize>,
    /// Combinations of them that are constrained.
    pub combinations: Vec<Invariant>,
}

/// A linear combination of parameters that is constant along all flat directions.
pub(super) struct Invariant {
    /// Index and factor of each parameter; the first factor is 1.
    pub terms: Vec<(usize, f64)>,
    /// 1-sigma error, in the unit of the first parameter.
    pub sigma: f64,
}

/// Eigenvalue of the scaled normal matrix, of trace n, below which a direction counts as flat: a combination with an error ten
/// thousand times larger than those of its members alone.
const FLAT: f64 = 1e-8;

impl Errors {
    pub fn of(jacobian: &DMatrix<f64>) -> Errors {
        let n = jacobian.ncols();
        let norms: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
        let alive: Vec<usize> = (0..n).filter(|&index| norms[index] > 0.0).collect();
        let mut errors = Errors {
            covariance: DMatrix::zeros(n, n),
            has_error: norms.iter().map(|norm| *norm > 0.0).collect(),
            degenerate: Vec::new(),
        };
        if alive.is_empty() {
            return errors;
        }
        let scaled = DMatrix::from_fn(jacobian.nrows(), n, |row, column| match norms[column] {
            norm if norm > 0.0 => jacobian[(row, column)] / norm,
            _ => 0.0,
        });
        let eigen = scaled.select_columns(&alive).tr_mul(&scaled.select_columns(&alive)).symmetric_eigen();
        // In units of each parameter's own error if it were alone; the pseudo-inverse of the normal matrix.
        let mut covariance = DMatrix::zeros(n, n);
        let mut flat = Vec::new();
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let mut direction = DVector::zeros(n);
            alive.iter().zip(vector.iter()).for_each(|(&index, part)| direction[index] = *part);
            if *value > FLAT {
                covariance += &direction * direction.transpose() / *value;
            } else {
                flat.push(direction);
            }
        }
        let own = reduce(&mut flat);
        errors.degenerate = degeneracies(&flat, &own, &covariance, &norms);
        for &index in errors.degenerate.iter().flat_map(|one| &one.members) {
            errors.has_error[index] = false;
        }
        let both = |a: usize, b: usize| errors.has_error[a] && errors.has_error[b];
        errors.covariance =
            DMatrix::from_fn(n, n, |a, b| if both(a, b) { covariance[(a, b)] / (norms[a] * norms[b]) } else { 0.0 });
        errors
    }

    /// Adds a covariance; the parameter at `index` has an error by it.
    pub fn add(&mut self, index: usize, covariance: &DMatrix<f64>) {
        self.has_error[index] = true;
        let both = |a: usize, b: usize| self.has_error[a] && self.has_error[b];
        self.covariance += DMatrix::from_fn(self.has_error.len(), self.has_error.len(), |a, b| match both(a, b) {
            true => covariance[(a, b)],
            false => 0.0,
        });
    }

    /// 1-sigma error of each parameter; None if the data do not constrain it.
    pub fn sigmas(&self) -> Vec<Option<f64>> {
        let sigma = |index: usize| Some(self.covariance[(index, index)].sqrt()).filter(|sigma| *sigma > 0.0);
        (0..self.has_error.len()).map(sigma).collect()
    }

    /// Correlation of two parameters; None if one of them has no error.
    pub fn correlation(&self) -> Vec<Vec<Option<f64>>> {
        let sigmas = self.sigmas();
        let of = |a: usize, b: usize| -> Option<f64> {
            let correlation = self.covariance[(a, b)] / (sigmas[a]? * sigmas[b]?);
            Some(if a == b { 1.0 } else { correlation.clamp(-1.0, 1.0) })
        };
        (0..sigmas.len()).map(|a| (0..sigmas.len()).map(|b| of(a, b)).collect()).collect()
    }

    /// Whether a parameter can be changed together with others without a change of chi2.
    pub fn is_degenerate(&self, index: usize) -> bool {
        self.degenerate.iter().any(|one| one.members.contains(&index))
    }
}

/// Part of a flat direction above which a parameter belongs to it: it would more than double the parameter's variance.
fn belongs(part: f64) -> bool {
    part.abs() > FLAT.sqrt()
}

/// Gauss-Jordan elimination with pivots: each direction gets a parameter of its own, with the part 1, that no other one contains.
/// Eigenvectors of equal eigenvalues are an arbitrary mixture of independent degeneracies. Returns the parameter of each.
fn reduce(flat: &mut [DVector<f64>]) -> Vec<usize> {
    let mut own = Vec::new();
    for place in 0..flat.len() {
        let largest = (place..flat.len()).max_by(|a, b| flat[*a].amax().total_cmp(&flat[*b].amax()));
        flat.swap(place, largest.expect("a direction"));
        let pivot = flat[place].iamax();
        let direction = &flat[place] / flat[place][pivot];
        for (other, row) in flat.iter_mut().enumerate() {
            let part = row[pivot];
            if other != place {
                row.axpy(-part, &direction, 1.0);
                row[pivot] = 0.0;
            }
        }
        flat[place] = direction;
        own.push(pivot);
    }
    own
}

/// The degeneracies of reduced flat directions, with the combinations that are constant along all of them: of each parameter
/// without a direction of its own, and those with one.
fn degeneracies(flat: &[DVector<f64>], own: &[usize], covariance: &DMatrix<f64>, norms: &[f64]) -> Vec<Degeneracy> {
    let mut found: Vec<Degeneracy> = Vec::new();
    for direction in flat {
        let mut members: Vec<usize> = (0..norms.len()).filter(|&index| belongs(direction[index])).collect();
        members.sort_by(|a, b| direction[*b].abs().total_cmp(&direction[*a].abs()));
        found.push(Degeneracy { members, combinations: Vec::new() });
    }
    for index in (0..norms.len()).filter(|index| !own.contains(index)) {
        let along: Vec<usize> = (0..flat.len()).filter(|&place| belongs(flat[place][index])).collect();
        let Some(&first) = along.first() else { continue };
        let mut scaled = DVector::zeros(norms.len());
        scaled[index] = 1.0;
        along.iter().for_each(|&place| scaled[own[place]] = -flat[place][index]);
        let in_units = |other: usize| (other, scaled[other] * norms[other] / norms[index]);
        let terms = [(index, 1.0)].into_iter().chain(along.iter().map(|&place| in_units(own[place]))).collect();
        let sigma = scaled.dot(&(covariance * &scaled)).max(0.0).sqrt() / norms[index];
        found[first].combinations.push(Invariant { terms, sigma });
    }
    found
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Random columns of very different lengths, of which two are the same up to a factor and a random part `apart`; with a factor
    /// below 0 they are correlated positively.
    fn design(random: &mut ChaCha8Rng, columns: usize, apart: f64) -> (DMatrix<f64>, f64) {
        let mut normal = || -> f64 { StandardNormal.sample(random) };
        let factor = normal().signum() * 10_f64.powf(2.0 * normal());
        let mut design = DMatrix::from_fn(30, columns, |_, _| normal());
        let other = DVector::from_fn(30, |_, _| normal());
        let twin = factor * (design.column(0) + apart * other);
        design.set_column(1, &twin);
        for mut column in design.column_iter_mut() {
            column *= 10_f64.powf(3.0 * normal());
        }
        (design, factor)
    }

    #[test]
    fn a_correlation_never_has_the_wrong_sign_and_a_flat_direction_no_small_error() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for case in 0..400 {
            let apart = if case % 2 == 0 { 0.0 } else { 10_f64.powf(-8.0 * random.random::<f64>()) };
            let columns = 2 + case % 4;
            let (design, factor) = design(&mut random, columns, apart);
            let errors = Errors::of(&design);
            let (sigmas, correlation) = (errors.sigmas(), errors.correlation());
            match correlation[0][1] {
                Some(found) => {
                    assert!(apart > 1e-6 && (apart > 0.3 || found * factor < 0.0), "{apart} {factor} {found}")
                }
                None => {
                    assert!(apart < 1e-3 && sigmas[0].is_none() && sigmas[1].is_none(), "{apart} {sigmas:?}");
                    assert_eq!(errors.degenerate.len(), 1);
                    let combination = &errors.degenerate[0].combinations[0];
                    assert_eq!(errors.degenerate[0].members.len(), 2);
                    // As if only one of the two were fitted.
                    let place = combination.terms[0].0;
                    let alone = Errors::of(&design.clone().remove_column(1 - place)).sigmas()[0].unwrap();
                    assert!((combination.sigma / alone - 1.0).abs() < 1e-3, "{} {alone}", combination.sigma);
                    let ratio =
                        design.column(1 - place).dot(&design.column(place)) / design.column(place).norm_squared();
                    assert!((combination.terms[1].1 / ratio - 1.0).abs() < 1e-3);
                }
            }
            assert!(sigmas[2..].iter().all(Option::is_some));
        }
    }

    #[test]
    fn independent_degeneracies_are_told_apart() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let (a, _) = design(&mut random, 2, 0.0);
        let (b, _) = design(&mut random, 3, 0.0);
        let both = DMatrix::from_columns(&[a.column(0), b.column(0), a.column(1), b.column(2), b.column(1)]);
        let errors = Errors::of(&both);
        let mut members: Vec<Vec<usize>> = errors.degenerate.iter().map(|one| one.members.clone()).collect();
        members.iter_mut().for_each(|members| members.sort_unstable());
        members.sort();
        assert_eq!(members, [vec![0, 2], vec![1, 4]]);
        assert!(errors.sigmas()[3].is_some() && errors.correlation()[3][0].is_none());
    }
}
