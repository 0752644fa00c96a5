//! Left does not know right: the modules of `src/lib.rs` stand in the order of the chain, and none uses one that stands after it.
//! `docs/architecture.md` says the same.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const TOP: &str = env!("CARGO_MANIFEST_DIR");

/// The modules of the library in the order of `src/lib.rs`.
fn modules() -> Vec<String> {
    let text = read("src/lib.rs");
    let name = |line: &str| line.strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_string);
    text.lines().filter_map(name).collect()
}

fn read(path: impl AsRef<Path>) -> String {
    fs::read_to_string(Path::new(TOP).join(path)).expect("a file of the repository")
}

/// All Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder of the repository").map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            found.extend(sources(&entry));
        } else if entry.extension().is_some_and(|ending| ending == "rs") {
            found.push(entry);
        }
    }
    found
}

/// What a module uses of the crate's top level, by a file's text: neither in comments nor in its tests.
fn uses(text: &str) -> BTreeSet<String> {
    let code = text.split("#[cfg(test)]\nmod tests {").next().expect("a first part");
    let code: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
    let word = |rest: &str| rest.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect();
    let mut used = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        match rest.strip_prefix('{') {
            None => _ = used.insert(word(rest)),
            Some(list) => {
                let list = list.split("};").next().expect("a first part");
                used.extend(list.split(',').map(|part| word(part.trim())));
            }
        }
    }
    used
}

#[test]
fn left_does_not_know_right() {
    let modules = modules();
    assert!(modules.len() > 10, "{modules:?}");
    let place = |name: &str| modules.iter().position(|known| known == name);
    let mut faults = Vec::new();
    let mut edges = 0;
    for file in sources(&Path::new(TOP).join("src")) {
        let inside = file.strip_prefix(Path::new(TOP).join("src")).unwrap().to_path_buf();
        let first = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs").to_string();
        let Some(own) = place(&first) else {
            assert!(["lib", "main"].contains(&first.as_str()), "src/lib.rs does not name {}", file.display());
            continue;
        };
        for used in uses(&fs::read_to_string(&file).unwrap()) {
            edges += usize::from(place(&used).is_some_and(|used| used < own));
            if place(&used).is_some_and(|used| used > own) {
                faults.push(format!("{} uses {used}", inside.display()));
            }
        }
    }
    assert!(edges > 100, "{edges} uses found: the search for them is broken");
    assert!(faults.is_empty(), "left knows right:\n{}", faults.join("\n"));
}

#[test]
fn the_readout_knows_nothing_of_the_program() {
    let manifest: toml::Table = read("crates/readout/Cargo.toml").parse().unwrap();
    let dependencies: Vec<&String> = manifest["dependencies"].as_table().unwrap().keys().collect();
    assert!(dependencies.iter().all(|name| !name.starts_with("ctiplan")), "{dependencies:?}");
}

/// Dose histories and traps are made by the model alone: all others would leave effects out.
#[test]
fn only_the_model_makes_doses_and_traps() {
    for file in sources(&Path::new(TOP).join("src")) {
        let text = fs::read_to_string(&file).unwrap();
        let is_home = file.ends_with("src/model.rs") || file.starts_with(Path::new(TOP).join("src/physics"));
        for maker in ["DoseHistory::of(", "Damage::default("] {
            assert!(is_home || !text.contains(maker), "{} calls {maker}", file.display());
        }
    }
    assert!(read("src/model.rs").contains("DoseHistory::of("));
}

#[test]
fn the_page_names_all_modules_in_their_order() {
    let page = read("docs/architecture.md");
    let named = |line: &str| Some(line.strip_prefix("| `")?.split('`').next()?.trim_end_matches('/').to_string());
    let known = modules();
    let named: Vec<String> = page.lines().filter_map(named).filter(|name| known.contains(name)).collect();
    assert_eq!(named, known);
}

/// Every path of the page and of the other documents leads somewhere.
#[test]
fn paths_in_documents_exist() {
    for entry in fs::read_dir(Path::new(TOP).join("docs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "md") {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        for quoted in text.split('`').skip(1).step_by(2) {
            let place = quoted.trim_end_matches('/');
            let is_path = ["src/", "crates/", "tests/", "benches/"].iter().any(|top| place.starts_with(top));
            let is_plain = place.chars().all(|letter| letter.is_ascii_alphanumeric() || "/._-".contains(letter));
            // What a reader is told to make: see tests/suite/start.rs.
            let to_be_made = place.contains("dark_current");
            assert!(
                !is_path || !is_plain || to_be_made || Path::new(TOP).join(place).exists(),
                "{}: there is no `{quoted}`",
                path.display()
            );
        }
    }
}

/// Lengths of files that the page gives as examples.
#[test]
fn examples_are_as_long_as_the_page_says() {
    let page = read("docs/architecture.md");
    let mut compared = 0;
    for line in page.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, _, path, lines, ..] = &cells[..] else { continue };
        let Ok(said) = lines.parse::<f64>() else { continue };
        let found = read(path.trim_matches('`')).lines().count() as f64;
        assert!((found - said).abs() <= 0.1 * found, "{path} has {found} lines, not {said}");
        compared += 1;
    }
    assert!(compared >= 5, "{compared}");
}
