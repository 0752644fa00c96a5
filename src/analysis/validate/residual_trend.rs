//! Residual trends with a condition.
//!
//! Rows are binned in a condition (by its values themselves if they are few). Two statistics test for a trend: chi2 of the bins'
//! means about the common one, for any shape, and the square of the slope against the bins' order, for a monotonic trend. Each has
//! a p-value from the chi2 distribution; twice the smaller is the p-value of this condition. The false-alarm probability is the
//! probability that, by noise alone, the smallest p-value of *all* conditions is as small; it is found by simulation.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::analysis::measurement::DataSet;
use crate::io::json;
use crate::numeric::parallel;

/// Trend of the residuals of one data set with one condition or covariate.
#[derive(Clone, Debug, Serialize)]
pub struct Trend {
    /// The data set, by its index.
    #[serde(skip)]
    pub set: usize,
    /// Its file.
    pub file: String,
    /// The condition or covariate.
    pub name: String,
    /// Change of the residual from the first bin to the last along a straight line in the bins' order, in sigma.
    pub slope_sigma: f64,
    /// Its error.
    pub slope_error_sigma: f64,
    /// Probability of as strong a trend with this condition by noise alone.
    pub chance: f64,
    /// Probability of as strong a trend with any of the conditions tested by noise alone.
    pub false_alarm: f64,
    /// Bins in ascending order (words in order of appearance).
    pub bins: Vec<Bin>,
}

/// Rows with similar values of the condition.
#[derive(Clone, Debug, Serialize)]
pub struct Bin {
    /// Smallest value of the condition.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// The word, if the condition is one.
    pub word: Option<String>,
    /// Rows; in JSON their number.
    #[serde(rename = "n", serialize_with = "json::length")]
    pub rows: Vec<usize>,
    /// Mean residual, in sigma.
    pub mean_sigma: f64,
    /// Error of the mean.
    pub error_sigma: f64,
}

/// Conditions with at most this number of values are not binned further.
const MOST_VALUES: usize = 12;

/// Number of bins for those with more.
const BINS: usize = 8;

/// Number of noise simulations.
const SIMULATIONS: u64 = 2000;

/// A condition of one data set, binned.
pub struct Trial {
    set: usize,
    file: String,
    name: String,
    /// Without means: those depend on the residuals.
    bins: Vec<Bin>,
}

impl Trial {
    /// None if fewer than two bins can be made.
    pub fn of(set: usize, data: &DataSet, name: &str) -> Option<Trial> {
        let at = data.against(name);
        let mut rows: Vec<usize> = (0..at.len()).filter(|&row| at[row].is_finite()).collect();
        rows.sort_by(|a, b| at[*a].total_cmp(&at[*b]).then(a.cmp(b)));
        let mut distinct: Vec<f64> = rows.iter().map(|&row| at[row]).collect();
        distinct.dedup();
        let words = data.is_words(name);
        let edges: Vec<f64> = if distinct.len() <= MOST_VALUES || words {
            distinct
        } else {
            // Equal numbers of rows, as nearly as equal values allow.
            let mut edges: Vec<f64> = (0..BINS).map(|bin| at[rows[bin * rows.len() / BINS]]).collect();
            edges.dedup();
            edges
        };
        let mut bins = Vec::new();
        for (index, &low) in edges.iter().enumerate() {
            let next = edges.get(index + 1).copied().unwrap_or(f64::INFINITY);
            let rows: Vec<usize> = rows.iter().copied().filter(|&row| at[row] >= low && at[row] < next).collect();
            let high = rows.iter().map(|&row| at[row]).fold(low, f64::max);
            let word = data.rows[rows[0]].word(name).filter(|_| words).map(str::to_string);
            bins.push(Bin { low, high, word, rows, mean_sigma: 0.0, error_sigma: 0.0 });
        }
        (bins.len() > 1).then(|| Trial { set, file: data.file.clone(), name: name.to_string(), bins })
    }

    /// Probability of the trend, its slope and the slope's error. `residuals` have a scatter of 1.
    fn chance(&self, residuals: &[f64]) -> (f64, f64, f64) {
        let (mut weight, mut sum) = (0.0, 0.0);
        let (mut order, mut order2, mut product) = (0.0, 0.0, 0.0);
        let last = (self.bins.len() - 1) as f64;
        let mut means = Vec::with_capacity(self.bins.len());
        for (index, bin) in self.bins.iter().enumerate() {
            let n = bin.rows.len() as f64;
            let total: f64 = bin.rows.iter().map(|&row| residuals[row]).sum();
            let place = index as f64 / last;
            weight += n;
            sum += total;
            order += n * place;
            order2 += n * place * place;
            product += place * total;
            means.push((n, total / n));
        }
        let mean = sum / weight;
        let about: f64 = means.iter().map(|(n, bin)| n * (bin - mean).powi(2)).sum();
        let spread = order2 - order * order / weight;
        let slope = (product - order * mean) / spread;
        let error = 1.0 / spread.sqrt();
        let chance = |chi2: f64, freedom: f64| ChiSquared::new(freedom).expect("above 0").sf(chi2);
        let best = chance(about, last).min(chance((slope / error).powi(2), 1.0));
        ((2.0 * best).min(1.0), slope, error)
    }
}

/// Trends of all trials, the most significant first. `scatter` is that of each data set's residuals without a trend.
pub fn all(trials: &[Trial], residuals: &[Vec<f64>], scatter: &[f64], seed: u64) -> Vec<Trend> {
    let scaled: Vec<Vec<f64>> = residuals
        .iter()
        .zip(scatter)
        .map(|(set, scatter)| set.iter().map(|residual| residual / scatter).collect())
        .collect();
    let simulated: Vec<f64> = parallel::map(0..SIMULATIONS, |simulation| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(simulation);
        let noise: Vec<Vec<f64>> =
            residuals.iter().map(|set| (0..set.len()).map(|_| StandardNormal.sample(&mut random)).collect()).collect();
        trials.iter().map(|trial| trial.chance(&noise[trial.set]).0).fold(1.0, f64::min)
    });
    let mut trends: Vec<Trend> = trials
        .iter()
        .map(|trial| {
            let scatter = scatter[trial.set];
            let (chance, slope, error) = trial.chance(&scaled[trial.set]);
            let as_small = simulated.iter().filter(|&&simulated| simulated <= chance).count();
            // Beyond the reach of simulations: as if all trials were independent, which gives the larger value.
            let bound = 1.0 - (1.0 - chance).powi(trials.len() as i32);
            let bound = if chance < 1e-12 { chance * trials.len() as f64 } else { bound };
            let false_alarm = if as_small < 10 { bound } else { as_small as f64 / SIMULATIONS as f64 };
            let bins = trial.bins.iter().map(|bin| {
                let n = bin.rows.len() as f64;
                let mean_sigma = bin.rows.iter().map(|&row| residuals[trial.set][row]).sum::<f64>() / n;
                Bin { mean_sigma, error_sigma: scatter / n.sqrt(), ..bin.clone() }
            });
            Trend {
                set: trial.set,
                file: trial.file.clone(),
                name: trial.name.clone(),
                bins: bins.collect(),
                slope_sigma: slope * scatter,
                slope_error_sigma: error * scatter,
                chance,
                false_alarm,
            }
        })
        .collect();
    trends.sort_by(|a, b| a.chance.total_cmp(&b.chance));
    trends
}
