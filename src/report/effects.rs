//! `ctiplan effects`, and the page generated from it.

use serde::ser::{Serialize, Serializer};

use super::{Report, at_least, indented, lines, longest_word, table, wrapped};
use crate::effect::{CATALOGUE, Card, Entry};
use crate::mission::Mission;
use crate::mission::keys::{Key, Need};

/// The catalogue.
pub struct Catalogue;

/// One effect.
pub struct OneEffect(pub &'static Entry);

impl Report for Catalogue {
    fn text(&self) -> String {
        let mut effects = table(&["effect", "what it adds", "parameters"]);
        for column in effects.column_iter_mut() {
            column.set_cell_alignment(comfy_table::CellAlignment::Left);
        }
        for entry in &CATALOGUE {
            effects.add_row(vec![entry.card.kind.to_string(), entry.card.adds.into(), parameters(&entry.card)]);
        }
        format!(
            "Effects, in the order of the physics: [effects.NAME] in a mission adds one,\n[[effects.NAME]] several of a \
             kind, and [fit] frees effects.NAME.PARAMETER\n\n{}\n`ctiplan effects NAME` describes one\n",
            lines(&effects)
        )
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let mut records = vec![["effect", "adds", "parameters"].map(str::to_string).to_vec()];
        for Entry { card, .. } in &CATALOGUE {
            records.push(vec![card.kind.into(), card.adds.into(), parameters(card)]);
        }
        records
    }
}

impl Report for OneEffect {
    fn text(&self) -> String {
        let card = &self.0.card;
        let mut out = wrapped(&format!("{}: {}", card.kind, card.adds), 2);
        for (title, said) in [
            ("Physics", card.physics),
            ("Source", card.source),
            ("Validity", card.holds),
            ("Residuals if it is missing", card.residuals),
        ] {
            out.push_str(&format!("\n{title}\n"));
            out.push_str(&wrapped(&format!("  {said}"), 2));
        }
        if !card.keys.is_empty() {
            out.push_str("\nParameters\n");
            let mut keys = table(&["key", "what", "allowed", "default"]);
            for column in keys.column_iter_mut() {
                column.set_cell_alignment(comfy_table::CellAlignment::Left);
            }
            for key in card.keys {
                keys.add_row(vec![name(key), key.what.into(), key.kind.allowed(key.unit), default(key)]);
            }
            // Keys are copied.
            let width = longest_word(&keys, 0, |text| text);
            at_least(&mut keys, 0, width);
            out.push_str(&lines(&keys));
        }
        out.push_str(&format!("\nExample\n{}", indented(&example(self.0))));
        out
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let mut records = vec![["key", "what", "unit", "allowed", "default"].map(str::to_string).to_vec()];
        for key in self.0.card.keys {
            records.push(vec![name(key), key.what.into(), key.unit.into(), key.kind.allowed(key.unit), default(key)]);
        }
        records
    }
}

/// The current content of the page `docs/effects.md`.
pub fn page() -> String {
    let mut out = String::from(
        "# Effects\n\nWhat can be added to the model, in the order of the physics. Generated from the catalogue by `ctiplan \
         effects --markdown`; a test\nkeeps it up to date. How to add one: [adding-an-effect.md](adding-an-effect.md).\n\n\
         `[effects.NAME]` in a mission file adds one, `[[effects.NAME]]` several of a kind. `[fit] free` or `--free` takes\n\
         `effects.NAME.PARAMETER` (`effects.NAME.2.PARAMETER` for the second of several).\n\n\
         | effect | adds | parameters |\n|---|---|---|\n",
    );
    for Entry { card, .. } in &CATALOGUE {
        out.push_str(&format!("| [{0}](#{0}) | {1} | {2} |\n", card.kind, card.adds, parameters(card)));
    }
    for entry in &CATALOGUE {
        let card = &entry.card;
        out.push_str(&format!(
            "\n## {}\n\n{}.\n\n**Physics.** {}\n\n**Source.** {}.\n\n**Validity.** {}\n\n**Residuals if it is missing.** {}\n\n```toml\n{}```\n",
            card.kind,
            capital(card.adds),
            card.physics,
            capital(card.source),
            card.holds,
            card.residuals,
            example(entry)
        ));
        if !card.keys.is_empty() {
            out.push_str("\n| parameter | what | allowed | default |\n|---|---|---|---|\n");
            for key in card.keys {
                let allowed = key.kind.allowed(key.unit);
                out.push_str(&format!("| `{}` | {} | {allowed} | {} |\n", name(key), key.what, default(key)));
            }
        }
    }
    out
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn parameters(card: &Card) -> String {
    if card.keys.is_empty() { "-".into() } else { card.keys.iter().map(name).collect::<Vec<_>>().join(", ") }
}

fn name(key: &Key) -> String {
    if key.path == "*" { "NAME".into() } else { key.path.into() }
}

fn default(key: &Key) -> String {
    match key.need {
        Need::Required => "required".into(),
        Need::Default(value) => value.into(),
        Need::Optional => "may be absent".into(),
    }
}

/// An example as TOML, for the mission of the README.
fn example(entry: &Entry) -> String {
    let mission = Mission::parse(include_str!("../../missions/snap_l2.toml")).expect("a mission that is tested");
    let kinds = toml::Table::from_iter([(entry.card.kind.to_string(), toml::Value::Table((entry.example)(&mission)))]);
    toml::to_string(&toml::Table::from_iter([("effects".to_string(), toml::Value::Table(kinds))])).expect("a table")
}

/// A card in JSON.
#[derive(serde::Serialize)]
struct OneCard {
    effect: &'static str,
    adds: &'static str,
    physics: &'static str,
    source: &'static str,
    holds: &'static str,
    residuals: &'static str,
    parameters: Vec<Parameter>,
}

/// A parameter in JSON.
#[derive(serde::Serialize)]
struct Parameter {
    name: String,
    what: &'static str,
    unit: &'static str,
    allowed: String,
    default: String,
}

impl Serialize for Catalogue {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(CATALOGUE.iter().map(|entry| OneCard::of(&entry.card)))
    }
}

impl Serialize for OneEffect {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        OneCard::of(&self.0.card).serialize(to)
    }
}

impl OneCard {
    fn of(card: &Card) -> OneCard {
        OneCard {
            effect: card.kind,
            adds: card.adds,
            physics: card.physics,
            source: card.source,
            holds: card.holds,
            residuals: card.residuals,
            parameters: card.keys.iter().map(Parameter::of).collect(),
        }
    }
}

impl Parameter {
    fn of(key: &Key) -> Parameter {
        Parameter {
            name: name(key),
            what: key.what,
            unit: key.unit,
            allowed: key.kind.allowed(key.unit),
            default: default(key),
        }
    }
}
