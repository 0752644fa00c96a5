//! Scale and correlation of errors by restricted maximum likelihood.
//!
//! For residuals r = B b + e, with everything smooth in the columns of B and errors e of covariance s² V(ρ) along trails, the
//! likelihood of the part of r beyond B (Patterson & Thompson 1971, Biometrika 58, 545) is
//!
//! ```text
//! −2 ln L = (n − k) ln s² + ln |V| + ln |Bᵀ V⁻¹ B|,   s² = rᵀ P r/(n − k)
//! ```
//!
//! It is unbiased although B absorbs slow noise, which would bias the correlation of the residuals.

use nalgebra::{DMatrix, DVector};

use crate::analysis::whitening::{Link, Neighbours, Shared};

/// Correlations that are tried.
const STEP: f64 = 0.05;
const STEPS: usize = 16;

/// Increase of 2 ln L that a correlation must bring: reached by one in two hundred samples of white noise.
const CLEAR: f64 = 6.6;

/// The likeliest errors.
pub(super) struct Likeliest {
    /// Their standard deviation, in quoted errors.
    pub scale: f64,
    pub correlation: f64,
    /// Root-mean-square distance from it of the correlations tried, weighted by their likelihoods.
    pub correlation_sigma: f64,
    pub neighbours: Neighbours,
    /// Degrees of freedom beyond what is smooth.
    pub freedom: f64,
}

impl Likeliest {
    /// From residuals of some rows (those that are right), smooth directions, and the preceding row of each in its trail.
    pub fn of(residuals: &DVector<f64>, smooth: &DMatrix<f64>, links: &[Link], right: &[usize]) -> Likeliest {
        let white = likelihood(residuals, smooth, links, right, &Shared::default());
        let mut tried = Vec::new();
        if links.iter().any(Option::is_some) {
            for neighbours in [Neighbours::Pixels, Neighbours::Rows] {
                for step in 1..=STEPS {
                    let shared = Shared { correlation: STEP * step as f64, neighbours, ..Shared::default() };
                    tried.push((likelihood(residuals, smooth, links, right, &shared), shared));
                }
            }
        }
        let best = tried.iter().max_by(|a, b| a.0.1.total_cmp(&b.0.1)).filter(|best| best.0.1 > white.1 + CLEAR);
        let Some(((scale, best, freedom), Shared { correlation, neighbours, .. })) = best else {
            let (scale, _, freedom) = white;
            let neighbours = Neighbours::default();
            return Likeliest { scale, correlation: 0.0, correlation_sigma: 0.0, neighbours, freedom };
        };
        let like = tried.iter().filter(|(_, shared)| shared.neighbours == *neighbours);
        let (mut squares, mut weights) = (0.0, 0.0);
        for ((_, likelihood, _), shared) in like {
            let weight = (0.5 * (likelihood - best)).exp();
            squares += weight * (shared.correlation - correlation).powi(2);
            weights += weight;
        }
        let correlation_sigma = (squares / weights).sqrt();
        Likeliest {
            scale: *scale,
            correlation: *correlation,
            correlation_sigma,
            neighbours: *neighbours,
            freedom: *freedom,
        }
    }
}

/// Scale, 2 ln L and degrees of freedom at a correlation.
fn likelihood(
    residuals: &DVector<f64>,
    smooth: &DMatrix<f64>,
    links: &[Link],
    right: &[usize],
    shared: &Shared,
) -> (f64, f64, f64) {
    let link = |row: usize| links[row].map(|(before, apart)| (before, shared.between(apart)));
    let determinant: f64 = right.iter().filter_map(|&row| link(row)).map(|(_, r)| (1.0 - r * r).ln()).sum();
    let white = |at: &dyn Fn(usize) -> f64, row: usize| match link(row) {
        Some((before, r)) => (at(row) - r * at(before)) / (1.0 - r * r).sqrt(),
        None => at(row),
    };
    let residuals = DVector::from_fn(right.len(), |place, _| white(&|row| residuals[row], right[place]));
    let smooth = DMatrix::from_fn(right.len(), smooth.ncols(), |place, column| {
        white(&|row| smooth[(row, column)], right[place])
    });
    let qr = smooth.qr();
    let (directions, triangle) = (qr.q(), qr.r());
    let left = &residuals - &directions * directions.tr_mul(&residuals);
    let freedom = (right.len() - directions.ncols()).max(1) as f64;
    let square = left.norm_squared() / freedom;
    let smooth_determinant: f64 = triangle.diagonal().iter().map(|size| 2.0 * size.abs().max(1e-300).ln()).sum();
    (square.sqrt(), -(freedom * square.ln() + determinant + smooth_determinant), freedom)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Errors 1.5 times those quoted, correlated by 0.6 along 30 trails of 8 pixels, about three smooth directions that are in the
    /// data with any strength: both numbers are found without bias, the correlation with its error, and no correlation if there is
    /// none.
    #[test]
    fn scale_and_correlation_are_found_without_bias() {
        let (trails, pixels) = (30, 8);
        let rows = trails * pixels;
        let links: Vec<Link> = (0..rows).map(|row| (row % pixels > 0).then(|| (row - 1, 1))).collect();
        let right: Vec<usize> = (0..rows).collect();
        let columns =
            DMatrix::from_fn(rows, 3, |row, power| ((row % pixels) as f64 / pixels as f64).powi(power as i32));
        let smooth = crate::numeric::least_squares::Span::of(&columns, 1e-6).directions().clone();
        let mean = |correlation: f64| {
            let found = (0..40).map(|seed| {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                let mut noise = DVector::zeros(rows);
                for row in 0..rows {
                    let fresh: f64 = StandardNormal.sample(&mut random);
                    let before = links[row].map_or(0.0, |(before, _)| correlation * noise[before]);
                    let share = if links[row].is_some() { (1.0 - correlation * correlation).sqrt() } else { 1.0 };
                    noise[row] = before + share * fresh;
                }
                let residuals = 1.5 * noise + 100.0 * &columns * DVector::from_element(3, 1.0);
                let found = Likeliest::of(&residuals, &smooth, &links, &right);
                [found.scale, found.correlation, found.correlation_sigma, (found.correlation - correlation).powi(2)]
            });
            found.fold([0.0; 4], |sum, found| std::array::from_fn(|of| sum[of] + found[of] / 40.0))
        };
        // One estimate of the scale is good to 5 %, of the correlation to 0.05: their means to a sixth of that.
        let [scale, correlation, sigma, square] = mean(0.6);
        assert!((scale - 1.5).abs() < 0.05 && (correlation - 0.6).abs() < 0.04, "{scale}, {correlation}");
        // The scatter of forty estimates is good to 11 %.
        assert!((sigma / square.sqrt() - 1.0).abs() < 0.33, "{sigma} where estimates are off by {}", square.sqrt());
        let [scale, correlation, ..] = mean(0.0);
        assert!((scale - 1.5).abs() < 0.03 && correlation < 0.03, "{scale}, {correlation}");
    }
}
