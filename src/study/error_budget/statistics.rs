//! Statistics of draws: percentiles of dates, and shares of a variance.

use super::PERCENTILES;
use crate::numeric::estimate::{quantile, share_error, share_error_in_order, with_errors};
use crate::plan::draws::{Fate, Fates};
use crate::study::Estimate;

/// Statistics of the draws, each number with its standard error.
pub struct Statistics {
    /// Share of the variance for each input, and for the nonlinear rest; None if |Δe| does not vary or is lost.
    pub shares: Option<(Vec<Estimate>, Estimate)>,
    /// Standard deviation of ln |Δe| at the end of the mission.
    pub sigma_ln: Option<Estimate>,
    /// When the uncorrected and the corrected budget are exceeded.
    pub limits: [Crossings; 2],
}

/// When a budget is exceeded.
pub struct Crossings {
    /// Each percentile of the time (yr), with its error if known; None beyond the horizon.
    pub percentiles: Vec<Option<(f64, Option<f64>)>>,
    /// Share of the draws in which it is exceeded within the mission.
    pub within: Estimate,
}

impl Statistics {
    /// From draws of a mission of this duration in years.
    pub fn of(found: &Fates, duration_yr: f64, seed: u64) -> Statistics {
        let (fates, inputs) = (&found.fates, found.names.len());
        let order = found.order.as_deref();
        // For each limit its percentiles and the share within, then σ, then the shares and the rest.
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
            let logs = found.explained(places);
            values.push(logs.sigma());
            values.extend(logs.shares().unwrap_or(vec![f64::NAN; inputs + 1]));
            values
        };
        let mut values = with_errors(fates.len(), order, seed, statistics).into_iter();
        let mut next = || values.next().expect("as many as there are statistics");
        let estimate = |(value, error): (f64, Option<f64>)| Estimate { value, error: error.unwrap_or(0.0) };
        let within_error = |limit: usize, share: f64| {
            let within = |fate: &Fate| fate.exceeded_yr[limit].is_some_and(|t_yr| t_yr <= duration_yr);
            let holds: Vec<bool> = fates.iter().map(within).collect();
            order.map_or(share_error(share, fates.len() as f64), |order| share_error_in_order(&holds, order))
        };
        let limits = [0, 1].map(|limit| Crossings {
            percentiles: PERCENTILES.map(|_| next()).into_iter().map(|one| one.0.is_finite().then_some(one)).collect(),
            within: {
                let share = next().0;
                Estimate { value: share, error: within_error(limit, share) }
            },
        });
        let sigma_ln = Some(estimate(next())).filter(|sigma| sigma.value.is_finite());
        let mut shares: Vec<Estimate> = values.map(estimate).collect();
        let rest = shares.pop().expect("what is left");
        Statistics { shares: (inputs > 0 && rest.value.is_finite()).then_some((shares, rest)), sigma_ln, limits }
    }
}
