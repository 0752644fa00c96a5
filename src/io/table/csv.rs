//! Rows of delimited cells, and plain CSV.

use saphyr::Scalar;

use super::columns::{Cell, Column, Datatype, Meta, PARTS, Table, scalar};
use crate::error::InputError;

/// A line of cells.
pub(super) struct Record {
    /// Its first line in the file, from 1.
    pub line: usize,
    pub cells: Vec<String>,
}

/// The rows of a text after its first `skip` lines, without blank lines and comments. An error is the line of a cell with an
/// unclosed quote.
///
/// Cells are split as in astropy (Python's `csv` with `skipinitialspace`): blanks before a cell are skipped, so several blanks are
/// one delimiter, and a quoted cell may continue on the next line.
pub(super) fn rows(text: &str, skip: usize, delimiter: char) -> impl Iterator<Item = Result<Record, usize>> {
    // With tabs as delimiters, a tab at the end of a line is an empty cell.
    let trimmed =
        move |line| str::trim_matches(line, |c| c == ' ' || c == '\r' || (c == '\t' && c != delimiter)).chars();
    let mut lines = text.lines().enumerate().skip(skip);
    std::iter::from_fn(move || {
        let (index, first) = lines.find(|(_, line)| !line.trim().is_empty() && !is_comment(line))?;
        let mut rest = trimmed(first);
        let mut row = Record { line: index + 1, cells: Vec::new() };
        let mut cell = String::new();
        let mut state = State::Start;
        loop {
            for c in rest {
                state = match (state, c) {
                    (State::Quoted, '"') => State::QuoteInQuoted,
                    (State::QuoteInQuoted, '"') | (State::Quoted, _) => {
                        cell.push(c);
                        State::Quoted
                    }
                    (State::Start, '"') => State::Quoted,
                    (State::Start, ' ') => State::Start,
                    _ if c == delimiter => {
                        row.cells.push(std::mem::take(&mut cell));
                        State::Start
                    }
                    _ => {
                        cell.push(c);
                        State::Plain
                    }
                };
            }
            if state != State::Quoted {
                break;
            }
            let Some((_, line)) = lines.next() else { return Some(Err(row.line)) };
            cell.push('\n');
            rest = trimmed(line);
        }
        row.cells.push(cell);
        for cell in &mut row.cells {
            *cell = cell.trim_matches([' ', '\t']).to_string();
        }
        Some(Ok(row))
    })
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    /// Before the first character of a cell.
    Start,
    /// In a cell without quotes.
    Plain,
    /// Between quotes.
    Quoted,
    /// After a quote within quotes: either the closing one, or the first of an escaped pair.
    QuoteInQuoted,
}

/// Whether a line is a comment, anywhere in the file.
pub(super) fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with('#')
}

impl Table {
    /// The names of the columns.
    pub(super) fn names(
        &mut self,
        first: Option<Result<Record, usize>>,
        text: &str,
    ) -> Result<Vec<String>, InputError> {
        match first {
            Some(Ok(row)) => {
                self.header_line = row.line;
                Ok(row.cells)
            }
            Some(Err(line)) => Err(self.unclosed(text, line)),
            None => Err(self.refuse("there is no line with the names of the columns")),
        }
    }

    /// Reads rows, which must have as many cells as there are columns; records their lines.
    pub(super) fn records(
        &mut self,
        rows: impl Iterator<Item = Result<Record, usize>>,
        text: &str,
    ) -> Result<Vec<Vec<String>>, InputError> {
        let help = "an empty cell is \"\" where blanks delimit, and a cell that holds the delimiter must be in quotes";
        let mut records = Vec::new();
        for row in rows {
            let row = row.map_err(|line| self.unclosed(text, line))?;
            let (cells, columns) = (row.cells.len(), self.columns.len());
            if cells != columns {
                let problem = format!("{cells} cells, where line {} names {columns} columns", self.header_line);
                return Err(self.refuse_line(text, row.line, problem).with_help(help));
            }
            self.lines.push(row.line);
            records.push(row.cells);
        }
        Ok(records)
    }

    fn unclosed(&self, text: &str, line: usize) -> InputError {
        self.refuse_line(text, line, "a cell that begins with a quote here never ends")
            .with_help("a quote within a cell is written twice: \"say \"\"yes\"\"\"")
    }

    /// Reads plain CSV.
    pub(super) fn read_csv(&mut self, text: &str) -> Result<(), InputError> {
        let skip = self.comments(text)?;
        let first = text.lines().skip(skip).find(|line| !is_comment(line)).unwrap_or("");
        let delimiter = [',', ';', '\t'].into_iter().find(|&delimiter| first.contains(delimiter)).unwrap_or(',');
        let mut rows = rows(text, skip, delimiter);
        let names = self.names(rows.next(), text)?;
        if let Some(number) = names.iter().find(|name| guess(name) != Datatype::Text) {
            let problem = format!("the first line must name the columns, and `{number}` is a number");
            return Err(self
                .refuse_line(text, self.header_line, problem)
                .with_help("above the rows, a line such as t_yr,value,sigma"));
        }
        let line = Some(self.header_line);
        self.columns.extend(names.into_iter().map(|name| Column { line, ..named(name) }));
        self.check_names()?;
        // A spreadsheet may have empty rows.
        let rows = rows.filter(|row| !row.as_ref().is_ok_and(|row| row.cells.iter().all(String::is_empty)));
        let records = self.records(rows, text)?;
        for (index, column) in self.columns.iter_mut().enumerate() {
            column.fill(records.iter().map(|record| record[index].as_str()));
        }
        Ok(())
    }

    /// Reads comments `# key: value` above the header. Returns the number of lines before the header.
    fn comments(&mut self, text: &str) -> Result<usize, InputError> {
        let mut skip = 0;
        for (index, line) in text.lines().enumerate() {
            // A spreadsheet pads comments with delimiters, and quotes those that contain a delimiter.
            let line = line.trim_matches([' ', '\t', '\r', ',', ';', '"']);
            if let Some(comment) = line.strip_prefix('#') {
                if let Some((key, value)) = comment.split_once(':')
                    && (value.is_empty() || value.starts_with([' ', '\t']))
                    && !key.trim().is_empty()
                {
                    if key.trim() == PARTS {
                        let problem = format!("`{}` is a key of ECSV, whose first line is `# %ECSV 1.0`", PARTS);
                        return Err(self.refuse_line(text, index + 1, problem));
                    }
                    self.meta.push(Meta { name: key.trim().to_string(), value: meta(value), line: Some(index + 1) });
                }
            } else if !line.is_empty() {
                break;
            }
            skip = index + 1;
        }
        Ok(skip)
    }
}

impl Column {
    /// Sets the cells from a file, with a datatype common to all of them.
    fn fill<'a>(&mut self, cells: impl Iterator<Item = &'a str> + Clone) {
        let kinds: Vec<Datatype> = cells.clone().filter(|cell| !cell.is_empty()).map(guess).collect();
        self.datatype = if kinds.is_empty() || kinds.contains(&Datatype::Text) {
            Datatype::Text
        } else if kinds.contains(&Datatype::Float(64)) {
            Datatype::Float(64)
        } else {
            Datatype::Int(64)
        };
        self.cells = cells
            .map(|cell| match self.datatype {
                _ if cell.is_empty() => Cell::Missing,
                Datatype::Int(_) => cell.parse().map_or(Cell::Missing, Cell::Integer),
                Datatype::Float(_) => cell.parse().map_or(Cell::Missing, Cell::Number),
                _ => Cell::Text(cell.to_string()),
            })
            .collect();
    }
}

/// An empty column: `value [unit]` is its name and unit.
fn named(header: String) -> Column {
    let (name, unit) = match header.strip_suffix(']').and_then(|header| header.split_once('[')) {
        Some((name, unit)) => (name.trim().to_string(), Some(unit.trim().to_string())),
        None => (header, None),
    };
    Column { name, unit: unit.filter(|unit| !unit.is_empty()), ..Column::default() }
}

/// The apparent datatype of a cell.
fn guess(cell: &str) -> Datatype {
    if cell.parse::<i64>().is_ok() {
        Datatype::Int(64)
    } else if cell.parse::<f64>().is_ok() {
        Datatype::Float(64)
    } else {
        Datatype::Text
    }
}

/// The value in a comment `# key: value`: a number or text, as in YAML.
fn meta(value: &str) -> Cell {
    let value = value.trim();
    match value.strip_prefix(['"', '\'']) {
        Some(word) => Cell::Text(word.trim_end_matches(['"', '\'']).to_string()),
        None if value.is_empty() => Cell::Missing,
        None => scalar(&Scalar::parse_from_cow(value.into())),
    }
}
