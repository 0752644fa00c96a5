//! Numbers and dates estimated from draws, rounded according to their errors.

use chrono::NaiveDate;

use super::short;
use crate::study::Estimate;

/// Days per month.
const MONTH_D: f64 = 365.25 / 12.0;

/// Errors of at least this many months leave only the year.
const MONTHS_BELOW: f64 = 24.0;

/// A date with an error in days (1 sigma), rounded to a day, a month, or a year.
pub(in crate::report) fn known_date(date: NaiveDate, error_d: Option<f64>) -> String {
    let format = match error_d {
        Some(error_d) if error_d < 0.5 * MONTH_D => "%Y-%m-%d",
        Some(error_d) if error_d < MONTHS_BELOW * MONTH_D => "%Y-%m",
        _ => "%Y",
    };
    date.format(format).to_string()
}

/// The error of such a date, in the same unit, rounded up.
pub(in crate::report) fn error_of_date(error_d: f64) -> String {
    match error_d / MONTH_D {
        months if months < 0.5 => format!("+- {} d", error_d.ceil()),
        months if months <= 1.0 => "+- 1 month".into(),
        months if months < MONTHS_BELOW => format!("+- {} months", months.ceil()),
        months => format!("+- {} yr", (months / 12.0).ceil()),
    }
}

/// Without an exponent, rounded according to the error; without an error if that is 0.
pub(in crate::report) fn plus_minus(estimate: Estimate) -> String {
    let Estimate { value, error } = estimate;
    if !is_known(error) {
        return short(value);
    }
    // At most the digits of a double.
    let last = last_digit(error).max(-12);
    let unit = 10_f64.powi(last.max(0));
    match usize::try_from(-last) {
        Ok(decimals) => format!("{value:.decimals$} +- {error:.decimals$}"),
        Err(_) => format!("{} +- {}", (value / unit).round() * unit, (error / unit).round() * unit),
    }
}

/// The same in scientific notation.
pub(in crate::report) fn scientific(estimate: Estimate) -> String {
    let value = scientific_value(estimate);
    if !is_known(estimate.error) {
        return value;
    }
    let own = usize::from(leads_with_1(estimate.error));
    format!("{value} +- {:.own$e}", estimate.error)
}

/// The value alone, in scientific notation, rounded according to the error.
pub(in crate::report) fn scientific_value(Estimate { value, error }: Estimate) -> String {
    if !is_known(error) {
        return format!("{value:.2e}");
    }
    let exponent = value.abs().max(error).log10().floor() as i32;
    let decimals = (exponent - last_digit(error)).max(0) as usize;
    format!("{value:.decimals$e}")
}

fn is_known(error: f64) -> bool {
    error > 0.0 && error.is_finite()
}

/// The power of ten of the last significant digit: the first digit of the error, or the one after a leading 1.
fn last_digit(error: f64) -> i32 {
    error.log10().floor() as i32 - i32::from(leads_with_1(error))
}

fn leads_with_1(error: f64) -> bool {
    error / 10_f64.powf(error.log10().floor()) < 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_match_the_error() {
        let shown = |value, error| plus_minus(Estimate { value, error });
        assert_eq!(shown(16.5618, 0.412), "16.6 +- 0.4");
        assert_eq!(shown(16.5618, 0.1712), "16.56 +- 0.17");
        assert_eq!(shown(16.5618, 2.3), "17 +- 2");
        assert_eq!(shown(1234.5, 56.0), "1230 +- 60");
        assert_eq!(shown(0.0372, 0.00313), "0.037 +- 0.003");
        assert_eq!(shown(0.999, 0.0996), "1.00 +- 0.10");
        assert_eq!(scientific(Estimate { value: 7.934e-5, error: 3.1e-6 }), "7.9e-5 +- 3e-6");
        assert_eq!(scientific(Estimate { value: 7.934e-5, error: 1.31e-6 }), "7.93e-5 +- 1.3e-6");
        assert_eq!(scientific(Estimate { value: 1.13e-6, error: 1.2e-5 }), "1.1e-6 +- 1.2e-5");
    }

    #[test]
    fn a_date_and_its_error_have_one_unit() {
        let date = NaiveDate::from_ymd_opt(2012, 7, 22).unwrap();
        let shown = |error_d| format!("{} {}", known_date(date, Some(error_d)), error_of_date(error_d));
        assert_eq!(shown(10.2), "2012-07-22 +- 11 d");
        assert_eq!(shown(15.4), "2012-07 +- 1 month");
        assert_eq!(shown(210.0), "2012-07 +- 7 months");
        assert_eq!(shown(731.0), "2012 +- 3 yr");
    }
}
