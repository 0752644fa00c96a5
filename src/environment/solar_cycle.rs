//! Solar maxima and the years around them in which protons come.
//!
//! ECSS-E-ST-10-04C (2008), annex B.1: a cycle of 11 years has 7 active ones, from 2.5 years before the maximum to 4.5
//! years after it; the other 4 add nothing.

/// Years before a maximum in which the Sun is already active.
pub const ACTIVE_BEFORE_YR: f64 = 2.5;
/// Years after a maximum in which it is still active.
pub const ACTIVE_AFTER_YR: f64 = 4.5;
/// Active share of a cycle: 7 years of 11.
pub const ACTIVE_SHARE: f64 = 7.0 / 11.0;
/// Years of a cycle.
pub const CYCLE_YR: f64 = 11.0;

/// Maxima of solar cycles 19 to 26, decimal years.
///
/// Cycles 19, 20, 22, 24 and 25: maximum of the 13-month smoothed international sunspot number v2.0 (NOAA/SWPC), rounded
/// to 0.1 yr. Cycle 21: 1979.9, as in ECSS table B-1 (v2.0: 1979.96). Cycle 23: 2000.3, its first peak, as in ECSS table B-1 (the second, slightly higher one in v2.0 is
/// 2001.9). Cycle 26: 2035.8 is an assumption, cycle 25 plus 11 years.
pub const MAXIMA: [f64; 8] = [1958.2, 1968.9, 1979.9, 1989.9, 2000.3, 2014.3, 2024.8, 2035.8];

/// Active windows (decimal years, start and end) of a list of maxima, joined where they overlap, in order.
pub fn active_windows(maxima: &[f64]) -> Vec<(f64, f64)> {
    let mut maxima = maxima.to_vec();
    maxima.sort_by(f64::total_cmp);
    let mut windows: Vec<(f64, f64)> = Vec::new();
    for maximum in maxima {
        let (start, end) = (maximum - ACTIVE_BEFORE_YR, maximum + ACTIVE_AFTER_YR);
        match windows.last_mut() {
            Some(last) if start <= last.1 => last.1 = end,
            _ => windows.push((start, end)),
        }
    }
    windows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seven_years_around_each_maximum_are_active() {
        let windows = active_windows(&MAXIMA);
        assert_eq!(windows.len(), 8);
        for ((start, end), maximum) in windows.iter().zip(MAXIMA) {
            assert!((end - start - 7.0).abs() < 1e-9 && *start < maximum);
        }
        assert_eq!(active_windows(&[2012.0, 2008.0]), vec![(2005.5, 2016.5)]);
    }
}
