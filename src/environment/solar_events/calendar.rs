//! Active and quiet time of a mission, with future maxima drawn.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::Activity;
use crate::environment::solar_cycle::{self, CYCLE_SCATTER_YR, Maximum};

/// The Sun over a mission, before any draw.
#[derive(Clone, Debug, PartialEq)]
pub enum Sun {
    /// It follows its cycle.
    Cycle {
        /// Maxima, known and expected, in order.
        maxima: Vec<Maximum>,
        /// Launch, decimal year.
        launch: f64,
    },
    /// A number of active years, spread evenly over the mission.
    Mean {
        /// Active years of the mission.
        active_yr: f64,
    },
}

impl Sun {
    /// Active and quiet time of a mission of `duration_yr`, with future maxima drawn: the lengths of cycles vary independently, so
    /// that each maximum shifts those after it.
    pub fn drawn(&self, duration_yr: f64, random: &mut impl Rng) -> Calendar {
        match self {
            Sun::Mean { active_yr } => {
                Calendar { stretches: vec![Stretch { length_yr: duration_yr, active: active_yr / duration_yr }] }
            }
            Sun::Cycle { maxima, launch } => {
                let mut shift_yr = 0.0;
                let drawn = maxima.iter().map(|maximum| {
                    if maximum.cycles_ahead > 0 {
                        let z: f64 = StandardNormal.sample(random);
                        shift_yr += CYCLE_SCATTER_YR * z;
                    }
                    Maximum { year: maximum.year + shift_yr, ..*maximum }
                });
                Calendar::around(&drawn.collect::<Vec<_>>(), *launch, duration_yr)
            }
        }
    }
}

/// Active and quiet time of a mission.
#[derive(Clone, Debug, PartialEq)]
pub struct Calendar {
    /// From launch to the end, one after the other.
    stretches: Vec<Stretch>,
}

/// Part of a mission with constant activity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stretch {
    length_yr: f64,
    /// Active fraction of it.
    active: f64,
}

impl Stretch {
    /// Fraction of it with this activity.
    fn share(&self, activity: Activity) -> f64 {
        match activity {
            Activity::Active => self.active,
            Activity::Quiet => 1.0 - self.active,
        }
    }
}

impl Calendar {
    /// Around maxima (decimal years), for a mission of this duration.
    pub fn around(maxima: &[Maximum], launch: f64, duration_yr: f64) -> Calendar {
        let mut stretches = Vec::new();
        let mut at_yr = 0.0;
        for active in solar_cycle::active_years(maxima) {
            let within = |year: f64| (year - launch).clamp(at_yr, duration_yr.max(at_yr));
            let (from_yr, to_yr) = (within(active.from), within(active.to));
            stretches.push(Stretch { length_yr: from_yr - at_yr, active: 0.0 });
            stretches.push(Stretch { length_yr: to_yr - from_yr, active: 1.0 });
            at_yr = to_yr;
        }
        stretches.push(Stretch { length_yr: duration_yr - at_yr, active: 0.0 });
        stretches.retain(|stretch| stretch.length_yr > 0.0);
        Calendar { stretches }
    }

    /// Time (yr) with this activity.
    pub fn years(&self, activity: Activity) -> f64 {
        self.stretches.iter().map(|stretch| stretch.length_yr * stretch.share(activity)).sum()
    }

    /// When (years since launch) this much active or quiet time has passed; the end, if there is less.
    pub fn when(&self, activity: Activity, elapsed_yr: f64) -> f64 {
        let (mut at_yr, mut left_yr) = (0.0, elapsed_yr);
        for stretch in &self.stretches {
            let own_yr = stretch.length_yr * stretch.share(activity);
            if left_yr < own_yr {
                return at_yr + left_yr / stretch.share(activity);
            }
            left_yr -= own_yr;
            at_yr += stretch.length_yr;
        }
        at_yr
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn active_and_quiet_time_follow_each_other() {
        let maxima = solar_cycle::maxima(&[2024.8], 2040.0);
        // Active to 2029.3, then from 2033.3.
        let calendar = Calendar::around(&maxima, 2028.0, 7.0);
        assert!((calendar.years(Activity::Active) - 3.0).abs() < 1e-9);
        assert!((calendar.years(Activity::Quiet) - 4.0).abs() < 1e-9);
        assert!((calendar.when(Activity::Active, 1.0) - 1.0).abs() < 1e-9);
        assert!((calendar.when(Activity::Active, 1.8) - 5.8).abs() < 1e-9);
        assert!((calendar.when(Activity::Quiet, 1.0) - 2.3).abs() < 1e-9);
        assert!((calendar.when(Activity::Quiet, 9.0) - 7.0).abs() < 1e-9);
    }

    #[test]
    fn a_mean_sun_is_active_and_quiet_at_once() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let calendar = Sun::Mean { active_yr: 3.5 }.drawn(5.5, &mut random);
        assert!((calendar.when(Activity::Active, 0.7) - 1.1).abs() < 1e-12);
        assert!((calendar.when(Activity::Quiet, 0.4) - 1.1).abs() < 1e-12);
    }
}
