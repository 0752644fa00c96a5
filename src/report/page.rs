//! A result as one self-contained HTML page, without network or scripts; for screen and print.

use comfy_table::Table;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::{Digest, Sha256};

use super::{Parts, Report, parts};
use crate::mission::Mission;
use crate::plan::sources::{self, Source};
use crate::report::plot::Figure;

/// A result with a page.
pub trait Page: Report {
    /// Its command, such as `study clock`.
    fn command(&self) -> String;
    /// The parts of its text.
    fn parts(&self) -> Parts;
    /// Figures with their file names.
    fn figures(&self) -> Vec<(String, Figure)>;
    /// Names of the missions of the result.
    fn names(&self, missions: &[Mission]) -> Vec<String> {
        missions.iter().map(|mission| mission.mission.name.clone()).collect()
    }
    /// Its requirements, one in each row, to be signed; None if it judges none.
    fn compliance(&self) -> Option<Table> {
        None
    }
    /// Sources of the models for these missions.
    fn sources(&self, missions: &[Mission]) -> Vec<Source> {
        sources::once(missions.iter().flat_map(sources::of))
    }
}

/// The style of a page: one column, narrower figures, black on white, without its own fonts.
const STYLE: &str = include_str!("page.css");

/// The page of a result for these missions.
pub fn page(result: &impl Page, missions: &[Mission]) -> String {
    let parts = result.parts();
    let names = result.names(missions);
    let all_names = names.join(", ");
    let (of, what) = parts.title_html().unwrap_or((&all_names, ""));
    let (figures, numbers) = (result.figures(), parts.rest_html());
    let version = env!("CARGO_PKG_VERSION");
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content=(format!("ctiplan {version}"));
                title { (of) " - ctiplan " (result.command()) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    p.command { "ctiplan " (result.command()) }
                    h1 { (of) }
                    @if !what.is_empty() { p { (what) } }
                }
                main {
                    section.verdict { h2 { "In short" } (parts.verdict_html()) }
                    @if let Some(lines) = result.compliance() { (to_be_signed(&lines, missions)) }
                    @if !figures.is_empty() {
                        section { h2 { "Figures" } @for (_, figure) in &figures { (drawn(figure)) } }
                    }
                    @if !numbers.0.is_empty() { section { h2 { "Numbers" } (numbers) } }
                    section {
                        h2 { "Mission as resolved" }
                        p { "With all defaults. It is a mission file itself: what is on this page can be computed from it again." }
                        @for (mission, name) in missions.iter().zip(&names) {
                            @if missions.len() > 1 { h3 { (name) } }
                            pre.mission { (mission.to_toml()) }
                        }
                    }
                    section { h2 { "Models and their sources" } (listed(&result.sources(missions))) }
                }
                footer { p { "Made by ctiplan " (version) "." } }
            }
        }
    };
    markup.into_string() + "\n"
}

/// Requirements with space for signatures; the digest of the mission as resolved identifies what is signed.
fn to_be_signed(lines: &Table, missions: &[Mission]) -> Markup {
    let digests = missions
        .iter()
        .map(|mission| Sha256::digest(mission.to_toml()).iter().map(|byte| format!("{byte:02x}")).collect::<String>());
    html! {
        section.compliance {
            h2 { "Compliance" }
            (parts::cells(lines))
            p { "Mission as resolved, SHA-256: " @for digest in digests { code { (digest) } " " } }
            div.table {
                table.signatures {
                    thead { tr { th {} @for head in ["Name", "Date", "Signature"] { th scope="col" { (head) } } } }
                    tbody { @for who in ["Prepared", "Checked", "Approved"] { tr { th scope="row" { (who) } td {} td {} td {} } } }
                }
            }
        }
    }
}

/// A figure; its title and axes are the text alternative.
fn drawn(figure: &Figure) -> Markup {
    let axes = figure.panels.iter().map(|panel| format!("{} against {}", panel.y_label, panel.x_label));
    let said = format!("{}: {}", figure.title, axes.collect::<Vec<_>>().join("; "));
    html! { figure role="img" aria-label=(said) { (PreEscaped(figure.svg())) } }
}

fn listed(sources: &[Source]) -> Markup {
    html! {
        dl { @for source in sources { dt { (source.model) } dd { (source.from) } } }
    }
}
