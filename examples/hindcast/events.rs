//! Solar proton events as they came.

/// Calendar years and the sum of the peak fluxes above 10 MeV (protons per cm², s and sr) of their events: NOAA SWPC, Solar Proton
/// Events Affecting the Earth Environment. 1999: from August on. A peak is not a fluence, and 10 MeV is less than shields stop: a
/// rough measure of how strong a year was.
pub const PEAKS: [(i32, f64); 22] = [
    (1999, 0.0),
    (2000, 41030.0),
    (2001, 67500.0),
    (2002, 4671.0),
    (2003, 35457.0),
    (2004, 3519.0),
    (2005, 10609.0),
    (2006, 2678.0),
    (2007, 0.0),
    (2008, 0.0),
    (2009, 0.0),
    (2010, 14.0),
    (2011, 374.0),
    (2012, 14764.0),
    (2013, 2057.0),
    (2014, 1377.0),
    (2015, 1128.0),
    (2016, 21.0),
    (2017, 2360.0),
    (2018, 0.0),
    (2019, 0.0),
    (2020, 0.0),
];

/// Peak flux of the event of 2003-10-28, the same unit and source.
pub const OCTOBER_2003: f64 = 29500.0;

/// Sum of peaks between two decimal years, those of a year spread over it.
pub fn sum(from: f64, to: f64) -> f64 {
    let within = |year: i32| (to.min(f64::from(year) + 1.0) - from.max(f64::from(year))).max(0.0);
    PEAKS.iter().map(|(year, peaks)| within(*year) * peaks).sum()
}
