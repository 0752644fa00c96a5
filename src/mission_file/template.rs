//! A mission file to start from, with comments on every key: its meaning, unit, and allowed values.
//!
//! The values are those of `example.toml`; the comments are from the definitions in [`keys`](crate::mission::keys).

use super::lookup;
use crate::effect;
use crate::mission::Mission;
use crate::mission::keys::{Allowed, Key, Need, TABLES};

/// The mission without comments on its keys. Defaults and optional keys are commented out.
const EXAMPLE: &str = include_str!("example.toml");

/// Column at which comments on keys start.
const COLUMN: usize = 38;

/// The text of a valid mission file, with every key: optional ones are commented out.
///
/// # Panics
/// Never: there is a single text, and it is tested.
pub fn template() -> String {
    let mission = Mission::parse(EXAMPLE).expect("the example is a mission");
    let effects = effect::CATALOGUE.iter().map(|entry| example_of(entry, &mission));
    let bare: String = std::iter::once(EXAMPLE.to_string()).chain(effects).collect();
    with_comments(&bare)
}

/// The example of an effect, commented out.
fn example_of(entry: &effect::Entry, mission: &Mission) -> String {
    let tables = toml::Table::from_iter([(entry.card.kind.to_string(), (entry.example)(mission).into())]);
    let effects = toml::Table::from_iter([("effects".to_string(), tables.into())]);
    let text = toml::to_string(&effects).expect("a table of numbers and words");
    let behind = |line: &str| if line.is_empty() { "#\n".to_string() } else { format!("# {line}\n") };
    format!("\n{}", text.lines().map(behind).collect::<String>())
}

/// A mission's text with a comment above every table and after every key, at the first occurrence of each.
fn with_comments(bare: &str) -> String {
    let mut said: Vec<String> = Vec::new();
    let mut table = String::new();
    let mut text = String::new();
    for line in bare.lines() {
        let written = line.strip_prefix("# ").unwrap_or(line);
        if let Some(header) = written.strip_prefix('[') {
            table = match header.strip_prefix('[') {
                Some(array) => format!("{}[]", array.trim_end_matches(']')),
                None => header.trim_end_matches(']').to_string(),
            };
            if let Some(what) = about_table(&table).filter(|_| !said.contains(&table)) {
                text += &format!("# {what}\n");
            }
            said.push(table.clone());
        } else if let Some((name, _)) = written.split_once(" = ") {
            let path = format!("{table}.{name}");
            if let Some(key) = lookup::find(&path).filter(|_| !said.contains(&path)) {
                text += &format!("{line:COLUMN$} # {}\n", about_key(key, line != written));
                said.push(path);
                continue;
            }
        }
        text += &format!("{line}\n");
    }
    text
}

fn about_table(table: &str) -> Option<String> {
    let what = match table.strip_prefix("effects.") {
        Some(kind) => effect::find(kind)?.card.adds,
        None => TABLES.iter().find(|(known, _)| *known == table)?.1,
    };
    let (first, rest) = what.split_at(what.chars().next()?.len_utf8());
    Some(format!("{}{rest}.", first.to_uppercase()))
}

fn about_key(key: &Key, behind: bool) -> String {
    let what = match key.kind {
        Allowed::Text => key.what.to_string(),
        kind => format!("{}: {}", key.what, kind.allowed(key.unit)),
    };
    match key.need {
        Need::Default(_) if behind => format!("{what} (default)"),
        Need::Optional if behind => format!("{what} (optional)"),
        _ => what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mission::keys::KEYS;

    /// The text with all commented keys and tables activated.
    fn all_of(text: &str) -> String {
        fn used(line: &str) -> Option<&str> {
            line.strip_prefix("# ").filter(|rest| rest.starts_with('[') || rest.contains(" = "))
        }
        text.lines().map(|line| format!("{}\n", used(line).unwrap_or(line))).collect()
    }

    #[test]
    fn the_example_has_every_table_and_key_and_the_defaults() {
        let example: toml::Table = all_of(EXAMPLE).parse().unwrap();
        let get = |path: &str| -> Option<toml::Value> {
            let mut value = toml::Value::Table(example.clone());
            for part in path.split('.') {
                value = value.get(part.trim_end_matches("[]"))?.clone();
                if part.ends_with("[]") {
                    value = value.get(0)?.clone();
                }
            }
            Some(value)
        };
        for (table, _) in TABLES {
            assert!(get(table).is_some(), "{table}");
            assert!(KEYS.iter().any(|key| key.path.rsplit_once('.').unwrap().0 == table), "{table}");
        }
        for key in KEYS {
            let value = get(key.path).unwrap_or_else(|| panic!("{} is missing", key.path));
            assert!(TABLES.iter().any(|(table, _)| *table == key.path.rsplit_once('.').unwrap().0), "{}", key.path);
            if let Need::Default(default) = key.need {
                let default: toml::Table = format!("value = {default}").parse().unwrap();
                assert_eq!(value, default["value"], "{}", key.path);
            }
        }
    }

    #[test]
    fn the_template_says_what_the_definitions_say() {
        let text = template();
        for (table, what) in TABLES {
            assert!(text.contains(&what[1..]), "{table}");
        }
        let effects = effect::CATALOGUE.iter().flat_map(|entry| entry.card.keys);
        for key in KEYS.iter().chain(effects) {
            let said = about_key(key, false);
            assert!(text.contains(&format!("# {said}")), "{}: {said}", key.path);
        }
    }

    #[test]
    fn every_effect_of_the_template_can_be_used() {
        let text = template();
        let (chain, effects) = text.split_at(text.find("# Effects are added").unwrap());
        assert!(Mission::parse(chain).unwrap().effects.is_empty());
        let mission = Mission::parse(&format!("{chain}{}", all_of(effects))).unwrap();
        assert_eq!(mission.effects.len(), effect::CATALOGUE.len());
    }
}
