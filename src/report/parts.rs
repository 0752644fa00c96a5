//! The content of a report, part by part: the same parts make the text of a terminal and the page of a browser.

use std::fmt::Display;
use std::io::stdout;

use anstream::{AutoStream, ColorChoice};
use anstyle::AnsiColor;
use comfy_table::Table;
use maud::{Markup, html};

use super::{indented, lines, wrapped};
use crate::warning::Warning;

/// The parts of a report, in order.
#[derive(Default)]
pub struct Parts(Vec<Part>);

/// A part of a report.
enum Part {
    /// The first line: the name of the subject, and a description.
    Title(String, String),
    /// A heading.
    Heading(String),
    /// A paragraph, indented by `indent` columns from the second line on.
    Words { text: String, indent: usize, verdict: bool, tone: Tone },
    /// One of several outcomes, whose names are `width` columns wide.
    Outcome { name: String, width: usize, text: String, tone: Tone },
    /// Rows of cells.
    Table(Table),
    /// TOML, to be copied.
    Code(String),
    /// An empty line; pages have their own spacing.
    Gap,
}

/// What a line means, shown by its colour on a terminal.
#[derive(Clone, Copy)]
enum Tone {
    Plain,
    Met,
    Exceeded,
    Warning,
}

impl Tone {
    /// Lines in the colour of what they mean, if standard output takes colours: not a pipe, not with NO_COLOR.
    fn of(self, lines: &str) -> String {
        let colour = match self {
            Tone::Plain => return lines.into(),
            Tone::Met => AnsiColor::Green,
            Tone::Exceeded => AnsiColor::Red,
            Tone::Warning => AnsiColor::Yellow,
        };
        if AutoStream::choice(&stdout()) == ColorChoice::Never {
            return lines.into();
        }
        let style = colour.on_default();
        lines.lines().map(|line| format!("{style}{line}{style:#}\n")).collect()
    }
}

impl Parts {
    /// The first line.
    pub fn title(&mut self, of: impl Into<String>, what: impl Into<String>) {
        self.0.push(Part::Title(of.into(), what.into()));
    }

    /// A heading, after an empty line.
    pub fn heading(&mut self, text: impl Into<String>) {
        self.0.push(Part::Heading(text.into()));
    }

    /// A paragraph, indented by `indent` columns from the second line on.
    pub fn words(&mut self, text: impl Into<String>, indent: usize) {
        self.0.push(Part::Words { text: text.into(), indent, verdict: false, tone: Tone::Plain });
    }

    /// The same for the main result: a page begins with it.
    pub fn verdict(&mut self, text: impl Into<String>, indent: usize) {
        self.0.push(Part::Words { text: text.into(), indent, verdict: true, tone: Tone::Plain });
    }

    /// Warnings, which belong to the main result.
    pub fn warnings<'a>(&mut self, warnings: impl IntoIterator<Item = &'a Warning>) {
        for warning in warnings {
            self.warning(warning);
        }
    }

    /// A warning, in words.
    pub fn warning(&mut self, warning: impl Display) {
        let text = format!("Warning: {warning}");
        self.0.push(Part::Words { text, indent: 2, verdict: true, tone: Tone::Warning });
    }

    /// One of several outcomes, listed below each other in text, with names `width` columns wide.
    pub fn outcome(&mut self, name: &str, width: usize, text: impl Into<String>) {
        self.0.push(Part::Outcome { name: name.into(), width, text: text.into(), tone: Tone::Plain });
    }

    /// The same for a budget that is met or exceeded.
    pub fn judged(&mut self, name: &str, width: usize, text: impl Into<String>, met: bool) {
        let tone = if met { Tone::Met } else { Tone::Exceeded };
        self.0.push(Part::Outcome { name: name.into(), width, text: text.into(), tone });
    }

    /// A table.
    pub fn table(&mut self, table: Table) {
        self.0.push(Part::Table(table));
    }

    /// TOML, indented.
    pub fn code(&mut self, text: impl Into<String>) {
        self.0.push(Part::Code(text.into()));
    }

    /// An empty line.
    pub fn gap(&mut self) {
        self.0.push(Part::Gap);
    }

    /// As text.
    pub fn text(&self) -> String {
        let text = |part: &Part| match part {
            Part::Title(of, what) => wrapped(&format!("{of}: {what}"), 2),
            Part::Heading(text) => format!("\n{text}\n"),
            Part::Words { text, indent, tone, .. } => tone.of(&wrapped(text, *indent)),
            Part::Outcome { name, width, text, tone } => tone.of(&wrapped(&format!("  {name:width$}  {text}"), 4)),
            Part::Table(table) => lines(table),
            Part::Code(text) => indented(text),
            Part::Gap => "\n".into(),
        };
        self.0.iter().map(text).collect()
    }

    /// The subject of the report, and its description, if there are any.
    pub(super) fn title_html(&self) -> Option<(&str, &str)> {
        self.0.iter().find_map(|part| match part {
            Part::Title(of, what) => Some((of.as_str(), what.as_str())),
            _ => None,
        })
    }

    /// The main result.
    pub(super) fn verdict_html(&self) -> Markup {
        markup(self.0.iter().filter(|part| part.is_verdict()))
    }

    /// The rest.
    pub(super) fn rest_html(&self) -> Markup {
        markup(self.0.iter().filter(|part| !part.is_verdict()))
    }
}

impl Part {
    fn is_verdict(&self) -> bool {
        matches!(self, Part::Words { verdict: true, .. } | Part::Outcome { .. })
    }
}

fn markup<'a>(parts: impl Iterator<Item = &'a Part>) -> Markup {
    html! {
        @for part in parts {
            @match part {
                Part::Title(..) | Part::Gap => {}
                Part::Heading(text) => h3 { (text) }
                Part::Words { text, .. } => @match text.trim().strip_prefix("- ") {
                    Some(item) => p.item { (item) },
                    None => p { (text.trim()) },
                },
                Part::Outcome { name, text, .. } => p { (name) ": " (text) },
                Part::Table(table) => (cells(table)),
                Part::Code(text) => pre { (text) },
            }
        }
    }
}

/// The cells of a table of the terminal. Numeric columns are right-aligned.
pub(super) fn cells(table: &Table) -> Markup {
    let rows: Vec<Vec<String>> =
        table.row_iter().map(|row| row.cell_iter().map(|cell| cell.content()).collect()).collect();
    let head: Vec<String> =
        table.header().into_iter().flat_map(|header| header.cell_iter()).map(|cell| cell.content()).collect();
    let at_right: Vec<bool> = (0..head.len())
        .map(|column| rows.iter().all(|row| row.get(column).is_none_or(|cell| is_number(cell))))
        .collect();
    let class = |column: usize| at_right.get(column).is_some_and(|right| *right).then_some("number");
    html! {
        div.table {
            table {
                thead { tr { @for (column, cell) in head.iter().enumerate() { th scope="col" class=[class(column)] { (cell) } } } }
                tbody {
                    @for row in &rows {
                        tr { @for (column, cell) in row.iter().enumerate() { td class=[class(column)] { (cell) } } }
                    }
                }
            }
        }
    }
}

/// Whether a cell contains a number or a date, or a word in place of one.
fn is_number(cell: &str) -> bool {
    let digits = cell.trim_start_matches(['+', '-', '<', '>', '~', ' ']);
    ["", "lost", "mean", "never"].contains(&digits)
        || digits.starts_with("below ")
        || digits.starts_with(|letter: char| letter.is_ascii_digit())
}
