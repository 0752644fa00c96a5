//! Modulation of cosmic rays and sunspot numbers, month by month, 1989 to 2025.

use std::sync::LazyLock;

use chrono::{NaiveDate, NaiveDateTime};

/// A month of the file.
struct Month {
    start: NaiveDateTime,
    modulation_gv: f64,
    /// None at the end of the file.
    sunspots: Option<f64>,
}

static MONTHS: LazyLock<Vec<Month>> = LazyLock::new(|| {
    let rows = include_str!("months.csv").lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|row| month(row).expect("a row of the program's own file")).collect()
});

fn month(row: &str) -> Option<Month> {
    let mut cells = row.split(',');
    let start = format!("{}-01", cells.next()?).parse::<NaiveDate>().ok()?.and_hms_opt(0, 0, 0)?;
    let modulation_gv = cells.next()?.parse::<f64>().ok()? / 1000.0;
    Some(Month { start, modulation_gv, sunspots: cells.next()?.parse().ok() })
}

/// Start of each month and its modulation, GV; last, the end of the last month with its modulation.
pub(super) fn modulation_gv() -> &'static [(NaiveDateTime, f64)] {
    static KNOWN: LazyLock<Vec<(NaiveDateTime, f64)>> = LazyLock::new(|| {
        let mut known: Vec<_> = MONTHS.iter().map(|month| (month.start, month.modulation_gv)).collect();
        let last = known.last().expect("months");
        known.push((next(last.0), last.1));
        known
    });
    &KNOWN
}

/// The start of the month after one.
fn next(start: NaiveDateTime) -> NaiveDateTime {
    start
        .date()
        .checked_add_months(chrono::Months::new(1))
        .map_or(start, |day| day.and_hms_opt(0, 0, 0).expect("midnight"))
}

/// Smoothed sunspot numbers at which AP-8 MIN and MAX hold: 13-month means of the international number v2.0 at the minimum of
/// 1964.8 and the maximum of 1968.9, the cycle of both maps (SILSO).
const MAPS: (f64, f64) = (14.3, 156.6);

/// Middle of each month and the share of AP-8 MIN then: linear in the 13-month smoothed sunspot number (half weight at its ends)
/// between those of the two maps, 0 to 1.
pub(super) fn shares_of_minimum() -> &'static [(NaiveDateTime, f64)] {
    static KNOWN: LazyLock<Vec<(NaiveDateTime, f64)>> = LazyLock::new(|| {
        let known: Vec<(NaiveDateTime, f64)> =
            MONTHS.iter().map_while(|month| Some((middle(month.start), month.sunspots?))).collect();
        let smoothed = |at: &[(NaiveDateTime, f64)]| {
            let ends = 0.5 * (at[0].1 + at[12].1);
            let sum: f64 = ends + at[1..12].iter().map(|month| month.1).sum::<f64>();
            (at[6].0, ((MAPS.1 - sum / 12.0) / (MAPS.1 - MAPS.0)).clamp(0.0, 1.0))
        };
        known.windows(13).map(smoothed).collect()
    });
    &KNOWN
}

/// The middle of a month.
fn middle(start: NaiveDateTime) -> NaiveDateTime {
    start + (next(start) - start) / 2
}

#[cfg(test)]
mod tests {
    use chrono::Datelike;

    use super::*;

    #[test]
    fn months_follow_each_other() {
        let months = modulation_gv();
        assert!(months.windows(2).all(|pair| next(pair[0].0) == pair[1].0));
        let of = |year: i32, month: u32| {
            months.iter().find(|known| known.0.year() == year && known.0.month() == month).unwrap().1
        };
        // As printed by the series' authors.
        assert_eq!((of(2009, 12), of(2003, 11)), (0.255, 1.281));
    }

    /// Cycle 24 was as weak as 116 at its maximum, and 1.8 at the minimum of 2019.9.
    #[test]
    fn sunspots_are_smoothed_as_usual() {
        let least = shares_of_minimum().iter().map(|month| month.1).fold(1.0, f64::min);
        let of = |year: i32, month: u32| {
            shares_of_minimum().iter().find(|known| known.0.year() == year && known.0.month() == month).unwrap().1
        };
        assert_eq!((least, of(2019, 12)), (0.0, 1.0));
        let sunspots = MAPS.1 - of(2014, 4) * (MAPS.1 - MAPS.0);
        assert!((sunspots - 116.4).abs() < 3.0, "{sunspots}");
    }
}
