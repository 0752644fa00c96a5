//! Time scales → UTC, in which dates of missions are.

use chrono::{NaiveDate, NaiveDateTime, TimeDelta};

/// Days on which TAI - UTC became larger, and its value from then on, s (IERS Bulletin C 52 and those before; none has been announced
/// since). From 1961 to 1972, UTC was defined otherwise and TAI - UTC was from 1.4 to 9.9 s: here it is 10 s.
const LEAP_SECONDS: [(i32, u32, i64); 28] = [
    (1972, 1, 10),
    (1972, 7, 11),
    (1973, 1, 12),
    (1974, 1, 13),
    (1975, 1, 14),
    (1976, 1, 15),
    (1977, 1, 16),
    (1978, 1, 17),
    (1979, 1, 18),
    (1980, 1, 19),
    (1981, 7, 20),
    (1982, 7, 21),
    (1983, 7, 22),
    (1985, 7, 23),
    (1988, 1, 24),
    (1990, 1, 25),
    (1991, 1, 26),
    (1992, 7, 27),
    (1993, 7, 28),
    (1994, 7, 29),
    (1996, 1, 30),
    (1997, 7, 31),
    (1999, 1, 32),
    (2006, 1, 33),
    (2009, 1, 34),
    (2012, 7, 35),
    (2015, 7, 36),
    (2017, 1, 37),
];

/// TT - TAI, s (IAU 1991, resolution A4).
const TT_TAI_S: f64 = 32.184;

/// 1 - dTT/dTCG (IAU 2000, resolution B1.9) and 1 - dTDB/dTCB (IAU 2006, resolution B3). Both coordinate times agree with TT at
/// 1977-01-01 00:00:32.184; the periodic terms of TDB, below 2 ms, are neglected.
const L_G: f64 = 6.969_290_134e-10;
const L_B: f64 = 1.550_519_768e-8;

/// The scales of astropy.
pub(super) const SCALES: [&str; 8] = ["utc", "tai", "tt", "tdb", "tcg", "tcb", "ut1", "local"];

/// A point in time in a scale of astropy, as UTC. UT1 differs from it by less than 0.9 s, which is neglected, and a local time is
/// taken as it is. None if there is no such scale, or the time is beyond the calendar.
pub(super) fn to_utc(time: NaiveDateTime, scale: &str) -> Option<NaiveDateTime> {
    let since_1977_s = || (time - day(1977, 1)?).num_milliseconds().checked_div(1000).map(|seconds| seconds as f64);
    let from_tt = |offset_s: f64| Some(utc_of_tai(later(time, -TT_TAI_S - offset_s)?));
    match scale {
        "" | "utc" | "ut1" | "local" => Some(time),
        "tai" => Some(utc_of_tai(time)),
        "tt" | "tdb" => from_tt(0.0),
        "tcg" => from_tt(L_G * since_1977_s()?),
        "tcb" => from_tt(L_B * since_1977_s()?),
        _ => None,
    }
}

fn utc_of_tai(tai: NaiveDateTime) -> NaiveDateTime {
    let utc = |seconds: i64| tai - TimeDelta::seconds(seconds);
    let has_begun = |entry: &&(i32, u32, i64)| day(entry.0, entry.1).is_some_and(|begin| utc(entry.2) >= begin);
    let (.., seconds) = LEAP_SECONDS.iter().rev().find(has_begun).unwrap_or(&LEAP_SECONDS[0]);
    utc(*seconds)
}

/// The first day of a month.
fn day(year: i32, month: u32) -> Option<NaiveDateTime> {
    NaiveDate::from_ymd_opt(year, month, 1)?.and_hms_opt(0, 0, 0)
}

/// A time so many seconds later, to the microsecond.
pub(super) fn later(time: NaiveDateTime, seconds: f64) -> Option<NaiveDateTime> {
    let microseconds = (seconds * 1e6).round();
    let within = microseconds.abs() < i64::MAX as f64;
    time.checked_add_signed(TimeDelta::microseconds(within.then_some(microseconds as i64)?))
}
