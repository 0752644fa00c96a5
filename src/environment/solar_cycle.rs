//! Solar maxima and the active years around them.
//!
//! ECSS-E-ST-10-04C (2008), annex B.1: a cycle of 11 years has 7 active ones, from 2.5 years before the maximum to 4.5 years after
//! it; the other 4 contribute nothing. After the last known maximum, cycles have the mean length.

use std::f64::consts::TAU;

/// Years before a maximum in which the Sun is already active.
pub const ACTIVE_BEFORE_YR: f64 = 2.5;
/// Years after a maximum in which it is still active.
pub const ACTIVE_AFTER_YR: f64 = 4.5;
/// Active years of a cycle.
pub const ACTIVE_YR: f64 = ACTIVE_BEFORE_YR + ACTIVE_AFTER_YR;
/// Active fraction of a cycle: 7 years of 11.
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
    /// Number of cycles after the last known one; 0 if it is known.
    pub cycles_ahead: u32,
}

impl Maximum {
    /// Standard deviation of its date, yr: the lengths of cycles vary independently.
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

/// An interval of active years.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveYears {
    /// Start, decimal year.
    pub from: f64,
    /// End, decimal year.
    pub to: f64,
    /// Whether it belongs to an extrapolated maximum.
    pub extrapolated: bool,
}

/// Active years around maxima (in order), joined if they overlap.
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

/// Minima of the solar cycle, decimal years; that of 2031 is assumed.
const MINIMA: [f64; 8] = [1954.3, 1964.8, 1976.2, 1986.7, 1996.6, 2008.9, 2019.9, 2031.0];

/// The solar cycle from minimum to minimum, with a delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// Delay behind the Sun, yr.
    pub lag_yr: f64,
}

impl Phase {
    /// Phase at a decimal year: 0 at minimum, ½ half-way between two minima, up to 1.
    pub fn at(self, year: f64) -> f64 {
        let (from, to) = around(year - self.lag_yr);
        (year - self.lag_yr - from) / (to - from)
    }

    /// Σ c_k cos 2πkx at a decimal year; x is the phase.
    pub fn value(self, cosines: &[f64], year: f64) -> f64 {
        let angle = TAU * self.at(year);
        cosines.iter().enumerate().map(|(k, cosine)| cosine * (k as f64 * angle).cos()).sum()
    }

    /// ∫ Σ c_k cos 2πkx dt between two decimal years, in years; x is the phase.
    pub fn integral(self, cosines: &[f64], from: f64, to: f64) -> f64 {
        let (mut start, stop) = (from - self.lag_yr, to - self.lag_yr);
        let mut sum = 0.0;
        while start < stop {
            let (minimum, next) = around(start);
            let end = stop.min(next);
            let length = next - minimum;
            let primitive = |year: f64| {
                let angle = TAU * (year - minimum) / length;
                let term = |(k, cosine): (usize, &f64)| match k {
                    0 => cosine * angle,
                    k => cosine * (k as f64 * angle).sin() / k as f64,
                };
                cosines.iter().enumerate().map(term).sum::<f64>() * length / TAU
            };
            sum += primitive(end) - primitive(start);
            start = end;
        }
        sum
    }
}

/// Minima before (or at) and after a decimal year; beyond the known ones, one every [`CYCLE_YR`].
fn around(year: f64) -> (f64, f64) {
    let (first, last) = (MINIMA[0], MINIMA[MINIMA.len() - 1]);
    if year < first {
        let back = first - CYCLE_YR * ((first - year) / CYCLE_YR).ceil();
        return (back, back + CYCLE_YR);
    }
    if year >= last {
        let on = last + CYCLE_YR * ((year - last) / CYCLE_YR).floor();
        // Rounding may leave the year at the end of the interval.
        return if year < on + CYCLE_YR { (on, on + CYCLE_YR) } else { (on + CYCLE_YR, on + 2.0 * CYCLE_YR) };
    }
    let after = MINIMA.partition_point(|minimum| *minimum <= year);
    (MINIMA[after - 1], MINIMA[after])
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
        // Six cycles: the mean within scatter/√6, the scatter to 30 %.
        assert!((mean - CYCLE_YR).abs() < 2.0 * CYCLE_SCATTER_YR / 6_f64.sqrt(), "{mean}");
        assert!((variance.sqrt() / CYCLE_SCATTER_YR - 1.0).abs() < 0.6, "{}", variance.sqrt());
    }

    #[test]
    fn the_phase_is_that_of_the_minima_and_its_integral_is_one() {
        let sun = Phase { lag_yr: 0.0 };
        assert!(sun.at(1996.6).abs() < 1e-9 && (sun.at(2014.4) - 0.5).abs() < 1e-9);
        let late = Phase { lag_yr: 430.0 / 365.25 };
        assert!((late.at(1997.0 + 430.0 / 365.25) - sun.at(1997.0)).abs() < 1e-9);
        for (from, to) in [(1990.0, 1990.0), (1990.3, 2044.7), (1900.0, 1960.0), (2100.0, 2111.0)] {
            for phase in [sun, late] {
                let steps = 200_000;
                let step = (to - from) / f64::from(steps);
                let value =
                    |year: f64| 0.7 - 0.3 * (TAU * phase.at(year)).cos() + 0.1 * (2.0 * TAU * phase.at(year)).cos();
                let sum: f64 = (0..steps).map(|index| step * value(from + (f64::from(index) + 0.5) * step)).sum();
                assert!((phase.integral(&[0.7, -0.3, 0.1], from, to) - sum).abs() < 1e-5, "{from} to {to}");
            }
        }
    }
}
