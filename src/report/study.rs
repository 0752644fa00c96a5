//! `ctiplan study`.

use serde::ser::{Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::{Page, Parts, Report, or_dash, table};
use crate::mission::Mission;
use crate::mission::keys::plain;
use crate::plan::sources::{self, Source};
use crate::report::plot::Figure;
use crate::study::{Cell, Column, Digits, Study, Table, days, known_date};

impl Serialize for Study {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let tables: Map<String, Value> =
            self.tables.iter().map(|part| (part.name.to_string(), rows_json(part))).collect();
        let document = json!({
            "study": self.name,
            "mission": self.mission,
            "results": self.results,
            "tables": tables,
            "findings": self.findings,
            "warnings": self.warnings,
        });
        document.serialize(to)
    }
}

impl Report for Study {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let first = &self.tables[0];
        let mut records = vec![keys(first).cloned().collect::<Vec<_>>()];
        let program = |value: Value| match value {
            Value::Null => String::new(),
            Value::String(words) => words,
            number => number.as_f64().map_or(String::new(), |number| number.to_string()),
        };
        records.extend(first.rows.iter().map(|row| values(first, row).map(program).collect()));
        records
    }
}

impl Page for Study {
    fn command(&self) -> String {
        format!("study {}", self.name)
    }

    fn parts(&self) -> Parts {
        let mut out = Parts::default();
        out.title(&self.mission, &self.title);
        for part in self.tables.iter().filter(|part| !part.rows.is_empty() && !part.programs_only) {
            out.gap();
            if !part.title.is_empty() {
                out.words(&part.title, 2);
            }
            let read = |column: &&Column| !column.head.is_empty();
            let heads: Vec<&str> = part.columns.iter().filter(read).map(|column| column.head.as_str()).collect();
            let mut shown = table(&heads);
            for row in &part.rows {
                let cells = part.columns.iter().zip(row).filter(|(column, _)| read(column));
                shown.add_row(cells.map(|(column, cell)| person(cell, column.digits)));
            }
            out.table(shown);
        }
        out.gap();
        for finding in &self.findings {
            out.verdict(format!("- {finding}"), 2);
        }
        for warning in &self.warnings {
            out.verdict(format!("Warning: {warning}"), 2);
        }
        out
    }

    fn figures(&self) -> Vec<(String, Figure)> {
        self.figures.clone()
    }

    fn sources(&self, missions: &[Mission]) -> Vec<Source> {
        sources::once(missions.iter().flat_map(sources::of).chain(self.sources.iter().cloned()))
    }
}

/// Keys of a table: those of its columns, each before that of its errors.
fn keys(part: &Table) -> impl Iterator<Item = &String> {
    part.columns.iter().flat_map(|column| [Some(&column.key), column.error_key.as_ref()]).flatten()
}

/// Values of a row, in the order of its keys.
fn values<'a>(part: &'a Table, row: &'a [Cell]) -> impl Iterator<Item = Value> + 'a {
    part.columns.iter().zip(row).flat_map(|(column, cell)| {
        let error = column.error_key.as_ref().map(|_| cell.error().into());
        [Some(cell.value()), error].into_iter().flatten()
    })
}

fn rows_json(part: &Table) -> Value {
    let row = |row: &Vec<Cell>| Value::Object(keys(part).cloned().zip(values(part, row)).collect());
    part.rows.iter().map(row).collect()
}

/// A value as people read it.
fn person(cell: &Cell, digits: Digits) -> String {
    let number = match cell {
        Cell::Number(number) => Some(*number),
        Cell::Words(words) => return words.clone(),
        Cell::Estimate(estimate) if matches!(digits, Digits::Scientific(_)) => return estimate.scientific(),
        Cell::Estimate(estimate) => return estimate.to_string(),
        Cell::Date(date, error_d) => {
            let error = error_d.map_or("+- ?".into(), days);
            return format!("{}\n{error}", known_date(*date, *error_d));
        }
        Cell::None => None,
    };
    or_dash(number.map(|number| match digits {
        Digits::Fixed(decimals) => format!("{number:.decimals$}"),
        Digits::Scientific(decimals) => format!("{number:.decimals$e}"),
        Digits::Significant(digits) => {
            let decimals = digits.saturating_sub(1);
            plain(format!("{number:.decimals$e}").parse().expect("a number that was printed"))
        }
    }))
}
