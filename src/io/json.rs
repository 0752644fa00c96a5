//! Results → JSON: conversions beyond serde's derives.

use serde::ser::{Serialize, Serializer};
use toml::{Table, Value};

/// A TOML value as JSON; dates as text.
struct Plain<'a>(&'a Value);

impl Serialize for Plain<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Value::Datetime(date) => to.collect_str(date),
            Value::Array(members) => to.collect_seq(members.iter().map(Plain)),
            Value::Table(members) => table(members, to),
            plain => plain.serialize(to),
        }
    }
}

/// A TOML table.
pub(crate) fn table<S: Serializer>(members: &Table, to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(members.iter().map(|(key, value)| (key, Plain(value))))
}

/// Keys and their values as a table.
pub(crate) fn settings<S: Serializer>(settings: &[(String, Value)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(settings.iter().map(|(key, value)| (key, Plain(value))))
}

/// A list as its length.
pub(crate) fn length<T, S: Serializer>(list: &[T], to: S) -> Result<S::Ok, S::Error> {
    list.len().serialize(to)
}
