//! Cells with points in time.

use chrono::{NaiveDate, NaiveDateTime, TimeDelta};

use super::columns::{Cell, Time};

impl Cell {
    /// A point in time: text in ISO 8601, or a number in one of astropy's time formats, named by `time`.
    pub fn moment(&self, time: Option<&Time>) -> Option<NaiveDateTime> {
        if let Cell::Text(text) = self {
            return written(text.trim().trim_end_matches('Z'));
        }
        let number = self.number().filter(|number| number.is_finite())?;
        match time?.format.as_str() {
            "mjd" => days_after(NaiveDate::from_ymd_opt(1858, 11, 17)?, number),
            // Julian dates start at noon.
            "jd" => days_after(NaiveDate::from_ymd_opt(1858, 11, 17)?, number - 2_400_000.5),
            "unix" => days_after(NaiveDate::from_ymd_opt(1970, 1, 1)?, number / 86_400.0),
            "decimalyear" | "jyear" => {
                let first = NaiveDate::from_ymd_opt(number.floor() as i32, 1, 1)?;
                let days = if first.leap_year() { 366.0 } else { 365.0 };
                days_after(first, number.fract() * days)
            }
            _ => None,
        }
    }
}

/// `2030-06-01`, `2030-06-01T12:00:00` or `2030-06-01 12:00:00`
fn written(text: &str) -> Option<NaiveDateTime> {
    let day = || text.parse::<NaiveDate>().ok()?.and_hms_opt(0, 0, 0);
    let time = |format| NaiveDateTime::parse_from_str(text, format).ok();
    day().or_else(|| time("%Y-%m-%dT%H:%M:%S%.f")).or_else(|| time("%Y-%m-%d %H:%M:%S%.f"))
}

fn days_after(date: NaiveDate, days: f64) -> Option<NaiveDateTime> {
    date.and_hms_opt(0, 0, 0)?.checked_add_signed(TimeDelta::try_milliseconds((days * 86_400_000.0).round() as i64)?)
}
