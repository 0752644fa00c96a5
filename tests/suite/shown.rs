//! Every output that a page shows is made by a command that a test runs, or says with which commit it was made.
//!
//! A block of `text` is output. It stands behind the command that printed it, on a page whose commands are run (see `tutorial.rs`), or
//! behind a comment `<!-- printed by COMMIT -->`. Formulas, drawings, and commands that are not run, are blocks of `formula`, `drawing`
//! and `console`.

use std::fs;
use std::path::PathBuf;

use crate::hindcast::PAGES;

/// Languages of blocks that are no output.
const NO_OUTPUT: [&str; 9] = ["sh", "toml", "rust", "python", "csv", "diff", "formula", "drawing", "console"];

/// Pages with one block behind a command that a test of its own runs.
const WITH_ITS_OWN_TEST: [(&str, &str); 2] = [
    ("README.md", "cargo run --release -- evaluate missions/snap_l2.toml"),
    ("docs/paper.md", "cargo run --release --example rhodes2010"),
];

/// Pages whose commands are run, as the tests name them.
fn pages_run() -> Vec<String> {
    let source = include_str!("tutorial.rs");
    let named =
        source.split("shows_what_is_printed(\"").skip(1).map(|rest| rest.split('"').next().unwrap().to_string());
    named.chain(["docs/hindcast.md".to_string()]).collect()
}

/// What is wrong with the blocks of a page.
fn faults(page: &str, text: &str, is_run: bool) -> Vec<String> {
    let lines: Vec<&str> = text.lines().collect();
    let mut faults = Vec::new();
    let (mut open, mut before) = (None::<&str>, String::new());
    let mut command = String::new();
    let mut own = WITH_ITS_OWN_TEST.iter().filter(|(known, said)| *known == page && text.contains(said));
    for (place, line) in lines.iter().enumerate() {
        let Some(language) = line.strip_prefix("```") else {
            match open {
                Some("sh") => command += line,
                None if !line.trim().is_empty() => before = line.to_string(),
                _ => (),
            }
            continue;
        };
        if open.is_some() {
            before = if open == Some("sh") { "```sh".into() } else { String::new() };
            open = None;
            continue;
        }
        open = Some(language);
        if language == "sh" {
            command.clear();
        }
        let marked = before.strip_prefix("<!-- printed by ").and_then(|rest| rest.strip_suffix(" -->"));
        let is_hash = |hash: &str| hash.len() >= 7 && hash.chars().all(|digit| digit.is_ascii_hexdigit());
        let fine = match language {
            "text" => {
                marked.is_some_and(is_hash)
                    || (is_run && before == "```sh" && command.starts_with("ctiplan "))
                    || (PAGES.contains(&page) && before == "```sh" && command.contains("--example hindcast -- "))
                    // The test reads the first block.
                    || own.next().is_some()
            }
            "console" => marked.is_some_and(is_hash) || !has_output(&lines[place + 1..]),
            language => NO_OUTPUT.contains(&language.split(',').next().unwrap()),
        };
        if !fine {
            faults.push(format!("{page}, line {}: ```{language}", place + 1));
        }
    }
    faults
}

/// Whether a block, which begins here, has lines that are no commands: commands begin with `$ ` where there are others.
fn has_output(lines: &[&str]) -> bool {
    let block: Vec<&str> = lines.iter().take_while(|line| !line.starts_with("```")).copied().collect();
    let is_command = |place: usize| block[place].starts_with("$ ") || (place > 0 && block[place - 1].ends_with('\\'));
    block.iter().any(|line| line.starts_with("$ ")) && !(0..block.len()).all(is_command)
}

#[test]
fn every_output_is_run_or_marked() {
    let run = pages_run();
    assert!(run.len() > 8, "{run:?}");
    let docs = fs::read_dir("docs").unwrap().map(|entry| entry.unwrap().path());
    let pages = docs.filter(|path| path.extension().is_some_and(|end| end == "md")).chain([PathBuf::from("README.md")]);
    let mut found = Vec::new();
    for page in pages {
        let name = page.to_str().unwrap();
        found.extend(faults(name, &fs::read_to_string(&page).unwrap(), run.iter().any(|known| known == name)));
    }
    assert!(
        found.is_empty(),
        "outputs without a test and without a commit (put `<!-- printed by COMMIT -->` before them):\n{}",
        found.join("\n")
    );
}

#[test]
fn an_output_of_nothing_is_found() {
    let shown = "```sh\nctiplan dose a.toml\n```\n\n```text\n1\n```\n";
    assert!(faults("a.md", shown, true).is_empty());
    assert_eq!(faults("a.md", shown, false).len(), 1);
    let marked = "<!-- printed by 0bfbd3b -->\n\n```text\n1\n```\n";
    assert!(faults("a.md", marked, false).is_empty());
    assert_eq!(faults("a.md", "It prints\n\n```text\n1\n```\n", true).len(), 1);
    assert_eq!(faults("a.md", "<!-- printed by somebody -->\n```text\n1\n```\n", true).len(), 1);
    assert_eq!(faults("a.md", "```\n1\n```\n", true).len(), 1);
    assert_eq!(faults("a.md", "```console\n$ a\n1\n```\n", true).len(), 1);
    assert!(faults("a.md", "```console\n$ a \\\n    b\n```\n", true).is_empty());
}
