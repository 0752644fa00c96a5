//! The documents as a book: every page is in the table of contents, and links lead somewhere; what is cited is this version.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use ctiplan::effect::CATALOGUE;

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

/// Numbers before a word, in digits or in letters, in prose: "23" and "eleven" of "23 effects" and "Eleven studies".
fn counts(text: &str, of: &str) -> Vec<usize> {
    const IN_LETTERS: [&str; 24] = [
        "zero",
        "one",
        "two",
        "three",
        "four",
        "five",
        "six",
        "seven",
        "eight",
        "nine",
        "ten",
        "eleven",
        "twelve",
        "thirteen",
        "fourteen",
        "fifteen",
        "sixteen",
        "seventeen",
        "eighteen",
        "nineteen",
        "twenty",
        "twenty-one",
        "twenty-two",
        "twenty-three",
    ];
    let bare = |word: &str| word.trim_matches(|letter: char| !letter.is_alphanumeric()).to_lowercase();
    let text: Vec<&str> = prose(text).into_iter().filter(|line| !line.starts_with('#')).collect();
    let prose = text.join(" ");
    let words: Vec<String> =
        prose.split_whitespace().map(bare).filter(|word| word != "physical" && word != "trade").collect();
    let number = |word: &String| word.parse().ok().or_else(|| IN_LETTERS.iter().position(|known| known == word));
    words.windows(2).filter(|pair| pair[1] == of).filter_map(|pair| number(&pair[0])).collect()
}

/// Larger numbers of effects or studies than any page has reason to name are those of all.
#[test]
fn pages_count_effects_and_studies_as_the_program_does() {
    let help = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(["study", "--help"]).output().unwrap().stdout;
    let help = String::from_utf8(help).unwrap();
    let is_command = |line: &&str| line.strip_prefix("  ").is_some_and(|rest| rest.starts_with(char::is_alphabetic));
    let commands = help.lines().skip_while(|line| *line != "Commands:").take_while(|line| !line.is_empty());
    let studies = commands.filter(is_command).filter(|line| !line.trim().starts_with("help")).count();
    // A formula is the user's.
    let effects = CATALOGUE.len() - 1;
    let mut found = [0, 0];
    for page in pages().into_iter().chain(["README.md", "CHANGELOG.md", "llms.txt"].map(PathBuf::from)) {
        let text = fs::read_to_string(&page).unwrap();
        for (place, (of, all)) in [("effects", effects), ("studies", studies)].into_iter().enumerate() {
            for count in counts(&text, of).into_iter().filter(|count| *count > all / 2) {
                assert_eq!(count, all, "{}: {count} {of}", page.display());
                found[place] += 1;
            }
        }
    }
    assert!(found.iter().all(|found| *found > 0), "{found:?}");
}

#[test]
fn the_citation_is_of_this_version() {
    let citation = fs::read_to_string("CITATION.cff").unwrap();
    assert!(citation.contains(concat!("\nversion: ", env!("CARGO_PKG_VERSION"), "\n")), "{citation}");
}
