//! The documents as a book: every page is in the table of contents, and links lead somewhere; what is cited is this version.

use std::fs;
use std::path::{Path, PathBuf};

fn pages() -> Vec<PathBuf> {
    let all = fs::read_dir("docs").unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<PathBuf> = all.filter(|path| path.extension().is_some_and(|end| end == "md")).collect();
    pages.sort();
    pages
}

/// Lines outside of fenced blocks.
fn prose(text: &str) -> Vec<&str> {
    let mut inside = false;
    let outside = |line: &&str| {
        let fence = line.starts_with("```");
        inside ^= fence;
        !inside && !fence
    };
    text.lines().filter(outside).collect()
}

/// Targets of links, `[...](target)`.
fn links(text: &str) -> Vec<String> {
    let prose = prose(text).join("\n");
    let after = prose.split("](").skip(1);
    after.filter_map(|rest| Some(rest.split_once(')')?.0.replace('\n', ""))).collect()
}

/// What a heading is called in a link: small letters, blanks as hyphens, nothing but letters, digits, hyphens and underscores.
fn anchors(text: &str) -> Vec<String> {
    let headings = prose(text).into_iter().filter(|line| line.starts_with('#'));
    let name = |heading: &str| {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        words.replace(' ', "-").chars().filter(|letter| letter.is_alphanumeric() || "-_".contains(*letter)).collect()
    };
    headings.map(name).collect()
}

#[test]
fn every_page_is_in_the_table_of_contents() {
    let summary = links(&fs::read_to_string("docs/SUMMARY.md").unwrap());
    let mut listed: Vec<PathBuf> = summary.iter().map(|page| Path::new("docs").join(page)).collect();
    listed.push("docs/SUMMARY.md".into());
    listed.sort();
    assert_eq!(listed, pages());
}

#[test]
fn every_page_is_in_the_list_for_language_models() {
    let listed = links(&fs::read_to_string("llms.txt").unwrap());
    for page in pages().iter().filter(|page| !page.ends_with("SUMMARY.md")) {
        assert!(listed.iter().any(|link| Path::new(link) == page), "llms.txt does not link {}", page.display());
    }
}

#[test]
fn links_lead_somewhere() {
    let mut checked = 0;
    let elsewhere = [
        "README.md",
        "CHANGELOG.md",
        "llms.txt",
        "tests/golden/README.md",
        ".github/CONTRIBUTING.md",
        ".github/SECURITY.md",
    ];
    for page in pages().into_iter().chain(elsewhere.map(PathBuf::from)) {
        let text = fs::read_to_string(&page).unwrap();
        for link in links(&text).into_iter().filter(|link| !link.contains("://") && !link.starts_with("mailto:")) {
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: {link}", page.display());
            let known =
                anchor.is_empty() || anchors(&fs::read_to_string(&target).unwrap()).contains(&anchor.to_string());
            assert!(known, "{}: {link}: there is no such heading", page.display());
            checked += 1;
        }
    }
    assert!(checked > 50, "{checked}");
}

#[test]
fn the_citation_is_of_this_version() {
    let citation = fs::read_to_string("CITATION.cff").unwrap();
    assert!(citation.contains(concat!("\nversion: ", env!("CARGO_PKG_VERSION"), "\n")), "{citation}");
}
