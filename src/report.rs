//! Results → tables, JSON, CSV, pages. Only results are shown here; nothing new is computed.

mod active;
mod catalogue;
mod compare;
mod diagnose;
mod dose;
pub mod effects;
mod evaluate;
mod fit;
mod image;
mod image_batch;
mod measure;
mod noise;
mod page;
mod parts;
pub mod plot;
mod ranked;
pub mod study;
mod sweep;
mod validate;

pub use evaluate::Depth;
pub use fit::FitReport;
pub use measure::MeasureReport;
pub use page::{Page, page};
pub use parts::Parts;
pub use sweep::SweepReport;

use std::io::{IsTerminal, stdout};

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table, Width, presets};
use serde::Serialize;

use crate::mission::keys::plain;
use crate::numeric::calendar::date_after;
use crate::plan::curve::Crossing;

/// Output format of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text tables for the terminal.
    Text,
    /// One JSON document.
    Json,
    /// One table of comma-separated values.
    Csv,
}

/// A result that can be shown. Its JSON is its serialisation.
pub trait Report: Serialize {
    /// As text, at most 80 columns wide.
    fn text(&self) -> String;
    /// For spreadsheets: header first, with units.
    fn csv(&self) -> Vec<Vec<String>>;

    /// The result in a format, with a final line end.
    fn render(&self, format: Format) -> String {
        match format {
            Format::Text => self.text(),
            Format::Json => {
                let json = serde_json::to_string_pretty(self).expect("keys are text, and a buffer takes all");
                json + "\n"
            }
            Format::Csv => {
                let mut writer = csv::Writer::from_writer(Vec::new());
                for record in self.csv() {
                    writer.write_record(record).expect("records of equal length");
                }
                String::from_utf8(writer.into_inner().expect("a buffer takes all")).expect("text in, text out")
            }
        }
    }
}

/// Maximum width of text in columns, and of tables written to a file.
const WIDTH: u16 = 80;

/// Maximum width of tables in columns: that of the terminal, if it is standard output.
fn columns() -> u16 {
    // Narrower tables would break words and numbers.
    const LEAST: u16 = 40;
    terminal_size::terminal_size_of(stdout()).map_or(WIDTH, |(columns, _)| columns.0.max(LEAST))
}

/// A table with a header; all columns but the first are numeric. It has lines around it only on a terminal.
fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(if stdout().is_terminal() { presets::UTF8_FULL_CONDENSED } else { presets::NOTHING })
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(columns())
        .set_header(header.to_vec());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Keeps the words of a table's columns, from one on, unbroken: lines that are too wide break between words, or in the columns
/// before.
fn keep_words(table: &mut Table, from: usize) {
    for place in from..table.column_count() {
        let width = longest_word(table, place, |text| text);
        at_least(table, place, width);
    }
}

/// Keeps numbers and their errors on one line, if all columns of the table can be wide enough.
fn keep_errors(table: &mut Table) {
    keep_joined(table, |text| text.replace(" +- ", "-+--"));
}

/// Keeps on one line what `joined` makes one word of, if all columns of the table can be wide enough.
fn keep_joined(table: &mut Table, joined: impl Fn(String) -> String) {
    let whole: usize = table.column_max_content_widths().iter().map(|width| usize::from(*width) + PADDING).sum();
    if whole <= usize::from(columns()) {
        return;
    }
    let widths: Vec<usize> = (0..table.column_count()).map(|place| longest_word(table, place, &joined)).collect();
    if widths.iter().sum::<usize>() <= usize::from(columns()) {
        widths.into_iter().enumerate().for_each(|(place, width)| at_least(table, place, width));
    }
}

/// Width of a column's longest word, with padding.
fn longest_word(table: &Table, place: usize, text: impl Fn(String) -> String) -> usize {
    let cells = table.row_iter().chain(table.header()).filter_map(|row| row.cell_iter().nth(place));
    let words = |text: String| text.split_whitespace().map(|word| word.chars().count()).max().unwrap_or(0);
    cells.map(|cell| words(text(cell.content()))).max().unwrap_or(0) + PADDING
}

/// Sets the minimum width of a column.
fn at_least(table: &mut Table, place: usize, width: usize) {
    if let (Some(column), Ok(width)) = (table.column_mut(place), u16::try_from(width)) {
        column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width)));
    }
}

/// Blanks around the text of a cell.
const PADDING: usize = 2;

/// The table as lines without trailing blanks. Non-breaking blanks (before a unit) then become plain ones.
fn lines(table: &Table) -> String {
    table.lines().map(|line| format!("{}\n", line.trim_end().replace('\u{a0}', " "))).collect()
}

/// TOML below its heading.
fn indented(text: &str) -> String {
    text.lines().map(|line| if line.is_empty() { "\n".into() } else { format!("  {line}\n") }).collect()
}

/// Text broken into lines of at most 80 columns, with an indent from the second line on.
fn wrapped(text: &str, indent: usize) -> String {
    let first = text.len() - text.trim_start_matches(' ').len();
    let mut out = " ".repeat(first);
    let mut column = first;
    let mut at_start = true;
    for word in text[first..].split(' ') {
        let length = word.chars().count();
        if !at_start && column + 1 + length > WIDTH as usize {
            out.push('\n');
            out.push_str(&" ".repeat(indent));
            column = indent;
        } else if !at_start {
            out.push(' ');
            column += 1;
        }
        at_start = false;
        out.push_str(word);
        column += length;
    }
    out.push('\n');
    out
}

/// A number and a noun, in the singular or plural.
fn counted(number: u64, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// A number in common notation, rounded to `digits` digits.
fn significant(number: f64, digits: usize) -> String {
    let decimals = digits.saturating_sub(1);
    plain(format!("{number:.decimals$e}").parse().expect("a number that was printed"))
}

/// `a, b and c`
fn listed(names: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match &names[..] {
        [before @ .., last] if before.len() > 1 => format!("{} and {last}", before.join(", ")),
        _ => names.join(" and "),
    }
}

/// Effects, each once: `solar-flare twice and cycle`
fn effects_listed(names: &[String]) -> String {
    let mut said: Vec<String> = Vec::new();
    for (place, name) in names.iter().enumerate().filter(|(place, name)| !names[..*place].contains(name)) {
        said.push(match names[place..].iter().filter(|other| *other == name).count() {
            1 => name.clone(),
            2 => format!("{name} twice"),
            times => format!("{name} {times} times"),
        });
    }
    listed(&said)
}

/// A number or a dash.
fn or_dash(value: Option<String>) -> String {
    value.unwrap_or_else(|| "-".into())
}

/// A probability in words.
fn chance(chance: f64) -> String {
    if chance < 1e-12 {
        "below 1e-12".into()
    } else if chance < 1e-3 {
        format!("{chance:.0e}")
    } else {
        plain((chance * 1000.0).round() / 1000.0)
    }
}

/// When a limit is exceeded, in words, for a given launch date; if it is not, the share of the budget that is used.
fn exceeded(crossing: &Crossing, launch: chrono::NaiveDate) -> String {
    let Some(first_yr) = crossing.t_yr else {
        let used = crossing.margin.map(|margin| 100.0 * (1.0 - margin / crossing.limit));
        return used.map_or("not exceeded".into(), |used| {
            format!("not exceeded; {used:.1} % of the budget used at end of life")
        });
    };
    let date = |t_yr: f64| date_after(launch, t_yr).map_or(format!("{t_yr:.3} yr"), |date| date.to_string());
    if crossing.crossings_yr.len() == 1 {
        return format!("exceeded after {first_yr:.3} yr, on {}", date(first_yr));
    }
    let spans = crossing.crossings_yr.chunks(2).map(|span| match span {
        [from, to] => format!("{} to {}", date(*from), date(*to)),
        _ => format!("{} to the end of the mission", date(span[0])),
    });
    let spans: Vec<String> = spans.collect();
    let shown = match &spans[..] {
        [most @ .., last] if spans.len() > SPANS => {
            format!("{}, {} more times, and {last}", most[..SPANS - 1].join(", "), spans.len() - SPANS)
        }
        [most @ .., last] if !most.is_empty() => format!("{}, and {last}", most.join(", ")),
        spans => spans.join(", "),
    };
    format!("exceeded after {first_yr:.3} yr: {shown}")
}

/// Maximum number of intervals that are listed one by one.
const SPANS: usize = 4;
