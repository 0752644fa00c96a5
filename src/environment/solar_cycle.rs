//! Solar maxima and the years around them in which protons come.
//!
//! ECSS-E-ST-10-04C (2008), annex B.1: a cycle of 11 years has 7 active ones, from 2.5 years before the maximum to 4.5
//! years after it; the other 4 add nothing. After the last maximum that is known the Sun goes on at the mean length of a
//! cycle.

/// Years before a maximum in which the Sun is already active.
pub const ACTIVE_BEFORE_YR: f64 = 2.5;
/// Years after a maximum in which it is still active.
pub const ACTIVE_AFTER_YR: f64 = 4.5;
/// Active years of a cycle.
pub const ACTIVE_YR: f64 = ACTIVE_BEFORE_YR + ACTIVE_AFTER_YR;
/// Active share of a cycle: 7 years of 11.
pub const ACTIVE_SHARE: f64 = ACTIVE_YR / CYCLE_YR;
/// Mean length of a cycle, yr.
pub const CYCLE_YR: f64 = 11.0;
/// Standard deviation of the time from one maximum to the next, yr: that of cycles 19 to 25 ([`MAXIMA`], a test) is 1.0.
pub const CYCLE_SCATTER_YR: f64 = 1.0;

/// Maxima of solar cycles 19 to 25, decimal years.
///
/// Cycles 19, 20, 22, 24 and 25: maximum of the 13-month smoothed international sunspot number v2.0 (NOAA/SWPC), rounded
/// to 0.1 yr. Cycle 21: 1979.9, as in ECSS table B-1 (v2.0: 1979.96). Cycle 23: 2000.3, its first peak, as in ECSS table B-1
/// (the second, slightly higher one in v2.0 is 2001.9).
pub const MAXIMA: [f64; 7] = [1958.2, 1968.9, 1979.9, 1989.9, 2000.3, 2014.3, 2024.8];

/// A solar maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maximum {
    /// Decimal year.
    pub year: f64,
    /// How many cycles after the last one that is known; 0 if it is known.
    pub cycles_ahead: u32,
}

impl Maximum {
    /// Standard deviation of its date, yr: the lengths of cycles scatter independently.
    pub fn sigma_yr(&self) -> f64 {
        CYCLE_SCATTER_YR * f64::from(self.cycles_ahead).sqrt()
    }
}

/// Known maxima (decimal years) in order, followed by one every [`CYCLE_YR`] until the active years of the last reach a
/// decimal year.
pub fn maxima(known: &[f64], until: f64) -> Vec<Maximum> {
    let mut known = known.to_vec();
    known.sort_by(f64::total_cmp);
    let mut maxima: Vec<Maximum> = known.iter().map(|year| Maximum { year: *year, cycles_ahead: 0 }).collect();
    let Some(last) = known.last() else { return maxima };
    let missing = ((until - ACTIVE_AFTER_YR - last) / CYCLE_YR).ceil().max(0.0) as u32;
    maxima.extend((1..=missing).map(|ahead| Maximum { year: last + CYCLE_YR * f64::from(ahead), cycles_ahead: ahead }));
    maxima
}

/// A stretch of active years.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveYears {
    /// Start, decimal year.
    pub from: f64,
    /// End, decimal year.
    pub to: f64,
    /// Whether it is that of a maximum after the last one that is known.
    pub extrapolated: bool,
}

/// Active years around maxima (in order), joined where they overlap.
pub fn active_years(maxima: &[Maximum]) -> Vec<ActiveYears> {
    let mut stretches: Vec<ActiveYears> = Vec::new();
    for maximum in maxima {
        let (from, to) = (maximum.year - ACTIVE_BEFORE_YR, maximum.year + ACTIVE_AFTER_YR);
        let extrapolated = maximum.cycles_ahead > 0;
        match stretches.last_mut() {
            Some(last) if from <= last.to => *last = ActiveYears { to, extrapolated, ..*last },
            _ => stretches.push(ActiveYears { from, to, extrapolated }),
        }
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seven_years_around_each_maximum_are_active() {
        let stretches = active_years(&maxima(&MAXIMA, 2000.0));
        assert_eq!(stretches.len(), 7);
        for (stretch, maximum) in stretches.iter().zip(MAXIMA) {
            assert!((stretch.to - stretch.from - 7.0).abs() < 1e-9 && stretch.from < maximum && !stretch.extrapolated);
        }
        let joined = active_years(&maxima(&[2012.0, 2008.0], 2010.0));
        assert_eq!(joined, vec![ActiveYears { from: 2005.5, to: 2016.5, extrapolated: false }]);
    }

    #[test]
    fn the_sun_goes_on_after_the_last_known_maximum() {
        let maxima = maxima(&MAXIMA, 2500.0);
        let year = |year: f64| maxima.iter().find(|maximum| (maximum.year - year).abs() < 1e-9);
        assert_eq!(year(2024.8).unwrap().cycles_ahead, 0);
        assert_eq!((year(2035.8).unwrap().cycles_ahead, year(2046.8).unwrap().sigma_yr()), (1, 2_f64.sqrt()));
        assert!(maxima.last().unwrap().year + ACTIVE_AFTER_YR >= 2500.0);
        assert!(maxima.last().unwrap().year + ACTIVE_AFTER_YR < 2500.0 + CYCLE_YR);
    }

    #[test]
    fn cycles_are_as_long_and_as_uneven_as_the_known_ones() {
        let lengths: Vec<f64> = MAXIMA.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
        let variance = lengths.iter().map(|length| (length - mean).powi(2)).sum::<f64>() / (lengths.len() - 1) as f64;
        // Six cycles: the mean to scatter/√6, the scatter to 30 %.
        assert!((mean - CYCLE_YR).abs() < 2.0 * CYCLE_SCATTER_YR / 6_f64.sqrt(), "{mean}");
        assert!((variance.sqrt() / CYCLE_SCATTER_YR - 1.0).abs() < 0.6, "{}", variance.sqrt());
    }
}
