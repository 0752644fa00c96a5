//! Tables → ECSV.

use std::fmt::Write;

use serde_json::Value;

use super::columns::{Cell, Column, PARTS, Table, float, word};

impl Table {
    /// The table as ECSV 1.0, delimited by commas: astropy reads the same values from it.
    ///
    /// Whatever ECSV cannot represent is lost: an empty text becomes missing, blanks around a text are removed, and masks,
    /// quantities and dates in parts are plain columns.
    pub fn to_ecsv(&self) -> String {
        let mut out = String::from("# %ECSV 1.0\n# ---\n");
        self.header_yaml().lines().for_each(|yaml| line(&mut out, format_args!("# {yaml}")));
        let lonely = self.columns.len() == 1;
        let names: Vec<String> = self.columns.iter().map(|column| quoted(&column.name, lonely)).collect();
        line(&mut out, format_args!("{}", names.join(",")));
        for row in 0..self.rows() {
            let cells: Vec<String> = self
                .columns
                .iter()
                .map(|column| quoted(&written(column.cells.get(row).unwrap_or(&Cell::Missing)), lonely))
                .collect();
            line(&mut out, format_args!("{}", cells.join(",")));
        }
        out
    }

    /// The header of ECSV, as YAML: columns with their units, and `meta`.
    pub(super) fn header_yaml(&self) -> String {
        let mut out = String::from("datatype:\n");
        for column in &self.columns {
            let datatype = Some(column.datatype.name());
            let said = [
                ("name", &Some(column.name.clone())),
                ("unit", &column.unit),
                ("datatype", &datatype),
                ("format", &column.format),
                ("description", &column.description),
                ("subtype", &column.subtype),
            ];
            let said: Vec<String> = said
                .into_iter()
                .filter_map(|(key, words)| words.as_ref().map(|words| format!("{key}: {}", yaml_text(words))))
                .collect();
            line(&mut out, format_args!("- {{{}}}", said.join(", ")));
        }
        line(&mut out, format_args!("delimiter: ','"));
        let times: Vec<&Column> = self.columns.iter().filter(|column| column.time.is_some()).collect();
        if !self.meta.is_empty() || !times.is_empty() {
            line(&mut out, format_args!("meta: !!omap"));
        }
        for meta in &self.meta {
            line(&mut out, format_args!("- {{{}: {}}}", yaml_text(&meta.name), yaml_cell(&meta.value)));
        }
        if !times.is_empty() {
            line(&mut out, format_args!("- {}:", PARTS));
        }
        for column in times {
            let Some(time) = &column.time else { continue };
            let name = yaml_text(&column.name);
            let mut value = format!("!astropy.table.SerializedColumn {{name: {name}}}");
            if column.cells.contains(&Cell::Missing) {
                let class = "__class__: astropy.utils.masked.core.MaskedNDArray";
                value = format!("!astropy.table.SerializedColumn {{{class}, data: {value}}}");
            }
            let (format, scale) = (yaml_text(&time.format), yaml_text(&time.scale));
            let class = "__class__: astropy.time.core.Time";
            line(&mut out, format_args!("    {name}: {{{class}, format: {format}, scale: {scale}, value: {value}}}"));
        }
        line(&mut out, format_args!("schema: astropy-2.0"));
        out
    }
}

fn line(out: &mut String, text: std::fmt::Arguments) {
    writeln!(out, "{text}").expect("text can be written to");
}

/// A cell without quotes.
fn written(cell: &Cell) -> String {
    match cell {
        Cell::Missing => String::new(),
        Cell::Number(number) => float(*number),
        Cell::Integer(integer) => integer.to_string(),
        Cell::Truth(truth) => word(*truth).to_string(),
        Cell::Text(text) => text.clone(),
        Cell::Other(value) => json(value),
    }
}

/// A cell, quoted if needed. One that begins with # would make its line a comment, an empty one would make the line of a
/// single-column table blank, and Python's line ends and blanks go beyond ASCII.
fn quoted(cell: &str, lonely: bool) -> String {
    let marks = |c: char| c == ',' || c == '"' || c.is_control() || c == '\u{2028}' || c == '\u{2029}';
    if cell.contains(marks) || cell.starts_with('#') || cell.trim() != cell || (lonely && cell.is_empty()) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_string()
    }
}

/// JSON in ASCII, as in Python.
fn json(value: &Value) -> String {
    let mut out = String::new();
    for c in value.to_string().chars() {
        if c.is_ascii() {
            out.push(c);
        } else {
            c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| out.push_str(&format!("\\u{unit:04x}")));
        }
    }
    out
}

fn yaml_cell(cell: &Cell) -> String {
    match cell {
        Cell::Missing => "null".to_string(),
        Cell::Number(number) => yaml_float(*number),
        Cell::Integer(integer) => integer.to_string(),
        Cell::Truth(truth) => truth.to_string(),
        Cell::Text(text) => yaml_text(text),
        Cell::Other(value) => yaml_value(value),
    }
}

fn yaml_value(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => yaml_float(number.as_f64().unwrap_or(f64::NAN)),
        Value::String(text) => yaml_text(text),
        Value::Array(members) => format!("[{}]", members.iter().map(yaml_value).collect::<Vec<_>>().join(", ")),
        Value::Object(members) => {
            let entry = |(key, value): (&String, &Value)| format!("{}: {}", yaml_text(key), yaml_value(value));
            format!("{{{}}}", members.iter().map(entry).collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}

/// A number in YAML 1.1, which requires a decimal point and a sign of the exponent: `1.0e+20`.
fn yaml_float(number: f64) -> String {
    if !number.is_finite() {
        return if number.is_nan() {
            ".nan"
        } else if number > 0.0 {
            ".inf"
        } else {
            "-.inf"
        }
        .to_string();
    }
    match float(number).split_once('e') {
        None => float(number),
        Some((mantissa, exponent)) => {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{mantissa}{point}e{sign}{exponent}")
        }
    }
}

/// Text in YAML, quoted unless unambiguous.
fn yaml_text(text: &str) -> String {
    const RESERVED: [&str; 9] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null"];
    let plain = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '.')
        && !RESERVED.contains(&text.to_lowercase().as_str());
    if plain {
        return text.to_string();
    }
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            ' '..='~' => out.push(c),
            _ => out.push_str(&format!("\\U{:08x}", u32::from(c))),
        }
    }
    out.push('"');
    out
}
