//! Clipped means, and their errors from the scatter.

/// Values further from the median than this number of robust standard deviations are rejected.
pub const CLIP_SIGMA: f64 = 5.0;

/// For n values the limit is wider by 1 + 5/n: the robust scatter of few values is often too small by chance, and a limit at 5
/// times it would cut into the noise (at n = 8 the variance of (mean - truth)/sigma would be 1.1).
const WIDER: f64 = 5.0;

/// Ratio of the standard deviation of a Gaussian to its median absolute deviation.
const SIGMA_OF_MAD: f64 = 1.4826;

/// Minimum number of values for a mean with an error: with fewer, the variance of its t distribution is infinite.
pub const FEWEST: usize = 5;

/// A clipped mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// The mean of the accepted values.
    pub value: f64,
    /// Its 1-sigma error: their standard deviation over the square root of their number n, times √((n − 1)/(n − 3)). The scatter of
    /// few values is itself uncertain; with this factor (from Student's t) deviations in units of sigma have variance 1.
    pub sigma: f64,
    /// Their standard deviation.
    pub scatter: f64,
    /// Number of accepted values.
    pub used: usize,
    /// Number of rejected values.
    pub rejected: usize,
}

impl Mean {
    /// Numbers of pixels for a table.
    pub(super) fn pixels(&self) -> Vec<(&'static str, usize)> {
        vec![("pixels_used", self.used), ("pixels_rejected", self.rejected)]
    }
}

/// The mean of the finite values within [`CLIP_SIGMA`] of their median; None for fewer than [`FEWEST`].
///
/// `quantum` is the step of the values. The scatter is at least that of rounding, quantum/√12, and nothing within [`CLIP_SIGMA`]
/// quanta is rejected: at few electrons with little noise most pixels contain none, and those with one are not outliers.
pub fn clipped(values: impl IntoIterator<Item = f64>, quantum: f64) -> Option<Mean> {
    clipped_beyond(values, quantum, quantum)
}

/// The same if the scatter is known to be at least `least_scatter`: few values may be close together by chance.
pub fn clipped_beyond(values: impl IntoIterator<Item = f64>, quantum: f64, least_scatter: f64) -> Option<Mean> {
    let finite: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    let kept = inliers(&finite, least_scatter);
    let inside: Vec<f64> = finite.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(value, _)| *value).collect();
    let mean = mean(&inside, quantum)?;
    Some(Mean { rejected: finite.len() - inside.len(), ..mean })
}

/// The mean of values without rejection; None for fewer than [`FEWEST`].
pub fn mean(values: &[f64], quantum: f64) -> Option<Mean> {
    if values.len() < FEWEST {
        return None;
    }
    let count = values.len() as f64;
    let value = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|inside| (inside - value).powi(2)).sum::<f64>() / (count - 1.0);
    let scatter = variance.sqrt().max(quantum / 12_f64.sqrt());
    let student = ((count - 1.0) / (count - 3.0)).sqrt();
    Some(Mean { value, sigma: student * scatter / count.sqrt(), scatter, used: values.len(), rejected: 0 })
}

/// Which values are within [`CLIP_SIGMA`] robust standard deviations (at least `least_scatter` each) of their median, or somewhat
/// more for few values; missing ones (NaN) count as inliers.
pub fn inliers(values: &[f64], least_scatter: f64) -> Vec<bool> {
    let (Some(middle), Some(scatter)) = (median(values.to_vec()), robust_scatter(values)) else { return Vec::new() };
    let count = values.iter().filter(|value| value.is_finite()).count() as f64;
    let limit = CLIP_SIGMA * (1.0 + WIDER / count) * scatter.max(least_scatter);
    values.iter().map(|value| value.is_nan() || (value - middle).abs() <= limit).collect()
}

/// Standard deviation of a Gaussian with the median absolute deviation of the finite values; None if there are none.
pub fn robust_scatter(values: &[f64]) -> Option<f64> {
    let middle = median(values.to_vec())?;
    Some(SIGMA_OF_MAD * median(values.iter().map(|value| (value - middle).abs()).collect())?)
}

/// Median of the finite values, the mean of the two middle ones if their number is even.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    if values.is_empty() {
        return None;
    }
    let upper = values.len() / 2;
    let odd = values.len() % 2 == 1;
    let (below, middle, _) = values.select_nth_unstable_by(upper, f64::total_cmp);
    let middle = *middle;
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(if odd { middle } else { 0.5 * (lower + middle) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    /// Of 4000 means of noise in steps, with one value in twenty hit by a cosmic ray.
    #[test]
    fn means_are_unbiased_and_their_errors_right() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let noise = Normal::new(0.0, 4.0).unwrap();
        for count in [12, 60] {
            let mut deviations = Vec::new();
            for _ in 0..4000 {
                let truth = random.random_range(0.0..50.0);
                let mut pixel = || {
                    let ray: f64 = if random.random_bool(0.05) { random.random_range(300.0..5000.0) } else { 0.0 };
                    1.5 * ((truth + noise.sample(&mut random) + ray) / 1.5).round()
                };
                let values: Vec<f64> = (0..count).map(|_| pixel()).collect();
                let mean = clipped(values, 1.5).unwrap();
                deviations.push((mean.value - truth) / mean.sigma);
            }
            let trials = deviations.len() as f64;
            let bias = deviations.iter().sum::<f64>() / trials;
            let variance = deviations.iter().map(|deviation| deviation * deviation).sum::<f64>() / trials;
            // For 4000 Gaussian deviations the mean is 0 +- 0.016 and the variance 1 +- 0.022; Student's t scatters more.
            assert!(bias.abs() < 0.06, "{count}: bias {bias} sigma");
            assert!((0.9..1.1).contains(&variance), "{count}: variance {variance}");
        }
    }

    #[test]
    fn outliers_and_missing_values_do_not_count() {
        let mut values = vec![1.0, 2.0, 3.0, 4.0, 5.0, f64::NAN];
        values.extend([1e6, -1e6]);
        let mean = clipped(values, 1.0).unwrap();
        assert_eq!((mean.value, mean.used, mean.rejected), (3.0, 5, 2));
        // Variance 2.5 of 5 values, (5 - 1)/(5 - 3).
        assert!((mean.sigma - (2.5_f64 / 5.0 * 2.0).sqrt()).abs() < 1e-12);
        assert_eq!(clipped([1.0, 2.0, 3.0, 4.0, f64::NAN], 1.0), None);
    }

    #[test]
    fn a_few_electrons_are_no_outliers() {
        let values = (0..100).map(|index| if index % 20 == 0 { 1.0 } else { 0.0 });
        let mean = clipped(values, 1.0).unwrap();
        assert_eq!((mean.value, mean.rejected), (0.05, 0));
        let flat = clipped([7.0; 12], 1.0).unwrap();
        assert!((flat.sigma - (11.0_f64 / 9.0).sqrt() / 12.0).abs() < 1e-12);
    }

    #[test]
    fn medians_are_in_the_middle() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, f64::NAN, 3.0, 2.0]), Some(2.5));
        assert_eq!(median(vec![f64::NAN]), None);
    }
}
