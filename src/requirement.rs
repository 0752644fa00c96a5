//! Change of shape over time → when the budget is exceeded.

use crate::root;

/// When, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// First time (years since launch) at which |Δe| reaches the limit; None where it does not within the mission.
    pub t_yr: Option<f64>,
    /// Limit on |Δe| before correction.
    pub limit: f64,
    /// Limit less |Δe| at the end of the mission; negative where it is exceeded then. None where the galaxy has no
    /// shape left by then.
    pub margin: Option<f64>,
}

/// Finds the first time at which a function of time reaches a limit.
///
/// `known` are times (years since launch, rising) with the function there: they must be close enough together that the
/// function crosses a limit at most once in between. None stands for "beyond any limit". The root is that of `function`
/// itself, to 1e-9 yr, not of a line between the known times.
pub fn first_crossing(limit: f64, known: &[(f64, Option<f64>)], function: impl Fn(f64) -> Option<f64>) -> Crossing {
    let excess = |value: Option<f64>| value.map_or(limit, |value| value - limit);
    let end = known.last().expect("at least one time");
    let margin = end.1.map(|value| limit - value);
    let reached = known.iter().position(|(_, value)| excess(*value) >= 0.0);
    let t_yr = match reached {
        None => None,
        Some(0) => Some(known[0].0),
        Some(after) => {
            let ends = [known[after - 1], known[after]];
            // A readout is dear, and the ends are known.
            let known = |t_yr: f64| ends.iter().find(|end| end.0 == t_yr).map(|end| end.1);
            let value = |t_yr: f64| excess(known(t_yr).unwrap_or_else(|| function(t_yr)));
            Some(root::between(ends[0].0, ends[1].0, 1e-9, value))
        }
    };
    Crossing { t_yr, limit, margin }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crossing(limit: f64, function: impl Fn(f64) -> Option<f64>) -> Crossing {
        let known: Vec<_> = (0..=5).map(|year| (f64::from(year), function(f64::from(year)))).collect();
        first_crossing(limit, &known, function)
    }

    #[test]
    fn the_root_is_that_of_the_curve() {
        let found = crossing(2.0, |t| Some(t * t));
        assert!((found.t_yr.unwrap() - 2_f64.sqrt()).abs() < 1e-8);
        assert_eq!(found.margin, Some(-23.0));
    }

    #[test]
    fn a_limit_that_is_not_reached_leaves_a_margin() {
        assert_eq!(crossing(30.0, |t| Some(t * t)), Crossing { t_yr: None, limit: 30.0, margin: Some(5.0) });
    }

    #[test]
    fn a_curve_that_starts_above_the_limit_has_exceeded_it_at_launch() {
        assert_eq!(crossing(1.0, |_| Some(2.0)).t_yr, Some(0.0));
    }

    #[test]
    fn a_shape_that_is_lost_is_beyond_any_limit() {
        let found = crossing(10.0, |t| (t < 3.5).then_some(t));
        assert!((found.t_yr.unwrap() - 3.5).abs() < 1e-6);
        assert_eq!(found.margin, None);
    }
}
