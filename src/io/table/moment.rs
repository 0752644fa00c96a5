//! Cells with points in time.

use std::ops::RangeInclusive;

use chrono::{DateTime, Datelike, NaiveDate, NaiveDateTime};

use super::columns::{Cell, Time};
use super::time_scale::{self, SCALES, later};

/// Years in which measurements and missions are: a date outside is one in another notation.
pub const YEARS: RangeInclusive<i32> = 1900..=2200;

/// Julian date of the modified Julian date 0, 1858-11-17.
const MODIFIED_JULIAN_DAY_0: f64 = 2_400_000.5;

/// Modified Julian dates of [`YEARS`].
const MODIFIED_JULIAN_DAYS: RangeInclusive<f64> = 15_020.0..=124_594.0;

/// Modified Julian date of the Julian epoch J2000.0, and of the Besselian epoch B1900.0 (Lieske 1979, A&A 73, 282).
const J2000_MJD: f64 = 51_544.5;
const B1900_MJD: f64 = 15_019.813_52;

/// Days in a Julian year, and in a tropical year of Besselian epochs.
const JULIAN_YEAR_D: f64 = 365.25;
const TROPICAL_YEAR_D: f64 = 365.242_198_781;

const SECONDS_PER_DAY: f64 = 86_400.0;

/// Why a cell is no point in time, and what to try.
#[derive(Clone, Debug, PartialEq)]
pub struct NotADate {
    /// What is wrong.
    pub problem: String,
    /// What to try.
    pub help: String,
}

impl NotADate {
    fn new(problem: impl Into<String>, help: impl Into<String>) -> NotADate {
        NotADate { problem: problem.into(), help: help.into() }
    }
}

impl Cell {
    /// A point in time, UTC: text in ISO 8601, of any offset from UTC, or one of astropy's time formats and scales, named by `time`.
    ///
    /// # Errors
    /// If it is not a point in time, or not one of the years 1900 to 2200.
    pub fn moment(&self, time: Option<&Time>) -> Result<NaiveDateTime, NotADate> {
        let (format, scale) = time.map_or(("", "utc"), |time| (time.format.as_str(), time.scale.as_str()));
        let found = match (self, format) {
            (Cell::Missing, _) => return Err(NotADate::new("the cell is empty; a date is needed here", WRITE)),
            (
                Cell::Text(text),
                "" | "iso" | "isot" | "fits" | "yday" | "datetime" | "datetime64" | "byear_str" | "jyear_str",
            ) => {
                let found = written(text.trim()).ok_or_else(|| unread(text.trim()))?;
                in_utc(found, scale)?
            }
            _ => {
                let number = self.number().filter(|number| number.is_finite());
                let number = number.ok_or_else(|| NotADate::new("this is not a date", WRITE))?;
                let (found, scale) = numbered(number, format, scale)?;
                found.map(|found| in_utc(found, scale)).transpose()?.ok_or_else(|| out_of_range(self, format))?
            }
        };
        if YEARS.contains(&found.year()) { Ok(found) } else { Err(out_of_range(self, format)) }
    }
}

const WRITE: &str = "write 2030-06-01, or 2030-06-01T12:00:00";

fn in_utc(time: NaiveDateTime, scale: &str) -> Result<NaiveDateTime, NotADate> {
    time_scale::to_utc(time, scale).ok_or_else(|| {
        let problem = format!("there is no time scale `{scale}`; there are: {}", SCALES.join(", "));
        NotADate::new(problem, "write the time as UTC: t[\"date\"] = t[\"date\"].utc")
    })
}

/// The point in time of a number in one of astropy's formats, and its scale; None beyond the calendar. Seconds and days since an
/// epoch have a scale of their own.
fn numbered<'a>(number: f64, format: &str, scale: &'a str) -> Result<(Option<NaiveDateTime>, &'a str), NotADate> {
    let day = |year, month, day| NaiveDate::from_ymd_opt(year, month, day).and_then(|day| day.and_hms_opt(0, 0, 0));
    let after = |epoch: Option<NaiveDateTime>, seconds: f64| epoch.and_then(|epoch| later(epoch, seconds));
    let of_mjd = |days: f64| after(day(1858, 11, 17), days * SECONDS_PER_DAY);
    Ok(match format {
        "mjd" => (of_mjd(number), scale),
        "jd" => (of_mjd(number - MODIFIED_JULIAN_DAY_0), scale),
        "jyear" => (of_mjd(J2000_MJD + (number - 2000.0) * JULIAN_YEAR_D), scale),
        "byear" => (of_mjd(B1900_MJD + (number - 1900.0) * TROPICAL_YEAR_D), scale),
        "decimalyear" => (decimal_year(number), scale),
        "unix" => (after(day(1970, 1, 1), number), "utc"),
        "unix_tai" => (after(day(1970, 1, 1), number), "tai"),
        "cxcsec" => (after(day(1998, 1, 1), number), "tt"),
        // The epoch is 1980-01-06 UTC.
        "gps" => (after(day(1980, 1, 6), number + 19.0), "tai"),
        "galexsec" => (after(day(1980, 1, 6), number), "utc"),
        // Matplotlib counted from the year 0 up to version 3.2, and counts from 1970; the two differ by 719163 d.
        "plot_date" if number > 200_000.0 => (after(day(1970, 1, 1), (number - 719_163.0) * SECONDS_PER_DAY), "utc"),
        "plot_date" => (after(day(1970, 1, 1), number * SECONDS_PER_DAY), "utc"),
        "" => return Err(bare_number(number)),
        other => {
            let problem = format!("times in the format `{other}` of astropy are not read");
            return Err(NotADate::new(problem, "write them as text: t[\"date\"].format = \"isot\""));
        }
    })
}

/// The year's part that has passed: of 365 or 366 days.
fn decimal_year(number: f64) -> Option<NaiveDateTime> {
    let first = |year: f64| NaiveDate::from_ymd_opt(year as i32, 1, 1)?.and_hms_opt(0, 0, 0);
    let (begin, end) = (first(number.floor())?, first(number.floor() + 1.0)?);
    later(begin, (number - number.floor()) * (end - begin).as_seconds_f64())
}

/// `2030-06-01`, `2030-06-01T12:00:00`, `2030-06-01 12:00`, these with an offset from UTC (`Z`, `+02:00`), the day of a year
/// (`2030:152:12:00:00`), and epochs (`J2030.5`, `B1950.0`).
fn written(text: &str) -> Option<NaiveDateTime> {
    if let Some(epoch) = text.strip_prefix(['J', 'B']) {
        let format = if text.starts_with('J') { "jyear" } else { "byear" };
        return numbered(epoch.parse().ok()?, format, "utc").ok()?.0;
    }
    if let Ok(day) = text.parse::<NaiveDate>() {
        return day.and_hms_opt(0, 0, 0);
    }
    if text.get(4..5) == Some(":") {
        let time = |format| NaiveDateTime::parse_from_str(text, format).ok();
        let day = || NaiveDate::parse_from_str(text, "%Y:%j").ok()?.and_hms_opt(0, 0, 0);
        return day().or_else(|| time("%Y:%j:%H:%M:%S%.f")).or_else(|| time("%Y:%j:%H:%M"));
    }
    let text = text.replacen(['T', 't'], " ", 1);
    let text = text.trim_end_matches(['Z', 'z']).trim_end();
    ["%Y-%m-%d %H:%M:%S%.f", "%Y-%m-%d %H:%M"].into_iter().find_map(|format| {
        let with_offset = || Some(DateTime::parse_from_str(text, &format!("{format}%#z")).ok()?.naive_utc());
        let with_space = || Some(DateTime::parse_from_str(text, &format!("{format} %#z")).ok()?.naive_utc());
        NaiveDateTime::parse_from_str(text, format).ok().or_else(with_offset).or_else(with_space)
    })
}

/// What to say of text that is not read.
fn unread(text: &str) -> NotADate {
    // A number among dates is text.
    text.parse().map_or_else(|_| other_notation(text), bare_number)
}

/// What to say of text that is a date in another notation, or none.
fn other_notation(text: &str) -> NotADate {
    let day = text.split([' ', 'T']).next().unwrap_or("");
    let parts: Vec<&str> = day.split(['/', '.', '-']).collect();
    let numbers: Option<Vec<u32>> = parts.iter().map(|part| part.parse().ok()).collect();
    let Some([a, b, c]) = numbers.and_then(|numbers| <[u32; 3]>::try_from(numbers).ok()) else {
        return NotADate::new("this is not a date", WRITE);
    };
    let (first, last) = (parts[0].len(), parts[2].len());
    let date = |year: u32, month, day| NaiveDate::from_ymd_opt(year as i32, month, day).map(|date| date.to_string());
    if first == 4 {
        return match date(a, b, c) {
            Some(date) => NotADate::new("this is not a date as it is read here", format!("write {date}")),
            None => NotADate::new("there is no such day", WRITE),
        };
    }
    // Two digits are those of the years from 1970 to 2069.
    let year = if last == 4 { c } else { c + if c < 70 { 2000 } else { 1900 } };
    let mut meant: Vec<String> = [date(year, b, a)].into_iter().flatten().collect();
    // Days come first where points delimit.
    if !day.contains('.') || meant.is_empty() {
        meant.extend(date(year, a, b));
    }
    meant.dedup();
    match meant.as_slice() {
        [] => NotADate::new("this is not a date", WRITE),
        meant => {
            let problem = "this is not a date as it is read here: the year comes first, in four digits";
            let whichever = if meant.len() > 1 { ", whichever is meant" } else { "" };
            NotADate::new(problem, format!("write {}{whichever}", meant.join(" or ")))
        }
    }
}

/// What to say of a number without a time format.
fn bare_number(number: f64) -> NotADate {
    let years = f64::from(*YEARS.start())..=f64::from(*YEARS.end());
    let digits =
        (number.fract() == 0.0).then_some(number).filter(|number| years.contains(&(number / 10_000.0).floor()));
    let date = digits.and_then(|number| {
        let number = number as u32;
        NaiveDate::from_ymd_opt((number / 10_000) as i32, number / 100 % 100, number % 100)
    });
    let help = match date {
        Some(date) => format!("write {date}"),
        None if MODIFIED_JULIAN_DAYS.contains(&(number - MODIFIED_JULIAN_DAY_0)) => {
            "call the column jd if these are Julian dates".into()
        }
        None if MODIFIED_JULIAN_DAYS.contains(&number) => {
            "call the column mjd if these are modified Julian dates; a spreadsheet's number of a day is to be formatted as \
             2030-06-01"
                .into()
        }
        None if years.contains(&number) => {
            "a decimal year needs astropy's Time (decimalyear, jyear); years since launch are t_yr".into()
        }
        None => format!("{WRITE}; numbers need astropy's Time (mjd, jd, decimalyear)"),
    };
    NotADate::new("this is not a date", help)
}

/// What to say of a time that is beyond all missions.
fn out_of_range(cell: &Cell, format: &str) -> NotADate {
    let problem = format!("this is not within the years {} to {}", YEARS.start(), YEARS.end());
    let number = cell.number().unwrap_or(f64::NAN);
    let help = match format {
        "mjd" if MODIFIED_JULIAN_DAYS.contains(&(number - MODIFIED_JULIAN_DAY_0)) => {
            "as a Julian date it would be: call the column jd. mjd counts days from 1858-11-17, jd is 2400000.5 more"
        }
        "jd" if MODIFIED_JULIAN_DAYS.contains(&number) => {
            "as a modified Julian date it would be: call the column mjd. mjd counts days from 1858-11-17, jd is 2400000.5 more"
        }
        "mjd" | "jd" => "mjd counts days from 1858-11-17, jd is 2400000.5 more",
        "" => "write the year in four digits: 2030-06-01",
        _ => "is this the format of the numbers? write them as text: t[\"date\"].format = \"isot\"",
    };
    NotADate::new(problem, help)
}
