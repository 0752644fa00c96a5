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
                let by_tabs = cells == 1 && row.cells[0].split('\t').count() == columns;
                let tabs = format!("tabs delimit here, and blanks in line {}: delimit both alike", self.header_line);
                let fault = self.refuse_line(text, row.line, problem);
                return Err(fault.with_help(if by_tabs { &tabs } else { help }));
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
        // A spreadsheet may have empty rows.
        let rows = rows.filter(|row| !row.as_ref().is_ok_and(|row| row.cells.iter().all(String::is_empty)));
        let mut records = self.records(rows, text)?;
        if delimiter != ',' {
            self.with_points(&mut records)?;
        }
        for (index, column) in self.columns.iter_mut().enumerate() {
            column.fill(records.iter().map(|record| record[index].as_str()));
        }
        self.drop_row_numbers();
        self.check_names()
    }

    /// Numbers with a decimal comma → with a decimal point, in columns of numbers and in `meta`.
    fn with_points(&mut self, records: &mut [Vec<String>]) -> Result<(), InputError> {
        let is_number = |cell: &str| cell.is_empty() || cell.parse::<f64>().is_ok() || has_decimal_comma(cell);
        let of_numbers = |column: &usize| records.iter().all(|record| is_number(&record[*column]));
        let columns: Vec<usize> = (0..self.columns.len()).filter(of_numbers).collect();
        let cells = |is: fn(&str) -> bool| {
            let found = |row: &usize| columns.iter().find(|column| is(&records[*row][**column])).copied();
            (0..records.len()).find_map(|row| Some((row, found(&row)?)))
        };
        let Some((row, column)) = cells(has_decimal_comma) else { return Ok(()) };
        let place = Some(format!("line {}: {} = {}", self.lines[row], self.columns[column].name, records[row][column]));
        let refused = |problem: &str| {
            let fault = InputError { place: place.clone(), ..self.refuse(problem) };
            Err(fault.with_help("write numbers with a decimal point, and without marks between thousands"))
        };
        if cells(|cell| cell.contains('.')).is_some() {
            return refused("this number has a comma, and others of the file have a point");
        }
        if cells(|cell| has_decimal_comma(cell) && !may_be_thousands(cell)).is_none() {
            return refused("the comma may delimit decimals or thousands");
        }
        for record in records.iter_mut() {
            columns.iter().for_each(|column| record[*column] = record[*column].replace(',', "."));
        }
        for meta in &mut self.meta {
            if let Some(number) = meta.value.text().filter(|text| has_decimal_comma(text)) {
                meta.value = number.replace(',', ".").parse().map_or(Cell::Missing, Cell::Number);
            }
        }
        Ok(())
    }

    /// Leaves out columns without a name that hold nothing: those of empty cells, which a spreadsheet adds, and a first one that
    /// numbers the rows, as the index of pandas does.
    fn drop_row_numbers(&mut self) {
        let counts = |column: &Column| {
            let number = |row: usize| if let Cell::Integer(number) = column.cells[row] { Some(number) } else { None };
            !column.cells.is_empty()
                && number(0).is_some_and(|first| {
                    (0..=1).contains(&first)
                        && (0..column.cells.len()).all(|row| number(row) == Some(first + row as i64))
                })
        };
        let is_nameless = |column: &Column| column.name.is_empty() || column.name.starts_with("Unnamed: ");
        let mut first = true;
        self.columns.retain(|column| {
            let holds_nothing = column.cells.iter().all(|cell| *cell == Cell::Missing) || (first && counts(column));
            first = false;
            !(is_nameless(column) && holds_nothing)
        });
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

/// Whether a cell is a number with a decimal comma, such as 0,25.
fn has_decimal_comma(cell: &str) -> bool {
    cell.matches(',').count() == 1 && !cell.contains('.') && cell.replace(',', ".").parse::<f64>().is_ok()
}

/// Whether a cell with a comma may be a number of thousands, such as 12,500.
fn may_be_thousands(cell: &str) -> bool {
    let digits = cell.trim_start_matches(['+', '-']);
    let parts = digits.split_once(',');
    parts.is_some_and(|(before, behind)| {
        (1..=3).contains(&before.len()) && !before.starts_with('0') && behind.len() == 3
    })
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
