//! Statistics of draws: percentiles of dates, and shares of a variance.

use nalgebra::{DMatrix, DVector};

use super::PERCENTILES;
use super::sampler::Fate;
use crate::numeric::estimate::{quantile, with_errors};
use crate::numeric::least_squares::Span;
use crate::study::Estimate;

/// Statistics of the draws, each number with its standard error.
pub struct Statistics {
    /// Share of the variance of each input, and of what is not linear; None where |Δe| does not vary or is lost.
    pub shares: Option<(Vec<Estimate>, Estimate)>,
    /// Standard deviation of ln |Δe| at the end of the mission.
    pub sigma_ln: Option<Estimate>,
    /// When the uncorrected and the corrected budget are exceeded.
    pub limits: [Crossings; 2],
}

/// When a budget is exceeded.
pub struct Crossings {
    /// Each percentile of the time (yr), with its error where that is known; None beyond the horizon.
    pub percentiles: Vec<Option<(f64, Option<f64>)>>,
    /// Share of the draws in which it is exceeded within the mission.
    pub within: Estimate,
}

impl Statistics {
    /// Of draws with deviations (in σ) of the inputs and what became of them, of a mission of so many years.
    pub fn of(deviations: &[Vec<f64>], fates: &[Fate], duration_yr: f64, seed: u64) -> Statistics {
        let inputs = deviations[0].len();
        // For each limit its percentiles and the share within, then σ, then the shares and what is left of them.
        let statistics = |places: &[usize]| {
            let mut values = Vec::new();
            for limit in [0, 1] {
                let mut times: Vec<f64> =
                    places.iter().map(|place| fates[*place].exceeded_yr[limit].unwrap_or(f64::INFINITY)).collect();
                times.sort_by(f64::total_cmp);
                values.extend(PERCENTILES.map(|percent| quantile(&times, percent / 100.0)));
                let within = times.partition_point(|t_yr| *t_yr <= duration_yr);
                values.push(within as f64 / times.len() as f64);
            }
            let logs = Logs::of(places, deviations, fates);
            values.push(logs.sigma());
            values.extend(logs.shares().unwrap_or(vec![f64::NAN; inputs + 1]));
            values
        };
        let mut found = with_errors(fates.len(), seed, statistics).into_iter();
        let mut next = || found.next().expect("as many as there are statistics");
        let estimate = |(value, error): (f64, Option<f64>)| Estimate { value, error: error.unwrap_or(0.0) };
        let limits = [0, 1].map(|_| Crossings {
            percentiles: PERCENTILES.map(|_| next()).into_iter().map(|one| one.0.is_finite().then_some(one)).collect(),
            within: estimate(next()),
        });
        let sigma_ln = Some(estimate(next())).filter(|sigma| sigma.value.is_finite());
        let mut shares: Vec<Estimate> = found.map(estimate).collect();
        let rest = shares.pop().expect("what is left");
        Statistics { shares: (inputs > 0 && rest.value.is_finite()).then_some((shares, rest)), sigma_ln, limits }
    }
}

/// ln |Δe| at the end of the mission, and the deviations that made it, of draws that have a shape left then.
struct Logs<'a>(Vec<(&'a Vec<f64>, f64)>);

impl Logs<'_> {
    fn of<'a>(places: &[usize], deviations: &'a [Vec<f64>], fates: &[Fate]) -> Logs<'a> {
        let log = |place: &usize| {
            let delta_e = fates[*place].delta_e.filter(|delta_e| *delta_e > 0.0)?;
            Some((&deviations[*place], delta_e.ln()))
        };
        Logs(places.iter().filter_map(log).collect())
    }

    /// Standard deviation; not a number of fewer than two.
    fn sigma(&self) -> f64 {
        let n = self.0.len() as f64;
        let mean = self.0.iter().map(|(_, log)| log).sum::<f64>() / n;
        (self.0.iter().map(|(_, log)| (log - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
    }

    /// Shares of the variance of each input, and what is left. None where there are too few, or nothing varies.
    fn shares(&self) -> Option<Vec<f64>> {
        let inputs = self.0.first()?.0.len();
        if inputs == 0 || self.0.len() < 2 * (inputs + 1) {
            return None;
        }
        let design = DMatrix::from_fn(self.0.len(), inputs + 1, |row, column| match column {
            0 => 1.0,
            column => self.0[row].0[column - 1],
        });
        let values = DVector::from_iterator(self.0.len(), self.0.iter().map(|(_, log)| *log));
        let found = Span::of(&design, 1e-9).solve(&values);
        let rest = (&values - design * &found).norm_squared() / (self.0.len() - inputs - 1) as f64;
        let mut parts: Vec<f64> = found.iter().skip(1).map(|slope| slope * slope).collect();
        parts.push(rest);
        let total: f64 = parts.iter().sum();
        (total > 0.0).then(|| parts.iter().map(|part| part / total).collect())
    }
}
