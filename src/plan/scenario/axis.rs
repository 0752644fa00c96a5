//! Lists and ranges of a key's values, as given on the command line.

use chrono::NaiveDate;
use toml::Value;

use crate::error::{InputError, nearest};
use crate::mission::Date;
use crate::mission::keys::{Allowed, KEYS};
use crate::mission_file::lookup;
use crate::numeric::range;

/// A key and its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Dotted key of the mission, such as `readout.line_time_ms` or `detector.traps.VV.density_per_px`.
    pub key: String,
    /// Its values, in order.
    pub values: Vec<Value>,
}

/// Maximum number of values in a range.
const MOST_VALUES: usize = 100_000;

impl Axis {
    /// Reads values: a list `5,10,25`, a range with a step `100..1700:100`, n values in equal steps `5..100:lin:8` or equal ratios
    /// `5..100:log:8`, or, for dates, with a step in years `2009-01-01..2020-01-01:1`.
    ///
    /// # Errors
    /// If the key does not exist, the text has none of these forms, or a value is of the wrong kind.
    pub fn parse(key: &str, text: &str) -> Result<Axis, InputError> {
        let refuse = |problem: String| InputError::new(format!("cannot read the values of {key}: `{text}`"), problem);
        let Some(kind) = kind_of(key) else {
            let near = nearest(key, KEYS.iter().map(|key| key.path));
            let error = InputError::new(format!("cannot set {key}"), format!("a mission has no key `{key}`"));
            return Err(match near {
                Some(near) => error.with_help(format!("did you mean `{}`?", near.replace("[]", ".NAME"))),
                None => error,
            });
        };
        let values = match text.split_once("..") {
            Some((from, to)) => range(kind, from.trim(), to.trim()),
            None => items(text).into_iter().map(|item| value(kind, item)).collect(),
        };
        let values = values.map_err(|problem| refuse(problem).with_help(help(kind)))?;
        Ok(Axis { key: key.to_string(), values })
    }
}

/// The forms that the values of a key take.
fn help(kind: Allowed) -> &'static str {
    match kind {
        Allowed::Date => "a list `2030-01-01,2031-07-01`, or a range with a step in years `2029-01-01..2040-01-01:1`",
        Allowed::Choice(_) | Allowed::Text => "a list `this,that`",
        Allowed::Numbers(..) | Allowed::Texts => "a list of lists `[a,b],[c]`, or `a,b` for lists of one each",
        Allowed::IntegerLists(..) => "the mission file takes lists of lists",
        Allowed::Number(..) | Allowed::Positive(..) | Allowed::Integer(..) => {
            "a list `5,10,25`, a range with a step `100..1700:100`, equal steps `5..100:lin:8`, or equal ratios `5..100:log:8`"
        }
    }
}

/// What is between commas, apart from those in brackets.
fn items(text: &str) -> Vec<&str> {
    let mut depth = 0;
    let outside = |symbol: char| {
        depth += i32::from(symbol == '[') - i32::from(symbol == ']');
        symbol == ',' && depth == 0
    };
    text.split(outside).map(str::trim).collect()
}

/// The kind of value that a key takes; a name matches any member.
fn kind_of(key: &str) -> Option<Allowed> {
    let known = lookup::find(key).or_else(|| {
        KEYS.iter().find(|known| {
            known.path.split_once("[].").is_some_and(|(array, field)| {
                key.strip_prefix(array)
                    .is_some_and(|rest| rest.starts_with('.') && rest.ends_with(&format!(".{field}")))
            })
        })
    })?;
    Some(known.kind)
}

fn value(kind: Allowed, item: &str) -> Result<Value, String> {
    let number =
        || item.parse::<f64>().ok().filter(|number| number.is_finite()).ok_or(format!("`{item}` is not a number"));
    match kind {
        Allowed::Integer(..) => match item.parse::<i64>() {
            Ok(integer) => Ok(Value::Integer(integer)),
            Err(_) => whole(number()?).ok_or(format!("`{item}` is not a whole number")),
        },
        Allowed::Number(..) | Allowed::Positive(..) => Ok(Value::Float(number()?)),
        Allowed::Numbers(..) => list(item, |member| value(Allowed::Number(f64::MIN, f64::MAX), member)),
        Allowed::IntegerLists(..) => Err("give lists of lists in the mission file".into()),
        Allowed::Date => Ok(Value::Datetime(Date(day(item)?).into())),
        Allowed::Choice(_) | Allowed::Text => Ok(Value::String(unquoted(item).to_string())),
        Allowed::Texts => list(item, |member| value(Allowed::Text, member)),
    }
}

/// A list in brackets, or of one value.
fn list(item: &str, member: impl Fn(&str) -> Result<Value, String>) -> Result<Value, String> {
    let members = item.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(item);
    Ok(Value::Array(items(members).into_iter().map(member).collect::<Result<_, _>>()?))
}

/// A text without the quotes that it has in a mission file.
fn unquoted(item: &str) -> &str {
    let within = |quote: char| item.strip_prefix(quote)?.strip_suffix(quote);
    within('"').or_else(|| within('\'')).unwrap_or(item)
}

fn range(kind: Allowed, from: &str, rest: &str) -> Result<Vec<Value>, String> {
    let parts: Vec<&str> = rest.split(':').map(str::trim).collect();
    match kind {
        Allowed::Date => dates(from, &parts),
        Allowed::Integer(..) => {
            // For whole numbers: rounded, without duplicates.
            let mut whole: Vec<i64> = numbers(from, &parts)?.iter().map(|number| number.round() as i64).collect();
            whole.dedup();
            Ok(whole.into_iter().map(Value::Integer).collect())
        }
        Allowed::Number(..) | Allowed::Positive(..) => {
            Ok(numbers(from, &parts)?.into_iter().map(Value::Float).collect())
        }
        _ => Err("this key takes no range".into()),
    }
}

/// Months by which a step in years may differ from a whole number of months: that of a step written with two digits, such as 0.17.
const MONTHS_OFF: f64 = 0.05;

fn dates(from: &str, rest: &[&str]) -> Result<Vec<Value>, String> {
    let [to, step] = rest[..] else { return Err("a range of dates needs a step in years, such as `:1`".into()) };
    let years = step.parse::<f64>().ok().filter(|years| (0.5 / 12.0..=1e4).contains(years));
    let months = 12.0 * years.ok_or(format!("`{step}` is not a step in years (at least a month)"))?;
    if (months - months.round()).abs() > MONTHS_OFF {
        return Err(format!("{step} yr is {months:.1} months; steps are whole months, such as 0.25 yr"));
    }
    let (first, last) = (day(from)?, day(to)?);
    if last < first {
        return Err(format!("{to} is before {from}"));
    }
    let dates = range::by_months(first, last, months.round() as u32);
    Ok(dates.into_iter().map(|date| Value::Datetime(Date(date).into())).collect())
}

fn numbers(from: &str, rest: &[&str]) -> Result<Vec<f64>, String> {
    let number = |text: &str| {
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or(format!("`{text}` is not a number"))
    };
    let count = |text: &str| match text.parse::<usize>() {
        Ok(count) if (2..=MOST_VALUES).contains(&count) => Ok(count),
        _ => Err(format!("`{text}` is not a number of values from 2 to {MOST_VALUES}")),
    };
    let (low, high) = (number(from)?, number(rest[0])?);
    match rest[1..] {
        ["log", n] if low > 0.0 && high > 0.0 => Ok(range::equal_ratios(low, high, count(n)?)),
        ["log", _] => Err("equal ratios need ends above 0".into()),
        ["lin", n] => Ok(range::equal_steps(low, high, count(n)?)),
        [step] => {
            let step = number(step)?;
            range::by_step(low, high, step, MOST_VALUES)
                .ok_or(format!("{step} does not lead from {low} to {high} in up to {MOST_VALUES} steps"))
        }
        _ => Err("a range needs a step".into()),
    }
}

fn whole(number: f64) -> Option<Value> {
    (number.fract() == 0.0 && number.abs() < 1e15).then_some(Value::Integer(number as i64))
}

fn day(text: &str) -> Result<NaiveDate, String> {
    text.parse().map_err(|_| format!("`{text}` is not a date such as 2030-01-01"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(key: &str, text: &str) -> Vec<f64> {
        let values = Axis::parse(key, text).unwrap().values;
        values.iter().map(|value| value.as_float().or(value.as_integer().map(|i| i as f64)).unwrap()).collect()
    }

    #[test]
    fn lists_and_ranges_are_read() {
        assert_eq!(numbers("readout.transfers", "100..1700:400"), [100.0, 500.0, 900.0, 1300.0, 1700.0]);
        assert_eq!(numbers("readout.line_time_ms", "0.1..0.3:0.1").len(), 3);
        let ratios = numbers("readout.line_time_ms", "5..100:log:8");
        assert_eq!((ratios.len(), ratios[0]), (8, 5.0));
        assert!((ratios[7] - 100.0).abs() < 1e-12 && (ratios[1] / ratios[0] - 20_f64.powf(1.0 / 7.0)).abs() < 1e-12);
        assert_eq!(numbers("detector.traps.VV.density_per_px", "1,2.5"), [1.0, 2.5]);
        let launches = Axis::parse("mission.launch", "2009-01-01..2011-06-01:0.5").unwrap().values;
        assert_eq!(launches.len(), 5);
        assert_eq!(launches[1].to_string(), "2009-07-01");
        let methods = |text| Axis::parse("accuracy.readout", text).unwrap().values;
        assert_eq!(methods("'exact',\"fractional\""), methods("exact,fractional"));
        let sources = |text| {
            let values = Axis::parse("environment.sources", text).unwrap().values;
            values.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(sources("[solar-protons, 'cosmic-rays'],[solar-protons]").len(), 2);
        assert_eq!(sources("[solar-protons,\"cosmic-rays\"]"), [r#"["solar-protons", "cosmic-rays"]"#]);
        assert_eq!(sources("solar-protons,cosmic-rays"), [r#"["solar-protons"]"#, r#"["cosmic-rays"]"#]);
        let maxima = Axis::parse("environment.solar_maximum", "[2025.2,2036]").unwrap().values;
        assert_eq!(maxima[0].as_array().unwrap().len(), 2);
    }

    #[test]
    fn what_is_neither_is_refused() {
        for (key, text) in [
            ("readout.transfers", "1..2"),
            ("readout.transfers", "a"),
            ("readout.transfers", "1.5"),
            ("readout.line_time_ms", "0..10:log:3"),
            ("readout.line_time_ms", "1..2:0"),
            ("readout.line_time_ms", "2..1:1"),
            ("readout.line_time_ms", "nan"),
            ("mission.launch", "2009-13-01"),
            ("readout.linetime", "1"),
        ] {
            assert!(Axis::parse(key, text).is_err(), "{key} {text}");
        }
    }
}
