//! The text of a mission with changed values, otherwise as written.

use toml_edit::{DocumentMut, Item, Table, Value};

use crate::effect;
use crate::error::InputError;
use crate::mission::Mission;

/// The text of a mission file with changed values of some keys; comments and order are kept. Keys that the file leaves to their
/// defaults are added.
///
/// # Panics
/// If the text is not that of the mission, or a key is not one of its keys.
pub fn edit(text: &str, mission: &Mission, settings: &[(String, toml::Value)]) -> String {
    let mut document: DocumentMut = text.parse().expect("the text of a mission that was read");
    for (key, value) in settings {
        let path = mission.path(key).expect("a key of the mission");
        set(document.as_item_mut(), &path, value);
    }
    document.to_string()
}

/// A mission with one more effect, and the dotted key of the new table, such as `effects.notch` or `effects.bakeout.2`.
///
/// # Errors
/// If it is invalid there.
pub fn add_effect(mission: &Mission, kind: &str, table: toml::Table) -> Result<(Mission, String), InputError> {
    let mut added = mission.clone();
    let there = effect::tables(mission, kind).len();
    let key = match added.effects.remove(kind) {
        None => {
            added.effects.insert(kind.into(), table.into());
            format!("effects.{kind}")
        }
        Some(one) => {
            let mut several = match one {
                toml::Value::Array(several) => several,
                one => vec![one],
            };
            several.push(table.into());
            added.effects.insert(kind.into(), several.into());
            format!("effects.{kind}.{}", there + 1)
        }
    };
    // Checked, and with defaults filled in.
    Ok((Mission::parse(&added.to_toml())?, key))
}

/// The text of a mission file with the tables of some kinds of effects replaced, each with a comment above it.
///
/// # Panics
/// If the text is not that of a mission.
pub fn with_effects(text: &str, effects: &toml::Table, comment: &str) -> String {
    let mut document: DocumentMut = text.parse().expect("the text of a mission that was read");
    if effects.is_empty() {
        return text.to_string();
    }
    let place = document.entry("effects").or_insert_with(|| {
        let mut table = Table::new();
        table.set_implicit(true);
        Item::Table(table)
    });
    for (kind, tables) in effects {
        let alone = toml::Table::from_iter([(kind.clone(), tables.clone())]);
        let written = toml::to_string(&alone).expect("tables of numbers and words");
        let mut item = written.parse::<DocumentMut>().expect("TOML that was written").as_table_mut().remove(kind);
        let above = format!("\n# {comment}\n");
        match item.as_mut() {
            Some(Item::Table(table)) => table.decor_mut().set_prefix(above),
            Some(Item::ArrayOfTables(tables)) => {
                if let Some(first) = tables.iter_mut().next() {
                    first.decor_mut().set_prefix(above);
                }
            }
            _ => {}
        }
        place[kind.as_str()] = item.expect("what was just written");
    }
    document.to_string()
}

/// Sets the value at `a.b[2].c`.
fn set(item: &mut Item, path: &str, value: &toml::Value) {
    let (first, rest) = path.split_once('.').map_or((path, None), |(first, rest)| (first, Some(rest)));
    let (name, index) = match first.split_once('[') {
        Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
        None => (first, None),
    };
    let Some(rest) = rest else {
        let new: Value = value.to_string().parse().expect("TOML that was written");
        let place = &mut item[name];
        match place.as_value_mut() {
            Some(old) => {
                // Blanks and the comment after it are kept.
                let decor = old.decor().clone();
                *old = new;
                *old.decor_mut() = decor;
            }
            None => *place = Item::Value(new),
        }
        return;
    };
    let mut inner = &mut item[name];
    if inner.is_none() {
        *inner = Item::Table(Table::new());
    }
    if let Some(index) = index {
        inner = &mut inner[index];
    }
    set(inner, rest, value);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_values_change() {
        let text = include_str!("../../missions/snap_l2.toml");
        let mission = Mission::parse(text).unwrap();
        assert_eq!(edit(text, &mission, &[]), text);
        let settings = [
            ("detector.traps.VV.density_per_px".to_string(), toml::Value::Float(0.513)),
            ("accuracy.relative".to_string(), toml::Value::Float(1e-5)),
        ];
        let edited = edit(text, &mission, &settings);
        assert_eq!(Mission::parse(&edited).unwrap(), mission.with(&settings).unwrap());
        let changed: Vec<(&str, &str)> = text.lines().zip(edited.lines()).filter(|(old, new)| old != new).collect();
        assert_eq!(changed, [("density_per_px = 0.49", "density_per_px = 0.513")]);
        assert!(edited.contains("# divacancy"));
    }
}
