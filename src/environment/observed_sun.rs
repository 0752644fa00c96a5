//! The Sun as it was: solar proton events, modulation of cosmic rays and sunspot numbers, each at its time.
//!
//! ```text
//! events.ecsv → [`Event`] → fluence spectrum at 1 AU          months.csv → φ of cosmic rays, share of AP-8 MIN
//! ```
//!
//! A record of events covers a time, with gaps. Outside that time the Sun is drawn, or a quantile: see [`super::solar_events`] and
//! [`super::esp`]. Sources of the numbers stand in the heads of the files.

mod event;
mod months;

use std::sync::{Arc, LazyLock};

use chrono::{NaiveDate, NaiveDateTime};

use super::SECONDS_PER_YEAR;
use crate::io::radiation_file::{SolarEventsFile, parse_solar_events};
use crate::numeric::calendar::decimal_year;
pub use event::{Event, relative_error};

/// Events of a time that was observed.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Start of the observed time.
    pub from: NaiveDateTime,
    /// Its end.
    pub to: NaiveDateTime,
    /// Times within it without good data: start and end, in order.
    pub gaps: Vec<(NaiveDateTime, NaiveDateTime)>,
    /// Events, in order.
    pub events: Vec<Arc<Event>>,
}

/// The record that comes with the program.
static BUILT_IN: LazyLock<Arc<Record>> = LazyLock::new(|| {
    let file = parse_solar_events("events.ecsv", include_str!("observed_sun/events.ecsv"));
    Arc::new(Record::of(file.expect("the program's own file")).expect("the program's own record"))
});

impl Record {
    /// 1997-01-01 to 2025-09-10.
    pub fn built_in() -> Arc<Record> {
        Arc::clone(&BUILT_IN)
    }

    /// The record of a file that states when its observations begin and end.
    fn of(file: SolarEventsFile) -> Option<Record> {
        let events = file.events.into_iter().map(|row| Arc::new(Event::of(row))).collect();
        Some(Record { from: file.observed_from?, to: file.observed_to, gaps: file.gaps, events })
    }

    /// The built-in record, continued by a file, or replaced by one that states when its observations begin.
    ///
    /// # Errors
    /// If an event of a continuation starts within the built-in record: it would count twice.
    pub fn with(file: SolarEventsFile) -> Result<Record, String> {
        let built_in = Record::built_in();
        if file.observed_from.is_some() {
            return Ok(Record::of(file).expect("a start of the observations"));
        }
        let twice = file.events.iter().find(|row| row.start < built_in.to);
        if let Some(row) = twice {
            return Err(format!(
                "the event of {} starts before the end of the built-in record, {}: it would count twice; to replace that \
                 record, state observed_from in the file's meta",
                row.start,
                built_in.to.date()
            ));
        }
        if file.observed_to < built_in.to {
            return Err(format!(
                "observed_to is {}, before the end of the built-in record, {}",
                file.observed_to.date(),
                built_in.to.date()
            ));
        }
        let mut record = (*built_in).clone();
        record.to = file.observed_to;
        record.gaps.extend(file.gaps);
        record.events.extend(file.events.into_iter().map(|row| Arc::new(Event::of(row))));
        Ok(record)
    }
}

/// The observed Sun of a mission. Its times are years: the decimal year of launch plus years of 365.25 days since then, the
/// coordinate of all laws of time.
#[derive(Clone, Debug)]
pub struct Observed {
    launch: NaiveDate,
    record: Arc<Record>,
}

impl PartialEq for Observed {
    fn eq(&self, other: &Observed) -> bool {
        self.launch == other.launch && (Arc::ptr_eq(&self.record, &other.record) || self.record == other.record)
    }
}

impl Observed {
    /// A record, seen from a launch.
    pub fn new(launch: NaiveDate, record: Arc<Record>) -> Observed {
        Observed { launch, record }
    }

    /// The record.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// A moment as a year.
    pub fn year(&self, moment: NaiveDateTime) -> f64 {
        let since = moment - self.launch.and_hms_opt(0, 0, 0).expect("midnight");
        decimal_year(self.launch) + since.as_seconds_f64() / SECONDS_PER_YEAR
    }

    /// Start and end of the observed time.
    pub fn span(&self) -> [f64; 2] {
        [self.year(self.record.from), self.year(self.record.to)]
    }

    /// Gaps in it.
    pub fn gaps(&self) -> impl Iterator<Item = [f64; 2]> {
        self.record.gaps.iter().map(|(from, to)| [self.year(*from), self.year(*to)])
    }

    /// Events that end after launch, each with its start and end.
    pub fn events(&self) -> impl Iterator<Item = (f64, f64, &Arc<Event>)> {
        let launch = decimal_year(self.launch);
        let dated = self.record.events.iter().map(|event| (self.year(event.start), self.year(event.end), event));
        dated.filter(move |(_, end, _)| *end > launch)
    }

    /// Modulation of cosmic rays (GV) of each observed month, with its start; the last entry is the end of the last month.
    pub fn modulation_gv(&self) -> Vec<(f64, f64)> {
        months::modulation_gv().iter().map(|(start, gv)| (self.year(*start), *gv)).collect()
    }

    /// Share of AP-8 MIN (the rest: MAX) at the middle of each observed month, for a delay (yr) behind the Sun.
    pub fn share_of_minimum(&self, lag_yr: f64) -> Vec<(f64, f64)> {
        let shares = months::shares_of_minimum();
        shares.iter().map(|(middle, share)| (self.year(*middle) + lag_yr, *share)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_record_is_in_order_and_within_its_time() {
        let record = Record::built_in();
        assert_eq!(record.events.len(), 304);
        assert!(record.events.windows(2).all(|pair| pair[0].start <= pair[1].start));
        assert!(record.events.iter().all(|event| event.start >= record.from && event.end <= record.to));
        assert!(record.gaps.iter().all(|(from, to)| from < to && *from >= record.from && *to <= record.to));
    }

    #[test]
    fn events_come_on_their_days_for_every_launch() {
        for launch in ["1999-12-10", "2000-07-14", "2013-12-19"] {
            let launch: NaiveDate = launch.parse().unwrap();
            let observed = Observed::new(launch, Record::built_in());
            for (start, end, event) in observed.events() {
                let days = (start - decimal_year(launch)) * crate::numeric::calendar::DAYS_PER_YEAR;
                let exact = (event.start - launch.and_hms_opt(0, 0, 0).unwrap()).as_seconds_f64() / 86_400.0;
                assert!((days - exact).abs() < 1e-6 && end > start, "{event:?}");
            }
        }
    }
}
