//! `ctiplan study`.

use serde_json::{Map, Value, json};

use super::{Page, Parts, Report, or_dash, table};
use crate::mission::Mission;
use crate::mission::keys::plain;
use crate::plot::Figure;
use crate::sources::{self, Source};
use crate::study::{Cell, Digits, Study, Table};

impl Report for Study {
    fn text(&self) -> String {
        self.parts().text()
    }

    fn json(&self) -> Value {
        let tables: Map<String, Value> =
            self.tables.iter().map(|part| (part.name.to_string(), rows_json(part))).collect();
        json!({
            "study": self.name,
            "mission": self.mission,
            "results": self.results,
            "tables": tables,
            "findings": self.findings,
        })
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let first = &self.tables[0];
        let mut records = vec![first.columns.iter().map(|column| column.key.clone()).collect::<Vec<_>>()];
        let program = |cell: &Cell| match cell {
            Cell::Number(number) => number.to_string(),
            Cell::Words(words) => words.clone(),
            Cell::None => String::new(),
        };
        records.extend(first.rows.iter().map(|row| row.iter().map(program).collect()));
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
            let heads: Vec<&str> = part.columns.iter().map(|column| column.head.as_str()).collect();
            let mut shown = table(&heads);
            for row in &part.rows {
                shown.add_row(row.iter().zip(&part.columns).map(|(cell, column)| person(cell, column.digits)));
            }
            out.table(shown);
        }
        out.gap();
        for finding in &self.findings {
            out.verdict(format!("- {finding}"), 2);
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

fn rows_json(part: &Table) -> Value {
    let value = |cell: &Cell| match cell {
        Cell::Number(number) => (*number).into(),
        Cell::Words(words) => words.clone().into(),
        Cell::None => Value::Null,
    };
    let row = |row: &Vec<Cell>| -> Value {
        Value::Object(part.columns.iter().zip(row).map(|(column, cell)| (column.key.clone(), value(cell))).collect())
    };
    part.rows.iter().map(row).collect()
}

/// A value as people read it.
fn person(cell: &Cell, digits: Digits) -> String {
    let number = match cell {
        Cell::Number(number) => Some(*number),
        Cell::Words(words) => return words.clone(),
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
