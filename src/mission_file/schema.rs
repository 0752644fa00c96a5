//! A JSON Schema (draft 2020-12) of mission files, for editors: the definitions in [`keys`](crate::mission::keys) in another notation.
//!
//! Checks of keys in combination (one of `flux_e` and `snr`, distinct names, a notch below the full well) are left to ctiplan.

use serde_json::{Map, Value, json};

use crate::effect;
use crate::mission::keys::{Allowed, KEYS, Key, Need, OPTIONAL_TABLES, TABLES};

/// The schema: tables, keys, units, allowed values, defaults.
pub fn schema() -> Value {
    let mut schema = table(KEYS, "");
    let effects: Map<String, Value> =
        effect::CATALOGUE.iter().map(|entry| (entry.card.kind.into(), of(entry))).collect();
    schema["properties"]["effects"] = json!({
        "description": "What is added to the model; `ctiplan effects KIND` describes one.",
        "type": "object",
        "properties": effects,
        "additionalProperties": false,
    });
    let mut head = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "ctiplan mission",
        "description": "A mission file of ctiplan (TOML). What keys say together is checked by ctiplan alone.",
    });
    let head = head.as_object_mut().expect("an object");
    head.append(schema.as_object_mut().expect("an object"));
    Value::Object(head.clone())
}

/// An effect: one table, or several of the kind.
fn of(entry: &effect::Entry) -> Value {
    let one = table(entry.card.keys, "");
    json!({"description": entry.card.adds, "anyOf": [one, {"type": "array", "minItems": 1, "items": one}]})
}

/// The table at a path, empty for the whole; `[]` at its end is a member of an array of tables.
fn table(keys: &[Key], path: &str) -> Value {
    let mut properties = Map::new();
    let mut required: Vec<Value> = Vec::new();
    // Keys of any name.
    let mut others = Value::Bool(false);
    for key in keys {
        let Some(rest) = below(key.path, path) else { continue };
        let Some((name, _)) = rest.split_once('.') else {
            if rest == "*" {
                others = value(key);
                continue;
            }
            properties.insert(rest.into(), value(key));
            if matches!(key.need, Need::Required) {
                required.push(rest.into());
            }
            continue;
        };
        let bare = name.trim_end_matches("[]");
        if properties.contains_key(bare) {
            continue;
        }
        let inner = if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
        let one = table(keys, &inner);
        if one.get("required").is_some() && !OPTIONAL_TABLES.contains(&inner.as_str()) {
            required.push(bare.into());
        }
        let one = if name == bare { one } else { json!({"type": "array", "minItems": 1, "items": one}) };
        properties.insert(bare.into(), one);
    }
    let mut table = json!({"type": "object", "properties": properties, "additionalProperties": others});
    if let Some((_, what)) = TABLES.iter().find(|(known, _)| *known == path) {
        table["description"] = (*what).into();
    }
    if !required.is_empty() {
        table["required"] = required.into();
    }
    table
}

/// The part of a key's path below a table.
fn below<'a>(key: &'a str, table: &str) -> Option<&'a str> {
    if table.is_empty() { Some(key) } else { key.strip_prefix(table)?.strip_prefix('.') }
}

/// Allowed values of a key.
fn value(key: &Key) -> Value {
    let mut value = match key.kind {
        Allowed::Number(low, high) => number(low, high),
        Allowed::Positive(low, high) => above(low, high),
        Allowed::Integer(low, high) => {
            let mut integer = json!({"type": "integer", "minimum": low});
            if high < i64::MAX {
                integer["maximum"] = high.into();
            }
            integer
        }
        Allowed::Numbers(low, high) => json!({"type": "array", "minItems": 1, "items": number(low, high)}),
        Allowed::IntegerLists(low, high) => {
            let one = json!({"type": "integer", "minimum": low, "maximum": high});
            json!({"type": "array", "minItems": 1, "items": {"type": "array", "minItems": 1, "items": one}})
        }
        Allowed::Choice(words) => json!({"enum": words}),
        Allowed::Text if key.is_name() => json!({"type": "string", "pattern": "^[^\\p{Cc}]*[^\\p{Cc}\\s][^\\p{Cc}]*$"}),
        Allowed::Text => json!({"type": "string", "pattern": "\\S"}),
        Allowed::Texts => json!({"type": "array", "items": {"type": "string"}}),
        Allowed::Date => json!({"type": "string", "format": "date"}),
    };
    let unit = if key.unit.is_empty() { String::new() } else { format!(", {}", key.unit) };
    value["description"] = format!("{}{unit}", key.what).into();
    if let Need::Default(default) = key.need {
        let default: toml::Table = format!("value = {default}").parse().expect("defaults are TOML");
        value["default"] = serde_json::to_value(&default["value"]).expect("a number, a word or a list");
    }
    value
}

/// A number from the first to the second. JSON has no infinity, which means no limit.
fn number(low: f64, high: f64) -> Value {
    limited([("minimum", low), ("maximum", high)])
}

/// A number above the first, up to the second.
fn above(low: f64, high: f64) -> Value {
    limited([("exclusiveMinimum", low), ("maximum", high)])
}

fn limited(limits: [(&str, f64); 2]) -> Value {
    let mut number = json!({"type": "number"});
    for (name, limit) in limits.into_iter().filter(|(_, limit)| limit.is_finite()) {
        number[name] = limit.into();
    }
    number
}
