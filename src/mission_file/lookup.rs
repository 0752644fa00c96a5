//! Lookup of any key of a mission file by its path, including those of effects.

use crate::effect;
use crate::mission::keys::{KEYS, Key, pattern_of};

/// The key of a path in which `[3]` may replace `[]`, including those of effects.
pub fn find(path: &str) -> Option<&'static Key> {
    let pattern = pattern_of(path);
    KEYS.iter().find(|key| key.path == pattern).or_else(|| effect::find_key(path))
}

/// Whether a path, in which `[3]` may replace `[]`, is that of a table.
pub fn is_table(path: &str) -> bool {
    let pattern = pattern_of(path);
    let holds = |key: &Key, table: &str| key.path.strip_prefix(table).is_some_and(|rest| rest.starts_with('.'));
    match pattern.strip_prefix("effects") {
        None => KEYS.iter().any(|key| holds(key, &pattern)),
        Some("") => true,
        Some(below) => {
            let (kind, rest) = below[1..].split_once('.').unwrap_or((&below[1..], ""));
            effect::find(kind.trim_end_matches("[]"))
                .is_some_and(|entry| rest.is_empty() || entry.card.keys.iter().any(|key| holds(key, rest)))
        }
    }
}

/// Names of the members of a table, by its path.
pub fn members(table: &str) -> Vec<&'static str> {
    let pattern = pattern_of(table);
    let within = |keys: &'static [Key], table: &str| -> Vec<&'static str> {
        let rest = |key: &Key| match table {
            "" => Some(key.path),
            table => key.path.strip_prefix(table)?.strip_prefix('.'),
        };
        let first = |rest: &'static str| rest.split(['.', '[']).next().expect("a first part");
        let mut names: Vec<&str> = keys.iter().filter_map(rest).map(first).collect();
        names.dedup();
        names
    };
    match pattern.strip_prefix("effects") {
        None if pattern.is_empty() => within(KEYS, "").into_iter().chain(["effects"]).collect(),
        None => within(KEYS, &pattern),
        Some("") => effect::CATALOGUE.iter().map(|entry| entry.card.kind).collect(),
        Some(below) => {
            let (kind, rest) = below[1..].split_once('.').unwrap_or((&below[1..], ""));
            effect::find(kind.trim_end_matches("[]")).map_or(Vec::new(), |entry| within(entry.card.keys, rest))
        }
    }
}
