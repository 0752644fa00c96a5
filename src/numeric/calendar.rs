//! Dates, decimal years and years since launch.
//!
//! A year since launch is 365.25 days, everywhere. Solar maxima are quoted in decimal calendar years, whose mean length is the
//! same; the difference, about a day, is far below the uncertainty of a maximum.

use chrono::{Datelike, NaiveDate, TimeDelta};

/// Days in a year since launch.
pub const DAYS_PER_YEAR: f64 = 365.25;

/// The date as a decimal year: 2009-01-01 is 2009.0, and a day is 1/365 or 1/366 of its year.
pub fn decimal_year(date: NaiveDate) -> f64 {
    let days = if date.leap_year() { 366.0 } else { 365.0 };
    f64::from(date.year()) + f64::from(date.ordinal0()) / days
}

/// The date (the day that has begun) `t_yr` years after launch. None after the year 9999.
pub fn date_after(launch: NaiveDate, t_yr: f64) -> Option<NaiveDate> {
    // A tiny fraction of a day keeps whole numbers of days in spite of rounding.
    let days = (t_yr * DAYS_PER_YEAR + 1e-6).floor();
    launch.checked_add_signed(TimeDelta::try_days(days as i64)?).filter(|date| date.year() <= 9999)
}

/// Years from launch to a date.
pub fn years_between(launch: NaiveDate, date: NaiveDate) -> f64 {
    (date - launch).num_days() as f64 / DAYS_PER_YEAR
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_years_since_launch_agree() {
        let launch = NaiveDate::from_ymd_opt(2009, 1, 1).unwrap();
        assert_eq!(decimal_year(launch), 2009.0);
        assert_eq!(date_after(launch, 1.0).unwrap().to_string(), "2010-01-01");
        assert_eq!(date_after(launch, 3.8).unwrap().to_string(), "2012-10-19");
        let later = date_after(launch, 1000.0 / DAYS_PER_YEAR).unwrap();
        assert_eq!(years_between(launch, later), 1000.0 / DAYS_PER_YEAR);
        assert_eq!(date_after(launch, 1e9), None);
    }
}
