//! The documents that show commands: what they show is what the program prints.
//!
//! Every `sh` block whose lines start with `ctiplan ` is run from the top of the repository, in the order of the
//! document, and must be followed by a `text` block with what it prints. A block of another language that starts with
//! `# PATH` is a piece of that file. Commands that are not run (because they take long, or need what is not there) stand in
//! other blocks. To renew all `text` blocks: `RENEW=1 cargo test --test suite what_the_program_prints -- --include-ignored`;
//! then read the sentences around them again.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::alike::first_difference;

const TOP: &str = env!("CARGO_MANIFEST_DIR");

/// A fenced block of a document.
struct Block {
    language: String,
    /// Places of its lines in the document, fences left out.
    lines: std::ops::Range<usize>,
}

fn blocks(lines: &[&str]) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<(String, usize)> = None;
    for (place, line) in lines.iter().enumerate() {
        let Some(language) = line.strip_prefix("```") else { continue };
        match open.take() {
            None => open = Some((language.to_string(), place + 1)),
            Some((language, first)) => blocks.push(Block { language, lines: first..place }),
        }
    }
    assert!(open.is_none(), "a block that does not end");
    blocks
}

/// The commands of a block, with lines that end in a backslash joined.
fn commands(lines: &[&str]) -> Vec<String> {
    let joined = lines.join("\n").replace("\\\n", " ");
    joined.lines().map(str::trim).filter(|line| !line.is_empty()).map(str::to_string).collect()
}

/// Words as a shell takes them, where only double quotes are special.
fn arguments(command: &str) -> Vec<String> {
    let mut words = Vec::new();
    let (mut word, mut quoted, mut begun) = (String::new(), false, false);
    for letter in command.chars() {
        match letter {
            '"' => (quoted, begun) = (!quoted, true),
            ' ' if !quoted => {
                if begun {
                    words.push(std::mem::take(&mut word));
                }
                begun = false;
            }
            letter => {
                word.push(letter);
                begun = true;
            }
        }
    }
    assert!(!quoted, "a quote that does not end: {command}");
    if begun {
        words.push(word);
    }
    words
}

/// What a terminal shows.
fn shown(command: &str) -> String {
    let words = arguments(command);
    assert_eq!(words[0], "ctiplan", "only ctiplan is run: {command}");
    let output = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(&words[1..]).current_dir(TOP).output().unwrap();
    [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat()
}

/// Runs the commands of a document (a path from the top of the repository) and compares what they print with what it shows.
pub fn shows_what_is_printed(document: &str) {
    let top = Path::new(TOP);
    // What the commands write goes there.
    fs::create_dir_all(top.join("target")).unwrap();
    let text = fs::read_to_string(top.join(document)).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let blocks = blocks(&lines);
    let mut renewed = String::new();
    let (mut copied, mut stale) = (0, Vec::new());
    for (index, block) in blocks.iter().enumerate() {
        let commands = commands(&lines[block.lines.clone()]);
        if block.language != "sh" || !commands.iter().any(|command| command.starts_with("ctiplan ")) {
            continue;
        }
        let at = format!("{document}, line {}", block.lines.start + 1);
        let output = blocks.get(index + 1).filter(|next| {
            next.language == "text"
                && lines[block.lines.end + 1..next.lines.start - 1].iter().all(|line| line.trim().is_empty())
        });
        let output = output.unwrap_or_else(|| panic!("{at}: no block of text follows the command"));
        let printed: String = commands.iter().map(|command| shown(command)).collect();
        let expected = lines[output.lines.clone()].join("\n");
        if let Some((expected, printed)) = first_difference(&expected, &printed) {
            stale.push(format!("{at}: {}\n  shown:   {expected}\n  printed: {printed}", commands.join("; ")));
        }
        for line in &lines[copied..output.lines.start] {
            renewed += line;
            renewed.push('\n');
        }
        renewed += &printed;
        if !printed.ends_with('\n') {
            renewed.push('\n');
        }
        copied = output.lines.end;
    }
    for line in &lines[copied..] {
        renewed += line;
        renewed.push('\n');
    }
    if std::env::var_os("RENEW").is_some() {
        fs::write(top.join(document), renewed).unwrap();
        return;
    }
    assert!(
        stale.is_empty(),
        "what the program prints is not what the document shows; if it should be so, run\n  RENEW=1 cargo test --test suite \
         what_the_program_prints -- --include-ignored\nand read again what is said about it:\n{}",
        stale.join("\n")
    );
}

fn quotes_files_as_they_are(document: &str) {
    let top = Path::new(TOP);
    let text = fs::read_to_string(top.join(document)).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    for block in blocks(&lines) {
        let comment = lines.get(block.lines.start).copied().unwrap_or_default();
        let Some(path) = comment.strip_prefix("# ").or_else(|| comment.strip_prefix("// ")) else { continue };
        if !top.join(path).is_file() {
            continue;
        }
        let quoted = lines[block.lines.start + 1..block.lines.end].join("\n");
        let file = fs::read_to_string(top.join(path)).unwrap();
        assert!(file.contains(&quoted), "{document}, line {}: not in {path}", block.lines.start + 1);
    }
}

#[test]
fn the_tutorial_shows_what_the_program_prints() {
    shows_what_is_printed("docs/tutorial.md");
    quotes_files_as_they_are("docs/tutorial.md");
}

#[test]
fn the_way_to_an_effect_shows_what_the_program_prints() {
    shows_what_is_printed("docs/adding-an-effect.md");
    quotes_files_as_they_are("docs/adding-an-effect.md");
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn the_page_of_the_diagnosis_shows_what_the_program_prints() {
    shows_what_is_printed("docs/diagnosis.md");
    quotes_files_as_they_are("docs/diagnosis.md");
}

#[test]
fn the_page_of_intervals_shows_what_the_program_prints() {
    shows_what_is_printed("docs/intervals.md");
}

#[test]
fn the_page_of_flown_measurements_shows_what_the_program_prints() {
    shows_what_is_printed("docs/flight.md");
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn the_page_of_the_studies_shows_what_the_program_prints() {
    shows_what_is_printed("docs/studies.md");
}

#[test]
fn the_first_steps_show_what_the_program_prints() {
    shows_what_is_printed("docs/start.md");
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn the_page_of_confidence_shows_what_the_program_prints() {
    shows_what_is_printed("docs/confidence.md");
}

#[test]
fn the_page_of_orbits_shows_what_the_program_prints() {
    shows_what_is_printed("docs/orbit.md");
}

#[test]
fn the_page_of_images_shows_what_the_program_prints() {
    shows_what_is_printed("docs/images.md");
}

#[test]
fn the_page_of_measurements_shows_what_the_program_prints() {
    shows_what_is_printed("docs/measure.md");
}

#[test]
fn the_way_to_an_observable_shows_files_as_they_are_and_names_every_member_of_a_card() {
    quotes_files_as_they_are("docs/adding-an-observable.md");
    let source = fs::read_to_string(Path::new(TOP).join("src/physics/observable.rs")).unwrap();
    let card = source.split_once("pub struct Card {").unwrap().1.split_once("\n}\n").unwrap().0;
    let members = card.lines().filter_map(|line| line.trim().strip_prefix("pub ")?.split_once(':'));
    let members: Vec<&str> = members.map(|(name, _)| name).collect();
    let page = fs::read_to_string(Path::new(TOP).join("docs/adding-an-observable.md")).unwrap();
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split_once('`'));
    assert_eq!(rows.map(|(name, _)| name).collect::<Vec<_>>(), members);
}

/// The table of methods is that of the trait.
#[test]
fn the_way_to_an_effect_names_every_method() {
    let source = fs::read_to_string(Path::new(TOP).join("src/effect.rs")).unwrap();
    let after = source.split_once("pub trait Effect").unwrap().1;
    let body = after.split_once("\n}\n").unwrap().0;
    let methods = |text: &str, before: &str, behind: char| -> Vec<String> {
        let lines = text.lines().filter_map(|line| line.trim().strip_prefix(before)?.split_once(behind));
        lines.map(|(name, _)| name.to_string()).collect()
    };
    let page = fs::read_to_string(Path::new(TOP).join("docs/adding-an-effect.md")).unwrap();
    assert_eq!(methods(&page, "| `", '`'), methods(body, "fn ", '('));
}

#[test]
fn words_are_those_of_a_shell() {
    let command = commands(&["ctiplan fit a.toml \\", "    --set \"mission.name=Two  species\" \"\""]);
    let expected = ["ctiplan", "fit", "a.toml", "--set", "mission.name=Two  species", ""];
    assert_eq!(arguments(&command[0]), expected);
}
